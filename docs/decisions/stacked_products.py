"""Whether a track's bits depend on how many tracks are worked in together, by the way that a product is written.

python docs/decisions/stacked_products.py
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SIZES = (1, 2, 3, 5, 8, 16, 33, 100, 1000)


def one_product(matrix: Floats, vectors: Floats) -> Floats:
    """Tracks as rows of one matrix: the library may sum in another order for another number of rows."""
    return np.asarray(vectors @ matrix.T)


def einsum_optimised(matrix: Floats, vectors: Floats) -> Floats:
    """The same, asked for in another way: optimised einsum calls the same library."""
    return np.asarray(np.einsum("ij,nj->ni", matrix, vectors, optimize=True))


def einsum_plain(matrix: Floats, vectors: Floats) -> Floats:
    """Plain einsum, loops of numpy's own."""
    return np.asarray(np.einsum("ij,nj->ni", matrix, vectors))


def stacked(matrix: Floats, vectors: Floats) -> Floats:
    """A small product for each track."""
    return np.asarray((matrix @ vectors[:, :, None])[:, :, 0])


WAYS: tuple[Callable[[Floats, Floats], Floats], ...] = (one_product, einsum_optimised, einsum_plain, stacked)


def changed(way: Callable[[Floats, Floats], Floats], trials: int = 200) -> float:
    """Share of trials in which the first track's bits differ between batches of some sizes."""
    generator, differing = np.random.default_rng(1), 0
    for _ in range(trials):
        matrix, vectors = generator.normal(size=(9, 9)), 1e4 * generator.normal(size=(max(SIZES), 9))
        bits = {way(matrix, np.ascontiguousarray(vectors[:size]))[0].tobytes() for size in SIZES}
        differing += len(bits) > 1
    return differing / trials


if __name__ == "__main__":
    print(f"{'9 x 9 matrix times n tracks':<30}{'bits depend on n':>20}")
    for way in WAYS:
        print(f"{way.__name__:<30}{100 * changed(way):>18.0f} %")
