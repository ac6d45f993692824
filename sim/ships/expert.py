"""The expert autopilot: what a helmsman does, as rules; the first that applies gives the order.

    steady so     within 0.3 degrees and not swinging: the rudder stays at the standing helm
    meet her      closing so fast that she would swing past: as much opposite rudder as stops her on the wanted heading
    hard over     more than 25 degrees off: full rudder towards it
    steady        else: the PID law, which also learns the standing helm

Meeting begins when stopping will take `MEETS_AT` of the full rudder by the time the rudder is there, and goes on to the last
degree or until the swing is stopped: the rudder that already opposes it is what is remembered. The rules use this hull's K and
T, which a helmsman learns of a ship in her first turns.

Source: 002-5 1.4, 3 (an expert module; the print gives no rules).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.ships.autopilots import Pid, Steering
from sim.ships.hull import Hull

Floats = NDArray[np.float64]

RULES = ("steady so", "meet her", "hard over", "steady")
FAR_RAD, NEAR_RAD, BAND_RAD = math.radians(25.0), math.radians(1.0), math.radians(0.3)
STILL_RADPS = math.radians(0.03)
MEETS_AT = 0.6  # of the full rudder


@dataclass(frozen=True, slots=True)
class Expert:
    """The rules for one hull; `holds` is the law near the wanted heading."""

    hull: Hull
    holds: Pid

    def __call__(self, seen: Steering, step_s: float) -> tuple[Floats, Floats]:
        """The order and the helm after a step."""
        held, helm = self.holds(seen, step_s)
        side = np.sign(seen.error_rad)
        met = np.minimum(self.stopping_rudder(*self._when_met(seen), seen.speed_mps), 0.0)
        orders = [seen.helm_rad, side * met, side * self.hull.rudder_limit_rad, held]
        return np.choose(self.rule(seen), orders), helm

    def rule(self, seen: Steering) -> NDArray[np.int64]:
        """Which rule applies (...), as its place in `RULES`."""
        far, side = np.abs(seen.error_rad), np.sign(seen.error_rad)
        closing, rudder = side * seen.rate_radps, side * seen.rudder_rad
        is_met = (rudder < 0.0) & (self.stopping_rudder(far, closing, seen.speed_mps) < 0.0)
        is_time = self.stopping_rudder(*self._when_met(seen), seen.speed_mps) < -MEETS_AT * self.hull.rudder_limit_rad
        steady_so = (far < BAND_RAD) & (np.abs(seen.rate_radps) < STILL_RADPS)
        meet = (far > NEAR_RAD) & (closing > STILL_RADPS) & (is_time | is_met)
        return np.asarray(np.select([steady_so, meet, far > FAR_RAD], [0, 1, 2], 3))

    def stopping_rudder(self, way_rad: Floats, closing_radps: Floats, speed_mps: Floats) -> Floats:
        """The rudder (...), positive towards the wanted heading, that stops a swing at the end of the way; full where it is late.

        T r' = K rudder - r with the constant r' = -r^2 / (2 way).
        """
        gain, lag = self.hull.gain_at(speed_mps), self.hull.lag_at(speed_mps)
        slowing = closing_radps * np.abs(closing_radps) / (2.0 * np.maximum(way_rad, 1e-6))
        return np.clip((closing_radps - lag * slowing) / gain, -self.hull.rudder_limit_rad, self.hull.rudder_limit_rad)

    def _when_met(self, seen: Steering) -> tuple[Floats, Floats]:
        """What is left of the way, and how fast she closes (...), when a rudder ordered over now has got there."""
        hull, side = self.hull, np.sign(seen.error_rad)
        closing, rudder = side * seen.rate_radps, side * seen.rudder_rad
        gain, lag = hull.gain_at(seen.speed_mps), hull.lag_at(seen.speed_mps)
        travel_s = np.maximum(rudder + MEETS_AT * hull.rudder_limit_rad, 0.0) / hull.rudder_rate_radps
        fades = np.exp(-travel_s / lag)
        steady = gain * (
            rudder + hull.rudder_rate_radps * lag
        )  # the rate under a rudder that moves, but for what fades
        moved = (closing - steady) * lag * (1.0 - fades) + travel_s * (
            steady - 0.5 * gain * hull.rudder_rate_radps * travel_s
        )
        closes = (closing - steady) * fades + steady - gain * hull.rudder_rate_radps * travel_s
        return np.abs(seen.error_rad) - moved, closes
