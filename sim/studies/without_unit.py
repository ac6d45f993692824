"""Dead reckoning of vehicles that tell no inertial samples: 20 s and 60 s of a recording without GPS, beside constant velocity.

python -m sim.studies.without_unit RECORDING [AIRCRAFT]     a copter, a rover or a boat that tells how it lies; .tlog, .BIN, .ulg

What an inertial unit told is left out. The filter runs once through the recording with GPS; from each tenth second of motion on
it goes on without. What is muted is what positions said: their own errors are in the figures.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from adapters.decode import Decoder
from gateway.observation import GpsReport, Heard, ImuSample, Many, Timing, VehicleStatus
from gateway.reckon.cells import CELL_NS, SECOND, SECOND_CELLS, cells, covered_until
from gateway.reckon.flying import carried_by, with_unit
from gateway.reckon.kinds import Kinds
from gateway.reckon.running import run
from gateway.reckon.tip import Tip
from gateway.reckon.told import PLACE, WIDTHS, Series, Told, portioned
from gateway.reckon.vehicle import first_tip
from gateway.runtime.playback import open_playback
from gateway.settings import DeadReckoning
from sim.studies.real_flight import Windows, scored

MOVES_MPS = 1.0  # over a window, on average: standing has nothing to gain
KNOWS_AFTER_S = 60.0  # it has learnt what it holds
STATED = (1.5, 3.0, 0.5)  # sigmas of positions and velocities, where a stream tells none
SETTINGS = DeadReckoning(refuses=False)


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


def windows(told: Told, vehicle_type: int | None, length_s: float, every_s: float = 10.0) -> Windows:
    """Every so many seconds in which it moves, by what carries it on."""
    by = carried_by(told, vehicle_type)
    told = with_unit(told, by)
    first = int(told.places.at[0]) // CELL_NS
    passed = list[Tip]()
    while (begun := first_tip(_early(told, first), SETTINGS)) is not None:
        since = int(begun.cell[0])
        end = covered_until(told, since)
        (some,) = run([begun], [cells(told, since, end)], Kinds.of([vehicle_type], [by]), SETTINGS)
        passed += some
        first = end + SECOND_CELLS
    length = round(length_s * SECOND_CELLS)
    starts = [one for one in passed if _is_start(told, one, length, round(every_s * SECOND_CELLS))]
    alone = replace(told, places=Series.empty(PLACE))
    inputs = [cells(alone, int(tip.cell[0]), int(tip.cell[0]) + length) for tip in starts]
    ways = run(starts, inputs, Kinds.of([vehicle_type] * len(starts), [by] * len(starts)), SETTINGS)
    table = np.array(
        [[scored(one, tip, told.places) for one in way] for tip, way in zip(starts, ways, strict=True)]
    ).reshape(len(starts), round(length_s), 3)
    return Windows(length_s, table[..., 0], table[..., 1], table[..., 2])


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


def main() -> None:
    """Print what the windows come to."""
    path, *names = sys.argv[1:]
    playback = open_playback([Path(path)])
    told, vehicle_type = told_of(
        (one for _, one in Decoder(playback.sources).hear_many(list(playback.arrivals()))[0]),
        names[0] if names else "mavlink:1",
    )
    print(f"carried on by {carried_by(told, vehicle_type).words}")
    for length_s in (20.0, 60.0):
        print(f"  {windows(told, vehicle_type, length_s).sentence()}")


if __name__ == "__main__":
    main()
