"""What register tells of itself at each step: what is found of each radar, what is taken off, and how far pairs are apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

EACH = 4  # range, azimuth, elevation, time: of each radar, and in this order


@dataclass(frozen=True, slots=True)
class Residuals:
    """The pairs that were learnt in this step, k rows: what a radar measured less what the aircraft reported.

    Range m, azimuth rad, elevation rad, NaN where not measured. `before`: as measured; `after`: with what was taken off.
    """

    time: Ints  # (k,) ns, the validity of the report
    radar: Ints  # (k,)
    aircraft: tuple[str, ...]
    before: Floats  # (k, 3)
    after: Floats  # (k, 3)

    @classmethod
    def of(cls, some: Sequence[Residuals]) -> Residuals:
        """Those of several seconds together."""
        if not some:
            return cls.none()
        return cls(
            np.concatenate([one.time for one in some]),
            np.concatenate([one.radar for one in some]),
            tuple(name for one in some for name in one.aircraft),
            np.concatenate([one.before for one in some]),
            np.concatenate([one.after for one in some]),
        )

    @classmethod
    def none(cls) -> Residuals:
        """Nothing was learnt."""
        whole, real = np.zeros(0, np.int64), np.zeros((0, 3))
        return cls(whole, whole, (), real, real)


@dataclass(frozen=True, slots=True)
class Registered:
    """What is known of r radars, one row each: by how much each measures too much, in range m, azimuth rad to the left,
    elevation rad, and by how much its stamps are late, s.

    `error` and `sigma` are what pairs tell, NaN where they tell nothing. `applied`: whether that is what `correction` is, or
    is on its way to. `told_at`: when they were found, ns; `verdict`: of each error, in plain words, "" before the first.
    `source_m`: by how much all position sources say too much together, east, north, up, and `own_sigma_m`, how far
    each is off by itself, an axis. `prior_wrong`: that is more than was assumed of them: nothing of this is to be trusted.
    """

    radars: tuple[int, ...]
    correction: Floats  # (r, 4), what is taken off measurements of this instant
    error: Floats  # (r, 4)
    sigma: Floats  # (r, 4)
    applied: Bools  # (r, 4)
    verdict: tuple[tuple[str, str, str, str], ...]
    told_at: int | None = None
    source_m: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    source_sigma_m: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    own_sigma_m: float = math.nan
    prior_wrong: bool = False
    residuals: Residuals = field(default_factory=Residuals.none)

    @classmethod
    def untold(cls, radars: Sequence[int], correction: Floats) -> Registered:
        """Before anything was learnt: only what the site file has taken off."""
        shape = len(radars), EACH
        unknown, words = np.full(shape, math.nan), (("", "", "", ""),) * len(radars)
        return cls(tuple(radars), correction, unknown, unknown.copy(), np.zeros(shape, np.bool_), words)
