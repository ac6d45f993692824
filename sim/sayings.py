"""Messages of one name that an aircraft says: when, and what."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.scene import Aircraft, Scene

Floats = NDArray[np.float64]
Fields = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Sayings:
    """Messages of one name: when each arrives (n,), and a function from its index to its fields."""

    name: str
    arrives_s: Floats
    fields: Callable[[int], Fields]


def ticks(scene: Scene, aircraft: Aircraft, period_s: float) -> Floats:
    """Times of a message with a period, in whole ms; aircraft do not all speak at the same instant."""
    start, end = scene.present(aircraft)
    first = start + 0.037 * (aircraft.system - 1) % min(period_s, 1.0)
    return np.asarray(np.round(np.arange(first, end, period_s), 3), dtype=np.float64)


def boot_s(scene: Scene, aircraft: Aircraft, time_s: float) -> float:
    """A time of the scene by the aircraft's own clock, which runs since it was switched on, s."""
    start, _ = scene.present(aircraft)
    return time_s - start + scene.say.booted_before_s
