"""A filter that has lost its track begins anew where the measurements are, and says so; one that is right never does."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators.kalman import POSITION
from gateway.fuse.events import Doubt, Event, Job
from gateway.fuse.filtering import run
from gateway.fuse.weighting import Model
from gateway.settings import EstimatorName, Options, PositionSource

Floats = NDArray[np.float64]

ESTIMATORS: tuple[EstimatorName, ...] = ("kalman", "imm", "rmimm", "alpha-beta-gamma")
JUMP_M = np.array([0.0, 5000.0, 0.0])


def _reports(world: Any, every_s: float, seconds: float, off: Any, seed: int = 1) -> list[Any]:
    """Noisy reports; `off` gives the offset (3,) in the runway frame at a time."""
    random, course = np.random.default_rng(seed), world.Course()
    times = every_s * np.arange(int(seconds / every_s))
    return [world.report(course, t, late_s=0.1, off_m=random.normal(0.0, 15.0, 3) + off(t)) for t in times]


def _worked(world: Any, measures: list[Any], estimator: EstimatorName) -> list[Event]:
    model = Model.of(Options(estimator=estimator), PositionSource(), world.radars)
    return run([Job(1, None, measures, lambda fix: None)], model)[0]


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("every_s", [0.2, 1.0, 5.0])
def test_a_source_that_jumps_and_stays_there_is_found_again(
    world: Any, estimator: EstimatorName, every_s: float
) -> None:
    """5 km aside: one sentence, one count, the same track number, and soon the reports' own accuracy."""
    end_s = 30.0 + 16.0 * every_s
    reports = _reports(world, every_s, end_s, lambda t: JUMP_M * (t > 30.0))
    ran = world.run(reports, options=Options(estimator=estimator))
    (said,) = ran.said("started again")
    assert said.level == "warning"
    assert "track 1 started again: its last" in said.text
    assert "km" in said.text
    assert 30.0 < (said.at - world.START) / world.SECOND <= 30.0 + max(5.2 * every_s, 3.0 * every_s + 10.0)
    assert ran.state.counters["restarted after divergence"] == 1
    assert set(ran.column("track")) == {1}
    last = [row for row in ran.rows() if row["updated_by"] == "gps"][-1]
    there = world.Course().at((last["time"] - world.START) / world.SECOND) + JUMP_M
    assert np.linalg.norm(last["runway_m"] - there) < 100.0  # three sigmas of an axis's allowed error


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("every_s", [0.2, 5.0])
def test_noise_turns_and_single_outliers_begin_nothing_anew(
    world: Any, estimator: EstimatorName, every_s: float
) -> None:
    """Whatever the noise draws, one report in three that lies 5 km off is an outlier, and the track stays where it was."""
    off = (np.zeros(3), np.zeros(3), JUMP_M)
    steady = _reports(world, every_s, 120.0 if every_s > 1.0 else 30.0, lambda t: off[round(t / every_s) % 3])
    ran = world.run(steady[:-1], options=Options(estimator=estimator))
    assert not ran.said("started again")
    assert ran.state.counters["outliers, their pull bounded"] > 3
    clean = world.run(
        _reports(world, every_s, 30.0, lambda t: np.zeros(3), seed=2), options=Options(estimator=estimator)
    )
    assert "restarted after divergence" not in clean.state.counters


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_hard_manoeuvre_is_no_loss(world: Any, estimator: EstimatorName) -> None:
    """Reports each 0.2 s to 0.3 m of an aircraft that turns with 20 m/s2 out of a minute straight on: it is followed."""
    aside = [10.0 * max(0.2 * k - 60.0, 0.0) ** 2 for k in range(310)]
    course = world.Course(swing_m=0.0)
    sure = np.full(3, 0.3)
    fixes = [world.fix(course, 0.2 * k, serial=k, off_m=(0.0, y, 0.0), sigma_m=sure) for k, y in enumerate(aside)]
    assert not any(event.restarted for event in _worked(world, fixes, estimator))


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_one_source_that_fits_is_enough(world: Any, estimator: EstimatorName) -> None:
    """A position source that jumps beside a radar that does not is outlying for as long as it likes."""
    course = world.Course()
    fixes = [world.fix(course, k + 0.2, serial=k, off_m=JUMP_M * (k > 10)) for k in range(30)]
    plots = [world.plot(course, 0.4 * k, serial=100 + k) for k in range(75)]
    events = _worked(world, sorted([*fixes, *plots], key=lambda one: one.at), estimator)
    assert not any(event.restarted for event in events)
    assert sum(event.outlying for event in events) > 15


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_radar_track_begins_anew_with_a_plot_that_lacks_nothing(world: Any, estimator: EstimatorName) -> None:
    """Plots that jump 5 km outwards: those without an elevation cannot begin anything, the first complete one does."""
    course = world.Course()
    plots = [world.plot(course, 0.4 * k, serial=k) for k in range(50)]
    for k in range(50, 80):
        lacks = "e" if k < 60 else ""
        plots.append(world.plot(course, 0.4 * k, serial=k, off=(5000.0, 0.0, 0.0), missing=lacks))
    events = _worked(world, plots, estimator)
    begun = [event.measure.serial for event in events if event.restarted]
    assert begun == [60]
    assert events[60].far_off == 0
    radar = world.radars[1]
    seen = np.linalg.norm(radar.from_enu(events[-1].mean[POSITION]))
    assert seen == pytest.approx(plots[-1].polar[0], abs=100.0)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("broken", [math.nan, -1.0])
def test_a_covariance_that_is_none_is_not_gone_on_with(world: Any, estimator: EstimatorName, broken: float) -> None:
    """Whatever made it so, the next report begins the track anew, by itself and beside a healthy one, and says why."""
    course = world.Course()
    model = Model.of(Options(estimator=estimator), PositionSource(), world.radars)
    fixes = [world.fix(course, float(k), serial=k) for k in range(6)]
    before = _worked(world, fixes[:4], estimator)[-1]
    ill = replace(before, **_broken(before, broken))
    jobs = [Job(1, ill, fixes[4:], lambda fix: None), Job(2, before, fixes[4:], lambda fix: None)]
    found, healthy = run(jobs, model)
    assert found[0].restarted == "its covariance was no longer positive"
    assert found[1].restarted is None
    assert found[0].height_at == found[0].at
    assert np.isfinite(found[1].covariance).all()
    assert np.linalg.norm(found[1].mean[POSITION] - healthy[1].mean[POSITION]) < 100.0
    assert not any(event.restarted for event in healthy)


def _broken(event: Event, value: float) -> dict[str, Any]:
    """What an estimator goes on with, broken: negative or no numbers in place of the covariance."""
    wrong = {"covariance": event.covariance * value}
    if event.mixture is not None:
        return {**wrong, "belief": replace(event.mixture, covariance=event.mixture.covariance * value)}
    if isinstance(event.belief, np.ndarray):
        belief = event.belief.copy()
        belief[7:13] *= value  # the six terms
        return {**wrong, "belief": belief}
    return wrong


def _with_velocities(world: Any, seconds: float, velocity: Any, off: Any = lambda t: np.zeros(3)) -> list[Any]:
    """Reports of 5 m, five a second, with velocities that a function makes of the true ones."""
    random, course = np.random.default_rng(3), world.Course()
    found = []
    for k in range(int(5 * seconds)):
        t = 0.2 * k
        speed = velocity(t, world.frame.enu_from_runway @ course.velocity(t) + random.normal(0.0, 0.5, 3))
        place, sigma = random.normal(0.0, 5.0, 3) + off(t), np.full(3, 5.0)
        found.append(world.fix(course, t, serial=k, off_m=place, velocity_mps=speed, sigma_m=sigma))
    return found


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("wrong", [100.0, -1.0, 0.0])
def test_velocities_that_are_not_those_of_the_positions_are_left_out(
    world: Any, estimator: EstimatorName, wrong: float
) -> None:
    """Of another unit, another sign, or none: the filter begins anew twice, says so, and follows the positions."""
    events = _worked(world, _with_velocities(world, 30.0, lambda t, v: wrong * v), estimator)
    said = [event.restarted for event in events if event.restarted]
    assert len(said) == 2
    assert "velocities" not in said[0]
    assert said[1].endswith("velocities of reports are left out until they fit it")
    course = world.Course()
    for event in events[-50:]:
        true = world.frame.enu_from_runway @ course.at((event.at - world.START) / world.SECOND)
        assert np.linalg.norm(event.mean[POSITION] - true) < 20.0


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_velocities_that_fit_again_are_believed_again(world: Any, estimator: EstimatorName) -> None:
    """After ten that fit, once the filter knows the velocity by itself."""
    events = _worked(world, _with_velocities(world, 40.0, lambda t, v: v * (-1.0 if t < 15.0 else 1.0)), estimator)
    doubted = [event.doubts > 0 for event in events]
    assert doubted[74]
    assert not any(doubted[-25:])
    assert sum(event.restarted is not None for event in events) == 2


def test_a_filter_that_is_lost_once_in_a_while_keeps_its_velocities(world: Any) -> None:
    """Places that jump and jump back 12 s later: two new beginnings, and nothing is doubted."""
    jumps = _with_velocities(world, 40.0, lambda t, v: v, lambda t: JUMP_M * (15.0 < t < 27.0))
    events = _worked(world, jumps, "kalman")
    assert sum(event.restarted is not None for event in events) == 2
    assert not any(event.doubts for event in events)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_track_that_wrong_velocities_led_begins_anew_with_its_next_report(
    world: Any, estimator: EstimatorName
) -> None:
    """Once, not with a plot; what turned wrong only lately was never worked in, and takes nothing from the track."""
    course, model = world.Course(), Model.of(Options(estimator=estimator), PositionSource(), world.radars)
    speed = 0.5 * (world.frame.enu_from_runway @ course.velocity(0.0))
    fixes = [world.fix(course, 5.0 * k, serial=k, velocity_mps=speed) for k in range(6)]
    before = _worked(world, fixes[:3], estimator)[-1]
    measures = [world.plot(course, 14.0, serial=9), *fixes[3:]]
    for doubt, begins in ((Doubt.ALL_ALONG, [3]), (Doubt.LATELY, []), (Doubt.NONE, [])):
        (events,) = run([Job(1, before, measures, lambda fix: None, doubt=doubt)], model)
        assert [event.measure.serial for event in events if event.restarted] == begins
        assert [event.doubts > 0 for event in events[1:]] == [doubt != Doubt.NONE] * 3
        assert events[1].score >= before.score
        assert (np.abs(events[1].mean[POSITION] - fixes[3].enu_m).max() < 1.0) == bool(begins)
