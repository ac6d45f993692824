"""Arrivals to what was heard: the one door from bytes to observations, the same live and replayed.

A pure function of the arrivals so far: no clock is read here, so that a replay of the same arrivals says the same.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from adapters import Arrival, Source
from adapters.clock import SessionEpoch
from adapters.mavlink import MavlinkObserver
from adapters.mavlink_frames import parse
from adapters.meters import SECOND, SpeedMeter
from adapters.radar import LandingRadarReceiver, Taken, observations
from gateway.observation import Heard, Observation, Timing
from gateway.picture import Health, SourceHealth

_RATE_S = 10


@dataclass(slots=True)
class _Listened:
    """One source's health."""

    source: Source
    counters: Counter[str] = field(default_factory=Counter)
    known_good: set[int] = field(default_factory=set)  # message ids that have passed their checksum
    last_heard: int | None = None
    lately: deque[list[int]] = field(default_factory=lambda: deque(maxlen=_RATE_S + 1))  # [second, observations]

    def count(self, received_at: int, number: int) -> None:
        """Take note of observations for the rate."""
        second = received_at // SECOND
        if self.lately and self.lately[-1][0] == second:
            self.lately[-1][1] += number
        else:
            self.lately.append([second, number])

    def health(self, received_at: int) -> SourceHealth:
        """How the source is doing at a stamp."""
        now = received_at // SECOND
        number = sum(count for second, count in self.lately if now - _RATE_S <= second < now)
        age_s = 0.0 if self.last_heard is None else max(received_at - self.last_heard, 0) / SECOND
        reasons = tuple(
            sorted((reason, total) for reason, total in self.counters.items() if total and reason != "lost")
        )
        source = self.source
        return SourceHealth(source.name, source.kind, age_s, number / _RATE_S, max(self.counters["lost"], 0), reasons)


@dataclass(slots=True)
class _RadarClock:
    speed: SpeedMeter = field(default_factory=SpeedMeter)
    is_named_foreign: bool = False


class Decoder:
    """Decodes the arrivals of a session, source by source, in the order of their stamps.

    `keys`: the key of each radar number that has one. `live`: a keyed datagram that is more than 10 s from the session's
    time is refused; a replay does not repeat that. After each `feed`, `refused` is the reason why that arrival was
    refused, or None: what was refused is to be recorded apart and not replayed; it has left no trace but its counter.
    """

    def __init__(
        self, sources: Sequence[Source] = (), *, keys: Mapping[int, bytes] | None = None, live: bool = False
    ) -> None:
        self.refused: str | None = None
        self._epoch = SessionEpoch()
        self._mavlink = MavlinkObserver(self._epoch)
        self._radar = LandingRadarReceiver(dict(keys or {}), live)
        self._radar_clocks: dict[tuple[str, int], _RadarClock] = {}
        self._listened: dict[int, _Listened] = {}
        self._notes = self._mavlink.notes
        for source in sources:
            self.add(source)

    def add(self, source: Source) -> None:
        """A source that is new."""
        self._listened[source.number] = _Listened(source)
        self._mavlink.origins[source.number] = source.origin

    @property
    def epoch_offset_s(self) -> int | None:
        """The session's epoch offset in whole seconds; None as long as no source's clock has settled."""
        return self._epoch.offset_s

    def session_time(self, received_at: int) -> int:
        """The session's time of a stamp, ns since 1970 UTC."""
        return self._epoch.session_time(received_at)

    def feed(self, arrival: Arrival) -> Heard:
        """One MAVLink frame or one radar datagram. Raises KeyError for a source that was not added, and nothing else."""
        listened = self._listened[arrival.source]
        listened.last_heard = arrival.received_at
        self.refused = None
        if listened.source.kind == "radar":
            found = self._feed_radar(arrival, listened)
        else:
            found = self._feed_mavlink(arrival, listened)
        if found:
            listened.count(arrival.received_at, len(found))
        return Heard(self._epoch.session_time(arrival.received_at), found, self._say())

    def watermark(self, received_at: int) -> Heard:
        """Nothing stamped at or before this is still to come."""
        return Heard(self._epoch.session_time(received_at), (), self._say())

    def health(self, received_at: int) -> Health:
        """How each source is doing at a stamp."""
        return Health(tuple(self._listened[number].health(received_at) for number in sorted(self._listened)))

    def counters(self) -> dict[str, int]:
        """Totals by source and reason."""
        return {
            f"{listened.source.name} {reason}": total
            for _, listened in sorted(self._listened.items())
            for reason, total in sorted(listened.counters.items())
            if total
        }

    def _say(self) -> tuple[tuple[str, str], ...]:
        if not self._notes:
            return ()
        notes = tuple(self._notes)
        self._notes.clear()
        return notes

    def _feed_mavlink(self, arrival: Arrival, listened: _Listened) -> tuple[Observation, ...]:
        frame = parse(arrival.data)
        if frame is None:
            listened.counters["not a frame"] += 1
            return ()
        listened.counters["frames"] += 1
        if frame.verdict == "good":
            listened.known_good.add(frame.message)
        elif frame.verdict == "bad checksum":  # always for one id, while framing goes on: not damage
            listened.counters["crc error" if frame.message in listened.known_good else "definition differs"] += 1
        else:
            listened.counters[frame.verdict] += 1
        if frame.signed:
            listened.counters["signed, unchecked"] += 1
        return self._mavlink.hear(arrival.source, frame, arrival.received_at, listened.counters)

    def _feed_radar(self, arrival: Arrival, listened: _Listened) -> tuple[Observation, ...]:
        origin = listened.source.origin if not arrival.peer else f"{arrival.peer} on {listened.source.origin}"
        now = self._epoch.session_time(arrival.received_at)
        self._radar.counters = listened.counters
        outcome = self._radar.hear(arrival.data, (arrival.source, arrival.peer), origin, now)
        if not isinstance(outcome, Taken):
            self.refused = outcome
            return ()
        self._notes.extend(outcome.notes)
        timing = self._radar_timing(outcome, arrival.received_at)
        return observations(outcome.datagram, arrival.received_at, timing)

    def _radar_timing(self, taken: Taken, received_at: int) -> Timing:
        header = taken.datagram.header
        key = ("radar", header.radar)
        clock = self._radar_clocks.setdefault(key, _RadarClock())
        clock.speed.hear(received_at, header.time)
        if self._epoch.hear(key, header.time, received_at, clock.speed.speed) and self._epoch.offset_s:
            text = f"The session runs on the clock of radar {header.radar}, {self._epoch.offset_s:+d} s from this machine's."
            self._notes.append(("info", text))
        timing = self._epoch.timing(key)
        if timing is Timing.FOREIGN and not clock.is_named_foreign:
            clock.is_named_foreign = True
            lag = self._epoch.lag_s(key)
            side = "behind" if lag > 0 else "ahead of"
            text = (
                f"The clock of radar {header.radar} is {abs(lag):.0f} s {side} the session's: it is shown, not fused."
            )
            self._notes.append(("warning", text))
        return timing
