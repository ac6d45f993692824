"""Dead reckoning of vehicles with wings that tell attitude and airspeed, and of no inertial unit or of too little."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from adapters.decode import Decoder
from gateway.estimators import inertial as ins
from gateway.observation import AirData, Attitude, GpsReport, Heard, ImuSample, Many, Observation, VehicleStatus
from gateway.picture import Picture
from gateway.reckon import LastPlace, Reckoners
from gateway.reckon.flying import flown
from gateway.reckon.told import Series
from gateway.runtime.playback import open_playback
from sim.told_pictures import FALSE_FROM_S, QUIET, SECOND, START, denials, errors_m, frozen, goes_away, pictures, told
from sim.told_rides import honest

RECORDING = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.BIN"
MUTED = (1_767_226_335 * SECOND, 1_767_226_365 * SECOND)


def by_radio(said: Iterable[Heard], samples_hz: int = 0) -> tuple[Heard, ...]:
    """What of it comes over a slow telemetry radio: attitude and airspeed three times a second, of the unit a sample or none."""
    kept = []
    for tenth, one in enumerate(said):
        mine = list[Observation]()
        for each in one.observations:
            if isinstance(each, Many):
                if samples_hz and tenth % (10 // samples_hz) == 0:
                    mine.append(Many(ImuSample, {name: column[:1] for name, column in each.columns.items()}))
            elif not isinstance(each, Attitude | AirData) or tenth % 3 == 0:
                mine.append(each)
        kept.append(replace(one, observations=tuple(mine)))
    return tuple(kept)


@cache
def flew(samples_hz: int) -> tuple[Picture, ...]:
    """A flight that has no positions for twenty seconds, of which a unit tells so many samples a second."""
    return tuple(picture for _, picture in pictures(by_radio(told("aeroplane", goes_away)[1], samples_hz)))


@pytest.mark.parametrize("samples_hz", [0, 2])
def test_attitude_and_airspeed_carry_a_track_on(samples_hz: int) -> None:
    """Twenty seconds without positions, a turn among them: inside three sigma, and much nearer than a constant velocity."""
    teller, _ = told("aeroplane", goes_away)
    rows = [row for row in errors_m(teller, flew(samples_hz)) if row[1] == "dead-reckoning"]
    assert 16 <= len(rows) <= 19
    assert all(off < 3.0 * sigma * math.sqrt(2.0) for _, _, off, sigma in rows)
    motion, begin = teller.ride.motion, round(FALSE_FROM_S * 50)
    gone = int(rows[-1][0] * 50)
    straight = motion.velocity_mps[begin, :2] * (gone / 50.0)
    here = ins.Motion(
        *(np.asarray(getattr(motion, name)[begin]) for name in ("latitude_rad", "longitude_rad", "height_m")),
        np.zeros(3),
        np.zeros(4),
    )
    there = (motion.latitude_rad[begin + gone], motion.longitude_rad[begin + gone], motion.height_m[begin + gone])
    constant_m = math.hypot(*(ins.between(*there, here)[:2] - straight))
    assert rows[-1][2] < constant_m / 3.0


def test_its_good_positions_are_not_refused_and_no_track_is_changed_by_it() -> None:
    said = by_radio(told("aeroplane", honest)[1])
    on, off = (
        [picture for _, picture in pictures(said, options=options)]
        for options in (QUIET, replace(QUIET, dead_reckoning="off"))
    )
    assert not denials(on)
    assert [one.fuse.covariance.tobytes() for one in on] == [one.fuse.covariance.tobytes() for one in off]


def test_a_position_that_freezes_while_it_flies_is_refused_and_the_track_goes_on() -> None:
    teller, said = told("aeroplane", honest)
    some = [picture for _, picture in pictures(frozen(by_radio(said), FALSE_FROM_S + 10.0))]
    (since_s, word) = denials(some)[0]
    assert word == "denied"
    assert 10.0 < since_s <= 12.0
    assert max(off for since_s, _, off, _ in errors_m(teller, some) if 10.0 < since_s < 30.0) < 60.0


def test_a_copters_position_that_freezes_while_its_velocity_tells_of_flight_is_refused() -> None:
    """Of a vehicle of which nothing else tells how it moves; the track coasts, and positions that change again are used."""
    teller, said = told("car", honest)
    plain = [
        replace(
            one, observations=tuple(each for each in one.observations if isinstance(each, GpsReport | VehicleStatus))
        )
        for one in said
    ]
    until = START + (FALSE_FROM_S + 10.0) * SECOND
    stuck = [
        *(one for one in frozen(plain, FALSE_FROM_S) if one.now < until),
        *(one for one in plain if one.now >= until),
    ]
    some = [picture for _, picture in pictures(stuck)]
    texts = [(event.at, event.text) for picture in some for event in picture.events if "its position" in event.text]
    assert ["stays the same" in text for _, text in texts] == [True, False]
    assert 2.0 <= (texts[0][0] - START) / SECOND - FALSE_FROM_S < 10.0
    assert not [row for row in errors_m(teller, some) if 9.0 < row[0] < 10.0 and row[1] == "gps"]
    assert not [event for _, picture in pictures(plain) for event in picture.events if "its position" in event.text]


def test_what_stands_tells_one_place_and_is_believed() -> None:
    last = LastPlace(0.8, 0.1, START, START)
    for second in range(1, 600):
        last = last.followed_by(START + second * SECOND, 0.8, 0.1, 0.5 * (second % 3))
    assert not last.is_frozen
    for second in range(600, 603):
        last = last.followed_by(START + second * SECOND, 0.8, 0.1, 12.0)
    assert last.is_frozen


def test_what_comes_in_other_portions_changes_no_bit() -> None:
    said = [one for one in by_radio(told("aeroplane", goes_away)[1]) if one.now < START + 41 * SECOND]
    end = Heard(START + 42 * SECOND)

    def rows(at_once: int) -> bytes:
        made = [picture.fuse for _, picture in pictures([*said, *[end] * (at_once - len(said) % at_once)], at_once)]
        return b"".join(np.concatenate([getattr(one, name) for one in made]).tobytes() for name in _COLUMNS)

    assert rows(37) == rows(7)


_COLUMNS = ("time", "latitude_rad", "longitude_rad", "velocity_mps", "covariance")


def test_what_a_unit_would_tell_of_a_level_turn_is_one() -> None:
    """30 m/s at 45 degrees of bank for 18 s, its attitude told once a second: the circle closes within 0.2 % of its length."""
    speed, bank = 30.0, math.radians(45.0)
    turning = 9.806_65 * math.tan(bank) / speed
    lasts_s = 2.0 * math.pi / turning
    seconds = np.linspace(0.0, lasts_s, 20)
    at = np.round(seconds * SECOND).astype(np.int64)
    lies = ins.from_angles(bank, 0.0, turning * seconds)
    unit = flown(Series(at, lies), Series(at, np.full((20, 1), speed)))
    motion = ins.Motion(
        np.zeros(1), np.zeros(1), np.zeros(1), np.array([[speed, 0.0, 0.0]]), ins.from_angles([bank], [0.0], [0.0])
    )
    for before, sample, after in zip(unit.at, unit.values, unit.at[1:], strict=False):
        step_s = (after - before) / SECOND
        motion = ins.advanced(motion, sample[None, 3:6], sample[None, :3], np.array([step_s]), harmful=False)
    origin = ins.Motion(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 4)))
    off = ins.between(motion.latitude_rad, motion.longitude_rad, motion.height_m, origin)[0]
    assert math.hypot(*off[:2]) < 0.002 * speed * lasts_s
    assert np.linalg.norm(unit.values[:, :3], axis=1) == pytest.approx(9.806_65 / math.cos(bank), rel=1e-6)


def test_a_recorded_approach_without_its_unit_goes_on_half_a_minute_without_positions() -> None:
    """SITL's final approach, by attitude and airspeed five times a second: 1.5 m off each second at most, inside 3 sigma."""
    playback = open_playback([RECORDING])
    decoder, setup = Decoder(playback.sources), playback.setup()
    muted, said, rows = list[GpsReport](), list[Heard](), list[tuple[int, float, float, float]]()
    for _, one in decoder.hear_many(list(playback.arrivals()))[0]:
        if one.now < MUTED[0] - 35 * SECOND:
            continue
        late = [
            each for each in one.observations if isinstance(each, GpsReport) and MUTED[0] < each.valid_at < MUTED[1]
        ]
        muted += late
        told_besides = (each for each in one.observations if not isinstance(each, ImuSample) and each not in late)
        said.append(replace(one, observations=tuple(told_besides)))
    for _, picture in pictures((one for one in said if one.now < MUTED[1]), 50, site=setup.place.site):
        fuse = picture.fuse
        for row in np.flatnonzero([by == "dead-reckoning" for by in fuse.updated_by]):
            sigma = math.sqrt(0.5 * (fuse.covariance[row, 0] + fuse.covariance[row, 7]))
            rows.append((int(fuse.time[row]), fuse.latitude_rad[row], fuse.longitude_rad[row], sigma))
    assert len(rows) >= 25
    for at, latitude, longitude, sigma in rows:
        off_m = apart_m(nearest(muted, at), latitude, longitude)
        assert off_m < 3.0 + 1.5 * (at - MUTED[0]) / SECOND
        assert off_m < 3.0 * math.sqrt(2.0) * sigma


def nearest(reports: Sequence[GpsReport], at: int) -> GpsReport:
    """The one that was so nearest to an instant."""
    return min(reports, key=lambda one: abs(one.valid_at - at))


def apart_m(one: GpsReport, latitude_rad: float, longitude_rad: float) -> float:
    """Level, from a place."""
    east = (longitude_rad - one.longitude_rad) * math.cos(latitude_rad)
    return math.hypot(latitude_rad - one.latitude_rad, east) * 6.371e6


def test_who_tells_no_place_for_a_minute_is_forgotten() -> None:
    """What was told last of vehicles that are gone is not kept: of thousands it would be copied with each report."""
    gone = Reckoners().telling({"mavlink:9": LastPlace(0.8, 0.1, 0, 0)})
    assert gone.planning(60 * SECOND).told_last
    assert not gone.planning(61 * SECOND).told_last
    assert gone.planning(61 * SECOND).is_idle
