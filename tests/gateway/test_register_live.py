"""A radar that is off, while a session runs: from arrivals to corrected tracks, in any order and in any ticks."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gateway.align import SECOND
from gateway.observation import Observation
from gateway.picture import Picture
from gateway.settings import Options

WRONG = np.array([60.0, 0.006, 0.004])  # range m, azimuth rad, elevation rad that the radar measures too much
SOON = Options(history_s=3.0)
UNTIL_S = 44


@pytest.fixture(scope="module")
def there(world: Any) -> Any:
    """A world whose position sources are known to be off by 30 m at most."""
    position = replace(world.site.position, systematic_m=30.0)
    return world.with_site(replace(world.site, position=position))


@pytest.fixture(scope="module")
def said(there: Any) -> list[Observation]:
    """Four aircraft, which say where they are once a second, and a radar that is off."""
    random, every = np.random.default_rng(5), list[Observation]()
    places = ((-12e3, 900.0), (-9e3, -2500.0), (-15e3, 2500.0), (-7e3, 1500.0))
    for number, (along_m, left_m) in enumerate(places, 1):
        speed_mps, swing_m = 70.0 + 8.0 * number, 900.0 if number % 2 else -900.0
        course = there.Course(along_m, left_m, 700.0 + 150.0 * number, speed_mps, 2.0, swing_m)
        for second in range(UNTIL_S):
            t_s = second + 0.1 * number
            east, north, up = velocity(there, course, t_s)
            told: dict[str, Any] = {"velocity_east_mps": east, "velocity_north_mps": north, "velocity_up_mps": up}
            off_m, late_s = random.normal(0.0, 5.0, 3), float(random.uniform(0.2, 1.5))
            one = there.report(
                course, t_s, aircraft=f"mavlink:{number}", late_s=late_s, off_m=off_m, **told, horizontal_sigma_m=6.0
            )
            every.append(one)
        for scan in range(round(UNTIL_S / 0.4)):
            off = WRONG + random.normal(0.0, [8.0, 5e-4, 5e-4])
            every.append(there.radar_plot(course, 0.4 * scan, number=number, off=off))
    return every


def velocity(there: Any, course: Any, t_s: float) -> list[float]:
    """East, north, up."""
    there: list[float] = (there.frame.enu_from_runway @ course.velocity(t_s)).tolist()
    return there


@pytest.fixture(scope="module")
def seen(there: Any, said: list[Observation]) -> Any:
    """The run of it, everything in one tick."""
    return there.run(said, options=SOON, until_s=float(UNTIL_S))


def test_a_radar_that_is_off_is_said_and_taken_off_while_the_session_runs(seen: Any) -> None:
    (applied,) = seen.said("radar 1: azimuth: +0.")
    assert applied.text.endswith("applied")
    last: Picture = seen.pictures[-1]
    assert last.register.applied[0, 1]
    assert last.register.correction[0, 1] > 0.3 * WRONG[1]
    assert (np.abs(last.register.error[0, :3] - WRONG) < 3.0 * last.register.sigma[0, :3]).all()


def test_ticks_change_no_bit_of_it(there: Any, said: list[Observation], seen: Any) -> None:
    for ticks in ("one", "20 ms"):
        other = there.run(said, ticks=ticks, options=SOON, until_s=float(UNTIL_S))
        assert other.bits() == seen.bits()
        assert np.array_equal(other.pictures[-1].register.correction, seen.pictures[-1].register.correction)
        assert [(e.at, e.text) for e in other.events] == [(e.at, e.text) for e in seen.events]


def test_what_comes_late_and_in_another_order_is_learnt_and_corrected_the_same(
    there: Any, said: list[Observation], seen: Any, differences: Any
) -> None:
    random = np.random.default_rng(7)
    late = [replace(one, received_at=one.valid_at + round(float(random.uniform(0.02, 2.5)) * SECOND)) for one in said]
    other = there.run(late, options=SOON, until_s=float(UNTIL_S))
    radar, instants = there.site.radars[0], [there.at(0.5 * k) for k in range(84, 2 * UNTIL_S)]
    told, again = ([run.state.registration.of(radar, at) for at in instants] for run in (seen, other))
    assert told == again
    assert told[-1][1] > 0.3 * WRONG[1]
    mine, others = seen.last(state="fused"), other.last(state="fused")
    both = mine.keys() & others.keys()
    assert len(both) > 200
    assert differences({key: mine[key] for key in both}, {key: others[key] for key in both}) < 1e-9


def test_no_track_jumps_while_it_is_taken_off(seen: Any) -> None:
    """From one row of a track to the next one no axis moves by three sigmas more than it was flying."""
    rows = sorted(seen.last(state="fused").items())
    jumps = []
    for (before, one), (after, two) in pairwise(rows):
        elapsed_s = (after[1] - before[1]) / SECOND
        if before[0] != after[0] or elapsed_s > 1.0:
            continue
        covariance = np.asarray(one["covariance"]).reshape(6, 6)
        spread = np.diag(covariance)[:3] + elapsed_s**2 * np.diag(covariance)[3:]
        spread = spread + 2.0 * elapsed_s * np.diag(covariance[:3, 3:])
        moved = np.asarray(two["runway_m"]) - one["runway_m"] - np.asarray(one["velocity_mps"]) * elapsed_s
        jumps.append(float(np.abs(moved / np.sqrt(spread)).max()))
    assert len(jumps) > 300
    assert max(jumps) < 3.0


def test_watching_only_changes_no_track(there: Any, said: list[Observation]) -> None:
    off, watch = (
        there.run(said, options=replace(SOON, registration=use), until_s=float(UNTIL_S)) for use in ("off", "watch")
    )
    assert off.bits() == watch.bits()
    assert watch.said("radar 1: azimuth: +0.")
    assert not off.said("radar 1: azimuth")


@pytest.mark.parametrize("phase_s", [0.05, 0.3, 0.55, 0.8])
def test_every_pair_is_learnt_from_whenever_in_its_second_the_report_was(there: Any, phase_s: float) -> None:
    """Nothing is forgotten before register has had it: each checked report that left the history is a pair."""
    course = there.Course(-9e3, 900.0, 900.0)
    reports = [there.report(course, second + phase_s, late_s=0.2) for second in range(20)]
    plots = [there.radar_plot(course, 0.4 * scan) for scan in range(50)]
    ran = there.run([*reports, *plots], options=SOON, until_s=20.0)
    learnt = [int(at) for picture in ran.pictures for at in picture.register.residuals.time]
    (since,) = (change.at for picture in ran.pictures for change in picture.associate.changes)
    gone = [one.valid_at for one in reports if since <= one.valid_at < there.at(20.0 - 3.0 - 1.5 - 1.0)]
    assert len(gone) > 5
    assert learnt[: len(gone)] == gone
