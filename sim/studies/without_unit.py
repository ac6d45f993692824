"""Dead reckoning of vehicles that tell no inertial samples: 20 s and 60 s of a recording without GPS, beside constant velocity.

python -m sim.studies.without_unit RECORDING [AIRCRAFT]     a copter, a rover or a boat that tells how it lies; .tlog, .BIN, .ulg
python -m sim.studies.without_unit                          simulated ones, beside the truth

What an inertial unit told is left out. The filter runs once through the recording with GPS; from each tenth second of motion on
it goes on without. What is muted is what positions said: their own errors are in the figures.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapters.mission_writing import TAKE_OFF, WAYPOINT, MissionItem
from gateway.estimators.inertial import displaced, from_angles
from gateway.observation import GpsReport, Heard, ImuSample, Many, Timing, VehicleStatus
from gateway.reckon.cells import CELL_NS, SECOND, SECOND_CELLS, cells, covered_until
from gateway.reckon.flying import carried_by, with_unit
from gateway.reckon.kinds import By, Kinds
from gateway.reckon.running import run
from gateway.reckon.tip import Tip
from gateway.reckon.told import ATTITUDE, PLACE, WIDTHS, Series, Told, portioned
from gateway.reckon.vehicle import first_tip
from gateway.settings import DeadReckoning
from sim.flown_way import Craft, FlownWay
from sim.studies.real_flight import Windows, scored
from sim.studies.walked import recorded
from sim.told_rides import AUTOPILOT_RAD, LASTS_S, NOISE_M, NOISE_MPS, WANDERS_FOR_S, WANDERS_M, lasting
from sim.vehicles.motion import Home
from sim.vehicles.steering import Plane
from sim.vehicles.wind import WindParameters

Floats = NDArray[np.float64]

MOVES_MPS = 1.0  # over a window, on average: standing has nothing to gain
KNOWS_AFTER_S = 60.0  # it has learnt what it holds
STATED = (1.5, 3.0, 0.5)  # sigmas of positions and velocities, where a stream tells none
SETTINGS = DeadReckoning(refuses=False)
STARTS = 1_700_000_000 * SECOND
VEHICLES = 3  # of a kind
TYPES: dict[Craft, int] = {"copter": 2, "helicopter": 4, "ship": 11}  # MAV_TYPE
SPEEDS_MPS = {"copter": (6.0, 14.0), "helicopter": (15.0, 30.0), "ship": (5.0, 10.0)}


def told_of(said: Iterable[Heard], aircraft: str) -> tuple[Told, int | None]:
    """What a vehicle told on a whole recording, without its inertial unit, and its MAV_TYPE."""
    others, reports, vehicle_type = [], list[GpsReport](), None
    for one in said:
        for each in one.observations:
            if isinstance(each, GpsReport):
                if each.aircraft == aircraft and each.timing is not Timing.PROVISIONAL:
                    reports.append(each)
            elif not isinstance(each, ImuSample) and not (isinstance(each, Many) and each.kind is ImuSample):
                others.append(each)
            if isinstance(each, VehicleStatus) and each.aircraft == aircraft:
                vehicle_type = each.vehicle_type
    series = portioned(others).get(aircraft, {})
    told = Told(tuple(series.get(kind, Series.empty(width)) for kind, width in enumerate(WIDTHS)))
    at = np.array([one.valid_at for one in reports], np.int64)
    places = np.array([_place(one) for one in reports]).reshape(-1, PLACE)
    return replace(told, places=Series.empty(PLACE).with_more(Series(at, places))), vehicle_type


def _place(one: GpsReport) -> tuple[float, ...]:
    known = [math.nan if value is None else value for value in (one.height_m or one.altitude_msl_m,)]
    north, east, up = (
        math.nan if value is None else value
        for value in (one.velocity_north_mps, one.velocity_east_mps, one.velocity_up_mps)
    )
    level_m, upright_m, speed = STATED
    return (one.latitude_rad, one.longitude_rad, *known, north, east, -up, level_m, upright_m, speed)


def simulated(craft: Craft, seed: int, hz: float = 4.0, length_s: float = 600.0) -> tuple[Told, int, Series]:
    """What a simulated vehicle tells on a mission of its own, its MAV_TYPE, and where it truly was, as `told.PLACE`.

    Its autopilot's attitude, so often, is off by half a degree, its heading by one, for half a minute at a time; its positions
    come five times a second and are off by a metre.
    """
    draws = np.random.default_rng([seed, len(craft)])
    way = _mission(craft, draws, seed)
    end_s = way.end_before(length_s)
    lies_s, place_s = np.arange(1.0, end_s, 1.0 / hz), np.arange(1.0, end_s, 0.2)
    flown, there = way.flown(lies_s), way.flown(place_s)
    leans = np.array(AUTOPILOT_RAD) * lasting(draws, len(lies_s), 1.0 / (hz * LASTS_S))
    angles = np.stack([flown.roll_rad, flown.pitch_rad, flown.yaw_rad], axis=1) + leans
    velocity = there.velocity_mps[:, [1, 0, 2]] * [1.0, 1.0, -1.0]
    truth = np.hstack([np.stack([there.latitude_rad, there.longitude_rad, there.height_m], axis=1), velocity])
    sigmas = np.broadcast_to(STATED, (len(place_s), 3))
    off = WANDERS_M * lasting(draws, len(place_s), 0.2 / WANDERS_FOR_S)
    off += NOISE_M * draws.standard_normal(off.shape)
    moved = np.stack(displaced(truth[:, 0], truth[:, 1], truth[:, 2], off), axis=1)
    noisy = np.hstack([moved, velocity + NOISE_MPS * draws.standard_normal(off.shape), sigmas])
    series = [Series.empty(width) for width in WIDTHS]
    series[ATTITUDE] = Series(_ns(lies_s), from_angles(*angles.T))
    told = Told(tuple(series), Series(_ns(place_s), noisy))
    return told, TYPES[craft], Series(_ns(place_s), np.hstack([truth, sigmas]))


def _ns(seconds: Floats) -> NDArray[np.int64]:
    return STARTS + np.round(seconds * 1e9).astype(np.int64)


def _mission(craft: Craft, draws: np.random.Generator, seed: int) -> FlownWay:
    """Legs of 20 to 60 s, corners of up to 120 degrees, wind and gusts, a current for ships."""
    home = Home(math.radians(47.4), math.radians(8.5), 500.0, 0.0, 0.0)
    plane, course, north, east = Plane.about(home), float(draws.uniform(0.0, 6.28)), 0.0, 0.0
    speed = float(draws.uniform(*SPEEDS_MPS[craft]))
    items = [] if craft == "ship" else [MissionItem(TAKE_OFF, altitude_m=60.0)]
    for _ in range(12):
        course += float(draws.uniform(-2.1, 2.1))
        leg_m = speed * float(draws.uniform(20.0, 60.0)) * (3.0 if craft == "ship" else 1.0)
        north, east = north + leg_m * math.cos(course), east + leg_m * math.sin(course)
        latitude, longitude = home.latitude_rad + north / plane.north_m, home.longitude_rad + east / plane.east_m
        items.append(MissionItem(WAYPOINT, math.degrees(latitude), math.degrees(longitude), 80.0 * (craft != "ship")))
    wind = WindParameters(
        float(draws.uniform(0.0, 8.0)), float(draws.uniform(0.0, 6.28)), float(draws.uniform(0.2, 1.5))
    )
    north, east = (0.3 * draws.standard_normal(2)).tolist()
    return FlownWay(craft, home, tuple(items), wind, speed, current_mps=(east, north), seed=seed)


def windows(
    told: Told, vehicle_type: int | None, length_s: float, every_s: float = 10.0, truth: Series | None = None
) -> Windows:
    """Every so many seconds in which it moves, by what carries it on, beside the truth, or what positions said."""
    by = carried_by(told, vehicle_type)
    told = with_unit(told, by)
    passed = _passed(told, vehicle_type, by)
    length = round(length_s * SECOND_CELLS)
    starts = [one for one in passed if _is_start(told, one, length, round(every_s * SECOND_CELLS))]
    alone = replace(told, places=Series.empty(PLACE))
    inputs = [cells(alone, int(tip.cell[0]), int(tip.cell[0]) + length) for tip in starts]
    ways = run(starts, inputs, Kinds.of([vehicle_type] * len(starts), [by] * len(starts)), SETTINGS)
    beside = truth or told.places
    rows = [[scored(one, tip, beside) for one in way] for tip, way in zip(starts, ways, strict=True)]
    table = np.array(rows).reshape(len(starts), round(length_s), 3)
    return Windows(length_s, table[..., 0], table[..., 1], table[..., 2])


def _passed(told: Told, vehicle_type: int | None, by: By) -> list[Tip]:
    """Its tips on the way with positions; after each gap in what it tells it begins anew."""
    passed, first = list[Tip](), int(told.places.at[0]) // CELL_NS
    while (begun := first_tip(_early(told, first), SETTINGS)) is not None:
        since = int(begun.cell[0])
        end = covered_until(told, since)
        (some,) = run([begun], [cells(told, since, end)], Kinds.of([vehicle_type], [by]), SETTINGS)
        passed += some
        first = end + SECOND_CELLS
    return passed


def _early(told: Told, first: int) -> Told:
    """The same with the first positions only that come at a cell or later, so that it begins there."""
    begin, _ = told.places.between(first * CELL_NS, 1 << 62)
    over = min(begin + 20, len(told.places.at))
    places = Series(told.places.at[begin:over], told.places.values[begin:over])
    until = int(places.at[-1]) + 2 * SECOND if len(places.at) else 0
    series = tuple(Series(one.at[: (n := int(np.searchsorted(one.at, until)))], one.values[:n]) for one in told.series)
    return replace(told, series=series, places=places)


def _is_start(told: Told, tip: Tip, length: int, every: int) -> bool:
    """Whether a window begins there: covered without a gap, with positions throughout, and in motion."""
    cell = int(tip.cell[0])
    begin, over = told.places.between(cell * CELL_NS, (cell + length) * CELL_NS)
    at, speed = told.places.at[begin:over], np.hypot(*told.places.values[begin:over, 3:5].T)
    if cell % every or cell - int(tip.began[0]) < 0 or len(at) < 2 or cell - int(tip.heard[0]) > 2 * SECOND_CELLS:
        return False
    is_told = np.diff(at).max() < 2.5 * SECOND and at[-1] > (cell + length) * CELL_NS - 2.5 * SECOND
    learnt = at[0] - told.places.at[0] > KNOWS_AFTER_S * SECOND
    return bool(is_told and learnt and covered_until(told, cell) >= cell + length and speed.mean() > MOVES_MPS)


def pooled(some: Sequence[Windows]) -> Windows:
    """The windows of several, all of one length."""
    columns = zip(*((one.reckoned_m, one.constant_m, one.inside) for one in some), strict=True)
    return Windows(some[0].length_s, *(np.concatenate(column) for column in columns))


def main() -> None:
    """Print what the windows of a recording come to; or, without one, those of simulated vehicles."""
    if len(sys.argv) == 1:
        for craft in TYPES:
            several = [simulated(craft, seed) for seed in range(1, 1 + VEHICLES)]
            print(f"{VEHICLES} of: {craft}, by {carried_by(*several[0][:2]).words}")
            for length_s in (20.0, 60.0):
                print(f"  {pooled([windows(*one[:2], length_s, truth=one[2]) for one in several]).sentence()}")
        return
    path, *names = sys.argv[1:]
    told, vehicle_type = told_of(recorded(Path(path)), names[0] if names else "mavlink:1")
    print(f"carried on by {carried_by(told, vehicle_type).words}")
    for length_s in (20.0, 60.0):
        print(f"  {windows(told, vehicle_type, length_s).sentence()}")


if __name__ == "__main__":
    main()
