"""What may be set of sensors and of a scene, and to which values: one set of tables for scene files and for `--set`.

A table's keys are the fields of its dataclass; angles, which fields have in rad, may be written in _deg too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar, get_type_hints

from gateway.settings.tables import Convert, Table, flag
from sim.scene import LARGEST_SYSTEM, SayParameters
from sim.sensors import GpsParameters, ImuParameters, Intervals, RadarParameters

Group = TypeVar("Group", GpsParameters, ImuParameters, RadarParameters, SayParameters)

_PROBABILITIES = ("missing", "missing_range", "missing_azimuth", "missing_elevation", "detection_probability", "share")
_ABOVE_ZERO = (
    "period_s",
    "heartbeat_period_s",
    "clock_period_s",
    "attitude_period_s",
    "status_period_s",
    "airspeed_period_s",
    "duration_s",
)
_ANY_SIGN = (
    "_error_m",
    "_error_rad",
    "_error_deg",
    "error_east_m",
    "error_north_m",
    "error_up_m",
    "time_error_s",
    "abeam_deg",
)
_BOUNDS = {
    "rate_hz": (0, 1000),
    "aircraft": (0, LARGEST_SYSTEM),
    "radars": (0, 20),
    "first_number": (1, 60_000),
    "birds": (0, 1000),
    "burst_plots": (0, 100_000),
}


def checked(name: str, kind: Any) -> Convert:
    """The check of a value by what its name means; kind is float, int, bool or Intervals."""
    if kind is bool:
        return flag
    if kind == Intervals:
        return _intervals
    low, high = _BOUNDS.get(name, (-math.inf if name.endswith(_ANY_SIGN) else 0.0, math.inf))
    if name in _PROBABILITIES:
        low, high = 0.0, 1.0
    above = name in _ABOVE_ZERO
    least = "above 0" if above else "finite" if low < 0.0 else f"at least {low:g}"
    bounds = f"from {low:g} to {high:g}" if math.isfinite(high) else least

    def convert(value: Any) -> Any:
        if isinstance(value, bool) or not isinstance(value, int if kind is int else int | float):
            raise ValueError(f"must be {'a whole number' if kind is int else 'a number'}, not {value!r}")
        if not low <= value <= high or math.isinf(value) or (above and value == 0):
            raise ValueError(f"must be {bounds}, not {value:g}")
        return kind(value)

    return convert


def _intervals(value: Any) -> Intervals:
    pairs: list[Any] = value if isinstance(value, list) else [value]
    if not all(isinstance(pair, list) and len(pair) == 2 and _is_interval(*pair) for pair in pairs):
        raise ValueError(f"must be seconds [[FROM, UNTIL], ...], such as [[60, 90]], not {value!r}")
    return tuple((float(since), float(until)) for since, until in pairs)


def _is_interval(since: Any, until: Any) -> bool:
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in (since, until))
    return numbers and 0.0 <= since < until < math.inf


def _radians(convert: Convert) -> Convert:
    return lambda value: math.radians(convert(value))


def _table(parameters: type, *, many: bool = False) -> Table:
    keys: dict[str, tuple[str, Convert]] = {}
    hints = get_type_hints(parameters)
    for one in fields(parameters):
        convert = checked(one.name, hints[one.name])
        keys[one.name] = (one.name, convert)
        for radians, degrees in (("_rad", "_deg"), ("_radps", "_degps")):
            if one.name.endswith(radians):
                keys[one.name.removesuffix(radians) + degrees] = (one.name, _radians(convert))
    return Table(keys, many=many)


GPS = _table(GpsParameters)
RADAR = _table(RadarParameters, many=True)
IMU = _table(ImuParameters)
SAY = _table(SayParameters)
KINDS: Mapping[type, Table] = {GpsParameters: GPS, ImuParameters: IMU, RadarParameters: RADAR, SayParameters: SAY}


def with_fields(parameters: Group, changed: Mapping[str, Any]) -> Group:
    """Parameters with fields that were read by their table. A bound of the latency moved past the other takes it along.

    Raises ValueError where both bounds are set, the wrong way round.
    """
    result = replace(parameters, **changed)
    if isinstance(result, GpsParameters) and result.latency_high_s < result.latency_low_s:
        moved = [value for name, value in changed.items() if name in ("latency_low_s", "latency_high_s")]
        if len(moved) > 1:
            raise ValueError("latency_high_s must not be below latency_low_s")
        return replace(result, latency_low_s=moved[0], latency_high_s=moved[0])
    return result
