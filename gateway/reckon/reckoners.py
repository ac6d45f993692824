"""The dead reckoning of all vehicles: what each has told lately, and how far its filters have come. One immutable value.

It moves on at whole seconds of the session's time, with everything that was heard before, so that it does not matter how
arrivals fall together. What comes late goes back to its place: the tips of the last seconds are kept, and it goes on from the
last one that the late thing does not touch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.inertial import displaced
from gateway.observation import Observation
from gateway.reckon.cells import BLOCK, CELL_NS, SECOND_CELLS, Cells, cells, covered_until, first_covered
from gateway.reckon.judging import TRUSTED_AFTER, WANDERS_M
from gateway.reckon.running import Kinds, begun, run
from gateway.reckon.tip import NOTHING, Tip
from gateway.reckon.told import ATTITUDE, INERTIAL, PLACE, Portion, Series, Told, portioned
from gateway.settings import DeadReckoning

Floats = NDArray[np.float64]

SECOND = 1_000_000_000
VEHICLES_AT_MOST = 200
TYPES_AT_MOST = 10_000  # a bound on what strangers can make us remember
NEAR_ATTITUDE_NS = 500_000_000
MARGIN_NS = 2 * SECOND  # what is told is kept so much longer than tips
SILENT_NS = 3 * SECOND  # an inertial unit that says nothing for so long: nobody knows how the vehicle moves
AHEAD_NS = 3 * SECOND  # a state is carried on so far at most
JERKED_MPS2 = 3.0  # and by then the acceleration may be another by this
WIND_KNOWN_MPS = 3.0  # a wind that is less sure than this is not told

Waiting = tuple[int, tuple[Observation, ...]]
"""Observations, and what is added to their stamps for the session's time."""


@dataclass(frozen=True, slots=True, eq=False)
class Reckoned:
    """Where dead reckoning has a vehicle at an instant. Vectors north, east, down; the wind is where the air moves to."""

    aircraft: str
    at: int
    latitude_rad: float
    longitude_rad: float
    height_m: float
    velocity_mps: Floats  # (3,)
    sigma_m: Floats  # (3,) with what good position sources wander by, which it has followed
    velocity_sigma_mps: Floats  # (3,)
    wind_mps: Floats  # (2,) NaN = not known
    scatter_m: float  # of its position source, level, an axis
    denied: int  # why its position source is refused: `tip.NOTHING`, JUMPED, WALKED_OFF
    heard_at: int  # when a position was worked in last
    trusted: bool  # it has learnt its own errors
    ahead_s: float  # since what vehicles told last

    @property
    def level_sigma_m(self) -> float:
        """An axis."""
        return math.sqrt(0.5 * float(self.sigma_m[0] ** 2 + self.sigma_m[1] ** 2))

    def shown(self) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[str, str], ...]]:
        """What people are shown of it: readings with their units, and words."""
        readings = [("dead reckoning sigma, m", self.level_sigma_m)]
        if not math.isnan(self.wind_mps[0]):
            north, east = self.wind_mps.tolist()
            readings.append(("wind found, m/s", math.hypot(north, east)))
            readings.append(("wind found from, degrees", math.degrees(math.atan2(-east, -north)) % 360.0))
        denied = ("believed", "refused: they jumped", "refused: they walk off")[self.denied]
        return tuple(readings), (("positions", denied),)


@dataclass(frozen=True, slots=True, eq=False)
class Easing:
    """How a position source that comes back is approached: from when until when, and what it was off by then (3,), in m."""

    since: int
    until: int
    off_m: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Reckoner:
    """One vehicle. `tips`: at whole seconds, oldest first, and the newest."""

    told: Told = Told()
    tips: tuple[Tip, ...] = ()

    @property
    def tip(self) -> Tip | None:
        """The newest."""
        return self.tips[-1] if self.tips else None


@dataclass(frozen=True, slots=True)
class Reckoners:
    """All vehicles that tell of their own motion."""

    by_aircraft: Mapping[str, Reckoner] = field(default_factory=lambda: MappingProxyType({}))
    types: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))  # MAV_TYPE
    waiting: tuple[Waiting, ...] = ()
    places: tuple[tuple[str, int, tuple[float, ...]], ...] = ()  # aircraft, when, and as `told.PLACE`
    easings: Mapping[str, Easing] = field(default_factory=lambda: MappingProxyType({}))
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
        """Whether nothing would happen however often it is advanced."""
        return not (self.by_aircraft or self.waiting)

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

    def easing(self, aircraft: str, easing: Easing) -> Reckoners:
        """The same with how a vehicle's positions are approached."""
        return replace(self, easings={**self.easings, aircraft: easing})

    def denied(self, aircraft: str) -> int:
        """Why a vehicle's positions are refused."""
        reckoner = self.by_aircraft.get(aircraft)
        return NOTHING if reckoner is None or reckoner.tip is None else int(reckoner.tip.denied[0])

    def advanced(self, at: int, history_ns: int, settings: DeadReckoning) -> Reckoners:
        """All of them as far as what was received before an instant tells, its position sources judged."""
        portions, later = self._portions(at)
        known, crowded = self._known(portions)
        by_place = _by_aircraft(self.places)
        oldest = at - history_ns
        changed: dict[str, Reckoner] = {}
        running: list[tuple[str, Reckoner, Cells]] = []
        for aircraft, was in known.items():
            told, since = _with_portions(was.told, [one[aircraft] for one in portions if aircraft in one])
            if aircraft in by_place:
                more = by_place[aircraft]
                told, since = replace(told, places=told.places.with_more(more)), min(since, int(more.at[0]))
            reckoner = _begun_or_kept(replace(was, told=told), since, at, settings)
            changed[aircraft] = reckoner
            end = 0 if reckoner.tip is None else covered_until(told, int(reckoner.tip.cell[0]))
            if reckoner.tip is not None and end > reckoner.tip.cell[0]:
                running.append((aircraft, reckoner, cells(told, int(reckoner.tip.cell[0]), end)))
        changed |= self._run(running, settings)
        kept = {aircraft: _pruned(one, oldest, settings) for aircraft, one in changed.items()}
        alive = {name: one for name, one in kept.items() if len(one.told.series[INERTIAL].at)}
        return replace(self, by_aircraft=alive, waiting=later, places=(), crowded=self.crowded or crowded)

    def _portions(self, at: int) -> tuple[list[Portion], tuple[Waiting, ...]]:
        portions, later = [], list[Waiting]()
        by_added: dict[int, list[Observation]] = {}
        for added, observations in self.waiting:
            by_added.setdefault(added, []).extend(observations)
        for added, several in by_added.items():
            portion, rest = portioned(several, at - added)
            portions.append(portion)
            if rest:
                later.append((added, tuple(rest)))
        return portions, tuple(later)

    def _known(self, portions: Sequence[Portion]) -> tuple[dict[str, Reckoner], bool]:
        """The vehicles with those that are new, as far as there is room; and whether there is none for some."""
        known = dict(self.by_aircraft)
        new = sorted({name for portion in portions for name, told in portion.items() if INERTIAL in told} - {*known})
        room = max(VEHICLES_AT_MOST - len(known), 0)
        known |= {aircraft: Reckoner() for aircraft in new[:room]}
        return known, len(new) > room

    def _run(self, running: Sequence[tuple[str, Reckoner, Cells]], settings: DeadReckoning) -> dict[str, Reckoner]:
        if not running:
            return {}
        kinds = Kinds.of([self.types.get(aircraft) for aircraft, _, _ in running])
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
        before = next((one for one in reversed(reckoner.tips) if int(one.cell[0]) * CELL_NS <= at), reckoner.tips[0])
        return replace(_reckoned(aircraft, before, at), denied=self.denied(aircraft))

    def wind_mps(self, aircraft: str | None) -> tuple[float, float]:
        """The wind that a vehicle has found, east and north, where the air moves to; NaN = it has not."""
        reckoner = self.by_aircraft.get(aircraft or "")
        if reckoner is None or reckoner.tip is None:
            return math.nan, math.nan
        north, east = _wind_mps(reckoner.tip).tolist()
        return east, north

    def pictured(self, aircraft: str, at: int, place: tuple[float, ...]) -> Reckoners:
        """The same with where radars had a vehicle, as `told.PLACE`; it counts from the next second on."""
        known = self.by_aircraft[aircraft]
        more = Series(np.array([at]), np.array([place]))
        told = replace(known.told, pictured=known.told.pictured.with_more(more))
        tips = _untouched(known.tips, at)
        return replace(self, by_aircraft={**self.by_aircraft, aircraft: Reckoner(told, tips)})


def _by_aircraft(places: Sequence[tuple[str, int, tuple[float, ...]]]) -> dict[str, Series]:
    found: dict[str, list[tuple[int, tuple[float, ...]]]] = {}
    for aircraft, at, place in places:
        found.setdefault(aircraft, []).append((at, place))
    empty = Series.empty(PLACE)
    return {
        aircraft: empty.with_more(Series(np.array([at for at, _ in rows]), np.array([place for _, place in rows])))
        for aircraft, rows in found.items()
    }


def _with_portions(told: Told, portions: Sequence[Mapping[int, Series]]) -> tuple[Told, int]:
    """What was told with what came since, and from when on that changes anything."""
    since = 1 << 62
    for portion in portions:
        told = told.with_more(portion)
        for kind, series in portion.items():
            first = int(series.at[0])
            if kind == INERTIAL:  # the line to it begins at the sample before
                at = told.series[kind].at
                first = int(at[max(int(np.searchsorted(at, first)) - 1, 0)])
            since = min(since, first)
    return told, since


def _untouched(tips: tuple[Tip, ...], since: int) -> tuple[Tip, ...]:
    """The tips that what was so at an instant, or later, does not change; the oldest in any case."""
    return tips[:1] + tuple(tip for tip in tips[1:] if int(tip.cell[0]) * CELL_NS <= since)


def _begun_or_kept(one: Reckoner, since: int, at: int, settings: DeadReckoning) -> Reckoner:
    """A vehicle's tips as far as they still hold; the first one, where dead reckoning can begin."""
    tips = _untouched(one.tips, since)
    if tips:
        end = covered_until(one.told, int(tips[-1].cell[0]))
        if at - end * CELL_NS > SILENT_NS:  # for so long what is missing may still come
            tips = ()
    if not tips:
        first = first_tip(one.told, settings)
        tips = () if first is None else (first,)
    return replace(one, tips=tips)


def first_tip(told: Told, settings: DeadReckoning) -> Tip | None:
    """The first tip, at the newest position with a velocity that an attitude is near to, if the unit goes on from there."""
    places, attitudes = told.places, told.series[ATTITUDE]
    if not len(places.at) or not len(attitudes.at) or not len(told.inertial.at):
        return None
    since = first_covered(told, 0)
    until = covered_until(told, since)
    at = places.at // CELL_NS // BLOCK * BLOCK
    usable = np.flatnonzero(~np.isnan(places.values[:, 3]) & (at >= since) & (at < until))
    for row in usable[::-1].tolist():
        nearest = int(np.argmin(np.abs(attitudes.at - places.at[row])))
        if abs(int(attitudes.at[nearest] - places.at[row])) <= NEAR_ATTITUDE_NS:
            return begun(int(places.at[row]), places.values[row], attitudes.values[nearest], settings)
    return None


def _pruned(one: Reckoner, oldest: int, settings: DeadReckoning) -> Reckoner:
    """A vehicle without what is too old, and without a dead reckoning that knows nothing any more."""
    tips = one.tips
    if tips:
        kept = [tip for tip in tips[:-1] if int(tip.cell[0]) % SECOND_CELLS == 0]
        recent = [tip for tip in kept if int(tip.cell[0]) * CELL_NS > oldest]
        older = kept[: len(kept) - len(recent)]
        tips = (*older[-1:], *recent, tips[-1])
        variance = tips[-1].state.covariance[0, 0, (0, 1), (0, 1)]
        if not variance.max() <= settings.ends_at_sigma_m**2:  # also what is no number
            tips = ()
    return Reckoner(one.told.since(oldest - MARGIN_NS), tips)


def _reckoned(aircraft: str, tip: Tip, at: int) -> Reckoned:
    """A tip carried on, or back, to an instant."""
    ahead_ns = at - int(tip.cell[0]) * CELL_NS
    ahead_s = ahead_ns / SECOND
    motion, accelerated = tip.state.motion, tip.accelerated_mps2[0]
    velocity = motion.velocity_mps[0, 0] + accelerated * ahead_s
    metres = (motion.velocity_mps[0, 0] + 0.5 * accelerated * ahead_s) * ahead_s
    latitude, longitude, height = displaced(
        motion.latitude_rad[0, 0], motion.longitude_rad[0, 0], motion.height_m[0, 0], metres
    )
    variance = np.diagonal(tip.state.covariance[0, 0])
    jerked = JERKED_MPS2 * ahead_s
    return Reckoned(
        aircraft,
        at,
        float(latitude),
        float(longitude),
        float(height),
        velocity,
        np.sqrt(variance[:3] + WANDERS_M**2 + variance[3:6] * ahead_s**2 + (0.5 * jerked * ahead_s) ** 2),
        np.sqrt(variance[3:6] + jerked**2),
        _wind_mps(tip),
        math.sqrt(float(tip.scatter_m2[0])),
        int(tip.denied[0]),
        int(tip.heard[0]) * CELL_NS,
        bool(tip.cell[0] - tip.began[0] >= TRUSTED_AFTER),
        ahead_s,
    )


def _wind_mps(tip: Tip) -> Floats:
    """North and east (2,); NaN = not known."""
    is_known = tip.state.covariance[0, 0, dr.WIND, dr.WIND].max() < WIND_KNOWN_MPS**2
    return tip.state.wind_mps[0, 0] if is_known else np.full(2, math.nan)
