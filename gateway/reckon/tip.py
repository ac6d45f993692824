"""How far the dead reckoning of some vehicles has come: its filters, and what it thinks of their position source.

Of each vehicle run several hypotheses side by side: the first one is corrected by GPS, the others were split off from it in
turn, five seconds apart, and go on without. What walks off too slowly for the first one is found by the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.dead_reckoning import Reckoning
from gateway.estimators.inertial import Motion

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

BRANCHES = 4
SEEDED_EVERY = 50  # cells
HYPOTHESES = 1 + BRANCHES
NOTHING, JUMPED, WALKED_OFF, DISAGREES, VELOCITY_JUMPED, VELOCITY_ONLY = range(6)
"""What is refused of positions, and why. DISAGREES: with their velocities; VELOCITY_ONLY: these are, positions are not."""
USED = (NOTHING, VELOCITY_ONLY)


@dataclass(frozen=True, slots=True, eq=False)
class Tip:
    """n vehicles at the starts of cells; the filters have shapes (n, HYPOTHESES, ...)."""

    state: Reckoning
    cell: Ints  # (n,)
    began: Ints  # (n,) the cell in which it began
    seeded: Ints  # (n, HYPOTHESES) the cell in which each was split off
    heard: Ints  # (n,) the cell of the last position that was worked in
    scatter_m2: Floats  # (n,) of positions about the filter, level, an axis
    scatter_mps2: Floats  # (n,) and of velocities
    above_m: Floats  # (n,) of heights over the altitudes that are told beside; NaN = not known
    denied: Ints  # (n,) what is refused of positions, and why
    agreed: Ints  # (n,) how many of which something is refused have agreed in a row
    accelerated_mps2: Floats  # (n, 3) north, east, down, in the last cell
    proved: Ints  # (n,) comparisons of good positions with the oldest hypothesis
    times: Floats  # (n,) the mean square that they were off by, of what is expected
    rough: Floats  # (n,) the power of what is not told of the forces between samples, in these
    told_from_mps: Floats  # (n,) the slowest walk with velocities to match that would be denied; NaN = not known
    last: Floats  # (n, 5) the last position: latitude, longitude; velocity north, east; how long before its cell's end it was
    placed: Ints  # (n,) the cell of it
    walked_m: Floats  # (n, HYPOTHESES, 2) how far positions had walked from their velocities: now, and when each was split off
    followed: Ints  # (n,) positions without a pause
    strays: Floats  # (n,) the mean square that they walk by, of what is expected

    def __len__(self) -> int:
        return len(self.cell)

    @property
    def refused(self) -> Bools:
        """Of which vehicles positions are refused (n,)."""
        return ~np.isin(self.denied, USED)

    def taken(self, rows: Ints) -> Tip:
        """Some of the vehicles."""
        return _each(lambda one: one[rows], self)

    def put(self, rows: Ints, some: Tip) -> Tip:
        """The same with some vehicles changed."""

        def changed(whole: NDArray[Any], part: NDArray[Any]) -> NDArray[Any]:
            whole = whole.copy()
            whole[rows] = part
            return whole

        return _each(changed, self, some)


def joined(tips: Sequence[Tip]) -> Tip:
    """Vehicles one after the other."""
    return tips[0] if len(tips) == 1 else _each(lambda *several: np.concatenate(several), *tips)


def _each(do: Callable[..., NDArray[Any]], *tips: Tip) -> Tip:
    states = with_each(do, *(tip.state for tip in tips))
    names = [one.name for one in fields(Tip) if one.name != "state"]
    return Tip(states, *(do(*(getattr(tip, name) for tip in tips)) for name in names))


def with_each(do: Callable[..., NDArray[Any]], *states: Reckoning) -> Reckoning:
    """A state whose every array is made of those of others."""
    motion = Motion(*(do(*(getattr(one.motion, field.name) for one in states)) for field in fields(Motion)))
    names = [one.name for one in fields(Reckoning) if one.name != "motion"]
    return Reckoning(motion, *(do(*(getattr(one, name) for one in states)) for name in names))


def spread(state: Reckoning) -> Reckoning:
    """States (n, ...) as those of all hypotheses (n, HYPOTHESES, ...)."""
    return with_each(lambda one: np.repeat(one[:, None], HYPOTHESES, axis=1), state)


def split_anew(tip: Tip, cell: int) -> Tip:
    """The same with every hypothesis split off from the first one now."""
    state, walked = spread(hypothesis(tip.state, 0)), np.zeros_like(tip.walked_m)
    return replace(tip, state=state, seeded=np.full_like(tip.seeded, cell), walked_m=walked)


def hypothesis(state: Reckoning, which: int) -> Reckoning:
    """One of the hypotheses of each vehicle (n, ...)."""
    return with_each(lambda one: one[:, which], state)


def with_hypothesis(state: Reckoning, which: int, one: Reckoning) -> Reckoning:
    """The same with one of the hypotheses changed."""

    def changed(whole: NDArray[Any], part: NDArray[Any]) -> NDArray[Any]:
        whole = whole.copy()
        whole[:, which] = part
        return whole

    return with_each(changed, state, one)


def with_rows(state: Reckoning, rows: Ints, one: Reckoning) -> Reckoning:
    """The same with all hypotheses of some vehicles those of one (rows, ...)."""

    def changed(whole: NDArray[Any], part: NDArray[Any]) -> NDArray[Any]:
        whole = whole.copy()
        whole[rows] = part[:, None]
        return whole

    return with_each(changed, state, one)
