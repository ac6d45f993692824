"""Air data of many frames side by side: the same as air.py reads from one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.air import (
    FASTEST_MPS,
    GREATEST_HPA,
    HIGHEST_M,
    KELVIN_CENTIDEGREES,
    LOWEST_M,
    STRONGEST_MPS,
    shown_wind,
)
from adapters.moments import LEAST_UNIX_USEC
from adapters.rows import Floats, Integers, Rows, Truths
from gateway.observation import AirData, Many

_HUD = ("airspeed", "groundspeed", "climb", "alt")
_HUD_LEAST = np.array([[0.0], [0.0], [-FASTEST_MPS], [LOWEST_M]])
_HUD_GREATEST = np.array([[FASTEST_MPS], [FASTEST_MPS], [FASTEST_MPS], [HIGHEST_M]])
_HUD_SHOWN = ("airspeed, m/s", "ground speed, m/s", "climb, m/s", "altitude, m")


def hud(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """VFR_HUD."""
    ((_, told),) = fields
    values = rows.within(np.array([told[name] for name in _HUD], np.float64), _HUD_LEAST, _HUD_GREATEST)
    rows.show(_HUD_SHOWN, values)
    says = ~np.logical_and.reduce(np.isnan(values))
    names = ("airspeed_mps", "groundspeed_mps", "climb_mps", "altitude_msl_m")
    return rows.many(AirData, says, rows.at_receipt(), **dict(zip(names, values, strict=True)))


def pressure(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """SCALED_PRESSURE."""
    ((_, told),) = fields
    static = rows.within(told["press_abs"].astype(np.float64), 1e-3, GREATEST_HPA)
    pitot = rows.within(told["press_diff"].astype(np.float64), -GREATEST_HPA, GREATEST_HPA)
    centidegrees = told["temperature"].astype(np.float64)
    names = ("static pressure, hPa", "differential pressure, hPa", "pressure sensor, degrees C")
    rows.show(names, np.array([static, pitot, centidegrees / 100]))
    return rows.many(
        AirData,
        np.ones(len(rows), np.bool_),
        rows.near(told["time_boot_ms"].astype(np.int64) * 1000),
        static_pressure_pa=static * 100,
        differential_pressure_pa=pitot * 100,
        temperature_k=(centidegrees + KELVIN_CENTIDEGREES) / 100,
    )


def wind(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """WIND."""
    ((_, told),) = fields
    strength = rows.within(told["speed"].astype(np.float64), 0.0, STRONGEST_MPS)
    bearing = rows.within(told["direction"].astype(np.float64), -360.0, 360.0)
    down = rows.within(told["speed_z"].astype(np.float64), -STRONGEST_MPS, STRONGEST_MPS)
    says = ~np.isnan(strength + bearing)
    # One by one: NumPy's sines differ from the C library's in the last bit, and what is heard must not depend on with whom.
    angles = list(map(math.radians, np.where(says, bearing, 0.0).tolist()))
    east, north = -strength * np.array(list(map(math.sin, angles))), -strength * np.array(list(map(math.cos, angles)))
    return _wind(rows, says, rows.at_receipt(), east, north, down)


def wind_components(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """WIND_COV."""
    ((_, told),) = fields
    known = ~(np.isnan(told["wind_x"]) | np.isnan(told["wind_y"]))
    if not known.all():
        rows, told = rows.saying(known), told[known]
    north = rows.within(told["wind_x"].astype(np.float64), -STRONGEST_MPS, STRONGEST_MPS)
    east = rows.within(told["wind_y"].astype(np.float64), -STRONGEST_MPS, STRONGEST_MPS)
    down = told["wind_z"].astype(np.float64)
    has_down = ~np.isnan(down)
    down[has_down] = rows[has_down].within(down[has_down], -STRONGEST_MPS, STRONGEST_MPS)
    usec = np.minimum(told["time_usec"], LEAST_UNIX_USEC).astype(np.int64)
    return _wind(rows, ~np.isnan(north + east), rows.near(usec), east, north, down)


def _wind(rows: Rows, says: Truths, valid_at: Integers, east: Floats, north: Floats, down: Floats) -> Many:
    last = dict(zip(rows.vehicle[says].tolist(), np.flatnonzero(says).tolist(), strict=True))
    for vehicle, row in last.items():
        shown = shown_wind(float(east[row]), float(north[row]))
        readings = rows.vehicles[vehicle].readings
        rows.shown.extend((int(rows.places[row]), readings, name, value) for name, value in shown.items())
    return rows.many(AirData, says, valid_at, wind_east_mps=east, wind_north_mps=north, wind_up_mps=-down)
