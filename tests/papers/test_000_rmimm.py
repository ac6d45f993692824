"""Paper 000: what its state estimation reaches, by the study that people run.

One draw of 60 runs (seed 1) instead of the study's 500, so nothing here is random; the same bounds are kept by 500 runs behind
the `study` marker. Over seeds 1 to 6, 60 runs scatter by 0.14 m, 0.06 m/s, 0.001 in the gain of separation and 0.1 to 0.4 s in
the delays (one sigma), and ratios on the same draws by 0.003. The bounds are the page's own; every one has three sigma of room.
"""

from __future__ import annotations

import numpy as np
import pytest

from sim.studies.rmimm import Reached, filtered, flight, reached

SEED = 1
Table = dict[str, Reached]


def _table(runs: int) -> Table:
    plain, measured = flight(runs, SEED), flight(runs, SEED, velocity=True)
    return {
        "imm": reached(plain, filtered(plain, "imm")),
        "literal": reached(plain, filtered(plain, "literal")),
        "default": reached(plain, filtered(plain, "rmimm")),
        "known": reached(plain, filtered(plain, "rmimm", known_point=True)),
        "imm, velocity": reached(measured, filtered(measured, "imm")),
        "velocity": reached(measured, filtered(measured, "rmimm")),
    }


@pytest.fixture(scope="module", params=[60, pytest.param(500, marks=pytest.mark.study)])
def table(request: pytest.FixtureRequest) -> Table:
    return _table(request.param)


def test_the_default_is_no_worse_than_the_imm(table: Table) -> None:
    """At equal tuning and on the same draws its position and velocity RMSE are at most the IMM's."""
    assert table["default"].position_m <= 1.00 * table["imm"].position_m
    assert table["default"].velocity_mps <= 1.00 * table["imm"].velocity_mps


def test_the_default_tells_the_modes_apart_by_more_in_every_segment(table: Table) -> None:
    """Its separation of the true mode from the likeliest other is at least 0.05 above the IMM's, segment by segment."""
    gain = np.subtract(table["default"].separation, table["imm"].separation)
    assert len(gain) == 5
    assert (gain >= 0.05).all()


def test_changes_of_mode_are_found_in_time(table: Table) -> None:
    """On average a turn's start is found within 8.0 s and its end within 10.5 s."""
    starts, ends = table["default"].delay_s[::2], table["default"].delay_s[1::2]
    assert max(starts) <= 8.0
    assert max(ends) <= 10.5


def test_the_imm_it_is_compared_with_is_not_crippled(table: Table) -> None:
    """The IMM is as good as in the page's table, and the literal rule as bad: beating them means something."""
    # the page's 28.7 m, 6.6 m/s are of other draws and another start; 3 % of each is three sigma of 60 runs
    assert table["imm"].position_m == pytest.approx(28.7, rel=0.03)
    assert table["imm"].velocity_mps == pytest.approx(6.6, rel=0.05)
    assert table["literal"].position_m == pytest.approx(31.8, rel=0.05)
    assert min(table["imm"].separation) >= 0.70


def test_a_known_point_shortens_the_detection_of_a_roll_out(table: Table) -> None:
    """With the point known: at most 6.5 s at a turn's end and 8.0 s at its start, velocity at most 0.90 of the IMM's."""
    known = table["known"]
    assert max(known.delay_s[::2]) <= 8.0
    assert max(known.delay_s[1::2]) <= 6.5
    assert known.velocity_mps <= 0.90 * table["imm"].velocity_mps


def test_where_velocity_is_measured_every_rule_is_as_good(table: Table) -> None:
    """With 10 m and 1 m/s: 4.4 m, 0.60 m/s, changes found within 2 s; IMM and default agree to 1 %."""
    one, other = table["velocity"], table["imm, velocity"]
    assert one.position_m <= 4.4
    assert one.velocity_mps <= 0.60
    assert max(one.delay_s) <= 2.0
    assert one.position_m == pytest.approx(other.position_m, rel=0.01)


def test_the_flight_is_the_papers() -> None:
    """It starts at 300 km/h on each axis, turns right through 300 degrees and left through 150, and keeps its speed."""
    flown = flight(1, SEED)
    course = np.unwrap(np.arctan2(flown.velocity[:, 1], flown.velocity[:, 0]))
    assert np.degrees(course[[0, 98, 199, 298, 349, 499]]) == pytest.approx(
        [45.0, 45.0, -255.0, -255.0, -105.0, -105.0]
    )
    assert np.hypot(*flown.velocity.T) == pytest.approx(300.0 / 3.6 * np.sqrt(2.0))
    # the position is the velocity's integral: Simpson's rule would do; half-way courses make it exact to a chord
    steps = np.hypot(*np.diff(flown.position, axis=0).T)
    assert steps == pytest.approx(300.0 / 3.6 * np.sqrt(2.0), rel=2e-4)
