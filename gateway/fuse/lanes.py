"""The system tracks: their numbers, their recent states, and how they end."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from gateway.align import SECOND, Plot
from gateway.associate import Spans
from gateway.frozen import made_swiftly
from gateway.fuse.filtering import Event
from gateway.settings import Options
from gateway.track import Key, name_of

_TRACK = "track "  # no aircraft's name has a space
EVENTS_AT_MOST = 1024  # of one track: a source of more than 100 measurements a second has a shorter history


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """One system track: an aircraft's, or a radar track's that is no aircraft (`key` and which of its free times)."""

    track: int
    aircraft: str | None
    key: Key | None
    ordinal: int
    events: tuple[Event, ...] = ()
    whole: bool = True  # nothing of its past was forgotten yet
    ended_at: int | None = None
    emptied_at: int = 0  # when its past was forgotten
    origin: str = ""  # how it began, for people
    told: str = ""  # the part of its life that was last told
    began_at: int | None = None  # once that is forgotten
    taken: tuple[tuple[int, int], ...] = ()  # numbers of radars' tracks that it goes on with: since when, and which

    @property
    def name(self) -> str:
        """What its radar tracks are said to be: its aircraft, else the track itself."""
        return self.aircraft or f"{_TRACK}{self.track}"

    @property
    def number(self) -> int:
        """What people know it by now."""
        return self.taken[-1][1] if self.taken else self.track

    def number_at(self, at: int) -> int:
        """What people know it by at an instant."""
        return next((number for since, number in reversed(self.taken) if at >= since), self.track)

    @property
    def began(self) -> int:
        """When its first state was; only of a lane with events."""
        return self.events[0].at if self.began_at is None else self.began_at

    @property
    def last(self) -> Event:
        """The newest state; only of a lane with events."""
        return self.events[-1]

    def with_events(self, events: tuple[Event, ...]) -> Lane:
        """The same with another past. Written out: on the hot path `dataclasses.replace` would cost four times this."""
        whole, began_at = self.whole, self.began_at
        if len(events) > EVENTS_AT_MOST:
            began_at = events[0].at if began_at is None else began_at
            events, whole = events[-EVENTS_AT_MOST:], False
        return Lane(
            self.track,
            self.aircraft,
            self.key,
            self.ordinal,
            events,
            whole,
            self.ended_at,
            self.emptied_at,
            self.origin,
            self.told,
            began_at,
            self.taken,
        )

    def coasting_at(self, at: int, options: Options) -> bool:
        """Whether it has been silent for longer than its own rhythm explains."""
        silence = at - self.last.heard_at
        return silence > max(int(options.coast_after_s * SECOND), min(self.last.interval, 20 * SECOND) * 5 // 2)


@dataclass(frozen=True, slots=True)
class Ended:
    """A system track that is no more, and why. `quiet`: it never was more than tentative, and nobody need be told."""

    at: int
    track: int
    reason: str
    quiet: bool = False
    into: int | None = None  # the track that it joined


@dataclass(frozen=True, slots=True)
class Gone:
    """An aircraft's track that ended: what its number can be given back by, while the aircraft may come back."""

    track: int
    at: int  # of its last state
    ended_at: int
    enu_m: tuple[float, ...]  # (3,) where that was
    event: Event | None  # that state; forgotten when no late data can go on from it any more
    taken: tuple[tuple[int, int], ...] = ()  # see `Lane.taken`

    @property
    def number(self) -> int:
        """What people knew it by."""
        return self.taken[-1][1] if self.taken else self.track


@dataclass(frozen=True, slots=True)
class Adopted:
    """A radar track that is an aircraft since an instant, because it goes on where that one's fell silent."""

    key: Key
    aircraft: str
    since: int
    former: Key | None
    until: int | None = None
    gps_at: int = 0  # the aircraft's last report that was counted
    reports: int = 0  # how many have come since


@dataclass(frozen=True, slots=True)
class Joint:
    """A radar track that is in another radar's track since an instant, or in an aircraft's because another radar's is."""

    key: Key
    name: str  # the track's, see `Lane.name`
    since: int
    until: int | None = None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Lanes:
    """All system tracks; track numbers count from 1, and none is ever given to something else."""

    lanes: Mapping[int, Lane] = field(default_factory=dict)
    by_aircraft: Mapping[str, int] = field(default_factory=dict)
    by_key: Mapping[tuple[Key, int], int] = field(default_factory=dict)
    next_track: int = 1
    gone: Mapping[str, Gone] = field(default_factory=dict)  # of aircraft whose track ended, the latest last
    adopted: tuple[Adopted, ...] = ()
    joints: tuple[Joint, ...] = ()  # in the order in which they began

    def track_of(self, name: str) -> int | None:
        """The track with a name, see `Lane.name`; None where there is none."""
        if not name.startswith(_TRACK):
            return self.by_aircraft.get(name)
        track = int(name.removeprefix(_TRACK))
        return track if track in self.lanes else None

    def numbered(self, number: int) -> Lane:
        """The track that people know by a number now."""
        known = self.lanes.get(number)
        if known is not None and known.number == number and known.ended_at is None:
            return known
        return next(lane for lane in self.lanes.values() if lane.number == number and lane.ended_at is None)

    def with_lane(self, lane: Lane) -> Lanes:
        """The same with one lane put in place of its former self."""
        return self.with_lanes({lane.track: lane})

    def with_lanes(self, lanes: Mapping[int, Lane]) -> Lanes:
        """The same with some lanes put in place of their former selves."""
        known = {**self.lanes, **lanes}
        return Lanes(known, self.by_aircraft, self.by_key, self.next_track, self.gone, self.adopted, self.joints)

    def begun(self, aircraft: str | None, key: Key | None, ordinal: int, origin: str) -> tuple[Lanes, Lane]:
        """The same with a new lane of the next number."""
        lane = Lane(self.next_track, aircraft, key, ordinal, origin=origin)
        return replace(self.added(lane), next_track=self.next_track + 1), lane

    def added(self, lane: Lane) -> Lanes:
        """The same with a lane that is found by its aircraft, or its radar track; what is known of its end is forgotten."""
        by_aircraft, by_key, gone = self.by_aircraft, self.by_key, self.gone
        if lane.aircraft is not None:
            by_aircraft = {**by_aircraft, lane.aircraft: lane.track}
            gone = {aircraft: one for aircraft, one in gone.items() if aircraft != lane.aircraft} if gone else gone
        if lane.key is not None:
            by_key = {**by_key, (lane.key, lane.ordinal): lane.track}
        lanes = {**self.lanes, lane.track: lane}
        return Lanes(lanes, by_aircraft, by_key, self.next_track, gone, self.adopted, self.joints)

    def without(self, tracks: Iterable[int]) -> Lanes:
        """The same without some tracks."""
        gone = set(tracks)
        return replace(
            self,
            lanes={track: lane for track, lane in self.lanes.items() if track not in gone},
            by_aircraft={aircraft: track for aircraft, track in self.by_aircraft.items() if track not in gone},
            by_key={key: track for key, track in self.by_key.items() if track not in gone},
        )

    def pruned(self, before: int, share: int, shares: int) -> Lanes:
        """The same with only the last state before an instant, and what came after it, in each lane of a share of them."""
        changed = {}
        for track, lane in self.lanes.items():
            if track % shares == share and len(lane.events) > 1 and lane.events[1].at < before:
                keep = max(bisect_left(lane.events, before, key=lambda event: event.at) - 1, 0)
                changed[track] = replace(lane, events=lane.events[keep:], whole=False, began_at=lane.began)
        return self.with_lanes(changed) if changed else self


def contains(lanes: Lanes, track: int | None, plot: Plot) -> bool:
    """Whether a track has worked in a plot already; only its newest measurements can be this one or hide it."""
    if track is None:
        return False
    for event in reversed(lanes.lanes[track].events):
        if event.measure.serial == plot.serial:
            return True
        if event.at < plot.at:
            return False
    return False


def emptied(lanes: Lanes, at: int) -> tuple[Lanes, list[Ended]]:
    """The aircraft's lanes without their past, under their numbers; radar tracks' lanes end."""
    kept = {
        track: replace(lane, events=(), whole=True, emptied_at=at, began_at=None, taken=_from_the_start(lane))
        for track, lane in lanes.lanes.items()
        if lane.key is None and lane.ended_at is None
    }
    ended = [
        Ended(at, lane.number, "the session's time was set back")
        for lane in lanes.lanes.values()
        if lane.key is not None and lane.ended_at is None
    ]
    return replace(lanes, lanes=kept, by_key={}, gone={}, adopted=(), joints=()), ended


def _from_the_start(lane: Lane) -> tuple[tuple[int, int], ...]:
    return ((0, lane.number),) if lane.taken else ()


def radar_names(lane: Lane, spans: Spans, at: int) -> str | None:
    """The radar tracks behind a lane at an instant, as people write them, with a space between."""
    known = spans.by_aircraft.get(lane.name, ())
    names = {name_of(s.key) for s in known if s.since <= at and (s.until is None or at < s.until)}
    if lane.key is not None:
        names.add(name_of(lane.key))
    return " ".join(sorted(names)) or None
