"""Fuse: what each measurement says of a state, how tracks begin, and the four weightings."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators.kalman import ERROR, POSITION, VELOCITY, Estimate
from gateway.frames import polar_from_xyz, xyz_from_polar
from gateway.fuse.filtering import Event, Job, run
from gateway.fuse.placing import begin
from gateway.fuse.starting import start_from_fixes, start_from_plots
from gateway.fuse.weighting import (
    Model,
    polar_difference,
    update_literally,
    update_with_fixes,
    update_with_plots,
)
from gateway.settings import Options, PositionSource, Weighting

Floats = NDArray[np.float64]
WEIGHTINGS: tuple[Weighting, ...] = ("bias", "covariance", "innovation", "literal")
NAN3 = np.full((1, 3), math.nan)


def _model(world: Any, weighting: Weighting = "bias", **options: Any) -> Model:
    return Model.of(Options(weighting=weighting, **options), PositionSource(), world.radars)


def _state(world: Any, model: Model, course: Any, off_m: Sequence[float] = (0.0, 0.0, 0.0)) -> Estimate:
    """A state on a course with a position known to 30 m."""
    position = (world.frame.enu_from_runway @ (course.at(0.0) + np.asarray(off_m)))[None]
    velocity = (world.frame.enu_from_runway @ course.velocity(0.0))[None]
    return start_from_fixes(position, np.full((1, 3), 30.0), velocity, np.full(1, 5.0), model)


# how tracks begin -----------------------------------------------------------------------------------------------------


def test_a_first_report_shares_its_error_between_position_and_source(world: Any) -> None:
    """Position plus source error is what was measured, to the report's sigma; each alone is known to the allowed error."""
    model = _model(world)
    state = start_from_fixes(np.ones((1, 3)), np.full((1, 3), 15.0), NAN3, np.ones(1), model)
    covariance, error = state.covariance[0], 60.0 / math.sqrt(3.0)  # 60 m in all, so much an axis
    both = covariance[POSITION, POSITION] + covariance[ERROR, ERROR] + 2.0 * covariance[POSITION, ERROR]
    assert both == pytest.approx(np.eye(3) * 15.0**2, abs=1e-9)
    assert np.sqrt(covariance[POSITION, POSITION].diagonal()) == pytest.approx([math.hypot(15.0, error)] * 3)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_a_first_report_without_velocity_may_go_anywhere(world: Any) -> None:
    """Velocity that was not measured is 0 with a sigma of 100 m/s; one that was is taken with its own."""
    model = _model(world)
    unknown = start_from_fixes(np.zeros((1, 3)), np.full((1, 3), 15.0), NAN3, np.ones(1), model)
    assert unknown.mean[0, VELOCITY].tolist() == [0.0, 0.0, 0.0]
    assert np.sqrt(unknown.covariance[0, VELOCITY, VELOCITY].diagonal()).tolist() == [100.0] * 3
    known = start_from_fixes(np.zeros((1, 3)), np.full((1, 3), 15.0), np.full((1, 3), 7.0), np.full(1, 0.5), model)
    assert known.mean[0, VELOCITY].tolist() == [7.0] * 3
    assert np.sqrt(known.covariance[0, VELOCITY, VELOCITY].diagonal()).tolist() == [0.5] * 3


def test_a_first_plot_is_as_uncertain_as_range_and_angles_make_it(world: Any) -> None:
    """The covariance of a first plot, seen along the beam and across it, is range's and distance times the angles'."""
    course = world.Course()
    polar, sigma = world.polar(course, 0.0)[None], np.array([[15.0, 1e-3, 2e-3]])
    state = start_from_plots(polar, sigma, 1, _model(world))
    radar = world.radars[1]
    assert radar.from_enu(state.mean[0, POSITION]) == pytest.approx(
        radar.from_enu(world.frame.enu_from_runway @ course.at(0.0)), abs=1e-6
    )
    samples = np.random.default_rng(1).normal(polar, sigma, (40_000, 3))
    spread = np.cov(radar.to_enu(xyz_from_polar(samples)).T)
    # 40 000 samples: a variance is known to sqrt(2 / 40 000) = 0.7 %; 4 of these
    assert state.covariance[0, POSITION, POSITION] == pytest.approx(spread, abs=0.03 * spread.diagonal().max())


def test_a_radar_track_begins_with_its_third_plot(world: Any) -> None:
    """Two plots are not a track, three are, and it starts with the first complete one."""
    course = world.Course()
    plots = [world.plot(course, 0.4 * k, serial=k) for k in range(5)]
    assert begin(plots[:2]) == []
    assert [plot.serial for plot in begin(plots)] == [2, 3, 4]


def test_a_plot_without_a_component_is_completed_by_its_neighbours(world: Any) -> None:
    """The start borrows what is missing from plots of the last 1.6 s, with a sigma that grew; without any it waits."""
    course = world.Course()
    plots = [world.plot(course, 0.4 * k, serial=k, missing="" if k == 0 else "e") for k in range(4)]
    first = begin(plots)[0]
    assert first.serial == 2
    assert first.polar[2] == plots[0].polar[2]
    assert first.sigma[2] > plots[2].sigma[2]
    assert list(first.sigma[:2]) == list(plots[2].sigma[:2])
    never = [world.plot(course, 0.4 * k, missing="e") for k in range(20)]
    assert begin(never) == []
    late = [world.plot(course, 0.0), world.plot(course, 1.0, missing="e"), world.plot(course, 2.0, missing="e")]
    assert begin(late) == []


# what measurements say ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing", [(0,), (1,), (2,), (0, 1), (1, 2)])
def test_a_missing_component_leaves_its_direction_alone(world: Any, missing: tuple[int, ...]) -> None:
    """What was measured is drawn towards the measurement; what was not is drawn nowhere."""
    model, course = _model(world), world.Course()
    state = _state(world, model, course, (60.0, -50.0, 40.0))
    polar = world.polar(course, 0.0)[None].copy()
    polar[:, list(missing)] = math.nan
    after, told = update_with_plots(state, polar, np.array([[15.0, 1e-3, 1e-3]]), world.radars[1])
    seen = [polar_from_xyz(world.radars[1].from_enu(s.mean[0, POSITION])) for s in (state, after)]
    was, now = (np.abs(polar_difference(one, world.polar(course, 0.0))) for one in seen)
    for component in range(3):
        if component in missing:
            # less than a tenth of its error: the position's errors along the three directions start independent
            assert abs(now[component] - was[component]) < 0.1 * was[component]
        else:
            assert now[component] < 0.5 * was[component]
    assert told.measured[0].tolist() == [component not in missing for component in range(3)]


def test_radar_finds_the_position_sources_error(world: Any) -> None:
    """After exact reports that are 60 m off and exact plots, the error's three states are those 60 m."""
    course, off_m = world.Course(), np.array([40.0, -30.0, 33.0])
    fixes = [world.fix(course, 5.0 * k + 0.2, serial=k, off_m=off_m) for k in range(24)]
    plots = [world.plot(course, 0.4 * k, serial=1000 + k) for k in range(300)]
    measures = sorted([*fixes, *plots], key=lambda one: one.at)
    (events,) = run([Job(1, None, measures, lambda fix: None)], _model(world))
    found = world.frame.runway_from_enu @ events[-1].mean[ERROR]
    # 15 m sigmas are claimed for exact numbers: the prior of 35 m pulls (15 / sqrt 24)^2 / 35^2 = 1 % of it, and the curve
    assert found == pytest.approx(off_m, abs=3.0)
    assert world.frame.runway_from_enu @ events[-1].mean[POSITION] == pytest.approx(course.at(119.6), abs=3.0)


@pytest.mark.parametrize("weighting", ["covariance", "innovation", "literal"])
def test_only_bias_has_an_error_of_the_source(world: Any, weighting: Weighting) -> None:
    """The other weightings keep the source's error at zero."""
    course = world.Course()
    measures = [world.fix(course, 5.0 * k, serial=k, off_m=(60.0, 0.0, 0.0)) for k in range(5)]
    (events,) = run([Job(1, None, measures, lambda fix: None)], _model(world, weighting))
    assert not events[-1].mean[ERROR].any()
    assert not events[-1].covariance[ERROR].any()


def test_innovation_weighting_believes_a_source_as_much_as_its_innovations_allow(world: Any) -> None:
    """After eight reports 100 m off beside an exact radar, the next one pulls a fraction of what it pulls by covariance."""
    course = world.Course()
    pulls = {}
    for weighting in ("covariance", "innovation"):
        model = _model(world, weighting)
        state = _state(world, model, course)
        state = replace(state, covariance=state.covariance * 0.02)  # a radar has been at it
        position = state.mean[:, POSITION] + 100.0
        memory = np.full((1, model.memory, 3), 100.0)
        after, _, kept = update_with_fixes(state, position, np.full((1, 3), 15.0), NAN3, np.ones(1), memory, model)
        pulls[weighting] = float((after.mean - state.mean)[0, 0])
        assert kept.shape == memory.shape
    assert 0.0 < pulls["innovation"] < 0.6 * pulls["covariance"]


def test_literal_weights_are_the_papers(world: Any) -> None:
    """Equations 11 to 14 written out for one state: residuals, weights, fused measurement and noise, then the update."""
    model, course = _model(world, "literal"), world.Course()
    state, radar = _state(world, model, course, (10.0, 20.0, -15.0)), world.radars[1]
    position = (world.frame.enu_from_runway @ np.add(course.at(0.0), [25.0, -30.0, 20.0]))[None]
    sigma = np.array([[15.0, 1e-3, 1e-3]])
    polar = world.polar(course, 0.0)[None] + [[8.0, 5e-4, -4e-4]]
    after, told = update_literally(state, position, np.full((1, 3), 15.0), polar, sigma, radar)

    expected = polar_from_xyz(radar.from_enu(state.mean[0, POSITION]))
    by_gps = polar_from_xyz(radar.from_enu(position[0])) - expected
    by_radar = polar[0] - expected
    distance, level = expected[0], expected[0] * math.cos(expected[2])
    gps_variance = np.array([15.0, 15.0 / level, 15.0 / distance]) ** 2
    share = (1.0 / by_radar**2) / (1.0 / by_radar**2 + 1.0 / by_gps**2)
    fused = share * by_radar + (1.0 - share) * by_gps
    variance = share * sigma[0] ** 2 + (1.0 - share) * gps_variance
    assert told.innovation[0] == pytest.approx(fused, rel=1e-9)
    h = np.zeros((3, 9))
    for axis in range(3):  # the measurement's derivative, by differences
        step = np.zeros(3)
        step[axis] = 0.01
        ends = [polar_from_xyz(radar.from_enu(state.mean[0, POSITION] + sign * step)) for sign in (1.0, -1.0)]
        h[:, axis] = (ends[0] - ends[1]) / 0.02
    p = state.covariance[0]
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(variance))
    # 1e-5 of 30 m: the differences are good to 1e-6
    assert after.mean[0] == pytest.approx(state.mean[0] + gain @ fused, abs=3e-4)


def test_literal_weights_survive_a_residual_of_zero(world: Any) -> None:
    """A plot that is just where it was expected has all the weight, and nothing is infinite."""
    model, course = _model(world, "literal"), world.Course()
    state, radar = _state(world, model, course), world.radars[1]
    expected = polar_from_xyz(radar.from_enu(state.mean[:, POSITION]))
    sigma = np.array([[15.0, 1e-3, 1e-3]])
    far = state.mean[:, POSITION] + 50.0
    after, _ = update_literally(state, far, np.full((1, 3), 15.0), expected, sigma, radar)
    assert np.isfinite(after.mean).all()
    # the floor of 1e-3 sigma against 50 m: a weight of 1e-6
    assert after.mean[0, POSITION] == pytest.approx(state.mean[0, POSITION], abs=1e-2)


def test_literal_without_radar_is_the_position_source(world: Any) -> None:
    """Components that the radar does not give stand by the position source alone."""
    model, course = _model(world, "literal"), world.Course()
    state, radar = _state(world, model, course), world.radars[1]
    position = state.mean[:, POSITION] + [[30.0, 20.0, 10.0]]
    sigma = np.array([[15.0, 1e-3, 1e-3]])
    after, told = update_literally(state, position, np.full((1, 3), 15.0), NAN3, sigma, radar)
    plain, _, _ = update_with_fixes(
        state, position, np.full((1, 3), 15.0), NAN3, np.ones(1), np.zeros((1, 0, 3)), model
    )
    assert told.measured.all()
    # polar against Cartesian: the same measurement but for the curvature of 40 m at 25 km, and correlated noises left out
    assert after.mean[0, POSITION] == pytest.approx(plain.mean[0, POSITION], abs=0.5)


# many at once ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_a_track_has_the_bits_among_others_that_it_has_alone(world: Any, weighting: Weighting) -> None:
    """Several tracks worked together, of different lengths and sources, give each the bits that it has alone."""
    there = world.two_radars
    model = _model(there, weighting)
    jobs = []
    for k in range(6):
        course = there.Course(left_m=800.0 * k, speed_mps=70.0 + 5.0 * k)
        fixes = [there.fix(course, 1.0 + 3.0 * i, serial=i, off_m=(9.0 * k, -30.0, 20.0)) for i in range(3 + k)]
        plots = [
            there.plot(course, 0.3 + 0.4 * i, serial=50 + i, radar=1 + (i + k) % 2, missing="rae"[i % 3])
            for i in range(12 * k)
        ]
        near = (1, there.polar(course, 4.0), np.array([15.0, 1e-3, 1e-3]))
        measures = sorted([*fixes, *(plot for plot in plots if plot.at > fixes[0].at)], key=lambda one: one.at)
        jobs.append(Job(k, None, measures, lambda fix, near=near, k=k: near if k % 2 else None))
    together = run(jobs, model)

    def bits(events: list[Event]) -> list[bytes]:
        return [event.mean.tobytes() + event.covariance.tobytes() + event.memory.tobytes() for event in events]

    for job, events in zip(jobs, together, strict=True):
        assert bits(run([job], model)[0]) == bits(events)
        assert len(events) == len(job.measures)


def test_two_halves_of_a_job_are_the_whole(world: Any) -> None:
    """Going on from a kept state gives the bits of never having stopped."""
    course = world.Course()
    measures = [world.fix(course, float(k), serial=k, off_m=(k % 3 * 9.0, 0.0, 0.0)) for k in range(12)]
    model = _model(world, "innovation")
    (whole,) = run([Job(1, None, measures, lambda fix: None)], model)
    (first,) = run([Job(1, None, measures[:5], lambda fix: None)], model)
    (second,) = run([Job(1, first[-1], measures[5:], lambda fix: None)], model)
    assert [event.mean.tobytes() for event in (*first, *second)] == [event.mean.tobytes() for event in whole]
    assert second[-1].covariance.tobytes() == whole[-1].covariance.tobytes()
