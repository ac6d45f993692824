"""Four generations of autopilot: mechanical, PID, adaptive, expert; each an order to the rudder from heading and rate.

    mechanical   rudder = P error                          the helm follows the compass; nothing meets the swing
    pid          P error - D rate + helm                   by pole placement; the rate is measured, never the error's difference
    adaptive     the same, placed anew at each speed       K ~ U, T ~ 1/U
    expert       the first rule that applies               `expert.py`

`helm` is the integral: the rudder that holds her against a steady wind. It is learnt only near the wanted heading and while the
order is not at the stops (conditional integration), or a turn would wind it up. The adaptive one is scheduled, not self-tuning or
model-following as the two families that the print names: speed is what changes a ship, and a log tells it.

Source: 002-5 1.1 to 1.4, 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.geodesy import wrap_rad
from sim.ships.hull import STEERAGE_MPS, Hull, swing
from sim.ships.wave_filter import WaveFilter, wave_filter
from sim.ships.waves import Waves

Floats = NDArray[np.float64]

BANDWIDTH_RADPS, DAMPING, HOLDING = 0.05, 0.9, 0.1  # of the closed loop; the third pole as a share of the bandwidth
LEARNS_WITHIN_RAD = math.radians(3.0)
HELM_LIMIT_RAD = math.radians(10.0)
KINDS = ("mechanical", "pid", "adaptive", "expert")


@dataclass(frozen=True, slots=True)
class Steering:
    """What a law of steering goes by, each (...): error to the wanted heading, rate, speed, rudder and standing helm."""

    error_rad: Floats
    rate_radps: Floats
    speed_mps: Floats
    rudder_rad: Floats
    helm_rad: Floats


class Law(Protocol):
    """From what is seen to the order to the rudder and the standing helm, each (...)."""

    def __call__(self, seen: Steering, step_s: float) -> tuple[Floats, Floats]:
        """The order and the helm after a step."""


@dataclass(frozen=True, slots=True)
class Gains:
    """Rudder for error, for its integral (1/s) and against the rate (s), each (...)."""

    proportional: Floats | float
    integral: Floats | float = 0.0
    derivative: Floats | float = 0.0


def place_poles(
    gain_per_s: ArrayLike, lag_s: ArrayLike, bandwidth_radps: ArrayLike = BANDWIDTH_RADPS, damping: float = DAMPING
) -> Gains:
    """The gains (...) that give Nomoto's ship with K and T (...) the poles of a second-order system and a slow third.

    T s^3 + (1 + K D) s^2 + K P s + K I = T (s^2 + 2 z w s + w^2)(s + h w), h being `HOLDING`.
    """
    gain, lag, w = (np.asarray(one, dtype=np.float64) for one in (gain_per_s, lag_s, bandwidth_radps))
    slow = HOLDING * w
    proportional = lag * (w * w + 2.0 * damping * w * slow) / gain
    derivative = (lag * (2.0 * damping * w + slow) - 1.0) / gain
    return Gains(proportional, lag * w * w * slow / gain, derivative)


@dataclass(frozen=True, slots=True)
class Pid:
    """The classical law with fixed gains; without integral and derivative the mechanical one."""

    gains: Gains
    limit_rad: float
    learns_within_rad: float = LEARNS_WITHIN_RAD

    def __call__(self, seen: Steering, step_s: float) -> tuple[Floats, Floats]:
        """The order and the helm after a step."""
        gains = self.gains
        order = gains.proportional * seen.error_rad - gains.derivative * seen.rate_radps + seen.helm_rad
        learns = (np.abs(seen.error_rad) < self.learns_within_rad) & (np.abs(order) < self.limit_rad)
        learnt = seen.helm_rad + np.where(learns, gains.integral * seen.error_rad * step_s, 0.0)
        return np.asarray(order), np.clip(learnt, -HELM_LIMIT_RAD, HELM_LIMIT_RAD)


@dataclass(frozen=True, slots=True)
class Adaptive:
    """The PID law placed anew for the speed that the log tells: the same time constant in ship's lengths, not in seconds."""

    hull: Hull
    bandwidth_radps: float = BANDWIDTH_RADPS  # at the hull's own speed

    def __call__(self, seen: Steering, step_s: float) -> tuple[Floats, Floats]:
        """The order and the helm after a step."""
        hull, speed = self.hull, seen.speed_mps
        w = self.bandwidth_radps * np.maximum(speed, STEERAGE_MPS) / hull.speed_mps
        gains = place_poles(hull.gain_at(speed), hull.lag_at(speed), w)
        return Pid(gains, hull.rudder_limit_rad)(seen, step_s)


@dataclass(frozen=True, slots=True)
class Autopilot:
    """A law of steering with what it needs to know of the ship; `waves` is its filter of them, None without one."""

    hull: Hull
    law: Law
    waves: WaveFilter | None = None

    def start(self, heading_rad: Floats) -> Memory:
        """Nothing learnt yet, on headings (...)."""
        known = None if self.waves is None else self.waves.start(heading_rad)
        return Memory(np.zeros_like(heading_rad), np.zeros_like(heading_rad), known)


@dataclass(frozen=True, slots=True)
class Memory:
    """What an autopilot remembers of ships (...): where the rudder is by its orders, the helm, the wave filter's states."""

    rudder_rad: Floats
    helm_rad: Floats
    filtered: Floats | None

    def heading(self, measured_rad: Floats) -> Floats:
        """The heading to go by (...), rad: what the filter left, or what was measured."""
        return measured_rad if self.filtered is None else np.asarray(self.filtered[..., 2])


def listen(
    autopilot: Autopilot, memory: Memory, heading_rad: Floats, rate_radps: Floats, ordered_rad: Floats, step_s: float
) -> Memory:
    """What an autopilot knows (...) after a step under its last order, with heading and rate measured at its end."""
    rudder = swing(autopilot.hull, memory.rudder_rad, ordered_rad, step_s)
    if autopilot.waves is None or memory.filtered is None:
        return Memory(rudder, memory.helm_rad, None)
    mean = 0.5 * (memory.rudder_rad + rudder)
    return Memory(rudder, memory.helm_rad, autopilot.waves.step(memory.filtered, mean, heading_rad, rate_radps))


def steer(
    autopilot: Autopilot,
    memory: Memory,
    heading_rad: Floats,
    rate_radps: Floats,
    speed_mps: Floats,
    wanted_rad: Floats,
    step_s: float,
) -> tuple[Floats, Memory]:
    """The order to the rudder (...), within its limits, and what is remembered after it."""
    rate = rate_radps if memory.filtered is None else memory.filtered[..., 3]
    error = wrap_rad(wanted_rad - memory.heading(heading_rad))
    order, helm = autopilot.law(Steering(error, rate, speed_mps, memory.rudder_rad, memory.helm_rad), step_s)
    limit = autopilot.hull.rudder_limit_rad
    return np.clip(order, -limit, limit), Memory(memory.rudder_rad, helm, memory.filtered)


def build_autopilot(kind: str, hull: Hull, sea: Waves | None, step_s: float) -> Autopilot:
    """One of `KINDS` for a hull, with a filter of the sea's waves where one is given.

    The mechanical one answers a degree with a degree. Raises ValueError for another kind.
    """
    from sim.ships.expert import Expert

    placed = place_poles(hull.gain_per_s, hull.lag_s)
    laws: dict[str, Law] = {
        "mechanical": Pid(Gains(1.0), hull.rudder_limit_rad),
        "pid": Pid(placed, hull.rudder_limit_rad),
        "adaptive": Adaptive(hull),
        "expert": Expert(hull, Pid(placed, hull.rudder_limit_rad)),
    }
    if kind not in laws:
        raise ValueError(f"there is no autopilot {kind!r}; there are {', '.join(KINDS)}")
    return Autopilot(hull, laws[kind], None if sea is None else wave_filter(hull, hull.speed_mps, sea, step_s))
