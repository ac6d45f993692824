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
from adapters.rows import Floats, Integers, Rows, Truths
from gateway.observation import AirData, Many


def hud(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """VFR_HUD."""
    ((_, told),) = fields
    columns = {
        "airspeed_mps": rows.within(told["airspeed"], 0.0, FASTEST_MPS),
        "groundspeed_mps": rows.within(told["groundspeed"], 0.0, FASTEST_MPS),
        "climb_mps": rows.within(told["climb"], -FASTEST_MPS, FASTEST_MPS),
        "altitude_msl_m": rows.within(told["alt"], LOWEST_M, HIGHEST_M),
    }
    names = ("airspeed, m/s", "ground speed, m/s", "climb, m/s", "altitude, m")
    for name, values in zip(names, columns.values(), strict=True):
        rows.show(name, values)
    says = ~np.logical_and.reduce([np.isnan(values) for values in columns.values()])
    return rows.many(AirData, says, rows.at_receipt(), **columns)


def pressure(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """SCALED_PRESSURE."""
    ((_, told),) = fields
    static = rows.within(told["press_abs"], 1e-3, GREATEST_HPA)
    pitot = rows.within(told["press_diff"], -GREATEST_HPA, GREATEST_HPA)
    centidegrees = told["temperature"].astype(np.float64)
    rows.show("static pressure, hPa", static)
    rows.show("differential pressure, hPa", pitot)
    rows.show("pressure sensor, degrees C", centidegrees / 100)
    return rows.many(
        AirData,
        np.full(len(rows), fill_value=True),
        rows.near(told["time_boot_ms"].astype(np.int64) * 1000),
        static_pressure_pa=static * 100,
        differential_pressure_pa=pitot * 100,
        temperature_k=(centidegrees + KELVIN_CENTIDEGREES) / 100,
    )


def wind(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """WIND."""
    ((_, told),) = fields
    strength = rows.within(told["speed"], 0.0, STRONGEST_MPS)
    bearing = rows.within(told["direction"], -360.0, 360.0)
    down = rows.within(told["speed_z"], -STRONGEST_MPS, STRONGEST_MPS)
    says = ~np.isnan(strength + bearing)
    # One by one: NumPy's sines differ from the C library's in the last bit, and what is heard must not depend on with whom.
    angles = [math.radians(one) if good else 0.0 for one, good in zip(bearing.tolist(), says.tolist(), strict=True)]
    east = -strength * np.array([math.sin(angle) for angle in angles])
    north = -strength * np.array([math.cos(angle) for angle in angles])
    return _wind(rows, says, rows.at_receipt(), east, north, down)


def wind_components(rows: Rows, fields: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """WIND_COV."""
    ((_, told),) = fields
    known = ~(np.isnan(told["wind_x"]) | np.isnan(told["wind_y"]))
    rows, told = rows[known], told[known]
    north = rows.within(told["wind_x"], -STRONGEST_MPS, STRONGEST_MPS)
    east = rows.within(told["wind_y"], -STRONGEST_MPS, STRONGEST_MPS)
    down = told["wind_z"].astype(np.float64)
    has_down = ~np.isnan(down)
    down[has_down] = rows[has_down].within(down[has_down], -STRONGEST_MPS, STRONGEST_MPS)
    return _wind(rows, ~np.isnan(north + east), rows.near(told["time_usec"]), east, north, down)


def _wind(rows: Rows, says: Truths, valid_at: Integers, east: Floats, north: Floats, down: Floats) -> Many:
    last = dict(zip(rows.vehicle[says].tolist(), np.flatnonzero(says).tolist(), strict=True))
    for vehicle, row in last.items():
        shown = shown_wind(float(east[row]), float(north[row]))
        readings = rows.vehicles[vehicle].readings
        rows.shown.extend((int(rows.places[row]), readings, name, value) for name, value in shown.items())
    return rows.many(AirData, says, valid_at, wind_east_mps=east, wind_north_mps=north, wind_up_mps=-down)
