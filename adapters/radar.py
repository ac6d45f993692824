"""The receiving side of the landing-radar wire: windows, keys and counters for each radar number; bytes in, values out.

Of each sender the last 1024 sequence numbers are remembered. A number seen before is a duplicate and dropped; one that
comes after a higher one is late and taken; a gap counts as lost. A sequence that falls back while the radar's clock goes on
is a radar that restarted: a new window. A radar with a key has one window for all senders, so that nothing recorded can be
sent again from elsewhere; without a key each sender has its own, since two radars of one number count separately.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

from adapters.landing_radar import Datagram, Header, Plot, Reason, Status, examine, records
from gateway.observation import RadarPlot, RadarStatus, Timing

WINDOW = 1024
LIVE_LIMIT_NS = 10 * 10**9
_RESTART_NS = 10**9  # within the window, only a datagram this much newer than every other tells of a restart
_SILENT_NS = 10 * 10**9  # a sender that was silent this long has been replaced, not doubled
_FASTEST_HZ = 1000  # a jump ahead by more than the window that no radar could have sent is a restart, not a loss
_LONGEST_GAP_S = 3600.0  # nor does a clock that leaps further make a loss of it: without a key anybody can write one
_WRAP = 1 << 32
_RADARS_AT_MOST = 64  # without a key; the numbers of more are made up
_SENDERS_AT_MOST = 64  # of one radar; the one silent for longest is forgotten
_NAMED_AT_MOST = 16  # senders of one radar that are told by name


@dataclass(slots=True)
class _Window:
    """The sequence numbers lately seen from one sender, as bits: bit d is `newest - d`."""

    newest: int = -1
    newest_time: int = -1
    floor_time: int = -1  # nothing at or before this belongs to the present run of the radar
    seen: int = 0

    def place(self, sequence: int, time: int, keyed: bool) -> tuple[Reason | None, str, int]:
        """Why this one is refused (None: it is taken), what it is ("", "late", "restarted"), and how many were lost."""
        if self.newest < 0:
            self._begin(sequence, time)
            return None, "", 0
        ahead = (sequence - self.newest) % _WRAP
        if time <= self.floor_time:
            return ("replayed" if keyed else None), "late", 0
        if 0 < ahead < _WRAP // 2:
            elapsed_s = min(max(time - self.newest_time, 0) / 10**9, _LONGEST_GAP_S)
            if ahead > WINDOW and ahead > _FASTEST_HZ * elapsed_s:
                return self._restart(sequence, time) if time > self.newest_time or not keyed else ("replayed", "", 0)
            self.seen = (self.seen << ahead | 1) & ((1 << WINDOW) - 1) if ahead < WINDOW else 1
            self.newest, self.newest_time = sequence, max(time, self.newest_time)
            return None, "", ahead - 1
        return self._behind(sequence, time, _WRAP - ahead if ahead else 0, keyed)

    def _behind(self, sequence: int, time: int, behind: int, keyed: bool) -> tuple[Reason | None, str, int]:
        seen = behind < WINDOW and bool(self.seen >> behind & 1)
        if behind >= WINDOW and time > self.newest_time:
            return self._restart(sequence, time)
        if seen and keyed:
            return "replayed", "", 0
        if behind and time > self.newest_time + _RESTART_NS:
            return self._restart(sequence, time)
        if seen:
            return "duplicate", "", 0
        if behind >= WINDOW:
            return ("replayed" if keyed else None), "late", 0
        self.seen |= 1 << behind
        return None, "late", -1  # it had been counted as lost

    def _begin(self, sequence: int, time: int) -> None:
        self.newest, self.newest_time, self.seen = sequence, time, 1

    def _restart(self, sequence: int, time: int) -> tuple[Reason | None, str, int]:
        self.floor_time = self.newest_time if time > self.newest_time else -1
        self._begin(sequence, time)
        return None, "restarted", 0


@dataclass(slots=True)
class _Radar:
    windows: dict[Hashable, _Window] = field(default_factory=dict)
    senders: dict[Hashable, tuple[str, int]] = field(
        default_factory=dict
    )  # name, session time when last heard; newest last
    named: int = 0

    def hear_sender(self, peer: Hashable, name: str, now: int) -> None:
        """Take note of who has sent; of too many the longest silent is forgotten."""
        self.senders.pop(peer, None)
        self.senders[peer] = (name, now)
        if len(self.senders) > _SENDERS_AT_MOST:
            silent = next(iter(self.senders))
            del self.senders[silent]
            self.windows.pop(silent, None)


@dataclass(frozen=True, slots=True)
class Taken:
    """A datagram that was taken, and what there is to say of it once, as (level, text)."""

    datagram: Datagram
    notes: tuple[tuple[str, str], ...] = ()


@dataclass(slots=True)
class LandingRadarReceiver:
    """All radars of a session. `keys`: the key of each radar number that has one; `live`: replays by age are refused too."""

    keys: Mapping[int, bytes] = field(default_factory=dict)
    live: bool = False
    counters: Counter[str] = field(default_factory=Counter)
    _radars: dict[int, _Radar] = field(default_factory=dict)

    def hear(self, data: bytes, sender: Hashable, name: str, session_time: int) -> Taken | Reason:
        """One datagram of one sender (`name`: what people call it): taken, or the reason why not. Never raises.

        `session_time` (ns UTC) is used on live links only: a keyed datagram more than 10 s from it is refused.
        """
        outcome = self._judge(data, sender, name, session_time)
        self.counters["datagrams" if isinstance(outcome, Taken) else outcome] += 1
        return outcome

    def _judge(self, data: bytes, sender: Hashable, name: str, session_time: int) -> Taken | Reason:
        key = self.keys.get(int.from_bytes(data[4:6], "big")) if self.keys else None
        header = examine(data, key)
        if isinstance(header, str):
            return header
        if key is not None and self.live and abs(header.time - session_time) > LIVE_LIMIT_NS:
            return "replayed"
        radar = self._radars.get(header.radar)
        if radar is None:
            if key is None and len(self._radars) >= _RADARS_AT_MOST + len(self.keys):
                return "too many radars"
            radar = _Radar()
        place = None if key is not None else sender
        window = radar.windows.get(place) or _Window()
        before = (window.newest, window.newest_time, window.floor_time, window.seen)
        refused, kind, lost = window.place(header.sequence, header.time, key is not None)
        if refused is not None:
            return refused
        found = records(data, header)
        if isinstance(found, str):  # a datagram that is refused leaves no trace in the window
            window.newest, window.newest_time, window.floor_time, window.seen = before
            return found
        self._radars[header.radar], radar.windows[place] = radar, window
        self.counters["lost"] += lost
        if kind:
            self.counters[kind] += 1
        return Taken(Datagram(header, found), self._notes(radar, header, (sender, name), session_time, kind))

    def _notes(
        self, radar: _Radar, header: Header, sender: tuple[Hashable, str], now: int, kind: str
    ) -> tuple[tuple[str, str], ...]:
        notes: list[tuple[str, str]] = []
        peer, name = sender
        if peer not in radar.senders:
            others = [other for other, heard in radar.senders.values() if now - heard < _SILENT_NS]
            if others:
                self.counters["second sender"] += 1
                text = f"Radar {header.radar} is sent by {others[0]} and also by {name}: give each its own number."
                notes.append(("warning", text))
            elif radar.senders:
                notes.append(("info", f"Radar {header.radar} is now sent by {name}."))
            radar.named += 1
            if radar.named > _NAMED_AT_MOST:
                notes.clear()
        radar.hear_sender(peer, name, now)
        if kind == "restarted":
            notes.append(("info", f"Radar {header.radar} has restarted: its sequence numbers begin anew."))
        return tuple(notes)


def refusal_advice(reason: Reason, origin: str) -> str:
    """What to tell a person the first time that a datagram is refused for a reason; "": damage, which is counted only."""
    return f"{origin}: {_ADVICE[reason]}" if reason in _ADVICE else ""


_ADVICE: Mapping[Reason, str] = {
    "magic": "what comes is no landing radar's, and is refused; is it sent to the right port?",
    "version": "a landing radar speaks a version of the protocol that is not known here, and is refused.",
    "tag": "a radar's datagrams without a right tag are refused; is its key_file in the site file the key that was set up there?",
    "replayed": "a keyed radar's datagrams that were sent before, or are more than 10 s old or early, are refused; "
    "is its clock set, and is nobody playing a recording?",
    "too many radars": f"more than {_RADARS_AT_MOST} radars without a key are not heard.",
}


def observations(datagram: Datagram, received_at: int, timing: Timing) -> tuple[RadarPlot | RadarStatus, ...]:
    """A datagram's records as observations: radians, metres, ns; the time of measurement is what they mean."""
    header = datagram.header
    return tuple(
        _radar_plot(record, header, received_at, timing)
        if isinstance(record, Plot)
        else _radar_status(record, header, received_at)
        for record in datagram.records
    )


def _radar_plot(plot: Plot, header: Header, received_at: int, timing: Timing) -> RadarPlot:
    return RadarPlot(
        header.radar,
        plot.track_number,
        plot.time,
        received_at,
        plot.range_m,
        None if plot.azimuth_deg is None else math.radians(plot.azimuth_deg),
        None if plot.elevation_deg is None else math.radians(plot.elevation_deg),
        plot.radial_velocity_mps,
        plot.snr_db,
        plot.range_sigma_m,
        plot.azimuth_sigma_rad,
        plot.elevation_sigma_rad,
        header.simulated,
        timing,
    )


def _radar_status(status: Status, header: Header, received_at: int) -> RadarStatus:
    return RadarStatus(
        header.radar,
        header.time,
        received_at,
        status.state,
        status.mode,
        status.update_period_s,
        math.radians(status.latitude_deg),
        math.radians(status.longitude_deg),
        status.height_m,
        math.radians(status.boresight_deg),
    )
