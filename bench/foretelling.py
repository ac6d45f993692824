"""What a round of predictions costs: many aircraft, each with twenty candidates, at four horizons, in CPU.

    python -m bench.foretelling [AIRCRAFT]

Every aircraft has a plan of ten points and says which it goes to; the site publishes four points more; home, the runway and a
go-around are candidates too, and there are places for ways around weather. Printed: the whole round, and its longest part.
"""

from __future__ import annotations

import sys
import time
from statistics import median

import numpy as np

from gateway import predict
from gateway.fuse.weighting import Model
from gateway.observation import FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint
from gateway.pipeline import initial, step
from gateway.predict import TOGETHER, table
from gateway.settings import DEMO_SITE, Options, Waypoint
from gateway.state import State

HORIZONS_S = (10.0, 30.0, 60.0, 120.0)
ROUNDS = 9
SECOND = 1_000_000_000
STARTS = 1_767_225_600 * SECOND


def crowd(aircraft: int, options: Options) -> State:
    """Aircraft that have reported for three seconds and told their plans."""
    runway = DEMO_SITE.runway
    chance = np.random.default_rng(1)
    places = chance.uniform(-0.4, 0.4, (aircraft, 11, 2)) + np.degrees([runway.latitude_rad, runway.longitude_rad])
    waypoints = tuple(Waypoint(f"W{place}", *np.radians([31.0 + 0.1 * place, 103.8])) for place in range(4))
    state = initial(type(DEMO_SITE)(DEMO_SITE.name, runway, DEMO_SITE.position, waypoints=waypoints), options)
    said: list[Observation] = []
    for number, (first, *others) in enumerate(np.radians(places).tolist()):
        name = f"mavlink:{number + 1}"
        home = PlanPoint(0, "home", first[0], first[1], altitude_msl_m=500.0)
        points = [PlanPoint(k, "waypoint", one[0], one[1], altitude_msl_m=900.0) for k, one in enumerate(others, 1)]
        said += [FlightPlan(name, STARTS, STARTS, (home, *points)), Intent(name, STARTS, STARTS, "mission", 1)]
    heard = [Heard(STARTS + 1, tuple(said))]
    for tenth in range(1, 31):
        at = STARTS + tenth * SECOND // 10
        heard.append(Heard(at, tuple(_report(number, place[0], at, tenth / 10) for number, place in enumerate(places))))
    return step(state, heard)[0]


def _report(number: int, place: np.ndarray[tuple[int], np.dtype[np.float64]], at: int, since_s: float) -> GpsReport:
    """Northward at 80 m/s."""
    latitude, longitude = np.radians(place)
    north = 80.0 * since_s / 6.37e6
    name = f"mavlink:{number + 1}"
    return GpsReport(
        name, at, at, float(latitude + north), float(longitude), 900.0, None, 0.0, 80.0, 0.0, 5.0, 8.0, 0.5
    )


def measured_ms(state: State, options: Options) -> tuple[float, float]:
    """CPU of a whole round, and of its longest part, over tracks that are predicted together."""
    predicting = state.predicting
    lanes = list(state.lanes.lanes.values())
    model = Model.of(options, state.site.position, {}, state.site.estimation)
    parts = [lanes[first : first + TOGETHER] for first in range(0, len(lanes), TOGETHER)]
    wholes, longest = [], []
    for turn in range(1, ROUNDS + 1):
        costs = []
        for part, some in enumerate(parts):
            at = STARTS + (3 + turn) * SECOND + part * SECOND // len(parts)
            began = time.process_time()
            predicting, made = predict.forecast(
                predicting, some, at, HORIZONS_S, model, state.site, state.frame, state.geoid.separation_m
            )
            table([made], state.frame)
            costs.append(1e3 * (time.process_time() - began))
        wholes.append(sum(costs))
        longest.append(max(costs))
    return median(wholes[1:]), median(longest[1:])


def main() -> None:
    """Print both estimators' costs."""
    aircraft = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    for estimator in ("kalman", "rmimm"):
        options = Options(estimator=estimator, horizons_s=HORIZONS_S)
        whole, part = measured_ms(crowd(aircraft, options), options)
        costs = f"{whole:.1f} ms CPU a round, {part:.1f} ms at most at once"
        print(f"{estimator}: {aircraft} aircraft, {len(HORIZONS_S)} horizons: {costs}")


if __name__ == "__main__":
    main()
