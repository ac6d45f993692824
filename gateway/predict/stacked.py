"""The goals of many aircraft as arrays, kept from round to round: they hardly ever change, and stacking them takes long."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from operator import is_

import numpy as np
from numpy.typing import NDArray

from gateway.predict.goals import Goals

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Stacked:
    """The c candidates of n aircraft, a row each, as `Goals` has them; nobody may write into the arrays."""

    goals: tuple[Goals, ...]
    route: Floats  # (n, c, 4, 2)
    up: Floats  # (n, c, 4)
    planned: Bools  # (n, c)
    lands: Bools  # (n, c, 4)
    circles: Bools  # (n, c)
    rounds: Bools  # (n, c)
    radius: Floats  # (n, c, 4)
    least: Floats  # (n, c, 4)
    over: Bools  # (n, c, 4)
    begins: Floats  # (n, 2)
    declared: Ints  # (n,) which is declared, -1 = none
    declared_at: Ints
    lowered: Floats  # (n, c)

    @classmethod
    def of(cls, goals: Sequence[Goals]) -> Stacked:
        """These goals, at least one."""
        return cls(tuple(goals), *(np.array([getattr(each, one.name) for each in goals]) for one in fields(cls)[1:]))

    def is_of(self, goals: Sequence[Goals]) -> bool:
        """Whether these very goals are what it was made of."""
        return len(goals) == len(self.goals) and all(map(is_, self.goals, goals))
