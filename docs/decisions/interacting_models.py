"""What it costs to carry the covariances of five modes of eleven states to the next report, by the way that it is written.

python docs/decisions/interacting_models.py        `compiled` needs numba; without it that way is left out
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import SIZE, Motion
from gateway.estimators.modes import Modes, moved
from gateway.fuse.flying import modes_of
from gateway.settings import Estimation, Options

Floats = NDArray[np.float64]
Way = Callable[[Floats, Floats], Floats]
SIZES = (1, 10, 100, 1000)
LEAST_S, TURNS = 0.02, 15


def stacked(carry: Floats, covariance: Floats) -> Floats:
    """F P F', (n, m, d, d), as the gateway has it: a product of small matrices for each track and mode."""
    return np.asarray(carry @ covariance @ carry.swapaxes(-1, -2))


def tracks_last(carry: Floats, covariance: Floats) -> Floats:
    """The same for (d, d, m, n), entry by entry of the transition that is not 0, each along all tracks at once."""
    found = covariance.copy()
    for rows in (found, found.swapaxes(0, 1)):
        speed, held = rows[3:5], rows[SIZE:]
        rows[0:2] += carry[0, 3] * speed
        rows[0] += carry[0, 4] * rows[4]
        rows[1] += carry[1, 3] * rows[3]
        rows[0:2] += carry[0, SIZE] * held
        rows[2] += carry[2, 5] * rows[5]
        faster = carry[3, 3] * speed
        faster[0] += carry[3, 4] * rows[4]
        faster[1] += carry[4, 3] * rows[3]
        faster += carry[3, SIZE] * held
        rows[3:5] = faster
        rows[6:SIZE] *= carry[6, 6]
        rows[SIZE:] *= carry[SIZE, SIZE]
    return found


def compiled() -> Way | None:
    """The same in loops for (n, m, d, d), compiled by numba, or None without it."""
    if importlib.util.find_spec("numba") is None:
        return None
    from numba import njit

    def loops(carry: Floats, covariance: Floats) -> Floats:
        found = np.empty_like(covariance)
        tracks, modes, size, _ = covariance.shape
        left = np.empty((size, size))
        for track in range(tracks):
            for mode in range(modes):
                f, p, into = carry[track, mode], covariance[track, mode], found[track, mode]
                for turn in range(2):
                    for k in range(size):
                        x = p[:, k] if turn == 0 else left[k]
                        y = left[:, k] if turn == 0 else into[k]
                        y[0] = x[0] + f[0, 3] * x[3] + f[0, 4] * x[4] + f[0, 9] * x[9]
                        y[1] = x[1] + f[1, 3] * x[3] + f[1, 4] * x[4] + f[1, 10] * x[10]
                        y[2] = x[2] + f[2, 5] * x[5]
                        y[3] = f[3, 3] * x[3] + f[3, 4] * x[4] + f[3, 9] * x[9]
                        y[4] = f[4, 3] * x[3] + f[4, 4] * x[4] + f[4, 10] * x[10]
                        y[5] = x[5]
                        for state in range(6, 11):
                            y[state] = f[state, state] * x[state]
        return found

    made: Way = njit(loops)
    return made


def problem(tracks: int) -> tuple[Floats, Floats]:
    """Transitions over a second and covariances, (n, m, d, d), of the default modes."""
    modes = modes_of(Options(estimator="imm"), Motion((1.0,) * 3, 20.0), Estimation())
    assert isinstance(modes, Modes)
    random, size = np.random.default_rng(1), SIZE + 2
    mean = random.normal(0.0, 60.0, (tracks, modes.count, size))
    carry, _ = moved(mean, np.full(mean.shape[:2], 1.0 / modes.count), np.ones(tracks), modes)
    root = random.normal(size=(tracks, modes.count, size, size))
    return carry, root @ root.swapaxes(-1, -2)


def cost_us(way: Way, carry: Floats, covariance: Floats) -> float:
    """CPU microseconds for all tracks, the least of some turns."""
    least = np.inf
    for _ in range(TURNS):
        count, began = 0, time.process_time()
        while time.process_time() - began < LEAST_S:
            way(carry, covariance)
            count += 1
        least = min(least, (time.process_time() - began) / count)
    return 1e6 * least


def main() -> None:
    """The table, microseconds a track; all ways agree."""
    by_loops = compiled()
    if by_loops is None:
        print("numba is not installed, compiled is left out: pip install numba")
    print(f"{'tracks':>8}{'stacked':>12}{'tracks last':>14}{'compiled':>12}")
    for tracks in SIZES:
        carry, covariance = problem(tracks)
        laid = [np.ascontiguousarray(part.transpose(2, 3, 1, 0)) for part in (carry, covariance)]
        wanted = stacked(carry, covariance)
        np.testing.assert_allclose(tracks_last(laid[0], laid[1]).transpose(3, 2, 0, 1), wanted, rtol=1e-9, atol=1e-9)
        row = [cost_us(stacked, carry, covariance), cost_us(tracks_last, laid[0], laid[1])]
        if by_loops is not None:
            np.testing.assert_allclose(by_loops(carry, covariance), wanted, rtol=1e-9, atol=1e-9)
            row.append(cost_us(by_loops, carry, covariance))
        print(
            f"{tracks:>8}"
            + "".join(f"{one / tracks:>{width}.2f}" for one, width in zip(row, (12, 14, 12), strict=False))
        )


if __name__ == "__main__":
    main()
