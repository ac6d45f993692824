"""Dead reckoning of vehicles without an inertial unit that have no airspeed either, and of those that stand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gateway.estimators import dead_reckoning as dr
from gateway.estimators import inertial as ins
from gateway.estimators.medium import dragged, turned_through
from gateway.observation import AirData, Attitude, Heard, ImuSample, Many, Observation, VehicleStatus
from gateway.picture import Picture
from gateway.reckon.flying import carried_by
from gateway.reckon.kinds import By
from gateway.reckon.told import ATTITUDE, INERTIAL, Series, Told
from sim.studies.without_unit import simulated, windows
from sim.told_pictures import FALSE_FROM_S, QUIET, SECOND, START, denials, errors_m, goes_away, pictures, told
from sim.told_rides import Teller, honest

HEARD_FROM = START + (FALSE_FROM_S - 20.0) * SECOND
OVER = START + (FALSE_FROM_S + 20.0) * SECOND
Changed = Callable[[Observation], Observation | None]


def said_by(kind: str, falsified: object, changed: Changed) -> tuple[Teller, tuple[Heard, ...]]:
    """What a ride's vehicle tells, each changed, or left out."""
    teller, said = told(kind, falsified)  # type: ignore[arg-type]
    made = []
    for one in said:
        some = (changed(each) for each in one.observations)
        made.append(replace(one, observations=tuple(each for each in some if each is not None)))
    return teller, tuple(made)


def without_unit(each: Observation) -> Observation | None:
    """No inertial samples."""
    return None if isinstance(each, Many | ImuSample) else each


def heading_only(each: Observation) -> Observation | None:
    """No attitude either, but VFR_HUD's whole degrees."""
    if not isinstance(each, Attitude):
        return without_unit(each)
    degrees = round(math.degrees(each.yaw_rad)) % 360
    return AirData(each.aircraft, each.valid_at, each.received_at, compass_heading_rad=math.radians(degrees))


@cache
def gone(kind: str, changed: Changed) -> tuple[list[tuple[float, str, float, float]], float]:
    """The rows that dead reckoning wrote in twenty seconds without positions; where a constant velocity is by the last."""
    teller, said = said_by(kind, goes_away, changed)
    some = [picture for _, picture in pictures(one for one in said if HEARD_FROM < one.now < OVER)]
    rows = [row for row in errors_m(teller, some) if row[1] == "dead-reckoning"]
    motion, begin = teller.ride.motion, round(FALSE_FROM_S * 50)
    last = begin + round(rows[-1][0] * 50)
    here = ins.Motion(
        *(np.asarray(getattr(motion, name)[begin]) for name in ("latitude_rad", "longitude_rad", "height_m")),
        np.zeros(3),
        np.zeros(4),
    )
    there = (motion.latitude_rad[last], motion.longitude_rad[last], motion.height_m[last])
    straight = motion.velocity_mps[begin, :2] * ((last - begin) / 50.0)
    return rows, math.hypot(*(ins.between(*there, here)[:2] - straight))


@pytest.mark.parametrize("changed", [pytest.param(without_unit, marks=pytest.mark.study), heading_only])
def test_a_heading_turns_the_way_of_a_car(changed: Changed) -> None:
    """Twenty seconds without positions: inside three sigma; nearer than a constant velocity."""
    rows, constant_m = gone("car", changed)
    assert 16 <= len(rows) <= 19
    assert all(off < 3.0 * sigma * math.sqrt(2.0) for _, _, off, sigma in rows)
    assert rows[-1][2] < 0.8 * constant_m  # it also goes slower, which nothing tells


@pytest.mark.study
def test_a_heading_in_whole_degrees_and_an_airspeed_carry_an_aeroplane() -> None:
    rows, constant_m = gone("aeroplane", heading_only)
    assert 16 <= len(rows) <= 19
    assert all(off < 3.0 * sigma * math.sqrt(2.0) for _, _, off, sigma in rows)
    assert rows[-1][2] < constant_m / 3.0


def test_good_positions_are_not_refused_and_no_track_is_changed() -> None:
    _, said = said_by("car", honest, without_unit)
    on, off = (
        [picture for _, picture in pictures(said[:400], options=options)]
        for options in (QUIET, replace(QUIET, dead_reckoning="off"))
    )
    assert [one.fuse.covariance.tobytes() for one in on] == [one.fuse.covariance.tobytes() for one in off]


def test_a_unit_that_tells_about_three_times_a_second_does_not_come_and_go() -> None:
    """A copter without one keeps on without until it tells four a second; one with a unit keeps it down to three."""
    lies = Series(START + np.arange(0, 12 * SECOND, SECOND // 2), np.tile([1.0, 0.0, 0.0, 0.0], (24, 1)))

    def carried(hz: float, until_now: By) -> By:
        at = START + np.round(np.arange(0.0, 12.0, 1.0 / hz) * SECOND).astype(np.int64)
        told = Told().with_more({ATTITUDE: lies, INERTIAL: Series(at, np.ones((len(at), 7)))})
        return carried_by(told, 2, until_now)

    assert [carried(hz, By.TILT) for hz in (2.5, 3.4, 4.5)] == [By.TILT, By.TILT, By.UNIT]
    assert [carried(hz, By.UNIT) for hz in (2.5, 3.4, 4.5)] == [By.TILT, By.UNIT, By.UNIT]


def test_what_is_known_of_a_source_outlasts_a_pause_of_what_carries_on() -> None:
    """Attitudes that pause for four seconds end dead reckoning: a walk that goes on then is refused ten seconds later."""

    def pausing(each: Observation) -> Observation | None:
        if isinstance(each, Attitude) and 28.0 < (each.valid_at - START) / SECOND < 32.0:
            return None
        return without_unit(each)

    _, said = said_by("car", walks_off_silently, pausing)
    (since_s, word), *_ = denials(picture for _, picture in pictures(one for one in said if one.now < OVER))
    assert word == "denied"
    assert 4.0 < since_s <= 12.0


def walks_off_silently(time_s: float) -> tuple[float, float, float, float]:
    """2 m/s, and its velocities say nothing of it."""
    gone_s = max(time_s - FALSE_FROM_S, 0.0)
    return 1.2 * gone_s, 1.6 * gone_s, 0.0, 0.0


@pytest.mark.study
def test_how_it_leans_carries_a_copter_on() -> None:
    """Windows of 20 s of a simulated mission: twice as near as a constant velocity over the window, and inside three sigma."""
    said, vehicle_type, truth = simulated("copter", 2, length_s=240.0)
    assert carried_by(said, vehicle_type) == By.TILT
    found = windows(said, vehicle_type, 20.0, 5.0, truth)
    assert len(found.reckoned_m) > 20
    assert found.inside.mean() > 0.99
    assert found.reckoned_m[:, -1].mean() < 0.5 * found.constant_m[:, -1].mean()


def stood(changed: Changed) -> tuple[Picture, ...]:
    """A car at rest, that never moves: the ride's first instant over and over, without positions after a while."""
    teller, said = told("car", goes_away)
    first = next(each for one in said for each in one.observations if isinstance(each, Attitude))
    made = list[Heard]()
    for one in said:
        some = list[Observation]()
        for each in one.observations:
            if isinstance(each, Attitude):
                each = replace(first, valid_at=each.valid_at, received_at=each.received_at)
            elif hasattr(each, "latitude_rad"):
                wander = 1e-7 * math.sin(each.valid_at / 7e9)
                each = replace(
                    each,
                    latitude_rad=float(teller.ride.motion.latitude_rad[0]) + wander,
                    longitude_rad=float(teller.ride.motion.longitude_rad[0]),
                    velocity_north_mps=0.4,
                    velocity_east_mps=-0.3,
                )
            changed_one = changed(each)
            some += [] if changed_one is None else [changed_one]
        made.append(replace(one, observations=tuple(some)))
    return tuple(picture for _, picture in pictures(one for one in made if HEARD_FROM < one.now < OVER))


@pytest.mark.parametrize(("armed", "landed"), [pytest.param(False, None, marks=pytest.mark.study), (True, "on ground")])
def test_what_says_that_it_rests_stays_where_it_is(armed: bool, landed: str | None) -> None:
    """Its last velocity was half a metre a second of noise: after twenty seconds it is metres off, and says so."""

    def resting(each: Observation) -> Observation | None:
        if isinstance(each, VehicleStatus):
            return replace(each, armed=armed, landed=landed)
        return without_unit(each)

    teller, _ = told("car", goes_away)
    rows = [row for picture in stood(resting) for row in _off_m(picture, teller.ride.motion)]
    assert len(rows) >= 16
    assert max(off for off, _ in rows) < 5.0
    assert max(sigma for _, sigma in rows) - rows[0][1] < 5.0


def _off_m(picture: Picture, still: ins.Motion) -> list[tuple[float, float]]:
    """How far from where it stands, and its sigma, of what dead reckoning wrote."""
    fuse, found = picture.fuse, []
    for row in np.flatnonzero([by == "dead-reckoning" for by in fuse.updated_by]):
        north = (fuse.latitude_rad[row] - still.latitude_rad[0]) * 6.367e6
        east = (fuse.longitude_rad[row] - still.longitude_rad[0]) * 6.388e6 * math.cos(still.latitude_rad[0])
        found.append((math.hypot(north, east), math.sqrt(fuse.covariance[row, 0])))
    return found


@pytest.mark.parametrize("step", [lambda one: turned_through(one, np.asarray(0.4), 0.5), lambda one: dragged(one, 0.5)])
def test_the_covariance_goes_with_the_way_through_the_medium(step: Callable[[dr.Reckoning], dr.Reckoning]) -> None:
    """Each error state moved a little before a step is where the covariance says it is after it."""
    motion = ins.Motion(
        *(np.asarray(one) for one in (0.8, 0.1, 500.0)), np.array([9.0, -4.0, 0.5]), ins.from_angles(0, 0, 1)
    )
    base = dr.started(motion, 1.0, 1.0, 1.0, drag_per_s=(0.3, 0.1))
    base = replace(base, wind_mps=np.array([2.0, 1.0]))
    after = step(base)
    for place in range(dr.STATES_WITH_DRAG):
        moved, only = np.zeros(dr.STATES_WITH_DRAG), np.zeros((dr.STATES_WITH_DRAG,) * 2)
        moved[place], only[place, place] = 1e-5, 1.0
        other, here = step(dr._corrected(base, moved, base.covariance)).motion, after.motion
        apart = np.concatenate(
            [
                ins.between(other.latitude_rad, other.longitude_rad, other.height_m, here),
                other.velocity_mps - here.velocity_mps,
            ]
        )
        claimed = np.diagonal(step(replace(base, covariance=only)).covariance)[:6]
        np.testing.assert_allclose((apart / 1e-5) ** 2, claimed, atol=2e-3)
