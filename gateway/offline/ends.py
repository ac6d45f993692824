"""The two ends of a flight: whether it rolled along the runway that is known, and where it touched down.

Source: 002-2 sections 2 and 3, which take both for granted: that the runway's direction is that of the roll, and that a flight
ends where it began.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import flight_path as paths
from gateway.offline.carrying import Place, level_m
from gateway.offline.parameters import Flown
from gateway.settings import Runway

Floats = NDArray[np.float64]

_STRONGEST_MPS = 100.0  # no wind that small aircraft fly in is stronger, and few jet streams
_ELSEWHERE_M, _ELSEWHERE_SHARE = (
    300.0,
    0.02,
)  # beyond both it landed elsewhere; 2 % of its way is what rebuilding is worth
# Of the airspeed. Closing a flight that ends elsewhere takes its way there for wind: straight ahead all of the airspeed, over
# half of it where it ends further away than half of what it flew. Little flies in such a wind.
_ABSURD_SHARE = 0.5
# Beyond its ends, or beside it: a position is not better than that, nor where airspeed says lift-off.
_OFF_RUNWAY_M = 1000.0
_OFF_DIRECTION_RAD = math.radians(20.0)  # no compass is wrong by more that a path can be made of


class Unplaced(ValueError):
    """A path should be closed on a place, and nothing tells where it began; the message is part of a sentence."""


class Unreachable(ValueError):
    """A path should end at a place to which no wind would have carried it; the message is a sentence."""


@dataclass(frozen=True, slots=True)
class Roll:
    """How much the heading showed too much on the take-off roll, and its 1 sigma, rad; NaN where nothing tells, and why."""

    bias_rad: float = math.nan
    sigma_rad: float = math.nan
    doubt: str | None = None  # a sentence


def roll_along(
    flown: Flown, first: int, take_off_mps: float, runway: Runway | float | None, lift_off: Place | None
) -> Roll:
    """What the minute before lift-off (sample `first`) tells of the heading.

    `runway`: the direction (rad) in which it surely rolled, or a runway, whose direction tells nothing of a flight that lifted
    off elsewhere.
    """
    if runway is None:
        return Roll()
    direction = runway.landing_compass_rad if isinstance(runway, Runway) else runway
    roll = slice(int(np.searchsorted(flown.time, flown.time[first] - 60 * SECOND)), first)
    bias, sigma = paths.heading_bias(flown.compass_rad[roll], flown.airspeed_mps[roll], take_off_mps, direction)
    why = _not_on(runway, bias, lift_off) if isinstance(runway, Runway) and not math.isnan(bias) else None
    if why is None:
        return Roll(bias, sigma)
    return Roll(doubt=f"{why}: that runway tells nothing of its heading (--runway-direction DEGREES).")


def _not_on(runway: Runway, bias_rad: float, lift_off: Place | None) -> str | None:
    """Why a roll was not on a runway; None: it was."""
    if lift_off is None:
        return "nothing tells whether it lifted off on the site's runway"
    centre = level_m(np.array([runway.latitude_rad]), np.array([runway.longitude_rad]), lift_off)[0]
    away = float(np.linalg.norm(centre))
    if away > 0.5 * runway.length_m + _OFF_RUNWAY_M:
        return f"it lifted off {away / 1000.0:.1f} km from the site's runway"
    if abs(bias_rad) > _OFF_DIRECTION_RAD:
        return f"it rolled {abs(math.degrees(bias_rad)):.0f} degrees across the site's runway"
    return None


@dataclass(frozen=True, slots=True)
class Closing:
    """What a path is closed on: "lift-off", "touchdown" (as told by positions), "place" or "nothing", and where that is, m."""

    on: str
    target_m: Floats | None  # (2,) east and north of lift-off
    doubt: str | None = None  # what speaks against it, a sentence


def closing(
    close_on: Place | str | None, path_m: Floats, lasted_s: float, lift_off: Place | None, touchdown: Place | None
) -> Closing:
    """Where a path through the air (n, 2) m, of a flight that landed, is to end. `touchdown`: where positions say it was then.

    None: where it lifted off, unless positions say that it touched down elsewhere. Raises Unplaced, Unreachable.
    """
    if close_on == "nothing":
        return Closing("nothing", None)
    if not (close_on is None or isinstance(close_on, str)):
        if lift_off is None:
            raise Unplaced("no position tells where it lifted off, so a path cannot be closed on a place")
        target = _level(close_on, lift_off)
        _check_reachable(target, path_m[-1], lasted_s)
        return Closing("place", target)
    flown_m = float(np.linalg.norm(np.diff(path_m, axis=0), axis=1).sum())
    if lift_off is None or touchdown is None:
        return Closing("lift-off", np.zeros(2), _absurd(path_m[-1], lasted_s, flown_m))
    told = _level(touchdown, lift_off)
    apart = float(np.linalg.norm(told))
    if apart <= max(_ELSEWHERE_M, _ELSEWHERE_SHARE * flown_m):
        return Closing("lift-off", np.zeros(2))
    said = f"its positions say that it touched down {apart / 1000.0:.1f} km from where it lifted off"
    if close_on is None and _carrying_mps(told, path_m[-1], lasted_s) <= _STRONGEST_MPS:
        return Closing("touchdown", told, f"{said}: the path is closed on where it touched down.")
    return Closing(
        "lift-off", np.zeros(2), f"{said}, and the path is closed on lift-off: do not believe path and wind."
    )


def _absurd(ended_m: Floats, lasted_s: float, flown_m: float) -> str | None:
    """What a wind says that would have brought a path back to where it lifted off."""
    wind, airspeed = _carrying_mps(np.zeros(2), ended_m, lasted_s), flown_m / lasted_s
    if wind <= _ABSURD_SHARE * airspeed:
        return None
    return (
        f"to end where it lifted off it needs a wind of {wind:.0f} m/s at an airspeed of {airspeed:.0f} m/s: it probably ended "
        "elsewhere (tell where with --close-on LAT,LON or threshold, or leave the path open with --close-on nothing)."
    )


def _level(place: Place, lift_off: Place) -> Floats:
    return np.asarray(level_m(np.array([place[0]]), np.array([place[1]]), lift_off)[0])


def _carrying_mps(target_m: Floats, ended_m: Floats, lasted_s: float) -> float:
    """The wind that carries a path from where it ended to where it should have."""
    return float(np.linalg.norm(target_m - ended_m)) / lasted_s


def _check_reachable(target_m: Floats, ended_m: Floats, lasted_s: float) -> None:
    """Raises Unreachable."""
    wind = _carrying_mps(target_m, ended_m, lasted_s)
    if wind > _STRONGEST_MPS:
        raise Unreachable(
            f"To end {np.linalg.norm(target_m) / 1000.0:.0f} km from where it lifted off, it would have been carried by "
            f"a wind of {wind:.0f} m/s: --close-on or --lift-off is not the place."
        )
