"""Paper 000: what its inference of intent and its two-segment prediction reach, by the study that people run.

One draw of 40 runs (seed 1) instead of the study's 300, so nothing here is random; the same bounds are kept by 300 runs behind
the `study` marker. The bounds are the page's own. Prediction is from origins that the page calls settled: 10 s into a turn,
20 s into a straight; its figures for the likeliest mode held (91, 761, 3771, 11629 m) are met from there.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from sim.studies import rmimm as case
from sim.studies.intents import VARIANTS, Followed, Method, Origins, Points, candidates, errors_m, right, rms_m, variant
from sim.studies.rmimm import Flight, Reached

SEED = 1


@dataclass(frozen=True)
class Found:
    """A flight and what each variant made of it."""

    flown: Flight
    points: Points
    by: dict[str, Followed]

    def reached(self, name: str) -> Reached:
        return case.reached(self.flown, self.by[name].tracks)

    def rms(self, name: str, which: Origins, method: Method) -> tuple[float, ...]:
        return rms_m(errors_m(self.by[name], self.flown, self.points, method), which)


@pytest.fixture(scope="module", params=[40, pytest.param(300, marks=pytest.mark.study)])
def found(request: pytest.FixtureRequest) -> Found:
    flown = case.flight(request.param, SEED)
    points = candidates(flown)
    return Found(flown, points, {name: variant(name, flown, points) for name, *_ in VARIANTS})


def test_the_right_point_is_believed(found: Found) -> None:
    """In at least 97 % of leg 1's seconds, 92 % of leg 2's and 93 % of leg 3's, the roll-outs included."""
    shares = [right(found.by["default"], leg) for leg in range(3)]
    assert shares[0] >= 0.97
    assert shares[1] >= 0.92
    assert shares[2] >= 0.93


def test_as_printed_a_planned_point_is_hardly_ever_believed(found: Found) -> None:
    """With 17 s the plan's point, 40 to 140 s ahead on leg 1, loses to whatever is published: beating that means something."""
    assert right(found.by["literal"], 0) < 0.6


def test_a_known_point_is_found_sooner(found: Found) -> None:
    """At most 6.5 s at turn ends and 8.0 s at turn starts, the velocity at most 0.90 of the IMM's (6.6 m/s on the page)."""
    known = found.reached("known point")
    assert max(known.delay_s[::2]) <= 8.0
    assert max(known.delay_s[1::2]) <= 6.5
    assert known.velocity_mps <= 0.90 * 6.6


def test_an_inferred_point_does_not_spoil_the_filter(found: Found) -> None:
    """Fed back, it leaves the delays within 8.0 s at turn starts and 10.5 s at turn ends, and the errors within 2 %."""
    alone, fed = found.reached("RMIMM"), found.reached("default")
    assert max(fed.delay_s[::2]) <= 8.0
    assert max(fed.delay_s[1::2]) <= 10.5
    assert fed.position_m <= 1.02 * alone.position_m
    assert fed.velocity_mps <= 1.02 * alone.velocity_mps


def test_with_a_known_point_turns_are_foretold(found: Found) -> None:
    """From inside the turns at most 80, 290, 720 and 1650 m RMS at 10, 30, 60 and 120 s.

    The printed rule flies straight at a point only when it is ahead already: where the filter doubts the turn it has no way.
    Over 300 runs that makes 746 m at 60 s, and up to 12 % more over 40.
    """
    bounds = (80.0, 290.0, 720.0, 1650.0)
    for rms, bound in zip(found.rms("RMIMM", "turns", "known point"), bounds, strict=True):
        assert rms <= bound
    for rms, bound in zip(found.rms("RMIMM", "turns", "known point, literal"), bounds, strict=True):
        assert rms <= 1.15 * bound


def test_with_an_inferred_point_straights_are_foretold(found: Found) -> None:
    """On settled straights, fed back, at most 50, 140, 300 and 550 m RMS at 10, 30, 60 and 120 s."""
    off = found.rms("default", "straights", "inferred")
    for rms, bound in zip(off, (50.0, 140.0, 300.0, 550.0), strict=True):
        assert rms <= bound


def test_inference_does_no_harm(found: Found) -> None:
    """Over all origins its predictions are no worse than 1.02 times the likeliest mode's, at every horizon.

    300 runs reach 1.015 at 10 s and 0.97 to 1.00 beyond; with 40 the former scatters by 0.01 about that.
    """
    allowed = 1.02 if found.flown.measured.shape[1] >= 300 else 1.04
    inferred, held = found.rms("default", "all", "inferred"), found.rms("RMIMM", "all", "likeliest mode")
    assert all(one <= allowed * other for one, other in zip(inferred, held, strict=True))
