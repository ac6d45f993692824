"""Corrections: what is taken off a radar's measurements, as a function of when these are valid.

A correction is approached in steps of a second, so that no track jumps. Each step is decided so long before it holds that
nothing that is valid then can have come yet: whatever came late or early, a measurement always meets the same correction.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Correction
from gateway.settings import RadarSite

Floats = NDArray[np.float64]

APPROACH_S = 15.0  # time constant
STEP_SIGMAS = 0.5  # of the radar's noise: the largest step
TIME_STEP_S = 0.01
_ARRIVED = 1e-3  # of the largest step: what is nearer is there
_ALWAYS = -(1 << 62)


@dataclass(frozen=True, slots=True)
class Steps:
    """Corrections of one radar and since when each holds, ns; the first one has always held."""

    since: tuple[int, ...]
    corrections: tuple[Correction, ...]

    @classmethod
    def always(cls, correction: Correction) -> Steps:
        """One that has always held."""
        return cls((_ALWAYS,), (correction,))

    def of(self, at: int) -> Correction:
        """What is taken off what is valid at an instant."""
        return self.corrections[max(bisect_right(self.since, at) - 1, 0)]

    def towards(self, target: Correction, largest: Correction, since: int) -> Steps:
        """The same with a step of a second towards a target, from an instant on."""
        last = self.corrections[-1]
        if last == target:
            return self
        share = 1.0 - math.exp(-1.0 / APPROACH_S)
        parts = []
        for now, wanted, most in zip(last, target, largest, strict=True):
            rest = wanted - now
            step = max(-most, min(most, share * rest))
            parts.append(wanted if abs(rest) <= _ARRIVED * most else now + step)
        correction = (parts[0], parts[1], parts[2], parts[3])
        return Steps((*self.since, since), (*self.corrections, correction))

    def pruned(self, before: int) -> Steps:
        """The same without what held only before an instant."""
        keep = max(bisect_right(self.since, before) - 1, 0)
        return self if keep == 0 else Steps(self.since[keep:], self.corrections[keep:])


def stated(radar: RadarSite) -> Correction:
    """What the site file says that a radar measures too much."""
    return radar.range_error_m, radar.azimuth_error_rad, radar.elevation_error_rad, radar.time_error_s


def largest_step(radar: RadarSite) -> Correction:
    """How much a correction may change within a second."""
    return (
        STEP_SIGMAS * radar.range_sigma_m,
        STEP_SIGMAS * radar.azimuth_sigma_rad,
        STEP_SIGMAS * radar.elevation_sigma_rad,
        TIME_STEP_S,
    )
