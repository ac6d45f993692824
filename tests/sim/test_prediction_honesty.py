"""Missions that nothing was chosen on: sigmas of the gateway's predictions mean what they say."""

import numpy as np
import pytest

from sim.studies.missions import missions
from sim.studies.prediction_honesty import scored


def test_missions_are_flown_along_their_plans() -> None:
    """Drawn twice with one seed they are the same; the way is as long as the speed says, and passes near the points."""
    (first,), (again,) = missions(1, 200, 5), missions(1, 200, 5)
    assert (first.places == again.places).all()
    length = np.linalg.norm(np.diff(first.places, axis=0), axis=1).sum()
    assert 200 * 12.0 < length < 200 * 60.0


@pytest.mark.study
def test_two_drawn_missions_are_within_their_sigmas() -> None:
    """Two missions are not many: about two thirds within one sigma, nine tenths within two, at 10 to 120 s, on each axis."""
    found = scored(2, 77)
    assert [one.horizon_s for one in found] == [10.0, 30.0, 60.0, 120.0]
    for one in found:
        for first, second in (one.along_within, one.across_within):
            assert 0.5 < first < 0.9
            assert second > 0.8
        assert one.rms_m < 0.5 * one.straight_on_rms_m
