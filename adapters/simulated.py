"""Where a simulator says that a vehicle really is, as Truth.

    SIM_STATE (108)   lat_int, lon_int degE7 (older ones: only lat, lon in degrees, as floats good to a metre);
                      alt m above mean sea level; vn, ve, vd m/s north, east, DOWN
    SIMSTATE (164)    lat, lng degE7; used only where SIM_STATE does not come, since it has no altitude

Neither carries a time.
"""

from __future__ import annotations

import math
from collections import Counter

from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations
from adapters.positions import DEGE7
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import Truth

SIM_STATE, _read_sim_state = fields("SIM_STATE", "lat_int", "lon_int", "lat", "lon", "alt", "vn", "ve", "vd")
SIMSTATE, _read_simstate = fields("SIMSTATE", "lat", "lng")


def sim_state(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """SIM_STATE."""
    lat_int, lon_int, latitude, longitude, altitude, north, east, down = _read_sim_state(payload)
    vehicle.has_sim_state = True
    if not math.isfinite(latitude + longitude + altitude + north + east + down):
        counters["not a number"] += 1
        return ()
    if lat_int == lon_int == 0:
        lat_int, lon_int = latitude * 1e7, longitude * 1e7
    if lat_int == lon_int == 0:
        return ()
    valid_at, _ = moments.at_receipt(component, received_at)
    return (
        Truth(
            vehicle.name,
            valid_at,
            received_at,
            lat_int * DEGE7,
            lon_int * DEGE7,
            altitude_msl_m=altitude,
            velocity_east_mps=east,
            velocity_north_mps=north,
            velocity_up_mps=-down,
        ),
    )


def simstate(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """SIMSTATE."""
    latitude, longitude = _read_simstate(payload)
    if vehicle.has_sim_state or latitude == longitude == 0:
        return ()
    valid_at, _ = moments.at_receipt(component, received_at)
    return (Truth(vehicle.name, valid_at, received_at, latitude * DEGE7, longitude * DEGE7),)
