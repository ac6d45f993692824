"""What can be declared to a session: goals as people write them, and whether the session knows what they name."""

from __future__ import annotations

import contextlib
from typing import Protocol

from adapters.declared import Goal, encode_intent, encode_weather
from gateway.observation import Intent
from gateway.settings.declared import Declarations, Declared


class Known(Protocol):
    """What a session knows of aircraft and points."""

    def known_aircraft(self) -> tuple[str, ...]:
        """Those that were heard."""

    def known_points(self, aircraft: str) -> tuple[str, ...]:
        """Where one can be declared to go."""


def goal_of(text: str) -> Goal | str:
    """What a person wrote as a goal: a name, an item's number, or `latitude,longitude[,altitude]`; else a sentence."""
    if text.isdecimal():
        return Goal(item=int(text)) if int(text) < 1 << 16 else f"There is no item {text} in any plan."
    parts = text.split(",")
    if len(parts) in (2, 3):
        with contextlib.suppress(ValueError):
            latitude, longitude, *altitude = (float(part) for part in parts)
            if abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and all(abs(one) <= 1e5 for one in altitude):
                return Goal(
                    latitude_deg=latitude, longitude_deg=longitude, altitude_msl_m=altitude[0] if altitude else None
                )
            return f"{text} is no place; latitude and longitude are degrees, the altitude metres above mean sea level."
    return Goal(name=text)


def objection(told: Intent, known: Known) -> str | None:
    """Why an intent cannot be declared, in one sentence; None where it can."""
    heard = known.known_aircraft()
    if told.aircraft not in heard:
        there = f"there are {', '.join(heard)}" if heard else "nobody has been heard yet"
        return f"There is no aircraft {told.aircraft}; {there}."
    wanted = told.name if told.sequence is None else str(told.sequence)
    points = known.known_points(told.aircraft)
    if wanted is None or wanted.casefold() in (point.casefold() for point in points):
        return None
    return f"Nobody knows a point {wanted} for {told.aircraft}; known are {', '.join(points)}, or LATITUDE,LONGITUDE."


def lines_of(declarations: Declarations) -> list[bytes]:
    """All that a file declares, as told lines."""
    goals = [encode_intent(goal.aircraft, goal_declared(goal)) for goal in declarations.goals]
    return [*goals, *(encode_weather(area.name, area) for area in declarations.weather)]


def goal_declared(declared: Declared) -> Goal:
    """Where a file declares one aircraft to go."""
    if declared.to is None:
        return Goal(None, None, declared.latitude_deg, declared.longitude_deg, declared.altitude_msl_m)
    return Goal(item=int(declared.to)) if declared.to.isdecimal() else Goal(name=declared.to)
