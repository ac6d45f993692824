"""Whether velocities are those of the positions that come with them: a wrong unit, sign or axis, or none at all.

Each aircraft's way is cut into legs: as long as it takes until it has moved, or said to have moved, by many times the noise
of its positions. Of a leg is known by how much the positions moved and by how much the velocities say so (their sum over the
intervals between reports, whatever these are), level and upright on their own. For each leg the evidence is the logarithm
of how much likelier its displacement is if the velocities had nothing to do with it than if they were right, or if the
positions stood still. It is summed like that on noise (`evidence`: a sum below nothing begins anew), beside the sums of a
regression of the one displacement on the other, of which every leg has the same share: what the velocities are instead.

Here positions are right and velocities are judged, of every aircraft and over minutes; `reckon.walking` judges positions by
velocities that were theirs until now, over seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.fuse.scatter import MANOEUVRE, Rows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Number = TypeVar("Number", np.float64, np.int64)

WAYS = 2  # level, and upright
LEAST_S, LONGEST_S = 4.0, 120.0  # of a leg
GAP_S = 30.0  # over which nothing is known of the way
CLEAR = np.array([12.0, 6.0])  # noises of its ends that a leg reaches over, level and upright
LASTING = 0.3  # of the stated noise of velocities, that may last all along a leg
TOLERANCE = 0.1  # of a displacement: times are coarse, scales are not exact
SPAN = math.log(1e4)  # sizes that a displacement may have that nothing is known of: all alike by their logarithm
FOR, AGAINST = 2.5, -3.0  # what a leg says at most: neither one jump nor two are enough
MOST = 24.0  # a sum grows no further, so that velocities that are put right are believed before long
# Columns of the sums: evidence, legs, and of these the squares of both displacements, the product of that of the positions
# with the other as told and as mirrored (complex numbers), the last one's direction, and how many went on in their last one's.
EVIDENCE, LEGS, TOLD2, MOVED2, LAST, ON, COLUMNS = 0, 1, 2, 3, slice(8, 10), 10, 11
STRAIGHT, MIRRORED = slice(4, 6), slice(6, 8)


@dataclass(frozen=True, slots=True, eq=False)
class Displacements:
    """Of n aircraft: the leg that each is on, level and upright, and what all of them until now have told."""

    aircraft: Mapping[str, int] = field(default_factory=dict)  # the row of each in what follows
    heard: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    since: Ints = field(default_factory=lambda: np.zeros((0, WAYS), dtype=np.int64))  # when its leg began
    start: Floats = field(default_factory=lambda: np.zeros((0, 3)))  # where, m; NaN = on none
    variance: Floats = field(default_factory=lambda: np.zeros((0, WAYS)))  # of that, m2
    told: Floats = field(default_factory=lambda: np.zeros((0, 3)))  # how far it moved since by its velocities, m
    slack: Floats = field(default_factory=lambda: np.zeros((0, WAYS)))  # variance of that, m2
    sums: Floats = field(default_factory=lambda: np.zeros((0, WAYS, COLUMNS)))

    def after(self, rows: Rows, aircraft: Sequence[str]) -> Displacements:
        """The same after new reports, in order, with those before them; `aircraft` (m,) of each group, by their order."""
        met = dict.fromkeys(name for name in aircraft if name not in self.aircraft)
        known = self._with(tuple(met)) if met else self
        first = np.flatnonzero(np.append(True, rows.group[1:] != rows.group[:-1]))
        last = np.append(first[1:], len(rows.at)) - 1
        place = np.array([known.aircraft[name] for name in aircraft], dtype=np.int64)
        heard = known.heard.copy()
        heard[place] = rows.at[last]
        known = replace(known, heard=heard)._walked(rows, first, last, place)
        return known._judged(rows, last, place)

    def remembered(self, at: int, since: int, most: int) -> Displacements:
        """The same without aircraft that were not heard since, or the least lately heard of too many.

        Whose legs have told nothing, or none has ended yet, has nothing to be remembered by once his leg is broken off.
        """
        keep = self.heard >= np.where(self.sums[:, :, LEGS].any(axis=1), since, at - int(GAP_S * SECOND))
        if len(keep) > most:
            keep &= self.heard.argsort(kind="stable").argsort() >= len(keep) - most
        if keep.all():
            return self
        names = [name for name, is_kept in zip(self.aircraft, keep.tolist(), strict=True) if is_kept]
        return replace(
            self,
            aircraft={name: row for row, name in enumerate(names)},
            **{one.name: getattr(self, one.name)[keep] for one in fields(self) if one.name != "aircraft"},
        )

    def _with(self, names: Sequence[str]) -> Displacements:
        """The same with new aircraft, of which nothing is known."""
        count = len(self.aircraft)
        return replace(
            self,
            aircraft={**self.aircraft, **{name: count + row for row, name in enumerate(names)}},
            heard=_more(self.heard, len(names), 0),
            since=_more(self.since, len(names), 0),
            start=_more(self.start, len(names), math.nan),
            variance=_more(self.variance, len(names), 0.0),
            told=_more(self.told, len(names), 0.0),
            slack=_more(self.slack, len(names), 0.0),
            sums=_more(self.sums, len(names), 0.0),
        )

    def _walked(self, rows: Rows, first: Ints, last: Ints, place: Ints) -> Displacements:
        """The same with the intervals that end with new reports added to the legs; after a gap a leg begins."""
        group = np.repeat(np.arange(len(first)), last - first + 1)
        step_s = np.append(math.inf, np.diff(rows.at_s))
        step_s[first] = math.inf
        velocity, before = rows.value[:, 3:], np.roll(rows.value[:, 3:], 1, axis=0)
        with np.errstate(invalid="ignore"):
            told = 0.5 * step_s[:, None] * (velocity + before)
            bent = np.square(0.25 * step_s[:, None] * (velocity - before))
            noise = np.square(step_s[:, None] * rows.sigma[:, 3:]) + (MANOEUVRE[1] / 12.0 * step_s**3)[:, None] ** 2
            slack = np.stack([(bent + noise)[:, :2].max(axis=1), (bent + noise)[:, 2]], axis=1)
        # NaN of any number makes the whole unknown: a position or a velocity at either end.
        both = told + rows.value[:, :3] + np.roll(rows.value[:, :3], 1, axis=0)
        whole = np.stack([np.isfinite(both[:, :2]).all(axis=1), np.isfinite(both[:, 2])], axis=1)
        whole &= (step_s <= GAP_S)[:, None]
        broken = ~whole & rows.new[:, None]
        row = np.arange(len(group))[:, None]
        begins = np.maximum.reduceat(np.where(broken, row, -1), first, axis=0)  # (m, ways)
        counts = whole & rows.new[:, None] & (row > begins[group])
        added, more = np.zeros((len(first), 3)), np.zeros((len(first), WAYS))
        np.add.at(added, group, np.where(counts[:, (0, 0, 1)], told, 0.0))
        np.add.at(more, group, np.where(counts, slack, 0.0))
        fresh, at = begins >= 0, np.maximum(begins, 0)
        each = fresh[:, (0, 0, 1)]
        there = np.concatenate([rows.value[at[:, 0], :2], rows.value[at[:, 1], 2:3]], axis=1)
        variance = np.stack([_variance(rows, at[:, 0])[:, 0], _variance(rows, at[:, 1])[:, 1]], axis=1)
        return replace(
            self,
            since=_put(self.since, place, np.where(fresh, rows.at[at], self.since[place])),
            start=_put(self.start, place, np.where(each, there, self.start[place])),
            variance=_put(self.variance, place, np.where(fresh, variance, self.variance[place])),
            told=_put(self.told, place, np.where(each, 0.0, self.told[place]) + added),
            slack=_put(self.slack, place, np.where(fresh, 0.0, self.slack[place]) + more),
        )

    def _judged(self, rows: Rows, last: Ints, place: Ints) -> Displacements:
        """The same with the legs ended that tell enough by now, and what they told in the sums; the next begin there."""
        here, now = rows.value[last, :3], rows.at[last]
        moved, told = here - self.start[place], self.told[place]
        own = self.variance[place] + _variance(rows, last)
        long_s = (now[:, None] - self.since[place]) / SECOND
        size2 = np.stack([_square(moved), _square(told)]).max(axis=0)
        ends = (long_s >= LEAST_S) & ((size2 >= CLEAR**2 * own) | (long_s >= LONGEST_S)) & np.isfinite(size2)
        if not ends.any():
            return self
        lasts = np.square(LASTING * long_s * rows.sigma[last, 3][:, None])
        evidence = _evidence(moved, told, own + lasts, self.slack[place])
        sums = np.where(ends[:, :, None], _summed(self.sums[place], evidence, moved, told), self.sums[place])
        each = ends[:, (0, 0, 1)]
        return replace(
            self,
            since=_put(self.since, place, np.where(ends, now[:, None], self.since[place])),
            start=_put(self.start, place, np.where(each, here, self.start[place])),
            variance=_put(self.variance, place, np.where(ends, _variance(rows, last), self.variance[place])),
            told=_put(self.told, place, np.where(each, 0.0, told)),
            slack=_put(self.slack, place, np.where(ends, 0.0, self.slack[place])),
            sums=_put(self.sums, place, sums),
        )


def _more(there: NDArray[Number], count: int, nothing: float) -> NDArray[Number]:
    """The same with so many more rows, of one value."""
    return np.concatenate([there, np.full((count, *there.shape[1:]), nothing, dtype=there.dtype)])


def _put(there: NDArray[Number], place: Ints, new: NDArray[Number]) -> NDArray[Number]:
    """A copy with some rows in place of former ones."""
    after = there.copy()
    after[place] = new
    return after


def _square(displacement: Floats) -> Floats:
    """The squares (n, ways) of displacements (n, 3), level and upright."""
    square = np.square(displacement)
    return np.stack([square[:, 0] + square[:, 1], square[:, 2]], axis=1)


def _variance(rows: Rows, at: Ints) -> Floats:
    """Of some reports' positions along one axis, (n, ways), as stated."""
    square = np.square(rows.sigma[at, :3])
    return np.stack([0.5 * (square[:, 0] + square[:, 1]), square[:, 2]], axis=1)


def _evidence(moved: Floats, told: Floats, noise: Floats, slack: Floats) -> Floats:
    """How much likelier legs (n, ways) are if velocities say nothing of them, as a logarithm within bounds."""
    axes = np.array([2.0, 1.0])
    by_told = noise + slack + TOLERANCE**2 * _square(told)
    right = -0.5 * (_square(moved - told) / by_told + axes * np.log(2.0 * math.pi * by_told))
    still = -0.5 * (_square(moved) / noise + axes * np.log(2.0 * math.pi * noise))
    size2 = _square(moved) + noise
    anything = np.stack(
        [-np.log(2.0 * math.pi * SPAN * size2[:, 0]), -np.log(2.0 * SPAN) - 0.5 * np.log(size2[:, 1])], axis=1
    )
    return np.asarray(np.clip(anything - np.maximum(right, still), AGAINST, FOR))


def _summed(sums: Floats, evidence: Floats, moved: Floats, told: Floats) -> Floats:
    """Sums (n, ways, columns) with one more leg each."""
    told2, moved2 = _square(told), _square(moved)
    size = np.maximum(np.sqrt(told2 + moved2), 1e-9)
    level, by = (moved[:, 0] + 1j * moved[:, 1]) / size[:, 0], (told[:, 0] + 1j * told[:, 1]) / size[:, 0]
    upright = moved[:, 2] * told[:, 2] / size[:, 1] ** 2
    straight, mirrored = np.stack([level * by.conj(), upright], axis=1), np.stack([level * by, upright], axis=1)
    way = np.maximum(np.sqrt(moved2), 1e-9)
    heading = np.zeros((len(moved), WAYS, 2))
    heading[:, 0], heading[:, 1, 0] = moved[:, :2] / way[:, :1], moved[:, 2] / way[:, 1]
    on = (heading * sums[:, :, LAST]).sum(axis=2)
    after = sums.copy()
    after[:, :, EVIDENCE] = np.minimum(sums[:, :, EVIDENCE] + evidence, MOST)
    after[:, :, LEGS] += 1.0
    after[:, :, TOLD2] += told2 / size**2
    after[:, :, MOVED2] += moved2 / size**2
    for columns, product in ((STRAIGHT, straight), (MIRRORED, mirrored)):
        after[:, :, columns] += np.stack([product.real, product.imag], axis=2)
    after[:, :, LAST] = heading
    after[:, :, ON] += on
    return np.where(after[:, :, :1] > 0.0, after, 0.0)
