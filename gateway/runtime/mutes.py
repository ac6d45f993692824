"""Sources that are not listened to for a while: what they report is taken out after decoding, and counted.

Their clocks, plans and states are heard all the same, so that nothing else changes.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from gateway.observation import GpsReport, Heard, Observation, RadarPlot
from gateway.runtime.muted import Muted
from gateway.settings import Mute

_KINDS = {"gps": "GPS reports muted", "radar": "radar plots muted"}


class Muting:
    """Takes out what is muted at its arrival's stamp. `counters`: how much, by kind; `muted`: what it scores."""

    def __init__(self, mutes: tuple[Mute, ...]) -> None:
        self._mutes = mutes
        self.counters: Counter[str] = Counter()
        self.muted = Muted()

    def without_muted(self, heard: Heard, received_at: int) -> Heard | None:
        """What is left of an arrival; None when that is nothing."""
        active = [mute for mute in self._mutes if mute.since <= received_at < mute.until]
        if not active:
            self._know(heard.observations)
            return heard
        left = tuple(observation for observation in heard.observations if not self._is_muted(observation, active))
        self._know(left)
        if len(left) == len(heard.observations):
            return heard
        return replace(heard, observations=left) if left or heard.notes else None

    def _know(self, observations: tuple[Observation, ...]) -> None:
        for observation in observations:
            if isinstance(observation, GpsReport):
                self.muted.know(observation)

    def _is_muted(self, observation: Observation, active: list[Mute]) -> bool:
        for mute in active:
            if mute.what == "gps" and isinstance(observation, GpsReport):
                hit = mute.number is None or _system_of(observation.aircraft) == mute.number
            elif mute.what == "radar" and isinstance(observation, RadarPlot):
                hit = mute.number is None or observation.radar == mute.number
            else:
                hit = False
            if hit:
                self.counters[_KINDS[mute.what]] += 1
                if isinstance(observation, GpsReport):
                    self.muted.hear(observation)
                return True
        return False


def _system_of(aircraft: str) -> int | None:
    """The system number of "mavlink:1" and "mavlink:1@2"; None for what has none."""
    kind, _, rest = aircraft.partition(":")
    number = rest.partition("@")[0]
    return int(number) if kind == "mavlink" and number.isdecimal() else None
