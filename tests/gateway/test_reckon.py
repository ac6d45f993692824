"""Dead reckoning live: what vehicles tell of their motion carries them on, and denies positions that are false."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest

from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.observation import Attitude, Heard, ImuSample, Many, RadarPlot
from gateway.picture import Picture
from gateway.settings import DeadReckoning, RadarSite
from sim.told_pictures import (
    FALSE_FROM_S,
    QUIET,
    SECOND,
    SITE,
    START,
    denials,
    errors_m,
    frozen,
    goes_away,
    pictures,
    told,
)
from sim.told_rides import Falsified, Teller, honest


def walks_off(time_s: float) -> tuple[float, float, float, float]:
    """2 m/s to the north-east, which its velocities say too."""
    gone_s = max(time_s - FALSE_FROM_S, 0.0)
    speed = math.sqrt(2.0) if gone_s else 0.0
    return speed * gone_s, speed * gone_s, speed, speed


def walks_off_silently(time_s: float) -> tuple[float, float, float, float]:
    """The same, and its velocities say nothing of it."""
    return (*walks_off(time_s)[:2], 0.0, 0.0)


def jumps(time_s: float) -> tuple[float, float, float, float]:
    """50 m to the side for twenty seconds."""
    return (30.0, 40.0, 0.0, 0.0) if FALSE_FROM_S < time_s <= FALSE_FROM_S + 20.0 else (0.0, 0.0, 0.0, 0.0)


def told_too_fast(time_s: float) -> tuple[float, float, float, float]:
    """Good positions, whose velocities are wrong by 15 m/s for ten seconds."""
    return (0.0, 0.0, 9.0, 12.0) if FALSE_FROM_S < time_s <= FALSE_FROM_S + 10.0 else (0.0, 0.0, 0.0, 0.0)


@cache
def ran(kind: str, falsified: Falsified, dead_reckoning: Literal["on", "off"] = "on") -> tuple[Picture, ...]:
    """A ride, seen through to its end."""
    options = replace(QUIET, dead_reckoning=dead_reckoning)
    return tuple(picture for _, picture in pictures(told(kind, falsified)[1], options=options))


def refused(some: Sequence[Picture]) -> int:
    (gateway,) = (one for one in some[-1].health.sources if one.kind == "pipeline")
    return dict(gateway.counters).get("GPS reports that inertial data deny", 0)


@pytest.mark.parametrize(
    ("kind", "falsified", "within_s"),
    [("car", walks_off, 20.0), ("aeroplane", walks_off_silently, 20.0), ("aeroplane", jumps, 2.0)],
)
def test_what_walks_off_at_2_m_s_is_refused_within_20_s_and_a_step_of_50_m_is_told_within_two(
    kind: str, falsified: Falsified, within_s: float
) -> None:
    since_s, word = denials(ran(kind, falsified))[0]
    assert word == "denied"
    assert 0.0 < since_s <= within_s


def test_no_position_after_a_step_of_50_m_reaches_the_track() -> None:
    teller, _ = told("aeroplane", jumps)
    rows = errors_m(teller, ran("aeroplane", jumps))
    assert max(off for since_s, _, off, _ in rows if since_s > -20.0) < 15.0
    assert refused(ran("aeroplane", jumps)) >= 40


def test_a_position_that_freezes_beside_a_radar_is_not_believed() -> None:
    radar = RadarSite(1, 100.0, 100.0, 3.0, 0.0, range_sigma_m=10.0)
    site = replace(SITE, radars=(radar,))
    teller, said = told("aeroplane", honest)
    heard_together = sorted([*frozen(said, FALSE_FROM_S), *plots(teller, radar)], key=lambda one: one.now)
    some = [picture for _, picture in pictures(heard_together, site=site)]
    assert [word for _, word in denials(some)] == ["denied"]
    late = [(by, off) for since_s, by, off, _ in errors_m(teller, some) if since_s > 3.0]
    assert {by for by, _ in late} == {"radar"}
    assert max(off for _, off in late) < 40.0


def plots(teller: Teller, radar: RadarSite) -> Iterator[Heard]:
    """One a second of where the vehicle is."""
    frame, motion = RunwayFrame(SITE.runway), teller.ride.motion
    seen = RadarFrame.of(radar, frame)
    generator = np.random.default_rng(3)
    for second in range(1, 66):
        at, place = START + second * SECOND, second * 50
        there = motion.latitude_rad[place], motion.longitude_rad[place], motion.height_m[place]
        polar = polar_from_xyz(seen.from_enu(frame.enu_from_geodetic(*there)))
        polar = polar + generator.standard_normal(3) * [10.0, 1e-3, 1e-3]
        yield Heard(at + 50_000_000, (RadarPlot(1, 7, at, at + 50_000_000, *polar.tolist()),))


def test_what_agrees_again_is_believed_again() -> None:
    (_, first), (since_s, second) = denials(ran("aeroplane", jumps))
    assert (first, second) == ("denied", "believed")
    assert 20.0 < since_s < 28.0


def test_good_positions_whose_velocities_turn_wrong_are_used_without_them_until_these_fit_again() -> None:
    some = ran("aeroplane", told_too_fast)
    (_, first), (since_s, second) = denials(some)
    assert (first, second) == ("denied", "believed")
    assert 5.0 <= since_s <= 8.0  # so begins a walk with velocities to match, too
    again = [
        (one.at - START) / SECOND - FALSE_FROM_S for picture in some for one in picture.events if "fits" in one.text
    ]
    assert len(again) == 2  # said when they are left out, and when they are not any more
    assert 15.0 <= again[1] <= 28.0
    rows = errors_m(told("aeroplane", told_too_fast)[0], some)
    assert max(off for row_s, _, off, _ in rows if row_s > -20.0) < 10.0
    assert {by for row_s, by, _, _ in rows if row_s > since_s + 1.0} == {"gps"}


def test_of_good_positions_none_is_refused_and_none_is_changed() -> None:
    on, off = ran("aeroplane", honest), ran("aeroplane", honest, "off")
    assert refused(on) == 0
    assert [one.fuse.covariance.tobytes() for one in on] == [one.fuse.covariance.tobytes() for one in off]
    assert [one.fuse.runway_m.tobytes() for one in on] == [one.fuse.runway_m.tobytes() for one in off]


def test_without_positions_the_track_goes_on_by_dead_reckoning_and_says_how_sure_it_is() -> None:
    teller, _ = told("aeroplane", goes_away)
    whole = errors_m(teller, ran("aeroplane", goes_away))
    rows = [row for row in whole if row[1] == "dead-reckoning"]
    assert 16 <= len(rows) <= 19
    assert max(off for _, _, off, _ in rows) < 15.0
    assert all(b[3] > a[3] for a, b in pairwise(rows[2:]))
    assert not [row for row in whole if row[1] == "coast"]
    off = errors_m(teller, ran("aeroplane", goes_away, "off"))
    assert {row[1] for row in off if 3.0 < row[0] <= 20.0} == {"coast"}


def test_positions_that_come_back_make_no_jump() -> None:
    teller, _ = told("aeroplane", goes_away)
    rows = sorted(errors_m(teller, ran("aeroplane", goes_away)))
    steps = [(abs(b[2] - a[2]), b[0] - a[0]) for a, b in pairwise(rows) if 19.0 < a[0] < 28.0]
    assert max(change / max(passed_s, 0.2) for change, passed_s in steps) < 8.0


def test_a_wind_is_found_and_written_beside_the_track() -> None:
    teller, _ = told("aeroplane", honest)
    east, north = ran("aeroplane", honest)[-1].fuse.wind_mps[-1]
    assert math.hypot(north - teller.ride.wind_mps[-1, 0], east - teller.ride.wind_mps[-1, 1]) < 2.5


def split(said: Iterable[Heard]) -> Iterator[Heard]:
    """What came together comes one by one, and inertial samples as objects."""
    for one in said:
        for observation in one.observations:
            alone = tuple(observation) if isinstance(observation, Many) else (observation,)
            yield from (replace(one, observations=(each,)) for each in alone)


def test_how_arrivals_fall_into_steps_changes_no_bit() -> None:
    said = tuple(one for one in told("aeroplane", goes_away)[1] if one.now < START + 41 * SECOND)
    end = Heard(START + 42 * SECOND)

    def rows(some: Iterable[Heard], at_once: int) -> bytes:
        made = [picture.fuse for _, picture in pictures(some, at_once)]
        return b"".join(np.concatenate([getattr(one, name) for one in made]).tobytes() for name in _COLUMNS)

    parts = [*split(said), end]
    assert rows([*parts, *[end] * (-len(parts) % 37)], 37) == rows([*said, end], len(said) + 1)


_COLUMNS = ("time", "latitude_rad", "longitude_rad", "height_m", "velocity_mps", "covariance", "wind_mps")


def test_what_is_told_late_goes_back_to_its_place() -> None:
    """Two seconds of inertial samples that come 1.5 s late leave the same state as samples that came in time."""
    _, said = told("car", honest, 14.0)
    late = []
    for one in said:
        samples = tuple(each for each in one.observations if isinstance(each, Many))
        if START + 8 * SECOND < one.now < START + 10 * SECOND:
            others = tuple(each for each in one.observations if not isinstance(each, Many))
            late.append((one.now, replace(one, observations=others)))
            later = one.now + 1_500_000_000
            moved = tuple(
                Many(ImuSample, {**each.columns, "received_at": each.columns["received_at"] + 1_500_000_000})
                for each in samples
            )
            late.append((later, Heard(later, moved)))
        else:
            late.append((one.now, one))
    late.sort(key=lambda pair: pair[0])
    *_, (in_time, _) = pictures(said, len(said))
    *_, (behind, _) = pictures([one for _, one in late], len(late))
    a, b = (state.reckoners.of("mavlink:1", START + 13 * SECOND) for state in (in_time, behind))
    assert a is not None
    assert b is not None
    assert a.latitude_rad == pytest.approx(b.latitude_rad, abs=1e-14)
    assert a.velocity_mps == pytest.approx(b.velocity_mps, abs=1e-9)


def test_a_car_that_tells_positions_only_is_nothing_to_dead_reckoning() -> None:
    _, said = told("car", goes_away)
    plain = [
        replace(one, observations=tuple(o for o in one.observations if not isinstance(o, Many | Attitude)))
        for one in said
    ]
    *_, (state, _) = pictures(plain[:200])
    assert not state.reckoners.by_aircraft
    assert sum(len(some) for _, some in state.reckoners.waiting) < 40


@pytest.mark.parametrize("wild", [1e6, 0.0])  # adapters let no more pass
def test_a_unit_that_tells_nonsense_stops_nothing(wild: float) -> None:
    said = list(told("aeroplane", honest)[1][:150])
    for place in range(100, 150):
        samples = (
            Many(
                ImuSample,
                {
                    **one.columns,
                    "acceleration_mps2": np.full((len(one), 3), wild),
                    "angular_rate_radps": np.full((len(one), 3), wild),
                },
            )
            if isinstance(one, Many)
            else one
            for one in said[place].observations
        )
        said[place] = replace(said[place], observations=tuple(samples))
    *_, (_, picture) = pictures(said)
    assert np.isfinite(picture.fuse.latitude_rad).all()
    assert np.isfinite(picture.fuse.covariance).all()


def test_a_site_may_let_everything_pass() -> None:
    site = replace(SITE, dead_reckoning=DeadReckoning(refuses=False))
    *_, (state, _) = pictures(told("aeroplane", jumps)[1][:400], site=site)
    assert "GPS reports that inertial data deny" not in state.counters
