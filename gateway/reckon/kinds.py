"""What vehicles are, and what carries them on while no position comes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from gateway.observation import AEROPLANES, COPTERS

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WHEELS = frozenset((10,))  # ground rover
HULLS = frozenset((11,))  # surface boat
WINGS = AEROPLANES | {28}  # a parafoil flies as they do
ROTORS = COPTERS


class By(IntEnum):
    """What carries a vehicle on."""

    UNIT = 0  # an inertial unit
    AIRSPEED = 1  # where its nose points, and its airspeed
    WHEELS = 2  # where its nose points, and the speed that it had
    KEEL = 3  # the same, in the current that was found
    TILT = 4  # how its rotors lean, in the wind and with the drag that were found

    @property
    def denies(self) -> bool:
        """Whether it can say that a position is false; what the others hold nothing holds."""
        return self in (By.UNIT, By.AIRSPEED)

    @property
    def words(self) -> str:
        """What it is called where people are told of it."""
        held = "its heading and the speed that it had"
        return ("inertial data", "its attitude and its airspeed", held, held, "its attitude")[self]


HELD = frozenset((By.WHEELS, By.KEEL))  # of these nothing tells what pushes them


@dataclass(frozen=True, slots=True)
class Kinds:
    """What n vehicles are (n,): with wheels, with a keel, with wings; and what carries them on (`By`)."""

    wheels: Bools
    hull: Bools
    wings: Bools
    by: Ints

    @classmethod
    def of(cls, types: Sequence[int | None], by: Sequence[By] | None = None) -> Kinds:
        """By MAV_TYPE; `by` None: an inertial unit tells of all."""
        return cls(
            np.array([one in WHEELS for one in types], np.bool_),
            np.array([one in HULLS for one in types], np.bool_),
            np.array([one in WINGS for one in types], np.bool_),
            np.array([By.UNIT] * len(types) if by is None else by, np.int64),
        )

    @property
    def unit(self) -> Bools:
        """Of which an inertial unit tells (n,)."""
        return np.asarray(self.by == By.UNIT)

    def taken(self, rows: Ints) -> Kinds:
        """Some of the vehicles."""
        return Kinds(self.wheels[rows], self.hull[rows], self.wings[rows], self.by[rows])
