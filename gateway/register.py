"""Register: the systematic errors of radars and position sources.

For now none is assumed and none is taken off; the correction travels the path all the same, so that align need not change.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

NO_CORRECTION: Floats = np.zeros(3)
NO_CORRECTION.setflags(write=False)


@dataclass(frozen=True, slots=True)
class Registered:
    """What is taken off each radar's measurements: range m, azimuth rad, elevation rad; one row a radar."""

    radars: tuple[int, ...]
    correction: Floats  # (r, 3)


@dataclass(frozen=True, slots=True)
class Registration:
    """What is known of each radar's errors: range m, azimuth rad, elevation rad (3,); used by the next align."""

    corrections: Mapping[int, Floats] = field(default_factory=dict)

    def of(self, radar: int) -> Floats:
        """What is taken off this radar's measurements."""
        return self.corrections.get(radar, NO_CORRECTION)

    def table(self, radars: Iterable[int]) -> Registered:
        """The corrections of some radars as columns."""
        numbers = tuple(sorted(radars))
        return Registered(numbers, np.array([self.of(number) for number in numbers]).reshape(-1, 3))
