"""Conflicts: pairs that will lose their separation are told in time, others are not, and what is over is cleared."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.predict.conflicts import Probing
from gateway.predict.encounters import encounters, near_each_other, neighbours
from gateway.predict.ways import STEP_S, Ways, path_on
from gateway.settings import DEMO_SITE, Options, Separation

Floats = NDArray[np.float64]

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
FRAME = RunwayFrame(DEMO_SITE.runway)
ROWS = 25


def ways(places: Sequence[Sequence[float]], velocities: Sequence[Sequence[float]], sigma_m: float = 10.0) -> Ways:
    """Straight ways of tracks 1, 2, ... from places with velocities, as certain as that."""
    place, velocity = np.array(places, dtype=np.float64), np.array(velocities, dtype=np.float64)
    times = np.arange(ROWS)[:, None] * STEP_S
    n = len(place)
    course = np.repeat(np.arctan2(velocity[:, 1], velocity[:, 0])[:, None], ROWS, axis=1)
    sigma = np.full((n, ROWS), sigma_m)
    yes = np.ones(n, dtype=np.bool_)
    path = place[:, None] + times * velocity[:, None]
    nobody = np.full(n, math.nan)  # flies straight without a way that he has told
    return Ways(np.arange(1, n + 1), np.full(n, T0), path, course, sigma, sigma, sigma, yes, yes, nobody)


def test_a_crossing_is_found_with_its_time_its_place_and_how_near() -> None:
    """Two that meet at right angles in 80 s, 300 m and 50 m apart: that is what is told, and that it is all but sure."""
    both = ways([[0.0, 0.0, 1000.0], [8000.0, -8300.0, 1050.0]], [[100.0, 0, 0], [0, 100.0, 0]])
    found = encounters(near_each_other(both, T0, Separation()), Separation())
    assert found.pair.tolist() == [[1, 2]]
    assert (found.closest_at[0] - T0) / SECOND == pytest.approx(81.5, abs=0.1)
    assert found.horizontal_m[0] == pytest.approx(300.0 / math.sqrt(2.0), abs=5.0)
    assert found.vertical_m[0] == pytest.approx(50.0, abs=0.5)
    assert found.places[0].mean(axis=0)[:2] == pytest.approx([8075.0, -75.0], abs=20.0)
    assert found.probability[0] > 0.99
    lost_s = (found.loses_at[0] - T0) / SECOND
    assert 81.5 - 1220.0 / 141.0 < lost_s < 81.5 - 1220.0 / 141.0 + 1.5


@pytest.mark.parametrize(
    ("height", "aside", "found"),
    [(1139.0, 0.0, True), (1190.0, 0.0, False), (1000.0, 1200.0, True), (1000.0, 1600.0, False)],
)
def test_levels_and_distances_keep_apart(height: float, aside: float, found: bool) -> None:
    """Head-on with 139 m between levels, or 1200 m to the side, is told; with 190 m, or 1600 m, it is not."""
    both = ways([[0, 0, 1000.0], [10000.0, aside, height]], [[80.0, 0, 0], [-80.0, 0, 0]])
    met = encounters(near_each_other(both, T0, Separation()), Separation())
    assert (len(met.ratio) == 1) == found


def test_the_probability_is_the_share_of_draws_that_come_too_near() -> None:
    """Of ways drawn with the sigmas that are told, as many lose separation as is told, within 3 %."""
    sigma, draws = 900.0, 4000
    one = ways([[0, 0, 1000.0], [10000.0, -9500.0, 1080.0]], [[90.0, 0, 0], [0, 90.0, 0]], sigma)
    one = replace(one, upright=np.full((2, ROWS), 60.0))
    told = encounters(near_each_other(one, T0, Separation()), Separation()).probability[0]
    chance = np.random.default_rng(3)
    off = chance.normal(0.0, [sigma, sigma, 60.0], (draws, 2, 3))
    times = np.arange(0.0, 120.0, 0.25)
    start = np.array([[0, 0, 1000.0], [10000.0, -9500.0, 1080.0]]) + off
    way = start[:, 1, None] - start[:, 0, None] + times[:, None] * (np.array([0, 90.0, 0]) - np.array([90.0, 0, 0]))
    near = (np.hypot(way[..., 0], way[..., 1]) < 1220.0) & (np.abs(way[..., 2]) < 140.0)
    assert told == pytest.approx(near.any(axis=1).mean(), abs=0.03)


def test_who_flies_straight_mostly_goes_on() -> None:
    """Two that meet head-on in 60 s, of whom nobody knows whether they turn: as many pairs lose separation as both fly on.

    Who turns is anywhere: the sigmas are 4 km. Straight flight goes on for 60 s with exp(-60 / 300).
    """
    both = ways([[0, 0, 1000.0], [9600.0, 0, 1000.0]], [[80.0, 0, 0], [-80.0, 0, 0]], 4000.0)
    both = replace(both, upright=np.full((2, ROWS), 1.0))
    both.along[:, 0] = 10.0
    anywhere = encounters(near_each_other(both, T0, Separation()), Separation()).probability[0]
    straight = replace(both, straight_mps=np.array([80.0, 80.0]))
    told = encounters(near_each_other(straight, T0, Separation()), Separation()).probability[0]
    assert anywhere < 0.2
    assert 0.95 * math.exp(-2 * 60 / 300.0) < told < math.exp(-2 * 60 / 300.0) + anywhere


def test_nobody_on_the_ground_is_probed_even_if_he_seems_to_climb() -> None:
    """One stands 20 m above the runway, as its source says, and seems to climb at 1.5 m/s: no conflict. At 40 m it is one."""
    place, velocity = [[0, 0, 20.0], [6000.0, 0, 60.0]], [[5.0, 0, 1.5], [-80.0, 0, 0]]
    grounded = encounters(near_each_other(ways(place, velocity), T0, Separation()), Separation())
    assert not len(grounded.ratio)
    place[0][2] = 40.0
    assert len(encounters(near_each_other(ways(place, velocity), T0, Separation()), Separation()).ratio) == 1


def test_neighbours_are_those_of_all_pairs() -> None:
    """Among 300 points at four times the same pairs are found as by comparing all with all; none twice."""
    place = np.random.default_rng(1).uniform(-30e3, 30e3, (300, 4, 2))
    place[7, 2] = np.nan
    first, second, time = neighbours(place, 2500.0)
    found = list(zip(first.tolist(), second.tolist(), time.tolist(), strict=True))
    way = place[:, None] - place[None]
    near = (way**2).sum(axis=-1) < 2500.0**2
    every = {(i, j, t) for i, j, t in np.argwhere(near).tolist() if i < j}
    assert len(found) == len(set(found))
    assert set(found) == every


def test_the_path_between_points_is_the_turn_that_they_are_on() -> None:
    """Of a turn at 3 degrees a second, known at 0, 10 and 30 s, the path between is right to 2 % of its radius."""
    rate, speed = math.radians(3.0), 80.0
    known, times = np.array([[0.0, 10.0, 30.0]]), np.arange(0.0, 31.0, 5.0)

    def turn(t: Floats) -> Floats:
        return speed / rate * np.stack([np.sin(rate * t), 1.0 - np.cos(rate * t)], axis=-1)

    place, course = path_on(times, known, turn(known), rate * known)
    assert place[0] == pytest.approx(turn(times), abs=0.02 * speed / rate)
    assert course[0] == pytest.approx(rate * times)


def test_a_conflict_is_told_after_three_rounds_and_over_after_five() -> None:
    """It does not flicker: two rounds of it are nothing, four without it do not end it."""
    probing, states = Probing(), []
    apart = ways([[0, 0, 1000.0], [10000.0, 9000.0, 1000.0]], [[80.0, 0, 0], [80.0, 0, 0]])
    toward = ways([[0, 0, 1000.0], [10000.0, 0.0, 1000.0]], [[80.0, 0, 0], [-80.0, 0, 0]])
    plan = [toward] * 2 + [apart] + [toward] * 4 + [apart] * 4 + [toward] + [apart] * 6
    for count, now in enumerate(plan):
        probing = probing.hearing(now, T0 + count, 1e-9)
        probing = probing.looking(T0, [1, 2], Separation()).meeting(Separation())
        probing, found = probing.watching(T0, [1, 2], Separation())
        states.append(found.state)
    told = [one[0] if one else "" for one in states]
    assert told == [""] * 5 + ["found"] + ["goes on"] * 10 + ["over", ""]


def report(name: str, at_s: int, place: Sequence[float], velocity: Sequence[float]) -> Heard:
    """An aircraft's word of itself at a second."""
    latitude, longitude, height = map(float, FRAME.geodetic_from_enu(place))
    at = T0 + at_s * SECOND
    told = GpsReport(name, at, at + 1000, latitude, longitude, None, height, *velocity, 3.0, 3.0, 0.3)
    return Heard(at + 1000 + int(name[-1]), (told,))


def flown(
    of: Mapping[str, tuple[Sequence[float], Sequence[float]]], seconds: int, said: Sequence[Observation] = ()
) -> list[Heard]:
    """Aircraft on straight ways from places with velocities; and what was said before."""
    heard = [Heard(T0 - SECOND + place, (one,)) for place, one in enumerate(said)]
    for at_s in range(seconds):
        for name, (place, velocity) in of.items():
            here = [start + at_s * rate for start, rate in zip(place, velocity, strict=True)]
            heard.append(report(name, at_s, here, velocity))
    return [*heard, Heard(heard[-1].now + 2 * SECOND)]


def run(heard: Sequence[Heard], together: int = 1000) -> list[Picture]:
    """The pictures of what was heard, so many arrivals a step."""
    state, pictures = initial(DEMO_SITE, Options()), []
    for first in range(0, len(heard), together):
        state, picture = step(state, heard[first : first + together])
        pictures.append(picture)
    return pictures


HEAD_ON = {
    "mavlink:1": ((-8000.0, 20000.0, 1000.0), (80.0, 0.0, 0.0)),
    "mavlink:2": ((7000.0, 20400.0, 1040.0), (-75.0, 0.0, 0.0)),
}


def test_of_a_swarm_the_soonest_are_told() -> None:
    """Of a hundred pairs that meet one after the other the first fifty are told, and the next where one of these is over."""
    number = np.arange(100.0)
    one = np.stack([np.zeros(100), 20e3 * number, np.full(100, 1000.0)], axis=-1)
    other = one + np.stack([7000.0 + 40.0 * number, np.zeros(100), np.zeros(100)], axis=-1)
    still, west = np.zeros((100, 3)), np.tile([-100.0, 0.0, 0.0], (100, 1))
    here = ways(np.concatenate([one, other]).tolist(), np.concatenate([still, west]).tolist())
    probing, everybody = Probing().hearing(here, T0, 10.0), list(range(1, 201))
    for rounds in range(3):
        looked = probing.looking(T0 + rounds * SECOND, everybody, Separation()).meeting(Separation())
        probing, found = looked.watching(T0 + rounds * SECOND, everybody, Separation())
    assert sorted(found.told.pair[:, 0].tolist()) == list(range(1, 51))
    assert found.untold == 50
    alive = [track for track in everybody if track != 1]
    looked = probing.looking(T0 + 3 * SECOND, alive, Separation()).meeting(Separation())
    probing, over = looked.watching(T0 + 3 * SECOND, alive, Separation())
    assert [pair[0] for pair, state in zip(over.told.pair.tolist(), over.state, strict=True) if state == "over"] == [1]
    looked = probing.looking(T0 + 4 * SECOND, alive, Separation()).meeting(Separation())
    probing, then = looked.watching(T0 + 4 * SECOND, alive, Separation())
    assert [pair[0] for pair, state in zip(then.told.pair.tolist(), then.state, strict=True) if state == "found"] == [
        51
    ]


def test_a_live_conflict_is_said_a_minute_ahead_shown_and_cleared() -> None:
    """Head-on, lost after 91 s: said within 20 s with both names, in the picture until it is over, which is said too."""
    pictures = run(flown(HEAD_ON, 120))
    said = [event for picture in pictures for event in picture.events if "conflict" in event.text]
    assert [event.level for event in said] == ["warning", "info"]
    assert "track 1 (mavlink:1) and track 2 (mavlink:2) lose their separation in" in said[0].text
    assert (said[0].at - T0) / SECOND < 20.0
    assert said[1].text == "the conflict of track 1 (mavlink:1) and track 2 (mavlink:2) is over"
    tables = [picture.predict.conflicts for picture in pictures]
    states = [state for table in tables for state in table.state]
    assert (states[0], states[-1], set(states[1:-1])) == ("found", "over", {"goes on"})
    probability = np.concatenate([table.probability for table in tables])
    assert probability[0] < probability[60] < probability[85]


def test_two_on_the_ground_are_no_conflict() -> None:
    """Side by side below 30 m above the runway nothing is said."""
    taxiing = {name: ((0.0, 30.0 * n, 2.0), (15.0, 0.0, 0.0)) for n, name in enumerate(("mavlink:1", "mavlink:2"))}
    assert not [e for picture in run(flown(taxiing, 20)) for e in picture.events if "conflict" in e.text]


def test_a_plan_that_turns_away_is_no_conflict() -> None:
    """Head-on, but one has told a plan that turns off in time and flies it: nothing is said while it does."""
    corner, end = (
        FRAME.geodetic_from_enu([-3000.0, 20000.0, 1000.0]),
        FRAME.geodetic_from_enu([-3000.0, 40000.0, 1000.0]),
    )
    points = tuple(
        PlanPoint(n, "waypoint", float(place[0]), float(place[1])) for n, place in enumerate((corner, end), 1)
    )
    said = [FlightPlan("mavlink:1", T0, T0, points), Intent("mavlink:1", T0, T0, "mission", 1)]
    pictures = run(flown(HEAD_ON, 45, said))
    assert not [event for picture in pictures for event in picture.events if "conflict" in event.text]


def test_how_arrivals_fall_into_steps_changes_no_conflict() -> None:
    """Steps of one arrival and of everything find the same conflicts, bit for bit."""
    heard = flown(HEAD_ON, 26)
    seen = [[picture.predict.conflicts for picture in run(heard, count)] for count in (1, 10_000)]
    one, every = ([np.concatenate([getattr(table, name) for table in tables]) for name in COLUMNS] for tables in seen)
    assert len(one[0]) > 5
    assert all(left.tobytes() == right.tobytes() for left, right in zip(one, every, strict=True))


COLUMNS = ("time", "closest_at", "loses_at", "horizontal_m", "probability", "latitude_rad", "places_m")
