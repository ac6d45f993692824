"""Modes that mix and then move, compiled, for blocks of tracks: what `modes.predict` does."""

from __future__ import annotations

import numpy as np

from gateway.estimators.batch.entering import ENTRIES, LEFT, PUSH, SHIFT, entered, flown, turned, usual
from gateway.estimators.batch.packed import Bools, Floats, Ints, at, compiled
from gateway.estimators.turning import (
    ACROSS,
    ALONG,
    ASIDE,
    BACK,
    BOTH,
    CLIMB,
    CLIMBING,
    COSINE,
    ERROR,
    HEIGHT,
    KEEP,
    OTHER,
    PLACE,
    RIGHT,
    SINE,
    SPEED,
    TIME,
)


@compiled
def mixed_and_moved(
    mean: Floats,
    covariance: Floats,
    weight: Floats,
    error: Floats,
    chance: Floats,
    anew: bool,
    elapsed_s: Floats,
    response: Floats,
    grown: Floats,
    turn: Floats,
    fades: Floats,
    scale: Floats,
    along: Floats,
    across: Floats,
    holds: Bools,
    shape: Ints,
    power: Ints,
    set_of: Floats,
    mean_after: Floats,
    covariance_after: Floats,
    weight_after: Floats,
    error_after: Floats,
) -> None:
    """All blocks. Means (b, m, d, L), covariances (b, m, t, L), weights (b, m, L), the told error (b, t, L); the modes'
    transition (b, m, m, L), and whether by it modes are drawn anew whatever they were; times (b, L), and over these what becomes
    of an acceleration that lasts, (b, 3, L) and (b, 6, L). Of the modes: `mode_set.Numbers` (m, ...), `across` 0 where noise is
    alike. Of the set: g times the tangent of the bank, the least turn rate, the lasting acceleration along and across and its
    drag, and which share of the noise the error gets.
    """
    lanes = mean.shape[-1]
    blocks, m, d, _ = mean.shape
    t = covariance.shape[2]
    off, spread = np.empty((m + 1, d, lanes)), np.empty((m + 1, t, lanes))
    shares, middle = np.empty((m, lanes)), np.empty((d, lanes))
    mixed, half = np.empty((t, lanes)), np.empty((d, d, lanes))
    noise, noises, whole = np.empty((t, lanes)), np.empty((t, lanes)), np.empty((ENTRIES, lanes))
    speed, course, entries = np.empty(lanes), np.empty((2, lanes)), np.zeros((ENTRIES, lanes))
    way, drawn = np.empty((3, lanes)), np.empty((3, lanes))
    banked, least_rps, along_mps2, across_mps2, drag, share = set_of
    for b in range(blocks):
        _apart(mean[b], covariance[b], off, spread)
        if anew:
            _summed(weight[b], off, off[m])
            _summed(weight[b], spread, spread[m])
        flown(weight[b], mean[b], speed, course)
        usual(course, speed, along_mps2, across_mps2, drag, drawn)
        whole[:] = 0.0
        noises[:] = 0.0
        for j in range(m):
            _shares(weight[b], chance[b], j, shares, weight_after[b, j])
            if anew:
                _of_two(weight[b], chance[b], j, weight_after[b, j], off, spread, middle, mixed)
            else:
                _summed(shares, off, middle)
                _summed(shares, spread, mixed)
                _about_mean(middle, mixed)
            for i in range(d):
                for lane in range(lanes):
                    middle[i, lane] += mean[b, 0, i, lane]
            entered(elapsed_s[b], speed, turn[j], banked, least_rps, fades[j], scale[j], shape, power, entries)
            for p in range(3):
                for lane in range(lanes):
                    entries[SHIFT + p, lane] = response[b, p, lane] if holds[j] else 0.0
            turned(course, speed, along[j], across[j], least_rps, way)
            _moved_mean(middle, entries, mean_after[b, j])
            _noise(entries, way, drawn, grown[b], holds[j], noise, d)
            _moved(mixed, entries, noise, half, covariance_after[b, j], d)
            for p in range(t):
                for lane in range(lanes):
                    noises[p, lane] += weight_after[b, j, lane] * noise[p, lane]
            for p in range(ENTRIES):
                for lane in range(lanes):
                    whole[p, lane] += weight_after[b, j, lane] * entries[p, lane]
        for i in range(d):
            for c in range(i + 1):
                if c < 6 or i > 8:  # of the source's error all of the noise
                    for lane in range(lanes):
                        noises[at(i, c), lane] *= share
        _moved(error[b], whole, noises, half, error_after[b], d)


@compiled
def _apart(mean: Floats, covariance: Floats, off: Floats, spread: Floats) -> None:
    """Means as differences from the first mode's, and the second moments about that."""
    lanes = mean.shape[-1]
    m, d, _ = mean.shape
    for i in range(m):
        for r in range(d):
            for lane in range(lanes):
                off[i, r, lane] = mean[i, r, lane] - mean[0, r, lane]
        for r in range(d):
            for c in range(r + 1):
                for lane in range(lanes):
                    spread[i, at(r, c), lane] = covariance[i, at(r, c), lane] + off[i, r, lane] * off[i, c, lane]


@compiled
def _summed(share: Floats, parts: Floats, whole: Floats) -> None:
    """Sums (p, L) of parts (m, p, L) in shares (m, L), two at a time: what takes long is fetching and storing."""
    m, lanes = share.shape
    for p in range(parts.shape[1]):
        for lane in range(lanes):
            whole[p, lane] = share[0, lane] * parts[0, p, lane]
        for i in range(1, m - 1, 2):
            for lane in range(lanes):
                whole[p, lane] += share[i, lane] * parts[i, p, lane] + share[i + 1, lane] * parts[i + 1, p, lane]
        if m % 2 == 0:
            for lane in range(lanes):
                whole[p, lane] += share[m - 1, lane] * parts[m - 1, p, lane]


@compiled
def _shares(weight: Floats, chance: Floats, j: int, shares: Floats, after: Floats) -> None:
    """The shares (m, L) of which mode j is made, and its weight after mixing."""
    m, lanes = weight.shape
    after[:] = 0.0
    for i in range(m):
        for lane in range(lanes):
            shares[i, lane] = weight[i, lane] * chance[i, j, lane]
            after[lane] += shares[i, lane]
    for i in range(m):
        for lane in range(lanes):
            shares[i, lane] /= after[lane]


@compiled
def _of_two(
    weight: Floats, chance: Floats, j: int, after: Floats, off: Floats, spread: Floats, middle: Floats, mixed: Floats
) -> None:
    """The same where who leaves any mode comes to mode j with one chance: mode j is made of what it was, and of all modes.

    Off and spread (m + 1, ..., L) are the modes', and last those of all by their weights.
    """
    m, lanes = weight.shape
    d = len(middle)
    from_all, from_own = np.empty(lanes), np.empty(lanes)
    for lane in range(lanes):
        come = chance[(j + 1) % m, j, lane]
        from_all[lane] = come / after[lane]
        from_own[lane] = weight[j, lane] * (chance[j, j, lane] - come) / after[lane]
    for r in range(d):
        for lane in range(lanes):
            middle[r, lane] = from_all[lane] * off[m, r, lane] + from_own[lane] * off[j, r, lane]
        for c in range(r + 1):
            p = at(r, c)
            for lane in range(lanes):
                mixed[p, lane] = (
                    from_all[lane] * spread[m, p, lane]
                    + from_own[lane] * spread[j, p, lane]
                    - middle[r, lane] * middle[c, lane]
                )


@compiled
def _about_mean(middle: Floats, mixed: Floats) -> None:
    """Second moments (t, L) become covariances."""
    d, lanes = middle.shape
    for r in range(d):
        for c in range(r + 1):
            for lane in range(lanes):
                mixed[at(r, c), lane] -= middle[r, lane] * middle[c, lane]


@compiled
def _moved_mean(mean: Floats, entries: Floats, after: Floats) -> None:
    """A mean (d, L) a time later."""
    lanes = mean.shape[-1]
    for lane in range(lanes):
        east, north = mean[3, lane], mean[4, lane]
        after[0, lane] = mean[0, lane] + entries[ALONG, lane] * east + entries[BACK, lane] * north
        after[1, lane] = mean[1, lane] + entries[ACROSS, lane] * east + entries[ALONG, lane] * north
        after[2, lane] = mean[2, lane] + entries[TIME, lane] * mean[5, lane]
        after[3, lane] = entries[COSINE, lane] * east + entries[RIGHT, lane] * north
        after[4, lane] = entries[SINE, lane] * east + entries[COSINE, lane] * north
        after[5, lane] = mean[5, lane]
    for i in range(6, 9):
        for lane in range(lanes):
            after[i, lane] = entries[KEEP, lane] * mean[i, lane]
    for axis in range(len(mean) - 9):
        for lane in range(lanes):
            held = mean[9 + axis, lane]
            after[axis, lane] += entries[SHIFT, lane] * held
            after[3 + axis, lane] += entries[PUSH, lane] * held
            after[9 + axis, lane] = entries[LEFT, lane] * held


@compiled
def _moved(p: Floats, e: Floats, noise: Floats, half: Floats, after: Floats, d: int) -> None:
    """F P F' + Q of packed (t, L), F being made of the entries; `half` (d, d, L) is scratch for F P."""
    lanes = p.shape[-1]
    for c in range(d):
        for lane in range(lanes):
            east, north = p[at(3, c), lane], p[at(4, c), lane]
            half[0, c, lane] = p[at(0, c), lane] + e[ALONG, lane] * east + e[BACK, lane] * north
            half[1, c, lane] = p[at(1, c), lane] + e[ACROSS, lane] * east + e[ALONG, lane] * north
            half[3, c, lane] = e[COSINE, lane] * east + e[RIGHT, lane] * north
            half[4, c, lane] = e[SINE, lane] * east + e[COSINE, lane] * north
        for lane in range(lanes):
            half[2, c, lane] = p[at(2, c), lane] + e[TIME, lane] * p[at(5, c), lane]
            half[5, c, lane] = p[at(5, c), lane]
        for i in range(6, 9):
            for lane in range(lanes):
                half[i, c, lane] = e[KEEP, lane] * p[at(i, c), lane]
        for axis in range(d - 9):
            for lane in range(lanes):
                held = p[at(9 + axis, c), lane]
                half[axis, c, lane] += e[SHIFT, lane] * held
                half[3 + axis, c, lane] += e[PUSH, lane] * held
                half[9 + axis, c, lane] = e[LEFT, lane] * held
    for i in range(d):
        row, first = half[i], at(i, 0)
        q, to = noise[first:], after[first:]
        for lane in range(lanes):
            to[0, lane] = q[0, lane] + row[0, lane] + e[ALONG, lane] * row[3, lane] + e[BACK, lane] * row[4, lane]
        if i >= 1:
            for lane in range(lanes):
                to[1, lane] = q[1, lane] + row[1, lane] + e[ACROSS, lane] * row[3, lane] + e[ALONG, lane] * row[4, lane]
        if i >= 2:
            for lane in range(lanes):
                to[2, lane] = q[2, lane] + row[2, lane] + e[TIME, lane] * row[5, lane]
        if i >= 3:
            for lane in range(lanes):
                to[3, lane] = q[3, lane] + e[COSINE, lane] * row[3, lane] + e[RIGHT, lane] * row[4, lane]
        if i >= 4:
            for lane in range(lanes):
                to[4, lane] = q[4, lane] + e[SINE, lane] * row[3, lane] + e[COSINE, lane] * row[4, lane]
        if i >= 5:
            for lane in range(lanes):
                to[5, lane] = q[5, lane] + row[5, lane]
        for j in range(6, min(i + 1, 9)):
            for lane in range(lanes):
                to[j, lane] = q[j, lane] + e[KEEP, lane] * row[j, lane]
        for axis in range(d - 9):
            held = row[9 + axis]
            if i >= axis:
                for lane in range(lanes):
                    to[axis, lane] += e[SHIFT, lane] * held[lane]
            if i >= 3 + axis:
                for lane in range(lanes):
                    to[3 + axis, lane] += e[PUSH, lane] * held[lane]
            if i >= 9 + axis:
                for lane in range(lanes):
                    to[9 + axis, lane] = q[9 + axis, lane] + e[LEFT, lane] * held[lane]


@compiled
def _noise(e: Floats, way: Floats, drawn: Floats, grown: Floats, holds: bool, noise: Floats, d: int) -> None:
    """The noise (t, L) of a mode: level (times its way), upright, of the source's error, and of the acceleration that lasts."""
    lanes = e.shape[-1]
    noise[:] = 0.0
    for lane in range(lanes):
        xx, xy, yy = way[0, lane], way[1, lane], way[2, lane]
        noise[at(0, 0), lane] = e[PLACE, lane] * xx
        noise[at(1, 0), lane] = e[PLACE, lane] * xy
        noise[at(1, 1), lane] = e[PLACE, lane] * yy
        noise[at(3, 0), lane] = e[BOTH, lane] * xx
        noise[at(3, 1), lane] = e[BOTH, lane] * xy + e[OTHER, lane]
        noise[at(4, 0), lane] = e[BOTH, lane] * xy + e[ASIDE, lane]
        noise[at(4, 1), lane] = e[BOTH, lane] * yy
    for lane in range(lanes):
        noise[at(3, 3), lane] = e[SPEED, lane] * way[0, lane]
        noise[at(4, 3), lane] = e[SPEED, lane] * way[1, lane]
        noise[at(4, 4), lane] = e[SPEED, lane] * way[2, lane]
        noise[at(2, 2), lane] = e[HEIGHT, lane]
        noise[at(5, 2), lane] = e[CLIMBING, lane]
        noise[at(5, 5), lane] = e[CLIMB, lane]
        noise[at(6, 6), lane] = e[ERROR, lane]
        noise[at(7, 7), lane] = e[ERROR, lane]
        noise[at(8, 8), lane] = e[ERROR, lane]
    if d == 9:
        return
    if not holds:
        for lane in range(lanes):
            noise[at(9, 9), lane] = drawn[0, lane]
            noise[at(10, 9), lane] = drawn[1, lane]
            noise[at(10, 10), lane] = drawn[2, lane]
        return
    level = (0, 3, 9)
    for p in range(3):
        for q in range(p + 1):
            r, c = level[p], level[q]
            for lane in range(lanes):
                of_both = grown[at(p, q), lane]
                noise[at(r, c), lane] += of_both * drawn[0, lane]
                noise[at(r + 1, c), lane] += of_both * drawn[1, lane]
                noise[at(r + 1, c + 1), lane] += of_both * drawn[2, lane]
            if p > q:
                for lane in range(lanes):
                    noise[at(r, c + 1), lane] += grown[at(p, q), lane] * drawn[1, lane]
