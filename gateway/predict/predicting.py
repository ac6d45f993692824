"""What predict remembers from one instant to the next, and which tracks are predicted when."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from operator import attrgetter
from typing import Any

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.fuse import Headings, Lane
from gateway.observation import WeatherArea
from gateway.predict.arrival_flows import FlowWays
from gateway.predict.finals import Gates
from gateway.predict.goals import Goals, goals_of
from gateway.predict.minds import Remembered
from gateway.predict.stacked import Stacked
from gateway.predict.told import Said, Tellings
from gateway.settings import Site

FEW = 20  # tracks that are predicted at the whole second, when much else is done; parts of more have their own instants
TOGETHER = 200  # tracks of a part
NEVER = 1 << 62


@dataclass(frozen=True, slots=True)
class Predicting:
    """What predict remembers: what was said, what is thought of each track, and each aircraft's goals as arrays."""

    tellings: Tellings = Tellings()
    remembered: Remembered = field(default_factory=Remembered)
    goals: Mapping[str | None, Goals] = field(default_factory=dict)  # by aircraft; None: of those that said nothing
    separation_m: float = 0.0  # of the geoid, as the goals have it
    planned: tuple[tuple[int, tuple[int, ...]], ...] = ()  # when which tracks are predicted next
    gates: Gates = Gates()  # what is remembered of finals
    stacks: Mapping[int, Stacked] = field(default_factory=dict)  # goals of parts, by their first tracks
    flows: FlowWays | None = None  # ways that many came
    headings: Headings = Headings()  # where aircraft say they go, as the filter of several modes uses it

    @property
    def due(self) -> int:
        """When the next tracks are predicted."""
        return self.planned[0][0] if self.planned else NEVER

    def planning(self, tracks: Sequence[int], at: int) -> Predicting:
        """The same with a round of predictions: of few tracks at an instant, of parts of many in the middles of as many parts
        of the second after it.
        """
        parts = [tuple(tracks[first : first + TOGETHER]) for first in range(0, len(tracks), TOGETHER)]
        stacks = {part[0]: self.stacks[part[0]] for part in parts if part[0] in self.stacks}
        if len(tracks) <= FEW:
            return replace(self, planned=tuple((at, part) for part in parts), stacks=stacks)
        middles = (at + (2 * place + 1) * SECOND // (2 * len(parts)) for place in range(len(parts)))
        return replace(self, planned=tuple(zip(middles, parts, strict=True)), stacks=stacks)

    def begun(self, at: int) -> tuple[Predicting, tuple[int, ...]]:
        """The same without the part that is due at an instant, and its tracks."""
        if self.due > at:
            return self, ()
        return replace(self, planned=self.planned[1:]), self.planned[0][1]

    def hearing(self, said: Said) -> Predicting:
        """The same with one thing more that was said."""
        tellings = self.tellings.hearing(said)
        if tellings is self.tellings:
            return self
        if isinstance(said, WeatherArea):
            return replace(self, tellings=tellings)
        known = self.tellings.by_aircraft.get(said.aircraft)
        now = tellings.by_aircraft[said.aircraft]
        if known is not None and known.plan is now.plan and known.intents is now.intents and known.status is now.status:
            # A wind. They come thick, and `replace` takes three times as long.
            return Predicting(tellings, *_beside_tellings(self))
        goals = {aircraft: one for aircraft, one in self.goals.items() if aircraft != said.aircraft}
        return replace(self, tellings=tellings, goals=goals)

    def with_goals(self, lanes: Sequence[Lane], site: Site, frame: RunwayFrame, separation_m: float) -> Predicting:
        """The same with the goals of these tracks' aircraft made."""
        goals = self.goals if separation_m == self.separation_m else {}
        told = self.tellings.by_aircraft
        wanted = {lane.aircraft if lane.aircraft in told else None for lane in lanes}
        missing = [one for one in wanted if one not in goals]
        if not missing:
            return self
        made = {one: goals_of(told.get(one) if one else None, site, frame, separation_m) for one in missing}
        return replace(self, goals={**goals, **made}, separation_m=separation_m)

    def stacked(self, first: int, goals: Sequence[Goals]) -> tuple[Predicting, Stacked]:
        """The goals of a part that begins with a track, and the same with them remembered."""
        known = self.stacks.get(first)
        if known is not None and known.is_of(goals):
            return self, known
        made = Stacked.of(goals)
        return replace(self, stacks={**self.stacks, first: made}), made

    def heading(self, at: int, before: int) -> Predicting:
        """The same with where aircraft say at an instant that they go told to the filter; `before` nobody asks any more."""
        told = self.tellings.by_aircraft
        goals = {one: goal.heading for one, goal in self.goals.items() if one is not None and one in told}
        return replace(self, headings=self.headings.known(at, goals, told, before))

    def forgotten(self, lanes: Mapping[int, Lane], by_aircraft: Mapping[str, int], at: int) -> Predicting:
        """The same without what is said of aircraft, and thought of tracks, that are long gone."""
        tellings = self.tellings.remembered(by_aircraft, at)
        goals = self.goals
        if len(tellings.by_aircraft) < len(self.tellings.by_aircraft):
            goals = {one: goal for one, goal in goals.items() if one is None or one in tellings.by_aircraft}
        if not lanes:
            return Predicting(tellings, flows=self.flows)
        remembered, gates = self.remembered.without(lanes), self.gates.without(lanes)
        return replace(self, tellings=tellings, goals=goals, remembered=remembered, gates=gates)


_beside_tellings: Callable[[Predicting], tuple[Any, ...]] = attrgetter(*(one.name for one in fields(Predicting)[1:]))
