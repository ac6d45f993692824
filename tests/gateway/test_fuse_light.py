"""Fuse with the alpha-beta-gamma filter: whatever is measured, in any order and any batch, with the covariance it claims."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.align import Fix, Local
from gateway.estimators.alpha_beta_gamma import Tuning, covariance, start, update
from gateway.estimators.alpha_beta_gamma import predict as predict_light
from gateway.estimators.kalman import ERROR, POSITION, VELOCITY
from gateway.estimators.source_error import begun
from gateway.fuse.events import Event, Job, rank
from gateway.fuse.filtering import carried_on, run
from gateway.fuse.light import LONGEST_STEP_S
from gateway.fuse.weighting import Model
from gateway.settings import Options, PositionSource, Weighting

Floats = NDArray[np.float64]

LIGHT = Options(estimator="alpha-beta-gamma")
WEIGHTINGS: tuple[Weighting, ...] = ("bias", "covariance", "innovation", "literal")
SIGMA = np.array([15.0, 1e-3, 1e-3])


def _model(world: Any, weighting: Weighting = "bias") -> Model:
    return Model.of(replace(LIGHT, weighting=weighting), PositionSource(), world.radars)


def _events(world: Any, measures: list[Any], weighting: Weighting = "bias") -> list[Event]:
    job = Job(1, None, sorted(measures, key=rank), lambda fix: None)
    return run([job], _model(world, weighting))[0]


def _plots(world: Any, course: Any, seconds: float, random: np.random.Generator, **extra: Any) -> list[Any]:
    """Noisy plots each 0.4 s."""
    times = 0.1 + 0.4 * np.arange(int(seconds / 0.4))
    noise = random.normal(0.0, 1.0, (len(times), 3)) * SIGMA
    return [world.plot(course, t, serial=k, off=noise[k], **extra) for k, t in enumerate(times)]


def _errors(world: Any, course: Any, events: list[Event]) -> Floats:
    """Position errors (t, 3) east, north, up."""
    true = np.array([course.at((event.at - world.START) / world.SECOND) for event in events])
    return np.array([event.mean[POSITION] for event in events]) - (world.frame.enu_from_runway @ true.T).T


def _local(world: Any, course: Any, t_s: float, has_height: bool, speeds: tuple[float, ...]) -> Local:
    latitude, longitude, _ = world.frame.geodetic_from_runway(course.at(t_s))
    return Local(world.frame.local_from_enu(latitude, longitude), np.array(speeds), has_height)


# in any batch and order -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_a_track_has_the_bits_among_others_that_it_has_alone(world: Any, weighting: Weighting) -> None:
    """Several tracks worked together, of different lengths, sources and gaps, give each the bits that it has alone."""
    there = world.two_radars
    model, jobs = _model(there, weighting), []
    for k in range(5):
        course = there.Course(left_m=800.0 * k, speed_mps=70.0 + 5.0 * k)
        fixes = [there.fix(course, 1.0 + 3.0 * i, serial=i, off_m=(9.0 * k, -30.0, 20.0)) for i in range(3 + k)]
        local = _local(there, course, 4.0, k % 2 == 0, (70.0, math.nan, 1.0))
        fixes[1] = replace(fixes[1], local=local, sigma_m=np.array([15.0, 15.0, 200.0]))
        fixes[2] = replace(fixes[2], velocity_mps=np.array([70.0, 1.0, -3.0]), velocity_sigma_mps=0.5)
        fixes.append(there.fix(course, 40.0 + k, serial=40))
        plots = [
            there.plot(course, 0.3 + 0.4 * i, serial=50 + i, radar=1 + (i + k) % 2, missing="rae"[i % 3])
            for i in range(8 * k)
        ]
        near = (1, there.polar(course, 4.0), SIGMA)
        measures = sorted([*fixes, *(plot for plot in plots if plot.at > fixes[0].at)], key=lambda one: one.at)
        jobs.append(Job(k, None, measures, lambda fix, near=near, k=k: near if k % 2 else None))

    def bits(events: list[Event]) -> list[bytes]:
        parts = ((one.mean, one.covariance, one.memory, np.asarray(one.belief)) for one in events)
        return [b"".join(each.tobytes() for each in row) for row in parts]

    for job, events in zip(jobs, run(jobs, model), strict=True):
        assert bits(run([job], model)[0]) == bits(events)
        assert len(events) == len(job.measures)
        assert all(np.isfinite(one.mean).all() and np.isfinite(one.covariance).all() for one in events)


def test_shuffled_within_5_s_is_in_order(world: Any, differences: Callable[..., float]) -> None:
    """Whatever comes up to 5 s late, the last row of each time is that of in-order processing to 1e-9."""
    said, random = world.flight(seconds=25.0), np.random.default_rng(2)
    in_order = [replace(one, received_at=one.valid_at) for one in said]
    late = [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in said]

    def last(given: list[Any]) -> dict[int, dict[str, Any]]:
        rows = world.run(given, options=LIGHT, until_s=32.0).rows()
        return {int(row["time"]): row for row in rows if row["aircraft"] and row["updated_by"] != "coast"}

    wanted, found = last(in_order), last(late)
    both = wanted.keys() & found.keys()
    assert len(both) > 30
    assert differences({at: wanted[at] for at in both}, {at: found[at] for at in both}) < 1e-9


def test_ticks_change_no_bit(world: Any) -> None:
    """Ticks of one arrival, of 20 ms and one of everything give equal rows and predictions, to the bit."""
    said = world.flight(seconds=15.0)
    ran = [world.run(said, ticks=ticks, options=LIGHT, until_s=20.0).bits() for ticks in ("one", "20 ms", "all")]
    assert ran[0] == ran[1] == ran[2]


def test_who_is_who_does_not_depend_on_the_estimator(world: Any) -> None:
    """The same comparisons, pairs and times of association as with the Kalman filter."""
    said = world.flight(seconds=40.0)
    light, kalman = (world.run(said, options=options) for options in (LIGHT, Options()))
    told = [[event.text for event in ran.events if "is radar track" in event.text] for ran in (light, kalman)]
    assert told[0] == told[1]
    assert len(told[0]) == 1
    assert light.checks == kalman.checks
    assert np.isnan(light.column("modes")).all()


# whatever is measured -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missing", ["", "r", "a", "e", "rae"])
def test_plots_that_lack_components_are_used_for_what_they_have(world: Any, missing: str) -> None:
    """Errors stay within what the covariance claims, whichever component every plot lacks, or each in its turn."""
    course, fits = world.Course(), []
    for seed in range(6):
        random = np.random.default_rng(seed)
        plots = _plots(world, course, 40.0, random)
        lacking = [missing[k % len(missing)] if missing else "" for k in range(len(plots))]
        polar = [
            tuple(math.nan if "rae"[c] in lacks else value for c, value in enumerate(plot.polar))
            for plot, lacks in zip(plots, lacking, strict=True)
        ]
        plots = [replace(plot, polar=each) for plot, each in zip(plots, polar, strict=True)]
        plots[:3] = _plots(world, course, 1.5, random)[:3]
        events = _events(world, [world.fix(course, 0.0, velocity_mps=_speed(world, course)), *plots])[-50:]
        off = _errors(world, course, events)
        claimed = np.array([event.covariance[POSITION, POSITION] for event in events])
        fits.append((off[:, None] @ np.linalg.inv(claimed) @ off[:, :, None]).mean())
        spread = np.sqrt(np.diagonal(claimed, axis1=1, axis2=2).sum(axis=1))
        assert np.median(np.linalg.norm(off, axis=1)) < 2.5 * spread.max()
    # 3 degrees of freedom, 2 where one is never measured and only drifts off; errors of neighbouring updates go together, so
    # six runs tell it to a factor of about two
    assert 0.5 < np.mean(fits) < 6.0


def _speed(world: Any, course: Any) -> Floats:
    return np.asarray(world.frame.enu_from_runway @ course.velocity(0.0))


def test_radar_finds_the_position_sources_error(world: Any) -> None:
    """After exact reports that are 60 m off and exact plots, the error is those 60 m; other weightings have none."""
    course, off_m = world.Course(swing_m=0.0), np.array([40.0, -30.0, 33.0])
    fixes = [world.fix(course, 5.0 * k + 0.2, serial=k, off_m=off_m) for k in range(24)]
    plots = [world.plot(course, 0.4 * k, serial=1000 + k) for k in range(300)]
    last = _events(world, [*fixes, *plots])[-1]
    # sigmas of 15 m are claimed: the prior of 35 m pulls (15 / sqrt 24)^2 / 35^2 = 1 % of it; plots tell no more than that
    assert world.frame.runway_from_enu @ last.mean[ERROR] == pytest.approx(off_m, abs=3.0)
    assert np.sqrt(np.diag(last.covariance)[ERROR]).max() < 8.0
    for weighting in ("covariance", "innovation", "literal"):
        events = _events(world, fixes[:5], weighting)
        assert not events[-1].mean[ERROR].any()
        assert not events[-1].covariance[ERROR].any()


def test_reports_alone_do_not_make_a_position_surer_than_their_error(world: Any) -> None:
    """However many reports come, the position is known to the allowed error; position plus error ever better."""
    course = world.Course(swing_m=0.0)
    events = _events(world, [world.fix(course, float(k), serial=k) for k in range(60)])
    covariance = events[-1].covariance
    allowed = 60.0 / math.sqrt(3.0)
    assert np.sqrt(np.diag(covariance)[POSITION]).min() > 0.99 * allowed
    both = np.concatenate([np.eye(3), np.zeros((3, 3)), np.eye(3)], axis=1)
    assert np.sqrt(np.diag(both @ covariance @ both.T)).max() < 12.0
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_a_second_radar_makes_it_surer(world: Any) -> None:
    """Plots of two radars tell more than those of one."""
    there, course, random = world.two_radars, world.Course(), np.random.default_rng(1)
    first, second = (_plots(there, course, 30.0, random, radar=radar) for radar in (1, 2))
    one, both = _events(there, first)[-1], _events(there, [*first, *second])[-1]
    assert np.trace(both.covariance[POSITION, POSITION]) < 0.8 * np.trace(one.covariance[POSITION, POSITION])


def test_without_a_height_the_vertical_is_left_alone(world: Any) -> None:
    """Reports without a height move nothing upwards; a vertical that is unsure is brought to the guess's sigma, no further."""
    course = world.Course(sink_mps=0.0)
    level = {"velocity_mps": _speed(world, course), "velocity_sigma_mps": 0.3}
    whole = [world.fix(course, float(k), serial=k, **level) for k in range(20)]
    lacking = [
        replace(
            world.fix(course, float(k), serial=k, sigma_m=np.array([15.0, 15.0, 400.0])),
            enu_m=world.fix(course, float(k)).enu_m + np.array([0.0, 0.0, 700.0]),
            local=_local(world, course, float(k), False, (math.nan,) * 3),
        )
        for k in range(20, 40)
    ]
    known, guessed = _events(world, [*whole, *lacking]), _events(world, lacking)
    assert abs(known[-1].mean[2] - whole[0].enu_m[2]) < 1.0  # the guess is 700 m off
    up = np.sqrt(guessed[-1].covariance[2, 2])
    assert 350.0 < up < 420.0
    assert guessed[-1].mean[2] == pytest.approx(lacking[-1].enu_m[2], abs=100.0)
    assert np.abs(_errors(world, course, known)[-1, :2]).max() < 5.0  # the course swings a little


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_whatever_comes_states_stay_numbers_and_covariances_positive(world: Any, weighting: Weighting) -> None:
    """Outliers of 100 km, gaps of minutes, two measurements at one instant, anything missing, ten random sequences."""
    there, model = world.two_radars, _model(world.two_radars, weighting)
    for seed in range(10):
        random, course, t, measures = np.random.default_rng(seed), there.Course(), 0.0, []
        for k in range(40):
            t += float(random.choice([0.0, 0.02, 0.4, 5.0, 90.0], p=[0.1, 0.2, 0.5, 0.15, 0.05]))
            off = random.normal(0.0, 1.0, 3) * float(random.choice([10.0, 1e5], p=[0.9, 0.1]))
            if k and random.random() < 0.6:
                missing = "".join(letter for letter in "rae" if random.random() < 0.25)
                plot = there.plot(course, t, serial=k, radar=int(random.integers(1, 3)), missing=missing)
                measures.append(
                    replace(plot, polar=tuple(value + o * 1e-4 for value, o in zip(plot.polar, off, strict=True)))
                )
            elif random.random() < 0.3:
                speeds = tuple(random.choice([math.nan, 50.0], 3).tolist())
                fix = there.fix(course, t, serial=k, off_m=off, sigma_m=np.array([15.0, 15.0, 300.0]))
                measures.append(replace(fix, local=_local(there, course, t, bool(random.random() < 0.5), speeds)))
            else:
                measures.append(there.fix(course, t, serial=k, off_m=off, velocity_mps=_speed(there, course)))
        near = (1, there.polar(course, 1.0), SIGMA)
        for event in run([Job(1, None, sorted(measures, key=rank), lambda fix, near=near: near)], model)[0]:
            claimed = event.covariance[:6, :6]
            assert np.isfinite(event.mean).all()
            scale = np.sqrt(np.diag(claimed))
            assert np.linalg.eigvalsh(claimed / np.outer(scale, scale)).min() > -1e-9
            assert not (event.restarted or "").startswith("its covariance")


# the covariance, and what is coming -----------------------------------------------------------------------------------


def test_with_the_best_gains_it_is_the_kalman_filter_with_the_sources_error(world: Any) -> None:
    """Where velocity is measured gains are the covariance's own: states and covariance are those of one joint filter."""
    tuning, allowed, random = (
        Tuning(density=0.5, learning=0.0, least_p=1.0, greatest_p=1.0),
        30.0,
        np.random.default_rng(3),
    )
    state = start(np.zeros((1, 1)), np.full((1, 1), 15.0), tuning, np.zeros((1, 1)), 0.5)
    state = replace(state, error=begun(np.ones((1, 1)), allowed))
    mean = np.zeros(4)
    joint = np.diag([15.0**2 + allowed**2, 0.25, 25.0, allowed**2])
    joint[0, 3] = joint[3, 0] = -(allowed**2)
    for step in range(12):
        t, by_source = float(random.uniform(0.2, 4.0)), float(step % 3 == 0)
        carry = np.array([[1.0, t, t * t / 2, 0.0], [0.0, 1.0, t, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        shaken = np.array([t * t / 2, t, 1.0, 0.0])[:, None]
        mean, joint = carry @ mean, carry @ joint @ carry.T + 0.5 * t * (shaken @ shaken.T)
        place, speed = random.normal(0.0, 30.0), random.normal(0.0, 2.0)
        for h, y, r in (
            (np.array([1.0, 0.0, 0.0, by_source]), place, 100.0),
            (np.array([0.0, 1.0, 0.0, 0.0]), speed, 0.25),
        ):
            gain = joint @ h / (h @ joint @ h + r)
            mean, joint = mean + gain * (y - h @ mean), joint - np.outer(gain, h @ joint)
        state = predict_light(state, np.array([t]))
        assert state.error is not None
        given = np.array([[place]]) - by_source * state.error[3]
        state, _ = update(state, given, np.full((1, 1), 10.0), tuning, np.array([[speed]]), 0.5, by_source=by_source)
        assert state.error is not None
        found = np.array([state.position[0, 0], state.velocity[0, 0], state.acceleration[0, 0], state.error[3, 0, 0]])
        np.testing.assert_allclose(found, mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariance(state)[0, 0], joint[:3, :3], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(state.error[4, 0, 0], joint[3, 3], rtol=1e-9)


def test_what_is_not_seen_is_known_less_and_less(world: Any) -> None:
    """While both sources are silent rows coast and sigmas grow; predictions farther ahead have greater ones."""
    options = replace(LIGHT, coast_after_s=1.0, horizons_s=(10.0, 30.0, 60.0))
    ran = world.run(world.flight(seconds=30.0), options=options, until_s=45.0)
    rows = [row for row in ran.rows(aircraft="mavlink:1", updated_by="coast") if row["time"] > world.at(30.0)]
    sigma = [row["covariance"][0] for row in rows]
    assert len(sigma) > 5
    assert (np.diff(sigma) > 0.0).all()
    ahead = ran.pictures[-1].predict
    for made in set(ahead.made.tolist()):
        for track in set(ahead.track[ahead.made == made].tolist()):
            spread = ahead.sigma_m[(ahead.made == made) & (ahead.track == track)]
            assert (np.diff(spread) > 0.0).all()


def test_an_acceleration_is_not_held_for_ever(world: Any) -> None:
    """Silent in a turn of 5 m/s2, after a minute it is within 700 m of straight on; held, that would be 9 km."""
    course = world.Course(swing_m=0.0)
    aside = [2.5 * max(0.2 * k - 10.0, 0.0) ** 2 for k in range(80)]
    sure = np.full(3, 1.0)
    fixes = [world.fix(course, 0.2 * k, serial=k, off_m=(0.0, y, 0.0), sigma_m=sure) for k, y in enumerate(aside)]
    model = _model(world)
    last = _events(world, fixes)[-1]
    ahead, _ = carried_on([last], np.array([60.0]), model)
    straight = last.mean[POSITION] + 60.0 * last.mean[VELOCITY]
    assert np.linalg.norm(last.mean[VELOCITY] - _speed(world, course)) > 25.0
    assert 300.0 < np.linalg.norm(ahead.mean[0, POSITION] - straight) < 700.0


def test_a_silent_gps_is_taken_up_again(world: Any) -> None:
    """After a minute without reports the next ones fit: no outlier, and the error is soon the old one again."""
    course = world.Course(swing_m=0.0)
    times = [*range(40), *range(40 + 6 * int(LONGEST_STEP_S), 140)]
    random = np.random.default_rng(4)
    fixes = [world.fix(course, float(t), serial=t, off_m=random.normal(0.0, 15.0, 3)) for t in times]
    events = _events(world, fixes)
    assert not any(event.outlying for event in events)
    assert not any(event.restarted for event in events)
    off = np.linalg.norm(_errors(world, course, events), axis=1)
    assert off[-20:].mean() < 25.0


def test_without_reports_radar_keeps_the_track(world: Any) -> None:
    """Reports end, plots go on: the source's error stays what was learnt, and the errors are the radar's."""
    course, random = world.Course(swing_m=0.0), np.random.default_rng(5)
    fixes = [world.fix(course, 5.0 * k + 0.2, serial=5000 + k, off_m=(40.0, -30.0, 33.0)) for k in range(8)]
    events = _events(world, [*fixes, *_plots(world, course, 80.0, random)])
    there = [event for event in events if event.at <= world.at(40.0)][-1]
    assert events[-1].mean[ERROR] == pytest.approx(there.mean[ERROR], abs=12.0)
    assert np.linalg.norm(_errors(world, course, events)[-60:], axis=1).mean() < 20.0


def test_the_first_state_is_what_every_other_estimator_starts_with(world: Any) -> None:
    """From a report, from one without a height, from a plot: the same means, and each axis's own variances."""
    course = world.Course()
    fix: Fix = world.fix(course, 1.0, velocity_mps=_speed(world, course))
    lacking = replace(fix, local=_local(world, course, 1.0, False, (70.0, math.nan, math.nan)))
    lacking = replace(lacking, sigma_m=np.array([15.0, 15.0, 300.0]), velocity_mps=np.full(3, math.nan))
    kalman = Model.of(Options(), PositionSource(), world.radars)
    for measure in (fix, lacking, world.plot(course, 1.0)):
        one, other = (
            run([Job(1, None, [measure], lambda fix: None)], model)[0][0] for model in (_model(world), kalman)
        )
        assert one.mean[POSITION] == pytest.approx(other.mean[POSITION])
        assert np.diag(one.covariance)[POSITION] == pytest.approx(np.diag(other.covariance)[POSITION], rel=1e-3)
        assert np.diag(one.covariance)[ERROR] == pytest.approx(np.diag(other.covariance)[ERROR])
    assert run([Job(1, None, [fix], lambda fix: None)], _model(world))[0][0].mean[VELOCITY] == pytest.approx(
        _speed(world, course)
    )
