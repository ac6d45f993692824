"""Changes to a scene's parameters, written as people write them: `gps.period_s=1`,
`radar2.missing_azimuth=0.3`.

    aircraft=12                      how many aircraft
    gps.sigma_m=5                    the position source of every aircraft
    gps.dropouts=60:90,200:230       seconds without it
    radar.azimuth_error_deg=0.5      every radar; angles may be written in _rad or _deg
    radar2.detection_probability=0.9 radar number 2 alone
    say.truth_period_s=0             what aircraft say beside their positions
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from typing import Any, TypeVar, get_type_hints

from sim.scene import LARGEST_SYSTEM, SayParameters
from sim.sensors import GpsParameters, Intervals, RadarParameters

Group = TypeVar("Group", GpsParameters, RadarParameters, SayParameters)


class OverrideError(ValueError):
    """A change that cannot be made; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class SceneParameters:
    """All that can be set in a scene. `radars` holds one entry for each radar, in the order of their numbers."""

    gps: GpsParameters = field(default_factory=GpsParameters)
    radars: tuple[RadarParameters, ...] = (RadarParameters(),)
    say: SayParameters = field(default_factory=SayParameters)
    aircraft: int = 1
    duration_s: float = 600.0
    abeam_deg: float = 0.0  # not 0: a second aircraft, seen from the first radar beside the first at this angle


_PROBABILITIES = ("missing", "missing_range", "missing_azimuth", "missing_elevation", "detection_probability")
_ABOVE_ZERO = ("period_s", "heartbeat_period_s", "clock_period_s", "attitude_period_s", "status_period_s", "duration_s")
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
_COUNTS = {
    "aircraft": (0, LARGEST_SYSTEM),
    "radars": (0, 20),
    "first_number": (1, 60_000),
    "birds": (0, 1000),
    "burst_plots": (0, 100_000),
}


def override(parameters: SceneParameters, changes: Iterable[str]) -> SceneParameters:
    """The parameters with changes made in their order, counts first.

    Raises OverrideError: one sentence with what is wrong and what is known.
    """
    pairs = [_pair(change) for change in changes]
    for key, text in sorted(pairs, key=lambda pair: pair[0] != "radars"):
        parameters = _change(parameters, key, text)
    return parameters


def _pair(change: str) -> tuple[str, str]:
    key, equals, text = change.partition("=")
    if not equals or not key.strip() or not text.strip():
        raise OverrideError(f"{change!r} is no setting: write KEY=VALUE, such as gps.period_s=1.")
    return key.strip(), text.strip()


def _change(parameters: SceneParameters, key: str, text: str) -> SceneParameters:
    group, dot, name = key.partition(".")
    if not dot:
        return _change_scene(parameters, key, text)
    if group == "gps":
        return replace(parameters, gps=_with(parameters.gps, group, name, text))
    if group == "say":
        return replace(parameters, say=_with(parameters.say, group, name, text))
    one = re.fullmatch(r"radar(\d*)", group)
    if one is None:
        raise OverrideError(f"{key}: unknown group {group!r}; known are gps, radar, radar1, radar2, ... and say.")
    count = len(parameters.radars)
    if one[1] and not 1 <= int(one[1]) <= count:
        raise OverrideError(f"{key}: the scene has {count} radar(s); add radars={one[1]} to have more.")
    chosen = range(count) if not one[1] else [int(one[1]) - 1]
    radars = list(parameters.radars)
    for index in chosen:
        radars[index] = _with(radars[index], group, name, text)
    if not count:  # still say what is wrong with the name or the value
        _with(RadarParameters(), group, name, text)
    return replace(parameters, radars=tuple(radars))


def _change_scene(parameters: SceneParameters, key: str, text: str) -> SceneParameters:
    if key == "radars":
        count = _value(key, text, int)
        known = parameters.radars
        last = known[-1] if known else RadarParameters()
        more = tuple(replace(last, first_number=100 * index + 1) for index in range(len(known), count))
        return replace(parameters, radars=(known + more)[:count])
    plain: Mapping[str, type] = {"aircraft": int, "duration_s": float, "abeam_deg": float}
    if key not in plain:
        raise OverrideError(f"unknown setting {key!r}{_meant(key, [*plain, 'radars', 'gps.…', 'radar.…', 'say.…'])}.")
    changed: dict[str, Any] = {key: _value(key, text, plain[key])}
    return replace(parameters, **changed)


def _with(parameters: Group, group: str, name: str, text: str) -> Group:
    hints = get_type_hints(type(parameters))
    radians = name.removesuffix("_deg") + "_rad"
    degrees = name.endswith("_deg") and radians in hints
    changes = radians if degrees else name
    if changes not in hints:
        raise OverrideError(f"{group}.{name}: unknown{_meant(name, [one.name for one in fields(parameters)])}.")
    value = _value(f"{group}.{name}", text, hints[changes])
    changed: dict[str, Any] = {changes: math.radians(value) if degrees else value}
    result = replace(parameters, **changed)
    if isinstance(result, GpsParameters) and result.latency_high_s < result.latency_low_s:
        # one of the two was moved past the other: the other follows
        both = {"latency_low_s": value, "latency_high_s": value}
        result = replace(result, **both)
    return result


def _value(key: str, text: str, kind: Any) -> Any:
    """The value of a setting: a number, a truth value or intervals, checked against what its name means."""
    name = key.rpartition(".")[2]
    if kind is bool:
        return _truth_value(key, text)
    if kind == Intervals:
        return _intervals(key, text)
    try:
        number = int(text) if kind is int else float(text)
    except ValueError as error:
        wanted = "a whole number" if kind is int else "a number"
        raise OverrideError(f"{key}: must be {wanted}, not {text!r}.") from error
    low, high = _COUNTS.get(name, (-math.inf if name.endswith(_ANY_SIGN) else 0.0, math.inf))
    if name in _PROBABILITIES:
        low, high = 0.0, 1.0
    if not low <= number <= high or math.isinf(number) or (name in _ABOVE_ZERO and number == 0.0):
        least = "above 0" if name in _ABOVE_ZERO else "finite" if low < 0.0 else f"at least {low:g}"
        bounds = f"from {low:g} to {high:g}" if math.isfinite(high) else least
        raise OverrideError(f"{key}: must be {bounds}, not {text}.")
    return number


def _truth_value(key: str, text: str) -> bool:
    words = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}
    if text.lower() not in words:
        raise OverrideError(f"{key}: must be true or false, not {text!r}.")
    return words[text.lower()]


def _intervals(key: str, text: str) -> Intervals:
    """`60:90,200:230`: seconds from and until."""
    found = []
    for part in text.split(","):
        shape = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*:\s*(\d+(?:\.\d*)?)\s*", part)
        if shape is None or float(shape[1]) >= float(shape[2]):
            raise OverrideError(f"{key}: must be seconds FROM:UNTIL, such as 60:90 or 60:90,200:230, not {text!r}.")
        found.append((float(shape[1]), float(shape[2])))
    return tuple(found)


def _meant(name: str, known: list[str]) -> str:
    near = get_close_matches(name, known, n=1)
    return f"; perhaps {near[0]} is meant" if near else f"; known are {', '.join(known)}"
