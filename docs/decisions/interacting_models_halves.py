"""How fast interacting models can be with the tracks as the last axis and half of every covariance, beside a textbook's loop.

PYTHONPATH=. python docs/decisions/interacting_models_halves.py

Mixing, carrying, correcting, weighing and combining, as `bench.estimation` has it, and nothing else: transitions and noise
are given, as they are to the textbook; no outliers, no error that is told, no memory of innovations. So it is the least that
this way can take. Of a covariance the lower half is kept, row after row, 66 of 121 numbers, each along all modes and tracks;
what is 0 in a transition or in the sensitivity costs nothing; who draws his mode anew draws by the shares, so that the
mixture of a mode is of two, its own and that of all modes.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.estimation_run import problem
from bench.estimation_sides import Problem, Run, States, ours, textbook

Floats = NDArray[np.float64]
Terms = list[list[tuple[int, Floats]]]  # of each row of the transitions: column and factor (m, 1)
SIZES, STEPS, TURNS = (1, 10, 100, 250, 500, 1000, 2000), 4, 3


@dataclass
class Tracks:
    """n tracks in m modes of d states: means (d, m, n), half covariances (h, m, n), weights (m, n), and all modes in one."""

    mean: Floats
    half: Floats
    weight: Floats
    joined: tuple[Floats, Floats]  # (d, n) and (h, n)


def row_of(half: Floats, i: int) -> Floats:
    """A row of the lower half, up to the diagonal."""
    return half[i * (i + 1) // 2 : (i + 1) * (i + 2) // 2]


def whole(half: Floats, size: int) -> Floats:
    """Both halves, (d, d, ...)."""
    i, j = np.indices((size, size))
    low, high = np.minimum(i, j), np.maximum(i, j)
    return half[high * (high + 1) // 2 + low]


def mixed(tracks: Tracks, keep: float, drawn: Floats, into: Floats) -> Floats:
    """The modes' weights after mixing; covariances (d, d, m, n) and behind them the means are written into (d, d + 1, m, n)."""
    size, (mean, joined) = len(tracks.mean), tracks.joined
    weight = drawn + keep * tracks.weight
    own, other = keep * tracks.weight / weight, drawn / weight
    off = tracks.mean - mean[:, None]
    np.add(mean[:, None], own * off, out=into[:, size])
    off *= np.sqrt(own * other)
    term = np.empty_like(off)
    for i in range(size):
        row = np.multiply(own, row_of(tracks.half, i), out=into[i, : i + 1])
        row += np.multiply(off[i], off[: i + 1], out=term[: i + 1])
        row += np.multiply(other, row_of(joined, i)[:, None], out=term[: i + 1])
        into[:i, i] = row[:i]
    return weight


def carried(terms: Terms, states: Floats, into: Floats, *, lower: bool = False) -> None:
    """Transitions times states (d, c, m, n), in each row all columns, or with `lower` those from the row's own on."""
    buffer = np.empty_like(into[0])
    for i, row in enumerate(terms):
        first = i if lower else 0
        found = into[i, first:]
        for place, (column, factor) in enumerate(row):
            term = np.multiply(factor, states[column, first:], out=buffer[first:] if place else found)
            if place:
                found += term


def corrected(half: Floats, mean: Floats, z: Floats, seen: list[list[int]], variance: float) -> tuple[Floats, Floats]:
    """Means, and the modes' log-likelihoods, after reports (k, n) of sums of states; the covariances are changed in place."""
    size, k = len(mean), len(seen)
    system = np.empty((k, k + size + 1, *mean.shape[1:]))
    for row, states, told in zip(system, seen, z, strict=True):
        for column in range(size):
            row[k + column] = sum(row_of(half, max(one, column))[min(one, column)] for one in states)
        for place, others in enumerate(seen):
            row[place] = sum(row[k + one] for one in others)
        row[-1] = told - sum(mean[one] for one in states)
    for i in range(k):
        system[i, i] += variance
    for i in range(k):  # S's root is divided out
        row = system[i, i:]
        row /= np.sqrt(row[0])
        system[i + 1 :, i + 1 :] -= row[1 : k - i, None] * row[1:]
    pull, off = system[:, k:-1], system[:, -1]
    product, term = np.empty_like(mean), np.empty_like(mean)
    for i in range(size):
        product[: i + 1] = pull[0, i] * pull[0, : i + 1]
        for one in pull[1:]:
            product[: i + 1] += np.multiply(one[i], one[: i + 1], out=term[: i + 1])
        row = row_of(half, i)
        row -= product[: i + 1]
    spread = 2.0 * sum(np.log(system[i, i]) for i in range(k)) + k * math.log(2.0 * math.pi)
    return mean + sum(one * part for one, part in zip(pull, off, strict=True)), -0.5 * (sum(off * off) + spread)


def in_one(mean: Floats, half: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Mean (d, n) and half covariance (h, n) of all modes."""
    middle = sum(mean[:, mode] * of_mode for mode, of_mode in enumerate(weight))
    off = (mean - middle[:, None]) * np.sqrt(weight)
    found, row, term = np.empty((len(half), half.shape[2])), np.empty_like(mean), np.empty_like(mean)
    for i in range(len(mean)):
        np.multiply(row_of(half, i), weight, out=row[: i + 1])
        row[: i + 1] += np.multiply(off[i], off[: i + 1], out=term[: i + 1])
        into = row_of(found, i)
        into[...] = row[: i + 1, 0]
        for mode in range(1, len(weight)):
            into += row[: i + 1, mode]
    return middle, found


def halves(given: Problem) -> Run:
    """The filter over all tracks of a problem together."""
    n, (m, d, _) = len(given.mean), given.carry.shape
    i, j = np.tril_indices(d)
    terms: Terms = [[(c, given.carry[:, r, c, None]) for c in range(d) if given.carry[:, r, c].any()] for r in range(d)]
    noise = given.noise[:, i, j].T[:, :, None]
    seen = [np.flatnonzero(row).tolist() for row in given.sensitivity]
    anew = float(given.chance[1, 0] / given.share[0])
    drawn = anew * given.share[:, None]
    full, once, twice = np.empty((d, d + 1, m, n)), np.empty((d, d + 1, m, n)), np.empty((d, d, m, n))

    def step(tracks: Tracks, z: Floats) -> Tracks:
        ahead = mixed(tracks, 1.0 - anew, drawn, full)
        carried(terms, full, once)
        carried(terms, once[:, :d].swapaxes(0, 1), twice.swapaxes(0, 1), lower=True)
        half = np.concatenate([twice[row, : row + 1] for row in range(d)])
        half += noise
        mean, likelihood = corrected(half, once[:, d], z.T, seen, given.variance)
        weight = ahead * np.exp(likelihood - likelihood.max(axis=0))
        weight /= sum(weight)
        return Tracks(mean, half, weight, in_one(mean, half, weight))

    mean = np.repeat(given.mean.T[:, None], m, axis=1)
    half = np.ascontiguousarray(np.broadcast_to(given.covariance[i, j][:, None, None], (len(i), m, n)))
    weight = np.repeat(given.share[:, None], n, axis=1)

    def run() -> States:
        tracks = Tracks(mean, half, weight, in_one(mean, half, weight))
        for z in given.measured:
            tracks = step(tracks, z)
        middle, joined = tracks.joined
        return middle.T, whole(joined, d).transpose(2, 0, 1)

    return run


def cost_us(run: Run, track_steps: int) -> float:
    """CPU microseconds a track and report."""
    began = time.process_time()
    run()
    return 1e6 * (time.process_time() - began) / track_steps


def main() -> None:
    """Turn by turn with the textbook's loop over twenty tracks: microseconds a track and report, and the ratios."""
    np.empty(1 << 22).fill(
        0.0
    )  # once freed, memory of this size is kept by glibc, and does not come new for each array
    some = problem(20, STEPS)
    wanted, found = textbook(some)(), halves(some)()
    sigma = np.sqrt(wanted[1].diagonal(axis1=1, axis2=2))
    size = sigma.shape[1]
    assert (np.abs(wanted[0] - found[0][:, :size]) < 1e-9 * sigma).all()
    assert (np.abs(wanted[1] - found[1][:, :size, :size]) < 1e-9 * sigma[:, :, None] * sigma[:, None]).all()
    print(f"{'tracks':>8}{'halves':>10}{'ours':>10}{'textbook / halves':>20}{'textbook / ours':>18}")
    for size in SIZES:
        given = problem(size, STEPS)
        steps = given.track_steps
        taken = []
        for _ in range(TURNS):
            repeats = max(50 // size, 1)
            here = [min(cost_us(way(given), steps) for _ in range(repeats)) for way in (halves, ours)]
            taken.append((cost_us(textbook(some), some.track_steps), *here))
        each = np.array(taken)
        ratio = np.median(each[:, :1] / each[:, 1:], axis=0)
        halved, own = np.median(each[:, 1:], axis=0)
        print(f"{size:>8}{halved:>10.1f}{own:>10.1f}{ratio[0]:>20.1f}{ratio[1]:>18.1f}")


if __name__ == "__main__":
    main()
