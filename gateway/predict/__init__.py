"""Predict: where it will be, how sure that is, and why (paper 000, 2.2 and 2.3).

`told` holds what aircraft say of their plans and `goals` makes candidates of it, `arrival_flows` of ways that many came, and
`weather` of areas to be flown round; `states` are where tracks are, `thinking` is how they move and how well each candidate
fits, `choosing` takes one of them or none. `forecasting` is one round of predictions, `heights` and `spread` their third
dimension and their sigmas, `table` the columns. `predicting` is what is remembered from round to round, `minds` that of each
track. `ways` are the predictions as paths on one grid of times, `encounters` which of them come near each other, `conflicts`
what is told of that.
"""

from gateway.predict.arrival_flows import ArrivalFlow, FlowWays
from gateway.predict.candidates import Candidates
from gateway.predict.conflicts import TOLD_AT_MOST, Conflicts, Probing, Round, sentence
from gateway.predict.forecasting import forecast
from gateway.predict.predicting import TOGETHER, Predicting
from gateway.predict.table import Forecast, Predicted, table
from gateway.predict.told import Said

__all__ = [
    "TOGETHER",
    "TOLD_AT_MOST",
    "ArrivalFlow",
    "Candidates",
    "Conflicts",
    "FlowWays",
    "Forecast",
    "Predicted",
    "Predicting",
    "Probing",
    "Round",
    "Said",
    "forecast",
    "sentence",
    "table",
]
