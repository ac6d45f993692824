"""Small symmetric matrices of many tracks, compiled: the tracks of a block lie beside each other as the last axis, L.

A symmetric matrix (d, d) is its lower triangle, row after row, (d (d + 1) / 2, L). Every loop over the lanes is one that the
compiler turns into vector instructions; nothing is done track by track but what hardly ever happens.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

try:
    import numba
except ImportError:  # the same loops, number by number: right, and far too slow to be of use
    numba = None

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Function = TypeVar("Function", bound=Callable[..., object])

INSTALLED = numba is not None


def _stamp() -> str:
    """A digest of all estimators' sources: machine code holds their constants, of which the compiler's cache knows nothing."""
    sources = sorted(Path(__file__).parents[1].rglob("*.py"))
    return hashlib.sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]


_STAMP = _stamp() if INSTALLED else ""


def compiled(function: Function) -> Function:
    """The function as machine code, kept for the next start; products and sums may be fused, nothing else is taken lightly."""
    if not INSTALLED:
        return function
    function.__qualname__ += f"_{_STAMP}"  # it is kept under this name
    made: Function = numba.njit(cache=True, fastmath={"contract"}, error_model="numpy")(function)
    return made


def is_kept(function: object) -> bool:
    """Whether machine code of a function is kept from an earlier start; without numba there is none to be made."""
    stats = getattr(function, "stats", None)
    if stats is None:
        return True
    name = getattr(function, "__qualname__", "")
    return any(Path(stats.cache_path).glob(f"*{name}*.nbi"))


@compiled
def at(i: int, j: int) -> int:
    """Where entry (i, j) of a symmetric matrix stands."""
    return i * (i + 1) // 2 + j if i >= j else j * (j + 1) // 2 + i


@compiled
def inverted(s: Floats, k: int, inverse: Floats, determinant: Floats) -> None:
    """The inverse (k, k, L) of positive matrices of which the lower triangle of s (k, k, L) is read, and the determinant (L,).

    By Cholesky's root: its inverse, and that one's square.
    """
    lanes = s.shape[-1]
    root = np.empty((k, k, lanes))
    determinant[:] = 1.0
    for i in range(k):
        for j in range(i):
            for lane in range(lanes):
                root[i, j, lane] = s[i, j, lane]
            for c in range(j):
                for lane in range(lanes):
                    root[i, j, lane] -= root[i, c, lane] * root[j, c, lane]
            for lane in range(lanes):
                root[i, j, lane] *= root[j, j, lane]  # the diagonal holds its inverses
        for lane in range(lanes):
            root[i, i, lane] = s[i, i, lane]
        for c in range(i):
            for lane in range(lanes):
                root[i, i, lane] -= root[i, c, lane] * root[i, c, lane]
        for lane in range(lanes):
            determinant[lane] *= root[i, i, lane]
        for lane in range(lanes):
            root[i, i, lane] = 1.0 / math.sqrt(root[i, i, lane])
    _root_inverted(root, k)
    for i in range(k):
        for j in range(i + 1):
            for lane in range(lanes):
                inverse[i, j, lane] = root[i, i, lane] * root[i, j, lane]
            for c in range(i + 1, k):
                for lane in range(lanes):
                    inverse[i, j, lane] += root[c, i, lane] * root[c, j, lane]
            for lane in range(lanes):
                inverse[j, i, lane] = inverse[i, j, lane]


@compiled
def _root_inverted(root: Floats, k: int) -> None:
    """The inverse of a lower triangle in its place; the diagonal holds its inverses already."""
    lanes = root.shape[-1]
    for i in range(1, k):
        for j in range(i):
            for lane in range(lanes):
                root[i, j, lane] *= root[j, j, lane]
            for c in range(j + 1, i):
                for lane in range(lanes):
                    root[i, j, lane] += root[i, c, lane] * root[c, j, lane]
            for lane in range(lanes):
                root[i, j, lane] *= -root[i, i, lane]


@compiled
def squared(inverse: Floats, y: Floats, k: int, square: Floats) -> None:
    """y' S^-1 y of (k, k, L) and (k, L), never less than 0."""
    lanes = inverse.shape[-1]
    square[:] = 0.0
    for i in range(k):
        for j in range(i):
            for lane in range(lanes):
                square[lane] += 2.0 * inverse[i, j, lane] * y[i, lane] * y[j, lane]
        for lane in range(lanes):
            square[lane] += inverse[i, i, lane] * y[i, lane] * y[i, lane]
    for lane in range(lanes):
        square[lane] = max(square[lane], 0.0)
