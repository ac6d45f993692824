"""What the conflict probe costs: a thousand aircraft on one level, each with its prediction, once a second, in CPU.

python -m bench.probing ROUNDS       prints, as JSON, milliseconds of looking who comes near whom, when, and of watching these

They stand so close that some hundreds of pairs are in conflict: far more than ever will be.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

from bench.measure import Figure, alone

AIRCRAFT, HORIZONS_S = 1000, (10.0, 30.0, 60.0, 120.0)
PART_MS = 10.0


def probing(rounds: int) -> list[Figure]:
    """The conflict probe of 1000 aircraft, 120 s ahead: its three parts, each of which holds up everything else."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.probing", str(rounds)]))
    name = f"conflict probe, {AIRCRAFT} aircraft, 120 s ahead, {told['conflicts']} conflicts"
    return [
        Figure(name, "ms", tuple(told["looking"]), PART_MS),
        Figure("… when they meet", "ms", tuple(told["meeting"]), PART_MS),
        Figure("… watching these", "ms", tuple(told["watching"]), PART_MS),
    ]


def measured_ms(rounds: int) -> dict[str, Any]:
    """CPU of the parts of each round, and how many conflicts stood at the end."""
    from bench.crowd import HEARD_S, STARTS, crowd
    from gateway import predict
    from gateway.align import SECOND
    from gateway.fuse.weighting import Model
    from gateway.predict import Probing
    from gateway.settings import Options

    options = Options(horizons_s=HORIZONS_S)
    state = crowd(AIRCRAFT, options)
    model = Model.of(options, state.site.position, {}, state.site.estimation)
    numbers, predicting, probing = [lane.number for lane in state.lanes.lanes.values()], state.predicting, Probing()
    found: dict[str, Any] = {"looking": [], "meeting": [], "watching": []}
    for turn in range(rounds + 1):
        second = STARTS + (HEARD_S + 1 + turn) * SECOND
        planned = predicting.planning(list(state.lanes.lanes), second)
        while planned.planned:
            at = planned.due
            planned, tracks = planned.begun(at)
            lanes = [state.lanes.lanes[track] for track in tracks]
            separation_m = state.geoid.separation_m
            planned, made = predict.forecast(
                planned, lanes, at, HORIZONS_S, model, state.site, state.frame, separation_m
            )
            probing = probing.hearing(made.ways, at, 1.0)
        predicting = planned
        began = time.process_time()
        probing = probing.looking(second + SECOND, numbers, state.site.separation)
        looked = time.process_time()
        probing = probing.meeting(state.site.separation)
        met = time.process_time()
        probing, told = probing.watching(second + SECOND, numbers, state.site.separation)
        if turn:
            found["looking"].append(1e3 * (looked - began))
            found["meeting"].append(1e3 * (met - looked))
            found["watching"].append(1e3 * (time.process_time() - met))
        found["conflicts"] = len(told.state)
    return found


if __name__ == "__main__":
    print(json.dumps(measured_ms(int(sys.argv[1]))))
