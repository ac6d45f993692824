"""What the header times of radars are worth: each radar's clock beside the session's."""

from __future__ import annotations

from dataclasses import dataclass, field

from adapters.clock import LIMIT_NS
from adapters.epoch import SessionEpoch, foreign_clock
from adapters.landing_radar import Header
from adapters.meters import SpeedMeter
from gateway.observation import Timing


@dataclass(slots=True)
class _RadarClock:
    speed: SpeedMeter = field(default_factory=SpeedMeter)
    is_named_foreign: bool = False


@dataclass(slots=True)
class RadarClocks:
    """The clocks of all radars of a session. What there is to say once gathers in `notes` as (level, text)."""

    epoch: SessionEpoch
    notes: list[tuple[str, str]]
    _clocks: dict[int, _RadarClock] = field(default_factory=dict)

    def timing(self, header: Header, received_at: int) -> Timing:
        """What the time of a datagram, heard at a stamp, is worth; the first one may give the session its time."""
        key = ("radar", header.radar)
        clock = self._clocks.setdefault(header.radar, _RadarClock())
        clock.speed.hear(received_at, header.time)
        if self.epoch.hear(key, header.time, received_at, clock.speed.speed) and self.epoch.offset_s:
            offset = f"{self.epoch.offset_s:+d} s from this machine's"
            self.notes.append(("info", f"The session runs on the clock of radar {header.radar}, {offset}."))
        timing = self.epoch.timing(key)
        if timing is Timing.PROVISIONAL and abs(header.time - received_at) >= LIMIT_NS:
            return Timing.FOREIGN  # until the session's time is known nobody can say that it is late
        if timing is Timing.FOREIGN and not clock.is_named_foreign:
            clock.is_named_foreign = True
            self.notes.append(("warning", foreign_clock(f"radar {header.radar}", self.epoch.lag_s(key))))
        return timing
