"""Air data of many frames side by side: the same as air.py reads from one. Winds are not among them (`waiting` says why)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.air import FASTEST_MPS, GREATEST_HPA, HIGHEST_M, KELVIN_CENTIDEGREES, LOWEST_M
from adapters.rows import Rows
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
    columns = dict(zip(names, values, strict=True))
    heading = told["heading"].astype(np.float64)
    is_known = (heading >= 0.0) & (heading <= 360.0)
    if is_known.any():
        columns["compass_heading_rad"] = np.where(is_known, np.radians(heading), np.nan)
    return rows.many(AirData, says, rows.at_receipt(), **columns)


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
