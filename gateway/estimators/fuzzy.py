"""Subtractive clustering and fuzzy C-means, by which paper 002-7 finds the points that tracks have in common."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ACCEPTED, REFUSED = 0.5, 0.15  # shares of the first potential: Chiu's


def feature_points(points: Floats, radius: float = 0.06, squash: float = 1.5, at_most: int = 80) -> NDArray[np.intp]:
    """Which of the points (n, d), each within the unit box, stand for all of them: indices in the order they were found.

    The potential of a point is how many are near it; the point of most potential is taken, and takes potential off its
    neighbours, until little is left. Source: 002-7 2.3 (Chiu's subtractive clustering).
    """
    near, wide = 4.0 / radius**2, 4.0 / (squash * radius) ** 2
    squares = np.sum((points[:, None, :] - points[None, :, :]) ** 2, axis=-1)
    potential = np.exp(-near * squares).sum(axis=1)
    most = float(potential.max())
    chosen: list[int] = []
    while len(chosen) < at_most:
        best = int(np.argmax(potential))
        left = float(potential[best])
        if left < REFUSED * most:
            break
        if left < ACCEPTED * most and chosen:
            apart = float(np.sqrt(squares[best, chosen].min()))
            if apart / radius + left / most < 1.0:  # neither far from the others nor of much weight
                potential[best] = 0.0
                continue
        chosen.append(best)
        potential = potential - left * np.exp(-wide * squares[best])
    return np.array(chosen, dtype=np.intp)


def fuzzy_means(
    points: Floats, count: int = 30, fuzziness: float = 2.0, *, seed: int = 0, rounds: int = 200, least: float = 1e-4
) -> tuple[Floats, Floats]:
    """Centres (count, d) of points (n, d), and memberships (n, count) that sum to 1.

    Begins from points that lie far from each other, so that the same points have the same centres. Source: 002-7 3.2 (Bezdek).
    """
    centres = _spread(points, count, seed)
    power = -1.0 / (fuzziness - 1.0)
    membership = np.zeros((len(points), len(centres)))
    for _ in range(rounds):
        squares = np.maximum(_squares(points, centres), 1e-18)
        closeness = squares**power
        membership = closeness / closeness.sum(axis=1, keepdims=True)
        weights = membership**fuzziness
        moved = (weights.T @ points) / weights.sum(axis=0)[:, None]
        change = float(np.abs(moved - centres).max())
        centres = moved
        if change < least:
            break
    return centres, membership


def _spread(points: Floats, count: int, seed: int) -> Floats:
    """Points to begin from: each far from those before, by chance in proportion to the square (k-means++)."""
    generator = np.random.default_rng(seed)
    centres = points[generator.integers(len(points))][None]
    for _ in range(min(count, len(points)) - 1):
        nearest = _squares(points, centres).min(axis=1)
        total = float(nearest.sum())
        chances = nearest / total if total > 0.0 else None
        centres = np.concatenate([centres, points[generator.choice(len(points), p=chances)][None]])
    return np.asarray(centres)


def _squares(points: Floats, centres: Floats) -> Floats:
    """Squared distances (n, count)."""
    return np.asarray(np.sum((points[:, None, :] - centres[None, :, :]) ** 2, axis=-1))
