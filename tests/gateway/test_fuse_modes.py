"""Fuse with interacting modes: straight and turns told apart from whatever is measured, in any order and any batch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.align import Fix
from gateway.fuse.filtering import Event, Job, run
from gateway.fuse.weighting import Model
from gateway.settings import EstimatorName, Options, PositionSource, Weighting

Floats = NDArray[np.float64]
ESTIMATORS: tuple[EstimatorName, ...] = ("imm", "rmimm")


def _model(world: Any, estimator: EstimatorName, weighting: Weighting = "bias") -> Model:
    return Model.of(Options(estimator=estimator, weighting=weighting), PositionSource(), world.radars)


def _circling(world: Any, rate_rps: float, seconds: int, speed_mps: float = 80.0) -> list[Any]:
    """Reports each second, with velocity and without noise, of an aircraft that flies 20 s straight and then turns."""
    reports, course, place = [], 0.0, np.array([-20_000.0, 0.0, 1000.0])
    for second in range(seconds):
        velocity = speed_mps * np.array([math.cos(course), math.sin(course), 0.0])
        enu = world.frame.enu_from_runway @ velocity
        latitude, longitude, height = world.frame.geodetic_from_runway(place)
        separation = world.site.runway.geoid_separation_m or 0.0
        report = world.report(world.Course(), float(second), late_s=0.1)
        reports.append(
            replace(
                report,
                latitude_rad=float(latitude),
                longitude_rad=float(longitude),
                altitude_msl_m=float(height) - separation,
                velocity_east_mps=float(enu[0]),
                velocity_north_mps=float(enu[1]),
                velocity_up_mps=0.0,
            )
        )
        turned = rate_rps if second >= 20 else 0.0
        middle = course + 0.5 * turned
        chord = speed_mps * np.sinc(0.5 * turned / math.pi)
        place = place + chord * np.array([math.cos(middle), math.sin(middle), 0.0])
        course += turned
    return reports


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize(("rate_deg", "place"), [(3.0, 1), (-3.0, 2), (0.0, 0)])
def test_a_turn_is_told_with_its_side(world: Any, estimator: EstimatorName, rate_deg: float, place: int) -> None:
    """Rows carry the probabilities of straight, left and right, which sum to 1; the true one becomes the likeliest."""
    there = world.run(_circling(world, math.radians(rate_deg), 40), options=Options(estimator=estimator))
    modes = np.array(there.column("modes"))
    assert modes.sum(axis=1) == pytest.approx(np.ones(len(modes)))
    assert (modes[10:20].argmax(axis=1) == 0).all()
    assert (modes[-10:].argmax(axis=1) == place).all()


def test_without_modes_there_are_no_probabilities(world: Any) -> None:
    """The Kalman filter's rows have none."""
    assert np.isnan(world.run(_circling(world, 0.05, 30)).column("modes")).all()


def test_a_look_ahead_goes_on_turning(world: Any) -> None:
    """In a turn the point in 10 s lies on the circle, whether modes tell of it or the course; straight on is off by 300 m."""
    rate, options = math.radians(3.0), Options(horizons_s=(10.0,))
    reports = _circling(world, rate, 60, 120.0)
    ran = [world.run(reports[:41], options=replace(options, estimator=name)) for name in ("rmimm", "kalman")]
    true = reports[50]
    east, north, _ = world.frame.enu_from_geodetic(true.latitude_rad, true.longitude_rad, 0.0)
    off = []
    for one in ran:
        predicted = one.pictures[-1].predict
        last = np.flatnonzero(predicted.valid == world.at(50.0))[-1]
        ahead = world.frame.enu_from_geodetic(predicted.latitude_rad[last], predicted.longitude_rad[last], 0.0)
        off.append(math.hypot(ahead[0] - east, ahead[1] - north))
    assert max(off) < 40.0


def test_coasting_goes_through_the_modes(world: Any) -> None:
    """A silent track carries its turn's probability on, less sure with time; its position's sigma grows."""
    options = Options(estimator="rmimm", coast_after_s=1.0)
    ran = world.run(_circling(world, math.radians(3.0), 40), options=options, until_s=55.0)
    coasting = [place for place, by in enumerate(ran.column("updated_by")) if by == "coast"]
    modes, sigma = np.array(ran.column("modes"))[coasting], np.array(ran.column("covariance"))[coasting, 0]
    assert len(coasting) > 5
    assert modes[0, 1] > 0.4
    assert (np.diff(modes[:, 1]) < 0.0).all()
    assert modes[-1, 1] > 0.05  # a turn's share of all time
    assert (np.diff(sigma) > 0.0).all()


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("weighting", ["bias", "innovation", "literal"])
def test_a_track_has_the_bits_among_others_that_it_has_alone(
    world: Any, estimator: EstimatorName, weighting: Weighting
) -> None:
    """Several tracks worked together, of different lengths and sources, give each the bits that it has alone."""
    there = world.two_radars
    model = _model(there, estimator, weighting)
    jobs = []
    for k in range(4):
        course = there.Course(left_m=800.0 * k, speed_mps=70.0 + 5.0 * k)
        fixes = [there.fix(course, 1.0 + 3.0 * i, serial=i, off_m=(9.0 * k, -30.0, 20.0)) for i in range(3 + k)]
        plots = [
            there.plot(course, 0.3 + 0.4 * i, serial=50 + i, radar=1 + (i + k) % 2, missing="rae"[i % 3])
            for i in range(8 * k)
        ]
        near = (1, there.polar(course, 4.0), np.array([15.0, 1e-3, 1e-3]))
        measures = sorted([*fixes, *(plot for plot in plots if plot.at > fixes[0].at)], key=lambda one: one.at)
        jobs.append(Job(k, None, measures, lambda fix, near=near, k=k: near if k % 2 else None))

    def bits(events: list[Event]) -> list[bytes]:
        parts = [(event.mean, event.covariance, event.memory, event.mixture) for event in events]
        return [b"".join([*(one.tobytes() for one in row[:3]), row[3].weight.tobytes()]) for row in parts if row[3]]

    for job, events in zip(jobs, run(jobs, model), strict=True):
        assert bits(run([job], model)[0]) == bits(events)
        assert len(bits(events)) == len(job.measures)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_shuffled_within_5_s_is_in_order(
    world: Any, differences: Callable[..., float], estimator: EstimatorName
) -> None:
    """Whatever comes up to 5 s late, the last row of each time is that of in-order processing to 1e-9, probabilities too."""
    said = world.flight(seconds=25.0)
    random, options = np.random.default_rng(2), Options(estimator=estimator)
    in_order = [replace(one, received_at=one.valid_at) for one in said]
    late = [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in said]

    def last(given: list[Any]) -> dict[int, tuple[dict[str, Any], Floats]]:
        ran = world.run(given, options=options, until_s=32.0)
        rows = zip(ran.rows(), ran.column("modes"), strict=True)
        named = ((row, flown) for row, flown in rows if row["aircraft"] and row["updated_by"] != "coast")
        return {int(row["time"]): (row, flown) for row, flown in named}

    wanted, found = last(in_order), last(late)
    both = wanted.keys() & found.keys()
    assert len(both) > 30
    assert differences({at: wanted[at][0] for at in both}, {at: found[at][0] for at in both}) < 1e-9
    assert max(float(np.abs(wanted[at][1] - found[at][1]).max()) for at in both) < 1e-9


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_ticks_change_no_bit(world: Any, estimator: EstimatorName) -> None:
    """Ticks of one arrival and one tick of everything give equal rows and predictions, to the bit."""
    said, options = world.flight(seconds=15.0), Options(estimator=estimator)
    one, other = (world.run(said, ticks=ticks, options=options, until_s=20.0) for ticks in ("one", "all"))
    assert one.bits() == other.bits()
    assert np.array(one.column("modes")).tobytes() == np.array(other.column("modes")).tobytes()


def test_a_drone_and_an_airliner_are_both_followed_round(world: Any) -> None:
    """One set of modes for 15 m/s turning at 20 degrees/s and 130 m/s turning at 3: the side is right, the end within 6 m."""
    for speed_mps, rate_deg in ((15.0, 20.0), (130.0, 3.0)):
        reports = _circling(world, math.radians(rate_deg), 40, speed_mps)
        ran = world.run(reports, options=Options(estimator="rmimm"))
        assert np.array(ran.column("modes"))[-5:].argmax(axis=1).tolist() == [1] * 5
        row = ran.rows()[-1]
        true = world.frame.enu_from_geodetic(reports[-1].latitude_rad, reports[-1].longitude_rad, 0.0)
        found = world.frame.enu_from_geodetic(row["latitude_rad"], row["longitude_rad"], 0.0)
        assert math.hypot(found[0] - true[0], found[1] - true[1]) < 6.0


def test_the_first_state_is_the_reports(world: Any) -> None:
    """A track that was just begun has one state in all modes."""
    first: Fix = world.fix(world.Course(), 1.0)
    ((event,),) = run([Job(1, None, [first], lambda fix: None)], _model(world, "rmimm"))
    assert event.mixture is not None
    assert (event.mixture.mean[..., :9] == event.mean).all()
    assert event.mixture.weight.sum() == pytest.approx(1.0)
