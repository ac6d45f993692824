"""Paper 002-5: what the ship and her autopilots reach, by the study that people run.

The bounds are the page's own unless a comment says else; seas are of one seed, so that nothing here is random. In waves 8 ships
are drawn instead of the study's 200; the same bounds are kept by 200 behind the `study` marker.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim.ships.autopilots import KINDS
from sim.studies import ship as study

SEED, WAVES_S = 1, 300.0


@pytest.fixture(scope="module", params=[8, pytest.param(200, marks=pytest.mark.study)])
def runs(request: pytest.FixtureRequest) -> int:
    """How many ships are in the same waves' statistics."""
    return int(request.param)


def test_a_step_of_20_degrees_hardly_overshoots_and_settles() -> None:
    """PID and adaptive: overshoot at most 8 %, within 5 % (a degree) after at most 150 s; the expert's rules as well."""
    for kind in KINDS[1:]:
        voyage = study.turn(kind, 20.0, duration_s=200.0)
        assert study.overshoot(voyage, 20.0) <= 0.08
        assert study.settled_s(voyage.time_s, np.degrees(voyage.heading_rad) - 20.0, 1.0) <= 150.0


def test_the_mechanical_autopilot_swings_past() -> None:
    """Without a derivative a step overshoots as a second-order system of its damping does, by 37 %, or more as rudders lag."""
    damping = 0.5 / math.sqrt(study.HULL.gain_per_s * study.HULL.lag_s)  # of T s^2 + s + K P, P = 1
    theory = math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2))
    assert theory <= study.overshoot(study.turn("mechanical", 20.0, duration_s=150.0), 20.0) <= theory + 0.05


def test_a_steady_wind_is_held_by_the_integral_alone() -> None:
    """2 degrees of wind: PID, adaptive and expert end within 0.3 degrees, PD more than 1 degree off, where theory has it."""
    ends = {kind: study.hold(kind, 1, SEED, None, None, 380.0) for kind in KINDS[1:]}
    ends["pd"] = study.hold("pd", 1, SEED, None, None, 250.0)
    errors = {kind: abs(float(one.heading_rad[-1, 0])) for kind, one in ends.items()}
    for kind in KINDS[1:]:
        assert errors[kind] <= math.radians(0.31)  # the expert swings about 0.3 by less than a hundredth
    assert errors["pd"] > math.radians(1.0)
    proportional = float(study.place_poles(study.HULL.gain_per_s, study.HULL.lag_s).proportional)
    assert errors["pd"] == pytest.approx(study.WIND_RAD / proportional, rel=0.01)  # the swing's last half percent


def test_the_wave_filter_cuts_the_rudders_travel_five_times(runs: int) -> None:
    """In waves of 2 degrees the filter cuts the travel at least 5 times, and the heading is held better than without."""
    plain = study.hold("pid", runs, SEED, study.SEA, None, WAVES_S)
    filtered = study.hold("pid", runs, SEED, study.SEA, study.SEA, WAVES_S)
    assert plain.rudder_travel_rad.mean() >= 5.0 * filtered.rudder_travel_rad.mean()
    late = plain.time_s > 0.5 * WAVES_S
    assert np.square(filtered.heading_rad[late]).mean() < np.square(plain.heading_rad[late]).mean()
    for voyage in (plain, filtered):
        _is_within_limits(voyage)


def test_course_line_of_sight_keeps_the_leg_across_a_current() -> None:
    """1 m/s across: within a twentieth of a length after at most 300 s, and RMS at most 6 m from then on."""
    voyage = study.track("course", 1, SEED, None, 450.0)
    assert np.sqrt(np.square(voyage.right_m[voyage.time_s >= 300.0]).mean()) <= 6.0
    assert study.settled_s(voyage.time_s, voyage.right_m, study.ON_TRACK_M) <= 300.0


def test_course_line_of_sight_keeps_the_leg_in_wind_and_waves(runs: int) -> None:
    """The same from 300 s on in 2 degrees of wind and of waves."""
    voyage = study.track("course", runs, SEED, study.SEA, 450.0)
    assert np.sqrt(np.square(voyage.right_m[voyage.time_s >= 300.0]).mean()) <= 6.0
    _is_within_limits(voyage)


@pytest.mark.parametrize(("after_s", "share"), [(600.0, 0.25), pytest.param(1000.0, 0.1, marks=pytest.mark.study)])
def test_plain_line_of_sight_is_off_as_theory_says_and_its_integral_is_not(after_s: float, share: float) -> None:
    """It rests D tan(asin(current / speed)) to the right, within 15 %; of that the integral law leaves a tenth after 1000 s."""
    rests = float(study.track("los", 1, SEED, None, 300.0).right_m[-1, 0])
    assert rests == pytest.approx(study.los_bias_m(), rel=0.15)
    assert abs(float(study.track("integral", 1, SEED, None, after_s).right_m[-1, 0])) < share * study.los_bias_m()


@pytest.mark.parametrize("kind", KINDS)
def test_the_steering_gear_is_never_asked_for_more_than_it_can(kind: str) -> None:
    """In the largest turn the rudder stays within 35 degrees and 2.5 degrees/s, and reaches both."""
    voyage = study.turn(kind, 120.0, duration_s=60.0)
    _is_within_limits(voyage)
    angle, rate = study.greatest_rudder(voyage)
    assert angle == pytest.approx(35.0)
    assert rate == pytest.approx(2.5)


def test_the_adaptive_autopilot_wins_at_other_speeds() -> None:
    """At 3 m/s the fixed gains overshoot by more than 8 %, the scheduled ones do not and settle in half the time."""
    fixed, scheduled = (study.turn(kind, 20.0, 3.0, 450.0) for kind in ("pid", "adaptive"))
    assert study.overshoot(fixed, 20.0) > 0.08
    assert study.overshoot(scheduled, 20.0) <= 0.08
    after = [study.settled_s(one.time_s, np.degrees(one.heading_rad) - 20.0, 1.0) for one in (fixed, scheduled)]
    assert after[1] <= 0.5 * after[0]


@pytest.mark.parametrize("change_deg", [60.0, pytest.param(90.0, marks=pytest.mark.study), 120.0])
def test_the_expert_wins_in_large_turns(change_deg: float) -> None:
    """It is within a degree at least 15 % sooner than the PID, overshooting by no more than that degree."""
    pid, expert = (study.turn(kind, change_deg, duration_s=150.0) for kind in ("pid", "expert"))
    after = [study.settled_s(one.time_s, np.degrees(one.heading_rad) - change_deg, 1.0) for one in (pid, expert)]
    assert after[1] <= 0.85 * after[0]  # 0.71, 0.76, 0.80 are measured
    assert np.degrees(expert.heading_rad).max() - change_deg <= 1.0


def _is_within_limits(voyage: study.Voyage) -> None:
    assert np.abs(voyage.rudder_rad).max() <= study.HULL.rudder_limit_rad
    rate = np.abs(np.diff(voyage.rudder_rad, axis=0)).max() / study.STEP_S
    assert rate <= study.HULL.rudder_rate_radps * (1.0 + 1e-12)  # the division by the step
