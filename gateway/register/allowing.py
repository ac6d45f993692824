"""Allowing: how far off radars may still be with what is taken off, for those who compare them with each other."""

from __future__ import annotations

import math
from collections.abc import Mapping

from gateway.associate import Systematic
from gateway.register.learning import Registration
from gateway.settings import RadarSite


def remaining(registration: Registration, radars: Mapping[int, RadarSite], at: int) -> dict[int, Systematic]:
    """One sigma of range m, azimuth rad, elevation rad of radars at an instant; of those only whose errors are all known."""
    found: dict[int, Systematic] = {}
    for number, radar in radars.items():
        verdicts = registration.verdicts(radar)
        if verdicts is None or not all(one.is_told for one in verdicts[:3]):
            continue
        left = zip(verdicts[:3], registration.of(radar, at)[:3], strict=True)
        distance, azimuth, elevation = (math.hypot(one.sigma, one.value - off) for one, off in left)
        found[number] = distance, azimuth, elevation
    return found
