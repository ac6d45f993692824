"""Headings: where aircraft say they go, as the filter of several modes uses it: who flies at that point goes on straight.

Only what is declared counts, and from the instant on at which it was known: what is inferred depends on the filter itself, and
late reports would leave other states behind than timely ones. Source: 000 2.2, feedback.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field

Heading = tuple[int, float, float]  # since when, ns; east and north of the point, NaN = nowhere
Point = tuple[float, float]
NOWHERE: Point = (math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Headings:
    """By aircraft where it has said that it goes, in the order of time, as far back as late data may come."""

    by_aircraft: Mapping[str, tuple[Heading, ...]] = field(default_factory=dict)

    def of(self, aircraft: str | None) -> tuple[Heading, ...]:
        """One aircraft's; none of who has said nothing, and of tracks that are no aircraft."""
        return self.by_aircraft.get(aircraft, ()) if aircraft is not None else ()

    def known(self, at: int, goals: Mapping[str, Point], told: Container[str], before: int) -> Headings:
        """The same with where some aircraft say at an instant that they go; others' stand, as long as they are `told` of.

        What was left for another one before an instant is forgotten.
        """
        if not goals and not self.by_aircraft:
            return self
        after = {aircraft: one for aircraft, one in self.by_aircraft.items() if aircraft in told}
        for aircraft, (east, north) in goals.items():
            history = after.get(aircraft, ())
            last = history[-1][1:] if history else NOWHERE
            if last != (east, north) and (last[0] == last[0] or east == east):
                after[aircraft] = (*(one for one in history[:-1] if one[0] >= before), *history[-1:], (at, east, north))
        return Headings(after)


def goal_at(headings: Sequence[Heading], at: int) -> Point:
    """East and north of where an aircraft went at an instant, NaN = nobody knows."""
    for since, east, north in reversed(headings):
        if since < at:
            return east, north
    return NOWHERE
