"""Predict: where it will be, and how sure that is. For now at constant velocity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Predicted:
    """Predicted points, n rows."""

    made: Ints  # (n,) ns
    track: Ints
    valid: Ints  # (n,) ns
    horizon_s: Floats
    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats
    sigma_m: Floats  # horizontal, 1 sigma an axis
    method: tuple[str, ...]  # "two segments", "model"
    intent: tuple[str | None, ...]
    intent_kind: tuple[str | None, ...]  # "declared", "inferred"
    confidence: Floats  # NaN where there is no intent
    runway_m: Floats  # (n, 3)
