"""What a round of predictions costs: a thousand aircraft that have told their plans, at four horizons, in CPU.

python -m bench.foretelling ROUNDS       prints, as JSON, milliseconds of whole rounds, and of their longest parts

Estimators take turns, round by round. A part is what is predicted at once, and holds everything else up.
"""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING, Any

from bench.measure import Figure, alone

if TYPE_CHECKING:
    from gateway.settings import EstimatorName

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "rmimm")
AIRCRAFT, HORIZONS_S = 1000, (10.0, 30.0, 60.0, 120.0)
ROUND_MS, PART_MS = 50.0, 10.0


def foretelling(rounds: int) -> list[Figure]:
    """Predictions of 1000 aircraft at four horizons, once a second: the whole round, and its longest part."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.foretelling", str(rounds)]))
    figures = []
    for estimator, (whole, longest) in told.items():
        name = f"predictions, {AIRCRAFT} aircraft, {len(HORIZONS_S)} horizons, {estimator}"
        figures += [Figure(name, "ms", tuple(whole), ROUND_MS), Figure("… at once", "ms", tuple(longest), PART_MS)]
    return figures


def measured_ms(rounds: int) -> dict[str, tuple[list[float], list[float]]]:
    """By estimator: CPU of whole rounds, and of the longest part of each."""
    from bench.crowd import HEARD_S, STARTS, crowd
    from gateway import predict
    from gateway.align import SECOND
    from gateway.fuse.weighting import Model
    from gateway.settings import Options

    found: dict[str, tuple[list[float], list[float]]] = {estimator: ([], []) for estimator in ESTIMATORS}
    options = {estimator: Options(estimator=estimator, horizons_s=HORIZONS_S) for estimator in ESTIMATORS}
    states = {estimator: crowd(AIRCRAFT, chosen) for estimator, chosen in options.items()}
    predicting = {estimator: state.predicting for estimator, state in states.items()}
    for turn in range(rounds + 1):
        for estimator, state in states.items():
            model = Model.of(options[estimator], state.site.position, {}, state.site.estimation)
            costs = []
            planned = predicting[estimator].planning(list(state.lanes.lanes), STARTS + (HEARD_S + 1 + turn) * SECOND)
            while planned.planned:
                at = planned.due
                began = time.process_time()
                planned, tracks = planned.begun(at)
                lanes = [state.lanes.lanes[track] for track in tracks]
                planned, made = predict.forecast(
                    planned, lanes, at, HORIZONS_S, model, state.site, state.frame, state.geoid.separation_m
                )
                predict.table([made], state.frame)
                costs.append(1e3 * (time.process_time() - began))
            predicting[estimator] = planned
            if turn:  # the first makes every aircraft's goals, which stay
                found[estimator][0].append(sum(costs))
                found[estimator][1].append(max(costs))
    return found


if __name__ == "__main__":
    print(json.dumps(measured_ms(int(sys.argv[1]))))
