"""Vehicles that fly drawn missions in closed loop: drawn alike with one seed, and within the sigmas of predictions."""

import pytest

from gateway.observation import FlightPlan, GpsReport
from sim.studies.flown_missions import KINDS, fly
from sim.studies.sigmas import ALL, WITHOUT_SHIPS, run


def test_a_seed_says_who_flies_where() -> None:
    """Flown twice with one seed a way is the same, with another one not; the gateway hears positions and the whole plan."""
    (first,), heard = fly(1, 40.0, 5)
    (again,), _ = fly(1, 40.0, 5)
    (other,), _ = fly(1, 40.0, 6)
    assert (first.latitude == again.latitude).all()
    assert (first.latitude[-1], first.longitude[-1]) != (other.latitude[-1], other.longitude[-1])
    said = [one for each in heard for one in each.observations]
    assert sum(isinstance(one, GpsReport) for one in said) > 100
    plans = [one for one in said if isinstance(one, FlightPlan)]
    assert len(plans[-1].points) >= 5
    assert first.kind == KINDS[0]


@pytest.mark.study
def test_sigmas_cover_what_they_say_on_seeds_that_nothing_was_chosen_on() -> None:
    """Sixteen vehicles but for two ships: one sigma covers 68 % within eight points, two no less than 85 %, at 10 to 60 s."""
    found = run(16, 11).figures
    for axis in ("along", "across"):
        for horizon in (10, 30, 60):
            assert abs(found[f"{WITHOUT_SHIPS}, {axis} within 1, {horizon} s"] - 68.0) < 8.0
            assert found[f"{WITHOUT_SHIPS}, {axis} within 2, {horizon} s"] > 85.0
    assert found[f"{ALL}, RMS, 60 s"] > 0.0
