"""Modes that mix and then move, compiled, for blocks of tracks: what `modes.predict` does."""

from __future__ import annotations

import numpy as np

from gateway.estimators.batch.entering import ENTRIES, LEFT, PUSH, SHIFT, entered, flown, turned, usual
from gateway.estimators.batch.mixing import apart, mixed_from, put_back, summed
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
        apart(mean[b], covariance[b], off, spread)
        if anew:
            summed(weight[b], off, off[m])
            summed(weight[b], spread, spread[m])
        flown(weight[b], mean[b], speed, course)
        usual(course, speed, along_mps2, across_mps2, drag, drawn)
        whole[:] = 0.0
        noises[:] = 0.0
        for j in range(m):
            mixed_from(weight[b], chance[b], anew, j, weight_after[b, j], off, spread, shares, middle, mixed)
            put_back(mean[b, 0], middle)
            entered(elapsed_s[b], speed, turn[j], banked, least_rps, fades[j], scale[j], shape, power, entries)
            _lasting(response[b], holds[j], entries)
            turned(course, speed, along[j], across[j], least_rps, way)
            _moved_mean(middle, entries, mean_after[b, j])
            _noise(entries, way, drawn, grown[b], holds[j], noise, d)
            _moved(mixed, entries, noise, half, covariance_after[b, j], d)
            _added(weight_after[b, j], noise, noises)
            _added(weight_after[b, j], entries, whole)
        _manoeuvres(noises, share, d)
        _moved(error[b], whole, noises, half, error_after[b], d)


@compiled
def _lasting(response: Floats, holds: bool, entries: Floats) -> None:
    """The entries of an acceleration that lasts; 0 in modes that hold none."""
    for p in range(3):
        for lane in range(entries.shape[1]):
            entries[SHIFT + p, lane] = response[p, lane] if holds else 0.0


@compiled
def _added(weight: Floats, part: Floats, whole: Floats) -> None:
    """A mode's part (p, L) in what all have, by its weight."""
    for p in range(len(part)):
        for lane in range(len(weight)):
            whole[p, lane] += weight[lane] * part[p, lane]


@compiled
def _manoeuvres(noises: Floats, share: float, d: int) -> None:
    """Of the modes' noise the told error gets a share; of the source's error all."""
    for i in range(d):
        for c in range(i + 1):
            if c < 6 or i > 8:
                for lane in range(noises.shape[1]):
                    noises[at(i, c), lane] *= share


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
