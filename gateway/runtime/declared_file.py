"""A file of declarations that is watched while a session runs."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from adapters.declared import Goal, decode, encode_intent, encode_weather
from adapters.reasons import reason_of
from gateway.observation import Intent
from gateway.runtime.declarable import Known, goal_declared, objection
from gateway.settings import SiteError, Weather
from gateway.settings.declared import Declarations, Declared, parse_declared

_LOOK_EVERY_S = 0.5

Notes = tuple[tuple[str, str], ...]


@dataclass(slots=True)
class WatchedFile:
    """A file of declarations; what changes in it is told, what goes from it is withdrawn. Raises SiteError at first."""

    path: Path
    _seen: tuple[int, int, int] | None = None
    _newer: tuple[int, int, int] | None = None
    _looked: float = 0.0
    _now: Declarations = field(default_factory=Declarations)
    _told: dict[str, Declared] = field(default_factory=dict)
    _weather: dict[str, Weather] = field(default_factory=dict)
    _said: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._now = self._read()

    def tend(self, known: Known) -> tuple[list[bytes], Notes]:
        """The lines that are to be told now, and what there is to say to a person."""
        if time.monotonic() - self._looked < _LOOK_EVERY_S:
            return [], ()
        self._looked, notes = time.monotonic(), list[tuple[str, str]]()
        try:
            self._look()
        except SiteError as error:
            notes += self._once(f"{error} What it declared before stays.")
        lines = [*self._goals(known, notes), *self._areas()]
        return lines, tuple(notes)

    def _look(self) -> None:
        """Read it again where it has changed, and is the same as it was half a second ago: it may be just being written."""
        stamp = self._stamp()
        if stamp == self._seen:
            return
        if stamp == self._newer:
            self._now, self._said = self._read(), set()
        self._newer = stamp

    def _stamp(self) -> tuple[int, int, int]:
        try:
            found = self.path.stat()
        except OSError:
            return (0, 0, 0)  # what it declared stays
        return found.st_mtime_ns, found.st_size, found.st_ino

    def _read(self) -> Declarations:
        self._seen = self._stamp()
        try:
            return parse_declared(self.path.read_text(encoding="utf-8"), str(self.path))
        except (OSError, UnicodeDecodeError) as error:
            raise SiteError(f"{self.path} cannot be read: {reason_of(error)}.") from error

    def _goals(self, known: Known, notes: list[tuple[str, str]]) -> list[bytes]:
        lines, wanted = [], {goal.aircraft: goal for goal in self._now.goals}
        for aircraft, goal in wanted.items():
            if self._told.get(aircraft) == goal or aircraft not in known.known_aircraft():
                continue
            line = encode_intent(aircraft, goal_declared(goal))
            said = decode(line, 0, 0)
            why = objection(said, known) if isinstance(said, Intent) else f"{self.path}: {goal.to} is no point."
            if why is not None:
                notes += self._once(f"{self.path}: {why}")
                continue
            lines.append(line)
            self._told[aircraft] = goal
        for aircraft in [one for one in self._told if one not in wanted]:
            lines.append(encode_intent(aircraft, Goal()))
            del self._told[aircraft]
        return lines

    def _areas(self) -> list[bytes]:
        wanted = {area.name: area for area in self._now.weather}
        lines = [encode_weather(name, area) for name, area in wanted.items() if self._weather.get(name) != area]
        lines += [encode_weather(name, None) for name in self._weather if name not in wanted]
        self._weather = wanted
        return lines

    def _once(self, text: str) -> Sequence[tuple[str, str]]:
        if text in self._said:
            return ()
        self._said.add(text)
        return (("warning", text),)
