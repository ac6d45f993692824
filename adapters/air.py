"""What a vehicle says of the air that it flies in, as AirData. Winds there are where the air moves TO.

    VFR_HUD (74)           airspeed, groundspeed, climb m/s; alt m above mean sea level; heading, whole degrees; no time
    SCALED_PRESSURE (29)   press_abs, press_diff hPa; temperature centidegrees C, of the pressure sensor
    WIND (168)             ArduPilot: direction degrees, where it comes FROM; speed m/s; speed_z m/s, DOWN; no time
    WIND_COV (231)         wind_x, wind_y, wind_z m/s: where it moves to, north, east, DOWN; NaN = not known

A value that is no number, or that nothing in the air reaches, is left out and counted.
"""

from __future__ import annotations

import math
from collections import Counter

from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import AirData

VFR_HUD, _read_hud = fields("VFR_HUD", "airspeed", "groundspeed", "alt", "climb", "heading")
SCALED_PRESSURE, _read_pressure = fields("SCALED_PRESSURE", "time_boot_ms", "press_abs", "press_diff", "temperature")
WIND, _read_wind = fields("WIND", "direction", "speed", "speed_z")
WIND_COV, _read_wind_components = fields("WIND_COV", "time_usec", "wind_x", "wind_y", "wind_z")

FASTEST_MPS = 1000.0
STRONGEST_MPS = 150.0
LOWEST_M, HIGHEST_M = -10_000.0, 100_000.0
GREATEST_HPA = 2000.0
KELVIN_CENTIDEGREES = 27315


def hud(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """VFR_HUD."""
    airspeed, groundspeed, altitude, climb, heading = _read_hud(payload)
    air = _within(airspeed, 0.0, FASTEST_MPS, counters)
    ground = _within(groundspeed, 0.0, FASTEST_MPS, counters)
    rate = _within(climb, -FASTEST_MPS, FASTEST_MPS, counters)
    high = _within(altitude, LOWEST_M, HIGHEST_M, counters)
    readings = vehicle.readings
    if air is not None:
        readings["airspeed, m/s"] = air
    if ground is not None:
        readings["ground speed, m/s"] = ground
    if rate is not None:
        readings["climb, m/s"] = rate
    if high is not None:
        readings["altitude, m"] = high
    if air is None and ground is None and rate is None and high is None:
        return ()
    valid_at = moments.shown_at_receipt(component, received_at)
    nose = math.radians(heading) if 0 <= heading <= 360 else None  # -1: its autopilot does not know
    return (AirData(vehicle.name, valid_at, received_at, air, ground, rate, high, compass_heading_rad=nose),)


def pressure(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """SCALED_PRESSURE."""
    boot_ms, absolute, differential, temperature = _read_pressure(payload)
    static = _within(absolute, 1e-3, GREATEST_HPA, counters)
    pitot = _within(differential, -GREATEST_HPA, GREATEST_HPA, counters)
    valid_at = moments.shown_near(component, boot_ms * 1000, received_at)
    if static is not None:
        vehicle.readings["static pressure, hPa"] = static
    if pitot is not None:
        vehicle.readings["differential pressure, hPa"] = pitot
    vehicle.readings["pressure sensor, degrees C"] = temperature / 100
    return (
        AirData(
            vehicle.name,
            valid_at,
            received_at,
            static_pressure_pa=None if static is None else static * 100,
            differential_pressure_pa=None if pitot is None else pitot * 100,
            temperature_k=(temperature + KELVIN_CENTIDEGREES) / 100,
        ),
    )


def wind(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """WIND."""
    direction, speed, down = _read_wind(payload)
    strength = _within(speed, 0.0, STRONGEST_MPS, counters)
    bearing = _within(direction, -360.0, 360.0, counters)
    sink = _within(down, -STRONGEST_MPS, STRONGEST_MPS, counters)
    if strength is None or bearing is None:
        return ()
    angle = math.radians(bearing)
    valid_at = moments.shown_at_receipt(component, received_at)
    towards = (-strength * math.sin(angle), -strength * math.cos(angle))
    return (_wind(vehicle, valid_at, received_at, towards, sink),)


def wind_components(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """WIND_COV."""
    usec, north, east, down = _read_wind_components(payload)
    if math.isnan(north) or math.isnan(east):  # not known
        return ()
    along = _within(north, -STRONGEST_MPS, STRONGEST_MPS, counters)
    across = _within(east, -STRONGEST_MPS, STRONGEST_MPS, counters)
    sink = None if math.isnan(down) else _within(down, -STRONGEST_MPS, STRONGEST_MPS, counters)
    if along is None or across is None:
        return ()
    valid_at = moments.shown_near(component, usec, received_at)
    return (_wind(vehicle, valid_at, received_at, (across, along), sink),)


def _wind(
    vehicle: Vehicle, valid_at: int, received_at: int, towards: tuple[float, float], down: float | None
) -> AirData:
    east, north = towards
    vehicle.readings |= shown_wind(east, north)
    up = None if down is None else -down
    return AirData(vehicle.name, valid_at, received_at, wind_east_mps=east, wind_north_mps=north, wind_up_mps=up)


def shown_wind(east_mps: float, north_mps: float) -> dict[str, float]:
    """A wind as people are shown it: how strong, and where it comes from."""
    from_rad = math.atan2(-east_mps, -north_mps)
    return {"wind, m/s": math.hypot(east_mps, north_mps), "wind from, degrees": math.degrees(from_rad) % 360}


def _within(value: float, least: float, greatest: float, counters: Counter[str]) -> float | None:
    """The value, where it is a number in its range; else None, counted."""
    if least <= value <= greatest:  # false for NaN, too
        return value
    counters["not a number" if math.isnan(value) else "air data out of range"] += 1
    return None
