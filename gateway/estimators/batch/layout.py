"""How the tracks of a batch lie beside each other: blocks of some tracks, of which each quantity is the last axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIDEST = 64  # tracks of a block: more do not fit the fast memory, fewer leave the vector instructions waiting
STEP = 8  # doubles of the widest vector registers


@dataclass(frozen=True, slots=True)
class Layout:
    """n tracks in blocks of a width; places beyond the last track are filled up with it."""

    tracks: int
    blocks: int
    width: int

    @classmethod
    def of(cls, tracks: int) -> Layout:
        """The layout of n tracks, n > 0."""
        blocks = -(-tracks // WIDEST)
        return cls(tracks, blocks, -(-tracks // (blocks * STEP)) * STEP)

    def laid(self, array: Floats) -> Floats:
        """An array (n, ...) as (b, ..., width); one row is that of every track."""
        if len(array) == 1:
            shape = (self.blocks, *array.shape[1:], self.width)
            return np.ascontiguousarray(np.broadcast_to(array[0, ..., None], shape))
        if len(array) < self.blocks * self.width:
            array = array[np.minimum(np.arange(self.blocks * self.width), len(array) - 1)]
        return np.ascontiguousarray(np.moveaxis(array.reshape(self.blocks, self.width, *array.shape[1:]), 1, -1))

    def once(self, array: Floats) -> Floats:
        """An array (1, ...) that is every track's as one block (1, ..., width)."""
        return np.ascontiguousarray(np.broadcast_to(array[..., None], (*array.shape, self.width)))

    def rows(self, array: Floats) -> Floats:
        """An array (b, ..., width) as (n, ...)."""
        return np.ascontiguousarray(np.moveaxis(array, -1, 1)).reshape(-1, *array.shape[1:-1])[: self.tracks]
