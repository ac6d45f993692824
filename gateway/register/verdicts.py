"""Verdicts: what is known of an error of a radar, and what follows from it, in plain words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

PRIOR_CHI_SQUARE = 16.3  # of the common error against its prior: three degrees of freedom, 99.9 %
SIGNIFICANT = 3.0  # sigmas
# Of so few aircraft it takes more: their own errors are then half of what is found, it is looked at again and again, and what
# is taken off wrongly does harm where a little that is left does none.
FEW, SIGNIFICANT_OF_FEW = 3, 4.5
PLAIN = 6.0  # sigmas: an error so large is worth taking off however well it is known; but for a clock's
NAMES = ("range", "azimuth", "elevation", "time")
UNITS = ("m", "degrees", "degrees", "ms")
LIMITS = (15.0, math.radians(0.05), math.radians(0.05), 0.03)  # a larger sigma than this is worth no correction
_PER_UNIT = (1.0, math.degrees(1.0), math.degrees(1.0), 1e3)
_DIGITS = (1, 3, 3, 0)
_CLAIMED = ("measures {:.1f} m too far", "{:+.3f} degrees to the left", "{:+.3f} degrees too high", "{:+.0f} ms late")

Use = Literal["to be applied", "applied"]  # what is done with what was found: of a recording, and while a session runs


@dataclass(frozen=True, slots=True)
class Verdict:
    """One error of a radar: by how much it measures too much (azimuth to the left, time late; SI), and what that is worth.

    `stated`: what the site file says that it is. `significant`: how many sigmas off that it has to be.
    """

    name: str
    value: float
    sigma: float
    observable: bool
    stated: float = 0.0
    significant: float = SIGNIFICANT

    @property
    def is_found(self) -> bool:
        """Whether it is worth taking off."""
        return self.is_told and self.off_sigmas > self.significant

    @property
    def is_told(self) -> bool:
        """Whether the geometry tells it well enough to be worth a correction."""
        is_plain = self.off_sigmas > PLAIN and self.name != "time"
        return self.observable and (self.sigma <= LIMITS[NAMES.index(self.name)] or is_plain)

    @property
    def off_sigmas(self) -> float:
        """How far it is from what is stated, in sigmas."""
        return abs(self.value - self.stated) / self.sigma if self.sigma > 0.0 else math.inf

    def sentence(self, use: Use = "to be applied") -> str:
        """In plain words."""
        place = NAMES.index(self.name)
        per, digits, unit = _PER_UNIT[place], _DIGITS[place], UNITS[place]
        sigma = f"+- {per * self.sigma:.{digits}f}"
        if not self.is_told:
            return f"{self.name}: not observable from this geometry ({sigma} {unit}): not {use}"
        if not self.is_found:
            beyond = " beyond what the site file says" if self.stated else ""
            off = per * (self.value - self.stated)
            return f"{self.name}: nothing significant{beyond} ({off:+.{digits}f} {sigma} {unit})"
        return f"{self.name}: {_CLAIMED[place].format(per * self.value)} ({sigma}): {use}"


def in_words(verdict: Verdict, applied: bool) -> str:
    """What is known of an error, and whether it is taken off at present."""
    if applied and not verdict.is_told:
        return f"{verdict.name}: applied as it was found before; at present the geometry does not tell it"
    return verdict.sentence("applied" if applied or not verdict.is_found else "to be applied")
