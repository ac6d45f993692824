"""Predict: where it will be, how sure that is, and why (paper 000, 2.2 and 2.3).

`told` holds what aircraft say of their plans, `goals` makes candidates of it, `thinking` believes one of them or none, `minds`
is what is remembered of each track meanwhile; `forecasting` is one round of predictions, `heights` and `spread` their third
dimension and their sigmas, `table` the columns.
"""

from gateway.predict.forecasting import TOGETHER, Predicting, forecast
from gateway.predict.table import Forecast, Predicted, table
from gateway.predict.told import Said

__all__ = ["TOGETHER", "Forecast", "Predicted", "Predicting", "Said", "forecast", "table"]
