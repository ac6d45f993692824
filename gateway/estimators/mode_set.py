"""A set of ways of moving (straight, left, right) and how they follow each other, for the filters of several models.

Arrays are over n tracks and m modes. Source: 000 2.1.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.holding import Held
from gateway.estimators.kalman import Motion
from gateway.estimators.turning import Shaken
from gateway.geodesy import STANDARD_GRAVITY_MPS2

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Rule = Literal["imm", "rmimm", "literal"]  # what tells the modes apart, see `modes`

LEAST_SPEED_MPS = 5.0  # below it a bank says nothing of the turn rate


def level_turn_rate(speed_mps: Floats, bank_rad: float, least_rps: float) -> Floats:
    """Turn rate (n,) in rad/s of level turns at a bank, at level speeds (n,); `least_rps` where this is more."""
    banked = STANDARD_GRAVITY_MPS2 * math.tan(bank_rad) / np.maximum(speed_mps, LEAST_SPEED_MPS)
    return np.asarray(np.maximum(banked, least_rps))


@dataclass(frozen=True, slots=True)
class Mode:
    """One way of moving. `turn` is a multiple of the set's turn rate: 0 is straight, positive to the left.

    `share` is how much of its time an aircraft spends so, against the other modes'; `along`, of a straight one, how much of
    the level noise's sigma there is along the course, 1 = as much as across; with `holds` an acceleration lasts. Across the
    course a slow aircraft has no more than the set's turn rate makes of its speed.
    """

    turn: float
    motion: Motion
    share: float = 1.0
    along: float = 1.0
    holds: bool = False


@dataclass(frozen=True, slots=True)
class Numbers:
    """A set of m modes as arrays (m,)."""

    turn: Floats
    share: Floats  # in all 1
    uneven: Ints  # the places of the u modes whose noise is not alike along and across
    along: Floats  # (u,) of these
    across: Floats  # (u,) m/s2
    holds: tuple[int, ...]  # places of the modes in which an acceleration lasts
    shaken: Shaken
    stays: Floats  # (m, m), how much likelier than by the shares it is, at first, that a mode stays what it is
    sides: Floats  # (m, 3), 1 where a mode is straight, to the left, to the right

    @classmethod
    def of(cls, modes: Sequence[Mode]) -> Numbers:
        """The modes' own numbers."""
        share, along = np.array([mode.share for mode in modes]), np.array([mode.along for mode in modes])
        turn = np.array([mode.turn for mode in modes])
        uneven, shaken = np.flatnonzero(along != 1.0), Shaken.of([mode.motion for mode in modes])
        return cls(
            turn,
            share / share.sum(),
            uneven,
            along[uneven],
            np.sqrt(shaken.level[uneven]),
            tuple(place for place, mode in enumerate(modes) if mode.holds),
            shaken,
            np.eye(len(modes)) - share / share.sum(),
            (np.sign(turn)[:, None] == [0.0, 1.0, -1.0]).astype(np.float64),
        )


@dataclass(frozen=True, slots=True)
class Modes:
    """A set of modes and how they follow each other.

    The turn rate is `turn_rate_rps`, or that of a level turn at `bank_rad` where this is more: 3 degrees/s is a standard
    turn of an airliner, while a drone of 15 m/s turns at 20.
    """

    modes: tuple[Mode, ...]
    rule: Rule = "rmimm"
    lasts_s: float = 22.0  # mean time until the mode is drawn anew; of three equal ones, each is left after 33 s
    turn_rate_rps: float = math.radians(3.0)
    bank_rad: float = math.radians(30.0)
    fade: float = 0.92  # of the residuals' mean, over MEAN_PERIOD_S
    acceleration: Held | None = None  # that lasts in modes which hold it; with it there are two states more
    numbers: Numbers = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", Numbers.of(self.modes))

    @property
    def count(self) -> int:
        """How many modes there are."""
        return len(self.modes)

    def turn_rate(self, speed_mps: Floats) -> Floats:
        """Turn rate (n, m) in rad/s, positive to the left, of each mode at level speeds (n,)."""
        return level_turn_rate(speed_mps, self.bank_rad, self.turn_rate_rps)[:, None] * self.numbers.turn

    def directions(self, weight: Floats) -> Floats:
        """Probabilities (n, 3) of flying straight, turning left, turning right, from the modes' weights (n, m)."""
        return np.asarray((weight[:, None, :] @ self.numbers.sides)[:, 0])

    def transition(self, elapsed_s: Floats) -> Floats:
        """Probabilities (n, m, m) of being in mode j after times (n,), having been in mode i.

        At a constant rate the mode is drawn anew, by the modes' shares, so that two short times equal one long one.
        Source: 000 2.1.2, p_ij. Deviation: of the time since the last update, never of a fixed period.
        """
        keep = np.exp(elapsed_s / -self.lasts_s)[:, None, None]
        return np.asarray(self.shares + keep * self.numbers.stays)

    @property
    def shares(self) -> Floats:
        """How much of its time an aircraft spends in each mode, (m,), in all 1."""
        return self.numbers.share
