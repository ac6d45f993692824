"""Walks that are put into what was recorded."""

from __future__ import annotations

import math

from sim.studies.walked import walked
from sim.told_pictures import told
from sim.told_rides import honest


def test_a_walk_put_into_what_an_aeroplane_told_is_denied_by_its_leap_in_velocity() -> None:
    _, said = told("aeroplane", honest, 42.0)
    (after_s, text), *later = walked(said, 37.0, math.pi, matching=True)
    assert 0.0 < after_s <= 2.0
    assert "a velocity that jumped" in text
    assert not later
