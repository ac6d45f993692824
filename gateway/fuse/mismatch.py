"""What velocities are that are not those of their positions, in words: another unit, sign or axis, or none.

Of the legs that speak against an aircraft's velocities (`displacement`) a regression has the factor between both
displacements, as complex numbers level, so that it holds a turn too; and the same of the mirrored one. Only what explains the
legs is said: positions that jump about contradict any velocity, and that is said elsewhere.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray

from gateway.fuse.displacement import EVIDENCE, LEGS, MIRRORED, MOVED2, ON, STRAIGHT, TOLD2, Displacements
from gateway.fuse.evidence import Finding

Floats = NDArray[np.float64]

# Units, by how many of them are one m/s.
UNITS = {
    "mm/s": 1000.0,
    "feet a minute": 196.85,
    "cm/s": 100.0,
    "dm/s": 10.0,
    "km/h": 3.6,
    "feet a second": 3.2808,
    "miles an hour": 2.2369,
    "knots": 1.9438,
}
NAMED_WITHIN = 0.045  # of a unit's factor; feet a second and km/h are 0.09 apart
NOTHING = 0.05  # times what positions move by: no velocity at all
EXPLAINED = 0.8  # of the squares
OFF = 0.2  # of its size, or radians: less is no other unit and no other axis
AXIS = math.radians(15.0)  # a direction this near to an axis is that one
GOES_ON = 0.5  # mean cosine between a leg and the next of what really moves


def mismatches(known: Displacements, least: float) -> dict[str, list[Finding]]:
    """Of each aircraft with more evidence than this against a velocity of its, what is wrong with it."""
    found: dict[str, list[Finding]] = {}
    against = known.sums[:, :, EVIDENCE] > least
    if not against.any():
        return found
    names = list(known.aircraft)
    for row, way in np.argwhere(against).tolist():
        if what := mismatch(known.sums[row, way], is_level=way == 0):
            source, name = f"GPS of {names[row]}", ("velocity", "climb rate")[way]
            text = f"{source}: its {name} {what}: its velocities are left out until they fit; put right what sends them"
            found.setdefault(names[row], []).append(Finding(f"{name} and positions, {source}", text))
    return found


def mismatch(sums: Floats, *, is_level: bool) -> str | None:
    """What is wrong with a velocity, level or upright, by the sums (columns,) of its legs; None = nothing that explains them."""
    legs, told2, moved2 = sums[LEGS], sums[TOLD2], sums[MOVED2]
    if not legs or not moved2:
        return None
    straight, mirrored = (complex(*sums[columns].tolist()) for columns in (STRAIGHT, MIRRORED))
    by_both = max(told2 * moved2, 1e-12)
    if max(abs(straight), abs(mirrored)) ** 2 < EXPLAINED * by_both:
        is_none = told2 < NOTHING**2 * legs and sums[ON] >= GOES_ON * (legs - 1.0)
        return "is next to nothing while its positions move" if is_none else None
    angle = -cmath.phase(straight)
    is_straight = abs(straight) ** 2 >= EXPLAINED * by_both
    size = told2 / abs(straight if is_straight else mirrored)
    if is_straight and abs(angle) < AXIS:
        return None if abs(math.log(size)) < OFF else _times(size)
    if is_straight and abs(angle) > math.pi - AXIS:
        return f"has the wrong sign{'' if is_level else ', as if up were taken for down'}{_and_times(size)}"
    if abs(mirrored) ** 2 >= EXPLAINED * by_both and (what := _axes(cmath.phase(mirrored))):
        return what + _and_times(told2 / abs(mirrored))
    if not is_straight:
        return None
    side = "left" if angle > 0.0 else "right"
    return f"points {abs(math.degrees(angle)):.0f} degrees to the {side} of where its positions move{_and_times(size)}"


def _axes(angle: float) -> str | None:
    """Which axes are swapped or mirrored, by how much the mirrored displacement is turned from that of the positions."""
    if abs(angle) < AXIS:
        return "has north and south confused"
    if abs(angle) > math.pi - AXIS:
        return "has east and west confused"
    if abs(abs(angle) - 0.5 * math.pi) < AXIS:
        return f"has east and north swapped{'' if angle > 0.0 else ', and the wrong sign'}"
    return None


def _times(size: float) -> str:
    text = f"is {size:.3g} times what its positions move by"
    for unit, per_mps in UNITS.items():
        if abs(math.log(size / per_mps)) < NAMED_WITHIN:
            return f"{text}, as if it were in {unit} and read as m/s"
        if abs(math.log(size * per_mps)) < NAMED_WITHIN:
            return f"{text}, as if it were in m/s and read as {unit}"
    return text


def _and_times(size: float) -> str:
    return "" if abs(math.log(size)) < OFF else f", and {_times(size)}"
