"""Changes to a scene's parameters, written as people write them: `gps.period_s=1`,
`radar2.missing_azimuth=0.3`.

    aircraft=12                      how many aircraft
    gps.sigma_m=5                    the position source of every aircraft
    gps.dropouts=60:90,200:230       seconds without it
    radar.azimuth_error_deg=0.5      every radar; angles may be written in _rad or _deg
    radar2.detection_probability=0.9 radar number 2 alone
    imu.rate_hz=50                   an inertial unit in every aircraft
    say.truth_period_s=0             what aircraft say beside their positions
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from typing import Any, get_type_hints

from sim.parameter_tables import KINDS, Group, checked, with_fields
from sim.scene import SayParameters
from sim.sensors import GpsParameters, ImuParameters, Intervals, RadarParameters


class OverrideError(ValueError):
    """A change that cannot be made; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class SceneParameters:
    """All that can be set in a scene. `radars` holds one entry for each radar, in the order of their numbers."""

    gps: GpsParameters = field(default_factory=GpsParameters)
    imu: ImuParameters = field(default_factory=ImuParameters)
    radars: tuple[RadarParameters, ...] = (RadarParameters(),)
    say: SayParameters = field(default_factory=SayParameters)
    aircraft: int | None = None  # None: as many as the scene is written with
    duration_s: float = 600.0
    abeam_deg: float = 0.0  # not 0: one more aircraft, seen from the first radar beside the first at this angle


_PLAIN: dict[str, type] = {"aircraft": int, "duration_s": float, "abeam_deg": float}
_TRUTHS = {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}


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
    if group == "imu":
        return replace(parameters, imu=_with(parameters.imu, group, name, text))
    if group == "say":
        return replace(parameters, say=_with(parameters.say, group, name, text))
    one = re.fullmatch(r"radar(\d*)", group)
    if one is None:
        raise OverrideError(f"{key}: unknown group {group!r}; known are gps, imu, radar, radar1, radar2, ... and say.")
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
        return replace(parameters, radars=so_many(parameters.radars, _value(key, text, int, checked(key, int))))
    if key not in _PLAIN:
        raise OverrideError(
            f"unknown setting {key!r}{_meant(key, [*_PLAIN, 'radars', 'gps.…', 'imu.…', 'radar.…', 'say.…'])}."
        )
    changed: dict[str, Any] = {key: _value(key, text, _PLAIN[key], checked(key, _PLAIN[key]))}
    return replace(parameters, **changed)


def so_many(radars: tuple[RadarParameters, ...], count: int) -> tuple[RadarParameters, ...]:
    """The first of these, or more of the last one, which number their tracks from hundreds of their own."""
    last = radars[-1] if radars else RadarParameters()
    more = tuple(replace(last, first_number=100 * index + 1) for index in range(len(radars), count))
    return (radars + more)[:count]


def _with(parameters: Group, group: str, name: str, text: str) -> Group:
    keys = KINDS[type(parameters)].keys
    if name not in keys:
        raise OverrideError(f"{group}.{name}: unknown{_meant(name, list(keys))}.")
    changes, convert = keys[name]
    value = _value(f"{group}.{name}", text, get_type_hints(type(parameters))[changes], convert)
    return with_fields(parameters, {changes: value})


def _value(key: str, text: str, kind: Any, convert: Callable[[Any], Any]) -> Any:
    """The value of a setting, as a scene file would have it, checked as there."""
    try:
        if kind is bool:
            return convert(_TRUTHS.get(text.lower(), text))
        if kind == Intervals:
            return convert(_pairs(key, text))
        return convert(_number(text, kind))
    except ValueError as error:
        raise OverrideError(f"{key}: {error}.") from error


def _number(text: str, kind: type) -> float:
    try:
        return int(text) if kind is int else float(text)
    except ValueError as error:
        raise ValueError(f"must be {'a whole number' if kind is int else 'a number'}, not {text!r}") from error


def _pairs(key: str, text: str) -> list[list[float]]:
    """`60:90,200:230`: seconds from and until."""
    found = []
    for part in text.split(","):
        shape = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*:\s*(\d+(?:\.\d*)?)\s*", part)
        if shape is None or float(shape[1]) >= float(shape[2]):
            raise OverrideError(f"{key}: must be seconds FROM:UNTIL, such as 60:90 or 60:90,200:230, not {text!r}.")
        found.append([float(shape[1]), float(shape[2])])
    return found


def _meant(name: str, known: list[str]) -> str:
    near = get_close_matches(name, known, n=1)
    return f"; perhaps {near[0]} is meant" if near else f"; known are {', '.join(known)}"
