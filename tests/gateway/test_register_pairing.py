"""Pairs for registration: of what was measured, whatever was taken off, and of which radar tracks."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.align import Correction, Fix, place_plot
from gateway.associate import Association, Check, Ledger, Span, Spans
from gateway.frames import turn
from gateway.register import Gathered, gathered
from gateway.track import RadarTracks

KEY = (1, 3, 0)
ERROR = np.array([60.0, 0.006, 0.004])
LATE_S = 0.05


def flown(world: Any, t_s: float, correction: Correction, radar_error: bool = True) -> tuple[Fix, RadarTracks]:
    """A report, and what the radar measured about its time, late and wrong, with something taken off."""
    course, radar = world.Course(-12e3, 900.0, 900.0, 85.0, 2.0, 0.0), world.site.radars[0]
    fix = world.fix(course, t_s, velocity_mps=turn(world.frame.enu_from_runway, course.velocity(t_s)))
    off = ERROR if radar_error else np.zeros(3)
    plots = []
    for scan in range(-4, 5):
        said = world.radar_plot(course, t_s + 0.1 + 0.4 * scan, off=off)
        said = replace(said, valid_at=said.valid_at + round(LATE_S * world.SECOND))
        plots.append(place_plot(said, scan, radar, correction))
    return fix, RadarTracks({KEY: tuple(plots)})


def paired(world: Any, fix: Fix, tracks: RadarTracks, *spans: Span) -> Gathered | None:
    """The pairs of one checked report."""
    held, nothing = Spans(spans), Ledger()
    check = Check(fix, (), frozenset(), nothing, nothing, ())
    state = Association(Ledger({}, held), (check,))
    return gathered(state, held, tracks, world.radars, fix.at - 10, fix.at + 10)


@pytest.mark.parametrize("correction", [(0.0, 0.0, 0.0, 0.0), (60.0, 0.006, 0.004, 0.05), (-500.0, 0.1, -0.1, -0.2)])
def test_a_pair_is_of_what_was_measured_whatever_was_taken_off(world: Any, correction: Correction) -> None:
    fix, tracks = flown(world, 30.0, correction)
    found = paired(world, fix, tracks, Span(KEY, "mavlink:1", 0))
    assert found is not None
    assert found.held.tolist() == [True]
    expected = ERROR - found.pairs.rates[0] * LATE_S
    assert found.pairs.off[0] == pytest.approx(expected, rel=1e-4, abs=1e-6)
    assert (found.pairs.sigma[0] > 0.0).all()


def test_a_report_without_a_velocity_is_carried_along_by_those_before_and_after(world: Any) -> None:
    fix, tracks = flown(world, 30.0, (0.0, 0.0, 0.0, 0.0))
    still = replace(fix, velocity_mps=np.full(3, np.nan))
    earlier, later = (flown(world, t_s, (0.0, 0.0, 0.0, 0.0))[0] for t_s in (25.0, 35.0))
    spans, nothing = Spans([Span(KEY, "mavlink:1", 0)]), Ledger()
    check = Check(still, (), frozenset(), nothing, nothing, ())
    state = Association(Ledger({}, spans), (check,), chosen={"mavlink:1": (earlier, still, later)})
    found = gathered(state, spans, tracks, world.radars, still.at, still.at + 1)
    assert found is not None
    assert found.pairs.off[0] == pytest.approx(ERROR - found.pairs.rates[0] * LATE_S, rel=1e-3, abs=1e-5)
    for others in ((), (still, later), (earlier, still)):
        alone = replace(state, chosen={"mavlink:1": others})
        assert gathered(alone, spans, tracks, world.radars, still.at, still.at + 1) is None


def test_the_errors_of_positions_alone_do_not_look_like_lateness(world: Any) -> None:
    """A velocity that is made of positions has none of the error of the report that it carries: they scatter apart."""
    random, spans, nothing = np.random.default_rng(3), Spans([Span(KEY, "mavlink:1", 0)]), Ledger()
    true, tracks = flown(world, 30.0, (0.0, 0.0, 0.0, 0.0), radar_error=False)
    off, rates = [], []
    for _ in range(400):
        fixes = []
        for second in range(-5, 6):
            said = world.fix(world.Course(-12e3, 900.0, 900.0, 85.0, 2.0, 0.0), 30.0 + second)
            noise = random.normal(0.0, 10.0, 3)
            fixes.append(replace(said, enu_m=said.enu_m + noise, velocity_mps=np.full(3, np.nan)))
        check = Check(fixes[5], (), frozenset(), nothing, nothing, ())
        state = Association(Ledger({}, spans), (check,), chosen={"mavlink:1": tuple(fixes)})
        found = gathered(state, spans, tracks, world.radars, true.at, true.at + 1)
        assert found is not None
        off.append(found.pairs.off[0, 0])
        rates.append(found.pairs.rates[0, 0])
    assert np.std(rates) < 2.5  # ten metres at eight seconds' distance: 1.8 m/s, not 14
    assert abs(np.corrcoef(off, rates)[0, 1]) < 0.15  # three sigma of 400; 0.7 if the report's own error is in both


def test_a_pair_that_was_lost_lately_is_watched_unless_either_has_another(world: Any) -> None:
    fix, tracks = flown(world, 30.0, (0.0, 0.0, 0.0, 0.0))
    lost = Span(KEY, "mavlink:1", 0, fix.at - 5 * world.SECOND)
    found = paired(world, fix, tracks, lost)
    assert found is not None
    assert found.held.tolist() == [False]
    taken = Span(KEY, "mavlink:2", fix.at - 3 * world.SECOND, index=2)
    assert paired(world, fix, tracks, lost, taken) is None
    assert paired(world, fix, tracks, replace(lost, until=fix.at - 25 * world.SECOND)) is None
    assert paired(world, fix, tracks, Span(KEY, "mavlink:2", 0)) is None
