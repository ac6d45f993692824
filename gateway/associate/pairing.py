"""Which radar tracks of two radars are one target at one instant: their tracklets compared, and which pairs are plain.

A pair's difference has the noise of both tracklets and the systematic errors of both radars; these are the same for all pairs of
the two radars. So pairs that are one already tell them, and where several could be meant (aircraft in formation), the
assignment that common errors explain best is taken, if it is plain.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from gateway.associate.tracklets import Tracklets
from gateway.track import Key

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Pair = tuple[Key, Key]  # of two radars, the lower number first
Systematic = tuple[float, float, float]  # 1 sigma of a radar's range m, azimuth rad, elevation rad

ALLOWED: Systematic = (100.0, 0.006, 0.006)  # of a radar that nobody has registered: 100 m and a third of a degree
LEFT_OVER: Systematic = (10.0, 3.5e-4, 3.5e-4)  # by which errors are not the same for two pairs of the same radars
TIME_SIGMA_S = 0.05  # of a radar's clock
GATE = 14.16  # chi-square of three components: of right ones 99.7 % are within
PLAIN = 9.2  # twice the logarithm of 100: by how much another assignment must be worse
SEVERAL_AT_MOST = 4  # of either radar: of more that lie that near to each other, each pair must be plain by itself


@dataclass(frozen=True, slots=True, eq=False)
class _Near:
    """m pairs of two radars that are near each other: rows of the tracklets, and their equations in the common errors."""

    one: Ints
    other: Ints
    off: Floats  # (m, 6)
    noise: Floats  # (m, 6, 6)
    by_error: Floats  # (m, 6, 6)
    information: Floats  # (m, 6, 6) what a pair tells of the common errors
    vector: Floats  # (m, 6)
    square: Floats  # (m,) what is left of it without any


def judged(seen: Tracklets, one: frozenset[Pair], systematic: Mapping[int, Systematic]) -> dict[Pair, bool | None]:
    """Pairs of tracklets that may be one target: a hit, a miss, or None where it is not plain which is meant.

    `one`: those that are taken for one; each of them that has both tracklets is judged. `systematic`: of radars whose errors
    are known better than `ALLOWED`.
    """
    found: dict[Pair, bool | None] = {}
    rows = {key: row for row, key in enumerate(seen.keys)}
    for first, second in combinations(sorted(set(seen.radar.tolist())), 2):
        sigma = np.array([*systematic.get(first, ALLOWED), *systematic.get(second, ALLOWED)])
        mine = [
            pair for pair in one if pair[0] in rows and pair[1] in rows and (pair[0][0], pair[1][0]) == (first, second)
        ]
        found |= dict.fromkeys(mine, False)
        near = _near(seen, first, second, sigma)
        if len(near.one):
            found |= _of_two_radars(seen, near, frozenset(mine), sigma)
    return found


def _near(seen: Tracklets, first: int, second: int, sigma: Floats) -> _Near:
    """The pairs whose level distance leaves a chance of a hit."""
    mine, others = np.flatnonzero(seen.radar == first), np.flatnonzero(seen.radar == second)
    reach = np.concatenate([_reach_m(seen, mine, sigma[:3]), _reach_m(seen, others, sigma[3:])])
    one, other = _within_reach(seen, mine, others, reach[: len(mine)] + reach[len(mine) :].max())
    off = seen.state[one] - seen.state[other]
    noise = seen.covariance[one] + seen.covariance[other]
    velocity = seen.state[one, 3:]
    noise[:, :3, :3] += 2.0 * TIME_SIGMA_S**2 * velocity[:, :, None] * velocity[:, None, :]
    by_error = np.concatenate([seen.by_error[one], -seen.by_error[other]], axis=2)
    weight = np.linalg.inv(noise)
    told = by_error.transpose(0, 2, 1) @ weight
    square = (off[:, None, :] @ weight @ off[:, :, None])[:, 0, 0]
    return _Near(one, other, off, noise, by_error, told @ by_error, (told @ off[:, :, None])[..., 0], square)


def _within_reach(seen: Tracklets, mine: Ints, others: Ints, reach_m: Floats) -> tuple[Ints, Ints]:
    """The pairs of two radars' tracklets whose level distance is within each one's reach (n,), in order.

    The others are sorted by their east: only those of the strip about each are looked at.
    """
    others = others[np.argsort(seen.state[others, 0], kind="stable")]
    east = seen.state[others, 0]
    first = np.searchsorted(east, seen.state[mine, 0] - reach_m)
    count = np.searchsorted(east, seen.state[mine, 0] + reach_m, side="right") - first
    one = np.repeat(np.arange(len(mine)), count)
    place = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    other = others[place]
    off = seen.state[mine[one], :2] - seen.state[other, :2]
    near = np.hypot(off[:, 0], off[:, 1]) <= reach_m[one]
    return mine[one[near]], other[near]


def _reach_m(seen: Tracklets, rows: Ints, sigma: Floats) -> Floats:
    """How far off a tracklet's level position may be."""
    level = seen.by_error[rows, :2] * sigma
    variance = (level**2).sum(axis=(1, 2)) + seen.covariance[rows, 0, 0] + seen.covariance[rows, 1, 1]
    return np.asarray(4.0 * np.sqrt(variance) + 10.0)


def _of_two_radars(seen: Tracklets, near: _Near, one: frozenset[Pair], sigma: Floats) -> dict[Pair, bool | None]:
    """Each near pair judged with what those that are one tell of the two radars' errors."""
    pairs = [(seen.keys[i], seen.keys[j]) for i, j in zip(near.one.tolist(), near.other.tolist(), strict=True)]
    prior = np.diag(sigma**-2.0)
    alone = near.by_error @ np.diag(sigma**2) @ near.by_error.transpose(0, 2, 1)
    within = _is_within(near.off, near.noise + alone)
    telling = np.array([pair in one for pair in pairs], np.bool_) & within
    information = prior + near.information[telling].sum(axis=0)
    vector = near.vector[telling].sum(axis=0)
    # What a pair tells itself must not be what it is judged by.
    others = np.linalg.inv(information - near.information * telling[:, None, None])
    error = (others @ (vector - near.vector * telling[:, None])[..., None])[..., 0]
    errors = others + np.diag(np.minimum(sigma, np.array([*LEFT_OVER, *LEFT_OVER])) ** 2)
    off = near.off - (near.by_error @ error[..., None])[..., 0]
    scatter = near.noise + near.by_error @ errors @ near.by_error.transpose(0, 2, 1)
    hit = within & _is_within(off, scatter)
    distance = (off[:, None, :] @ np.linalg.inv(scatter) @ off[:, :, None])[:, 0, 0]
    shared = _are_shared(near, hit)
    found: dict[Pair, bool | None] = {pairs[row]: True for row in np.flatnonzero(hit & ~shared).tolist()}
    for group in _groups(near, np.flatnonzero(hit & shared).tolist()):
        own = [row for row in group if telling[row]]
        known_of = information - near.information[own].sum(axis=0), vector - near.vector[own].sum(axis=0)
        plain, worse = _plain(near, group, *known_of, distance)
        for row in group:
            known = pairs[row] in one
            found[pairs[row]] = True if row in plain else False if row in worse else True if known else None
    return {pair: found.get(pair, False) for pair in pairs if pair in found or pair in one}


def _is_within(off: Floats, scatter: Floats) -> Bools:
    """Whether positions, and velocities, are within their gates: (m, 6) and (m, 6, 6)."""
    parts = [(off[:, part], scatter[:, part, part]) for part in (slice(0, 3), slice(3, 6))]
    square = [(o[:, None, :] @ np.linalg.inv(s) @ o[:, :, None])[:, 0, 0] for o, s in parts]
    return np.asarray((square[0] <= GATE) & (square[1] <= GATE))


def _are_shared(near: _Near, hit: Bools) -> Bools:
    """Which pairs (m,) have a radar track that is also in another hit."""
    often = [np.bincount(rows[hit], minlength=int(rows.max()) + 1)[rows] > 1 for rows in (near.one, near.other)]
    return np.asarray(often[0] | often[1])


def _groups(near: _Near, rows: Sequence[int]) -> list[list[int]]:
    """Pairs that share a radar track, directly or by way of others, together."""
    group_of: dict[tuple[int, int], list[int]] = {}
    for row in rows:
        ends = (0, int(near.one[row])), (1, int(near.other[row]))
        known = [group_of[end] for end in ends if end in group_of]
        group = known[0] if known else []
        if len(known) == 2 and known[1] is not group:
            group += known[1]
            group_of.update(
                {(side, int(by[r])): group for r in known[1] for side, by in enumerate((near.one, near.other))}
            )
        group.append(row)
        group_of.update(dict.fromkeys(ends, group))
    return list({id(group): sorted(group) for group in group_of.values()}.values())


def _plain(
    near: _Near, group: Sequence[int], information: Floats, vector: Floats, distance: Floats
) -> tuple[set[int], set[int]]:
    """Of pairs that exclude each other, those that are plainly meant, and those that plainly are not."""
    ones, others = sorted({int(near.one[row]) for row in group}), sorted({int(near.other[row]) for row in group})
    if max(len(ones), len(others)) > SEVERAL_AT_MOST:
        return _plain_alone(near, group, distance)
    row_of = {(int(near.one[row]), int(near.other[row])): row for row in group}
    swap = len(ones) > len(others)
    few, many = (others, ones) if swap else (ones, others)
    told = []
    for chosen in permutations(many, len(few)):
        ends = [(m, f) if swap else (f, m) for f, m in zip(few, chosen, strict=True)]
        rows = [row_of[end] for end in ends if end in row_of]
        told.append((frozenset(rows), len(few) - len(rows)))
    most = min(missing for _, missing in told)
    sets = {rows for rows, missing in told if missing == most}
    cost = {rows: _left_over(near, sorted(rows), information, vector) for rows in sets}
    best = min(cost, key=lambda rows: (cost[rows], sorted(rows)))
    against = {row: min((cost[rows] for rows in sets if row not in rows), default=np.inf) for row in best}
    plain = {row for row in best if against[row] - cost[best] >= PLAIN}
    worse = {row for row in group if row not in best and _shares(near, row, plain)}
    return plain, worse


def _left_over(near: _Near, rows: Sequence[int], information: Floats, vector: Floats) -> float:
    """Chi-square of some pairs after the common errors that explain them, and those known before, best."""
    total, told = information + near.information[rows].sum(axis=0), vector + near.vector[rows].sum(axis=0)
    return float(near.square[rows].sum() - told @ np.linalg.solve(total, told))


def _plain_alone(near: _Near, group: Sequence[int], distance: Floats) -> tuple[set[int], set[int]]:
    """Those that are plain against every pair that they share a radar track with."""
    plain = set()
    for row in group:
        rivals = [r for r in group if r != row and (near.one[r] == near.one[row] or near.other[r] == near.other[row])]
        if all(distance[rival] - distance[row] >= PLAIN for rival in rivals):
            plain.add(row)
    return plain, {row for row in group if row not in plain and _shares(near, row, plain)}


def _shares(near: _Near, row: int, plain: set[int]) -> bool:
    return any(near.one[row] == near.one[other] or near.other[row] == near.other[other] for other in plain)
