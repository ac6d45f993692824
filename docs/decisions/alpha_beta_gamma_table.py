"""Makes the table of gateway/estimators/steady_gains.py: the gain parameter of least mean square error, by simulation.

python docs/decisions/alpha_beta_gamma_table.py

A target whose acceleration takes a random step before each interval, measured with noise, is followed by filters that differ
in their gain parameter, all on the same draws; the least error is where a parabola through them has its bottom. One
interval, unit noise: only the ratio counts. What is simulated is the filters' error, not the target, which would wander off
further than numbers are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.steady_gains import gains, gamma_for, memory

Floats = NDArray[np.float64]

DECIBELS = range(-120, 31, 10)
TARGETS, UPDATES, SEED = 4000, 800, 1
TRIED = np.linspace(-1.0, 1.0, 9)  # about the last round's best, in the logarithm of gamma / (4 - gamma)
WIDTHS = (2.0, 0.5, 0.25, 0.25)  # how far; the first round takes the best one, the others the bottom of the parabola


def mean_square_error(gamma: Floats, ratio: float, rng: np.random.Generator) -> Floats:
    """Mean square position error (k,) after updates, in units of the noise's variance, of k filters on the same targets."""
    position, velocity, acceleration = (gain[:, None] for gain in gains(gamma, np.ones_like(gamma)))
    settling = int(6.0 / np.log(1.0 / memory(gamma)).min()) + 20
    s, v, a = np.zeros((3, len(gamma), TARGETS))
    total = np.zeros(len(gamma))
    for update in range(settling + UPDATES):
        a = a - ratio * rng.standard_normal(TARGETS)  # estimate less truth
        s, v = s + v + 0.5 * a, v + a
        residual = rng.standard_normal(TARGETS) - s
        s, v, a = s + position * residual, v + velocity * residual, a + acceleration * residual
        if update >= settling:
            total += (s * s).mean(axis=1)
    return total / UPDATES


def best_gamma(ratio: float) -> float:
    """The gain parameter of least error at a signal-to-noise ratio (amplitude)."""
    best = min(2.0 * ratio, 1.5)
    for width in WIDTHS:
        place = np.log(best / (4.0 - best)) + width * TRIED  # so spread, the curve is even to both sides
        error = mean_square_error(4.0 / (1.0 + np.exp(-place)), ratio, np.random.default_rng(SEED))
        found = place[error.argmin()]
        if width < 1.0:
            bend, slope, _ = np.polyfit(place - place.mean(), error, 2)
            found = place.mean() - slope / (2.0 * bend)
        best = float(4.0 / (1.0 + np.exp(-found)))
    return best


def closed_form(ratio: float) -> float:
    """The same from gamma = 2 r ratio, by halving."""
    low, high = 1e-12, 4.0 - 1e-12
    for _ in range(200):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if middle < 2.0 * ratio * memory(np.array(middle)) else (low, middle)
    return float(low)


if __name__ == "__main__":
    print("ratio dB    gamma  closed form  error over the least %  error between entries %")
    for decibels in DECIBELS:
        ratio = 10.0 ** (decibels / 20.0)
        found, exact = best_gamma(ratio), closed_form(ratio)
        between = ratio * 10.0**0.25
        pairs = (
            (np.array([found, exact]), ratio),
            (np.array([gamma_for(np.array(between**2)), closed_form(between)]), between),
        )
        worse = [np.divide(*mean_square_error(pair, at, np.random.default_rng(SEED + 1))) - 1.0 for pair, at in pairs]
        print(f"{decibels:8d} {found:8.3g} {exact:12.3g} {100.0 * worse[0]:23.3f} {100.0 * worse[1]:24.3f}", flush=True)
