"""The dead reckoning of all vehicles: what each has told lately, and how far its filters have come. One immutable value.

It moves on at whole seconds of the session's time, with everything that was heard before, so that it does not matter how
arrivals fall together. Many vehicles do not do so at once: shares of them follow within the second, each at its own instant,
and are then where they would have been at the second itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gateway.observation import Observation
from gateway.reckon.cells import CELL_NS, SECOND, Cells, cells, covered_until
from gateway.reckon.flying import carried_by, with_unit
from gateway.reckon.freezing import LastPlace
from gateway.reckon.kinds import By, Kinds
from gateway.reckon.reckoned import Floats, Reckoned, reckoned, wind_mps
from gateway.reckon.running import run
from gateway.reckon.tip import NOTHING, VELOCITY_ONLY
from gateway.reckon.told import INERTIAL, PLACE, Series, Told, before, by_share, carrying, portioned, tells_motion
from gateway.reckon.vehicle import Reckoner, begun_or_kept, pruned, untouched, with_portion
from gateway.settings import DeadReckoning

VEHICLES_AT_MOST = 200
TYPES_AT_MOST = 10_000  # a bound on what strangers can make us remember
AHEAD_NS = 3 * SECOND  # a state is carried on so far at most
TOGETHER = 6  # vehicles of a share: fewer at once cost more each, more hold up what comes
NOTHING_DUE = 1 << 62
TOLD_LAST_NS = 60 * SECOND  # who told no place for so long is gone

Waiting = tuple[int, tuple[Observation, ...]]
"""Observations, and what is added to their stamps for the session's time."""

Place = tuple[str, int, tuple[float, ...]]
"""A position that a vehicle told: which, when, and as `told.PLACE`."""


@dataclass(frozen=True, slots=True, eq=False)
class Share:
    """Some vehicles that go on together, at a whole second `at`, and all that was told of them before it and is new."""

    at: int
    names: tuple[str, ...]
    told: Sequence[Observation]
    places: tuple[Place, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Easing:
    """How a position source that comes back is approached: from when until when, and what it was off by then (3,), in m."""

    since: int
    until: int
    off_m: Floats


@dataclass(frozen=True, slots=True)
class Reckoners:
    """All vehicles that tell of their own motion."""

    by_aircraft: Mapping[str, Reckoner] = field(default_factory=dict)
    types: Mapping[str, int] = field(default_factory=dict)  # MAV_TYPE
    waiting: tuple[Waiting, ...] = ()
    places: tuple[Place, ...] = ()
    suspects: tuple[str, ...] = ()  # whose positions were refused as they came, since the last second
    planned: tuple[tuple[int, Share], ...] = ()  # when which vehicles go on
    easings: Mapping[str, Easing] = field(default_factory=dict)
    told_last: Mapping[str, LastPlace] = field(default_factory=dict)  # of vehicles that are not followed
    doubted: frozenset[str] = frozenset()  # of whom positions are believed, and not the velocities beside them
    crowded: bool = False  # more tell of their motion than are followed

    def hearing(self, added: int, observations: Sequence[Observation]) -> Reckoners:
        """The same with what was told of motion; `added`: to its stamps for the session's time."""
        told, waiting = tuple(observations), self.waiting
        while waiting and waiting[-1][0] == added and len(waiting[-1][1]) <= len(told):
            told, waiting = (
                waiting[-1][1] + told,
                waiting[:-1],
            )  # each part longer than the next: few, and seldom copied
        return replace(self, waiting=(*waiting, (added, told)))

    @property
    def is_idle(self) -> bool:
        """Whether nothing would happen however often it goes on."""
        return not (self.by_aircraft or self.waiting or self.planned or self.told_last)

    @property
    def due(self) -> int:
        """When the next vehicles go on."""
        return self.planned[0][0] if self.planned else NOTHING_DUE

    def emptied(self) -> Reckoners:
        """The same without anything that is dated."""
        return Reckoners(types=self.types)

    def of_type(self, aircraft: str, vehicle_type: int) -> Reckoners:
        """The same with what a vehicle says that it is."""
        known = self.types.get(aircraft)
        if known == vehicle_type or (known is None and len(self.types) >= TYPES_AT_MOST):
            return self
        return replace(self, types={**self.types, aircraft: vehicle_type})

    def placed(self, aircraft: str, at: int, place: tuple[float, ...]) -> Reckoners:
        """The same with a position that a vehicle told, as `told.PLACE`."""
        return replace(self, places=(*self.places, (aircraft, at, place)))

    def telling(self, told: Mapping[str, LastPlace]) -> Reckoners:
        """The same with the places that some vehicles told last."""
        return replace(self, told_last={**self.told_last, **told})

    def easing(self, aircraft: str, easing: Easing) -> Reckoners:
        """The same with how a vehicle's positions are approached."""
        return replace(self, easings={**self.easings, aircraft: easing})

    def denied(self, aircraft: str) -> int:
        """Why a vehicle's positions are refused."""
        reckoner = self.by_aircraft.get(aircraft)
        return NOTHING if reckoner is None or reckoner.tip is None else int(reckoner.tip.denied[0])

    def denies(self, aircraft: str, at: int) -> bool:
        """Whether dead reckoning judges a vehicle's positions by itself."""
        found = self.of(aircraft, at)
        return found is not None and (found.trusted or self.by(aircraft).denies)

    def by(self, aircraft: str) -> By:
        """What carries a vehicle on."""
        reckoner = self.by_aircraft.get(aircraft)
        return By.UNIT if reckoner is None else reckoner.by

    def suspecting(self, aircraft: str) -> Reckoners:
        """The same where a vehicle's position was refused as it came: that one is among the first to go on."""
        return self if aircraft in self.suspects else replace(self, suspects=(*self.suspects, aircraft))

    def planning(self, at: int) -> Reckoners:
        """At a whole second, the same with all vehicles in shares, each with what was received before: a single one is due
        now, of several each in the middle of its part of the second. What was planned before must have been done.
        """
        told, later = list[Observation](), list[Waiting]()
        for added, observations in self.waiting:
            now, rest = before(observations, at - added)
            told += now
            if rest:
                later.append((added, tuple(rest)))
        new = sorted(tells_motion(told, self.types) - {*self.by_aircraft})
        room = max(VEHICLES_AT_MOST - len(self.by_aircraft), 0)
        known = {**self.by_aircraft, **{name: Reckoner() for name in new[:room]}}
        parts = _parts(tuple(known), self.suspects, at)
        number = {name: place for place, (_, part) in enumerate(parts) for name in part}
        theirs = by_share(told, number)
        planned = []
        for place, (due, part) in enumerate(parts):
            places = tuple(one for one in self.places if number.get(one[0]) == place)
            planned.append((due, Share(at, part, theirs.get(place, ()), places)))
        return replace(
            self,
            by_aircraft=known,
            waiting=tuple(later),
            places=(),
            suspects=(),
            planned=tuple(planned),
            told_last={name: last for name, last in self.told_last.items() if at - last.at <= TOLD_LAST_NS},
            crowded=self.crowded or len(new) > room,
        )

    def advanced(self, history_ns: int, settings: DeadReckoning) -> Reckoners:
        """The same with the share that is due as far as what it was told reaches, its position sources judged."""
        (_, share), *planned = self.planned
        portion, by_place = portioned(share.told), _by_aircraft(share.places)
        changed: dict[str, Reckoner] = {}
        running: list[tuple[str, Reckoner, Cells]] = []
        for aircraft in share.names:
            was, part = self.by_aircraft[aircraft], portion.get(aircraft, {})
            is_new = INERTIAL in part and was.by == By.UNIT and not len(was.told.series[INERTIAL].at)
            was = Reckoner() if is_new else was  # a unit's vehicle is one from its first sample on
            told, since = with_portion(was, part)
            if aircraft in by_place and not is_new:
                more = by_place[aircraft]
                told, since = replace(told, places=told.places.with_more(more)), min(since, int(more.at[0]))
            moves = with_unit(told, carried_by(told, self.types.get(aircraft), was.by))
            reckoner = begun_or_kept(replace(was, told=told), moves, since, share.at, settings)
            changed[aircraft] = reckoner
            end = 0 if reckoner.tip is None else covered_until(moves, int(reckoner.tip.cell[0]))
            if reckoner.tip is not None and end > reckoner.tip.cell[0]:
                running.append((aircraft, reckoner, cells(moves, int(reckoner.tip.cell[0]), end)))
        changed |= self._run(running, settings)
        kept = {aircraft: pruned(one, share.at - history_ns, settings) for aircraft, one in changed.items()}
        gone = {aircraft for aircraft, one in kept.items() if self._tells_nothing(aircraft, one.told)}
        alive = {name: one for name, one in {**self.by_aircraft, **kept}.items() if name not in gone}
        after = replace(self, by_aircraft=alive, planned=tuple(planned))
        doubted = (name for name in share.names if after.denied(name) == VELOCITY_ONLY)
        return replace(after, doubted=self.doubted.difference(share.names).union(doubted))

    def _tells_nothing(self, aircraft: str, told: Told) -> bool:
        """Whether a vehicle is not heard any more of how it moves."""
        return not any(len(told.series[kind].at) for kind in carrying(self.types.get(aircraft)))

    def _run(self, running: Sequence[tuple[str, Reckoner, Cells]], settings: DeadReckoning) -> dict[str, Reckoner]:
        if not running:
            return {}
        types = [self.types.get(aircraft) for aircraft, _, _ in running]
        kinds = Kinds.of(types, [one.by for _, one, _ in running])
        tips = [one.tips[-1] for _, one, _ in running]
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # what is no number any more is let go of
            left = run(tips, [inputs for _, _, inputs in running], kinds, settings)
        return {
            aircraft: replace(one, tips=(*one.tips, *passed))
            for (aircraft, one, _), passed in zip(running, left, strict=True)
        }

    def of(self, aircraft: str, at: int) -> Reckoned | None:
        """Where a vehicle is at an instant about now; None where dead reckoning does not know."""
        reckoner = self.by_aircraft.get(aircraft)
        tip = None if reckoner is None else reckoner.tip
        if reckoner is None or tip is None or at - int(tip.cell[0]) * CELL_NS > AHEAD_NS:
            return None
        earlier = next((one for one in reversed(reckoner.tips) if int(one.cell[0]) * CELL_NS <= at), reckoner.tips[0])
        return reckoned(aircraft, earlier, at, int(tip.denied[0]))

    def follows(self, aircraft: str, at: int) -> bool:
        """Whether a vehicle will go on to this instant later in its second."""
        is_planned = any(aircraft in share.names for _, share in self.planned)
        return is_planned and self.of(aircraft, at) is not None

    def wind_mps(self, aircraft: str | None) -> tuple[float, float]:
        """The wind that a vehicle has found, east and north, where the air moves to; NaN = it has not."""
        reckoner = self.by_aircraft.get(aircraft or "")
        if reckoner is None or reckoner.tip is None:
            return math.nan, math.nan
        north, east = wind_mps(reckoner.tip).tolist()
        return east, north

    def pictured(self, aircraft: str, at: int, place: tuple[float, ...]) -> Reckoners:
        """The same with where radars had a vehicle, as `told.PLACE`; it counts from the next second on."""
        known = self.by_aircraft[aircraft]
        more = Series(np.array([at]), np.array([place]))
        told = replace(known.told, pictured=known.told.pictured.with_more(more))
        tips = untouched(known.tips, at)
        return replace(self, by_aircraft={**self.by_aircraft, aircraft: replace(known, told=told, tips=tips)})


def _parts(names: Sequence[str], suspects: Sequence[str], at: int) -> list[tuple[int, tuple[str, ...]]]:
    """Which vehicles go on when, within the second from an instant on."""
    if len(names) <= TOGETHER:
        return [(at, tuple(names))] if names else []
    first = tuple(name for name in suspects if name in names)[:TOGETHER]
    others = [name for name in names if name not in first]
    parts = [tuple(others[place : place + TOGETHER]) for place in range(0, len(others), TOGETHER)]
    middles = (at + (2 * place + 1) * SECOND // (2 * len(parts)) for place in range(len(parts)))
    return [*([(at, first)] if first else []), *zip(middles, parts, strict=True)]


def _by_aircraft(places: Sequence[Place]) -> dict[str, Series]:
    found: dict[str, list[tuple[int, tuple[float, ...]]]] = {}
    for aircraft, at, place in places:
        found.setdefault(aircraft, []).append((at, place))
    empty = Series.empty(PLACE)
    return {
        aircraft: empty.with_more(Series(np.array([at for at, _ in rows]), np.array([place for _, place in rows])))
        for aircraft, rows in found.items()
    }
