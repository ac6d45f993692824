"""HIGH_LATENCY2 (235): all that comes of a vehicle over a satellite link, each 5 s or less often.

timestamp                ms since boot
latitude, longitude      degE7; altitude m above mean sea level, whole
heading                  degrees / 2: where the nose points, so that it and `groundspeed` (m/s x 5) make no velocity
airspeed, windspeed      m/s x 5; 255 = 51 m/s or more; 0 is also what is sent where nothing is measured
wind_heading             degrees / 2: where the wind comes FROM with ArduPilot, where it goes TO with PX4
eph, epv                 dm, the greatest error since the last message; 0 (ArduPilot) and 255 (PX4) = not given
temperature_air          degrees C; -128 = not given
climb_rate               dm/s, the greatest magnitude since the last message, without a sign: no velocity either
wp_num                   the item of the mission that it goes to; 65535 = none
failure_flags            bits; GPS among them
custom0                  ArduPilot: base_mode (128 = armed)
"""

from __future__ import annotations

import math
from collections import Counter

from adapters.condition import ARMED, keep_status
from adapters.fixes import HIGH_LATENCY
from adapters.mavlink_frames import fields
from adapters.missions import mission_intent
from adapters.moments import Moments, Observations, When
from adapters.positions import DEGE7, show
from adapters.roles import ARDUPILOT, PX4
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import AirData, GpsReport, Observation

_PLACE = ("timestamp", "latitude", "longitude", "altitude", "heading", "eph", "epv", "failure_flags")
_AIR = ("airspeed", "groundspeed", "windspeed", "wind_heading", "temperature_air", "climb_rate", "autopilot")
HIGH_LATENCY2, _read_place = fields("HIGH_LATENCY2", *_PLACE)
_, _read_air = fields("HIGH_LATENCY2", *_AIR)
_, _read_condition = fields("HIGH_LATENCY2", "type", "autopilot", "custom_mode", "wp_num", "custom0")
_, read_role = fields("HIGH_LATENCY2", "type", "autopilot")

_GPS_FAILURE = 1
_FAILURES = ("GPS", "differential pressure", "absolute pressure", "accelerometer", "gyroscope", "magnetometer", "terrain",
             "battery", "RC receiver", "offboard link", "engine", "geofence", "estimator", "mission")  # fmt: skip
_SATURATED = 255
_NO_TEMPERATURE = -128
_NO_WAYPOINT = 65535
_KELVIN = 273.15


def high_latency(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """A report, what it says of the air, its status (ArduPilot) and its next waypoint when that has changed."""
    boot_ms, *_ = _read_place(payload)
    boot_ns = moments.boot(component, vehicle, boot_ms, received_at, counters)
    if boot_ns is None:
        return ()
    when = moments.when(component, boot_ns, received_at)
    found: list[Observation | None] = [
        _report(moments, vehicle, payload, when, received_at, counters),
        _air(vehicle, payload, when, received_at, counters),
    ]
    kind, autopilot, mode, waypoint, base_mode = _read_condition(payload)
    if autopilot == ARDUPILOT:
        armed = bool(base_mode & ARMED)
        found.append(keep_status(vehicle, when[0], received_at, kind, autopilot, armed, mode))
    if waypoint != _NO_WAYPOINT and not (waypoint == 0 and autopilot == ARDUPILOT):
        found.append(mission_intent(vehicle, "high latency", waypoint, when[0], received_at))
    return tuple(one for one in found if one is not None)


def _report(
    moments: Moments, vehicle: Vehicle, payload: bytes, when: When, received_at: int, counters: Counter[str]
) -> GpsReport | None:
    boot_ms, latitude, longitude, altitude, heading, eph, epv, failures = _read_place(payload)
    vehicle.words["failures"] = ", ".join(name for bit, name in enumerate(_FAILURES) if failures >> bit & 1) or "none"
    now = moments.epoch.session_time(received_at)
    if vehicle.fixes.refuses(HIGH_LATENCY, (boot_ms,), (latitude, longitude), now):
        return None
    if failures & _GPS_FAILURE:
        counters["no fix"] += 1
        return None
    horizontal, vertical = (error / 10 if 0 < error < _SATURATED else None for error in (eph, epv))
    show(vehicle, HIGH_LATENCY, horizontal)
    return GpsReport(
        vehicle.name,
        when[0],
        received_at,
        latitude * DEGE7,
        longitude * DEGE7,
        altitude_msl_m=float(altitude),
        height_m=vehicle.fixes.height_m(altitude * 1000),
        horizontal_sigma_m=horizontal,
        vertical_sigma_m=vertical,
        compass_heading_rad=math.radians(heading * 2) if heading <= 180 else None,
        timing=when[1],
    )


def _air(vehicle: Vehicle, payload: bytes, when: When, received_at: int, counters: Counter[str]) -> AirData | None:
    air, ground, wind, wind_heading, temperature, climb, autopilot = _read_air(payload)
    airspeed, groundspeed, windspeed = (speed / 5 if 0 < speed < _SATURATED else None for speed in (air, ground, wind))
    east = north = None
    if windspeed is not None:
        if autopilot in (ARDUPILOT, PX4):
            towards = math.radians(wind_heading * 2) + (math.pi if autopilot == ARDUPILOT else 0.0)
            east, north = windspeed * math.sin(towards), windspeed * math.cos(towards)
        else:
            counters["wind direction undefined"] += 1
    for name, value in (("airspeed, m/s", airspeed), ("ground speed, m/s", groundspeed), ("wind, m/s", windspeed)):
        if value is not None:
            vehicle.readings[name] = value
    if temperature != _NO_TEMPERATURE:
        vehicle.readings["air temperature, degrees C"] = temperature
    vehicle.readings["greatest climb or sink lately, m/s"] = abs(climb) / 10
    if airspeed is None and groundspeed is None and east is None and temperature == _NO_TEMPERATURE:
        return None
    return AirData(
        vehicle.name,
        when[0],
        received_at,
        airspeed_mps=airspeed,
        groundspeed_mps=groundspeed,
        temperature_k=temperature + _KELVIN if temperature != _NO_TEMPERATURE else None,
        wind_east_mps=east,
        wind_north_mps=north,
    )
