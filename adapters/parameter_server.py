"""A vehicle's side of MAVLink's parameter protocol, without a link: a list of numbers under names of at most 16 letters.

    PARAM_REQUEST_LIST (21)   answered with a PARAM_VALUE (22) for each
    PARAM_REQUEST_READ (20)   by name, or by index where it is not -1
    PARAM_SET (23)            answered with the PARAM_VALUE that then holds: the old one where the new one cannot be

All are told as 32-bit floats, as ArduPilot's are in memory. Source: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from adapters.mavlink_frames import fields

REQUEST_LIST, _ = fields("PARAM_REQUEST_LIST", "target_system", "target_component")
REQUEST_READ, _read_request = fields(
    "PARAM_REQUEST_READ", "param_index", "target_system", "target_component", "param_id"
)
SET, _read_set = fields("PARAM_SET", "param_value", "target_system", "target_component", "param_id")
TRAFFIC = frozenset((REQUEST_LIST, REQUEST_READ, SET))

_REAL32 = 9


def hear_parameters(
    message: int, payload: bytes, settings: Mapping[str, float], limits: Mapping[str, tuple[float, float]]
) -> tuple[list[dict[str, Any]], tuple[str, float] | None]:
    """One of `TRAFFIC`, for a vehicle with these parameters: the PARAM_VALUEs to answer with, and what is set to what.

    `limits`: between what a parameter may be; one without is only told.
    """
    names = sorted(settings)
    if message == REQUEST_LIST:
        return [_value(settings, names, name) for name in names], None
    if message == REQUEST_READ:
        index, *_, told = _read_request(payload)
        name = _text(told) if index == -1 else (names[index] if 0 <= index < len(names) else "")
        return ([_value(settings, names, name)] if name in settings else []), None
    value, *_, told = _read_set(payload)
    name = _text(told)
    if name not in settings:
        return [], None
    least, most = limits.get(name, (math.inf, -math.inf))
    if not least <= value <= most:  # false for NaN too
        return [_value(settings, names, name)], None
    return [_value({**settings, name: value}, names, name)], (name, value)


def _value(settings: Mapping[str, float], names: list[str], name: str) -> dict[str, Any]:
    return {
        "param_id": name.encode(),
        "param_value": settings[name],
        "param_type": _REAL32,
        "param_count": len(names),
        "param_index": names.index(name),
    }


def _text(told: bytes) -> str:
    return told.partition(b"\0")[0].decode("ascii", "replace")
