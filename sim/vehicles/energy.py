"""Height and speed of an aeroplane, held as energy: throttle gives what climbing and speeding up need, the nose shares it out.

Where the engine gives no more, speed goes before height; where it is too fast with the engine idle, it descends less.
"""

from __future__ import annotations

import math

from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.aeroplane import Aeroplane, Controls

_CLIMB_PER_M, _SPEED_PER_S, _SPEEDING_UP = 0.3, 0.4, 0.15  # 1/s, 1/s, g
_STEEPEST = 0.4  # sine


def hold_energy(aeroplane: Aeroplane, height_m: float, climb_mps: float, speed_mps: float, bank_rad: float) -> Controls:
    """Towards a height that itself climbs, at an airspeed."""
    p, has_mps = aeroplane.parameters, aeroplane.airspeed_mps
    speed = max(has_mps, p.slowest_mps)
    climb = climb_mps + _CLIMB_PER_M * (height_m - aeroplane.body.height_m)
    sine = min(max(climb, -p.sink_mps), p.climb_mps) / speed
    faster = min(max(_SPEED_PER_S * (speed_mps - has_mps) / STANDARD_GRAVITY_MPS2, -_SPEEDING_UP), _SPEEDING_UP)
    needs = aeroplane.drag(speed, 1.0 / math.cos(bank_rad))
    throttle = (needs + sine + faster) / p.thrust
    if throttle > 1.0:
        sine = min(sine, p.thrust - needs - max(faster, 0.0))
    elif has_mps > p.fastest_mps:
        sine = max(sine, -needs)
    return Controls(bank_rad, math.asin(min(max(sine, -_STEEPEST), _STEEPEST)), min(max(throttle, 0.0), 1.0))
