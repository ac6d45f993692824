"""What people declare while a session runs: over a port of this machine, and in a file that is watched.

A client sends one line, a JSON object as `adapters.declared` has it, and hears one line: {"ok": true, "said": "..."}. What is
understood is told to the session as if it had come in, and recorded with it; what is not is answered with what would be.
Nobody outside this machine is listened to.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from adapters.declared import LONGEST_LINE, Goal, decode, encode_intent, encode_weather, says_where, sentence
from gateway.observation import Intent
from gateway.runtime.setup import RunFailure
from gateway.runtime.urls import LinkError
from gateway.settings import SiteError, Weather
from gateway.settings.declared import Declarations, Declared, parse_declared

DECLARE_PORT = 30071
HOST = "127.0.0.1"
PORT_FILE = "declare.json"  # in a session's folder while it runs
_CLIENTS_AT_MOST = 8
_PATIENCE_S = 5.0
_LOOK_EVERY_S = 0.5

Notes = tuple[tuple[str, str], ...]


class Known(Protocol):
    """What a session knows of aircraft and points."""

    def known_aircraft(self) -> tuple[str, ...]:
        """Those that were heard."""

    def known_points(self, aircraft: str) -> tuple[str, ...]:
        """Where one can be declared to go."""


def goal_of(text: str) -> Goal | str:
    """What a person wrote as a goal: a name, an item's number, or `latitude,longitude[,altitude]`; else a sentence."""
    if text.isdecimal():
        return Goal(item=int(text)) if int(text) < 1 << 16 else f"There is no item {text} in any plan."
    parts = text.split(",")
    if len(parts) in (2, 3):
        with contextlib.suppress(ValueError):
            latitude, longitude, *altitude = (float(part) for part in parts)
            if abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and all(abs(one) <= 1e5 for one in altitude):
                return Goal(
                    latitude_deg=latitude, longitude_deg=longitude, altitude_msl_m=altitude[0] if altitude else None
                )
            return f"{text} is no place; latitude and longitude are degrees, the altitude metres above mean sea level."
    return Goal(name=text)


def objection(told: Intent, known: Known) -> str | None:
    """Why an intent cannot be declared, in one sentence; None where it can."""
    heard = known.known_aircraft()
    if told.aircraft not in heard:
        there = f"there are {', '.join(heard)}" if heard else "nobody has been heard yet"
        return f"There is no aircraft {told.aircraft}; {there}."
    wanted = told.name if told.sequence is None else str(told.sequence)
    points = known.known_points(told.aircraft)
    if wanted is None or wanted.casefold() in (point.casefold() for point in points):
        return None
    return f"Nobody knows a point {wanted} for {told.aircraft}; known are {', '.join(points)}, or LATITUDE,LONGITUDE."


@dataclass(slots=True)
class _Client:
    """Somebody who has connected."""

    socket: socket.socket
    since: float
    data: bytes = b""


class DeclaringPort:
    """Listens on a port of this machine; `tend` takes in what came and never waits."""

    def __init__(self, port: int | None = None) -> None:
        """None: the usual port, or a free one where that is taken. Raises LinkError where a port that was asked for is taken."""
        self._listening = _bound(port)
        self.port = int(self._listening.getsockname()[1])
        self._clients: list[_Client] = []
        self._file: Path | None = None

    def tend(self, known: Known) -> list[bytes]:
        """The lines that were declared and understood."""
        self._admit()
        lines, kept = list[bytes](), list[_Client]()
        for client in self._clients:
            answer = self._hear(client, known, lines)
            if answer is None and time.monotonic() - client.since < _PATIENCE_S:
                kept.append(client)
                continue
            with contextlib.suppress(OSError):
                if answer:
                    client.socket.sendall(answer)
            client.socket.close()
        self._clients = kept
        return lines

    def write_into(self, folder: Path) -> None:
        """Leave the port's number in a session's folder; raises OSError."""
        self._file = folder / PORT_FILE
        self._file.write_text(json.dumps({"port": self.port, "process": os.getpid()}) + "\n", encoding="utf-8")

    def close(self) -> None:
        """Let go of the port."""
        for client in self._clients:
            client.socket.close()
        self._listening.close()
        if self._file is not None:
            self._file.unlink(missing_ok=True)

    def _admit(self) -> None:
        while len(self._clients) < _CLIENTS_AT_MOST:
            try:
                client, _ = self._listening.accept()
            except OSError:  # nobody, or one who has gone again
                return
            client.setblocking(False)
            self._clients.append(_Client(client, time.monotonic()))

    def _hear(self, client: _Client, known: Known, lines: list[bytes]) -> bytes | None:
        """What to answer a client; empty: nothing any more, None: its line is not whole yet."""
        try:
            data = client.socket.recv(1 << 16)
        except BlockingIOError:
            return None
        except OSError:
            return b""
        client.data += data
        if b"\n" not in client.data:
            return b"" if not data or len(client.data) > LONGEST_LINE else None
        line = client.data.partition(b"\n")[0].strip()
        said = decode(line, 0, 0)
        if said is None:
            return _answer(False, "That was not understood.")
        if isinstance(said, Intent) and says_where(said) and (why := objection(said, known)) is not None:
            return _answer(False, why)
        lines.append(line)
        told = sentence(said)
        return _answer(True, f"{told}.")


def _bound(port: int | None) -> socket.socket:
    wanted = [DECLARE_PORT, 0] if port is None else [port]
    for number in wanted:
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listening.bind((HOST, number))
        except OSError as error:
            listening.close()
            if number == wanted[-1]:
                raise LinkError(f"Port {number} is taken or not ours to take; give --declare-port another.") from error
            continue
        break
    listening.listen(_CLIENTS_AT_MOST)
    listening.setblocking(False)
    return listening


def _answer(ok: bool, said: str) -> bytes:
    return json.dumps({"ok": ok, "said": said}).encode() + b"\n"


def declare(line: bytes, port: int) -> tuple[bool, str]:
    """Tell a running gateway one line; whether it took it, and what it said. Raises LinkError where none answers."""
    try:
        with socket.create_connection((HOST, port), timeout=_PATIENCE_S) as connection:
            connection.sendall(line + b"\n")
            with connection.makefile("rb") as reader:
                answer = json.loads(reader.readline(LONGEST_LINE))
    except (OSError, ValueError) as error:
        raise LinkError(
            f"No gateway answers on port {port} of this machine; start `talkdown live`, or give the port that it prints "
            "with --port."
        ) from error
    if not isinstance(answer, dict):
        raise LinkError(f"What answers on port {port} is no gateway.")
    return bool(answer.get("ok")), str(answer.get("said", ""))


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
        except OSError as error:
            raise SiteError(f"{self.path} cannot be read: {(error.strerror or str(error)).lower()}.") from error
        except UnicodeDecodeError as error:
            raise SiteError(f"{self.path} is no text.") from error

    def _goals(self, known: Known, notes: list[tuple[str, str]]) -> list[bytes]:
        lines, wanted = [], {goal.aircraft: goal for goal in self._now.goals}
        for aircraft, goal in wanted.items():
            if self._told.get(aircraft) == goal or aircraft not in known.known_aircraft():
                continue
            line = encode_intent(aircraft, _goal(goal))
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


def lines_of(declarations: Declarations) -> list[bytes]:
    """All that a file declares, as told lines."""
    goals = [encode_intent(goal.aircraft, _goal(goal)) for goal in declarations.goals]
    return [*goals, *(encode_weather(area.name, area) for area in declarations.weather)]


def _goal(declared: Declared) -> Goal:
    if declared.to is None:
        return Goal(None, None, declared.latitude_deg, declared.longitude_deg, declared.altitude_msl_m)
    return Goal(item=int(declared.to)) if declared.to.isdecimal() else Goal(name=declared.to)


@dataclass(slots=True)
class Declaring:
    """Both ways in which people declare something to a session that runs."""

    port: DeclaringPort | None = None
    file: WatchedFile | None = None

    def tend(self, known: Known) -> tuple[list[bytes], Notes]:
        """The lines that are to be told now, and what there is to say to a person."""
        lines = [] if self.port is None else self.port.tend(known)
        if self.file is None:
            return lines, ()
        more, notes = self.file.tend(known)
        return [*lines, *more], notes

    def write_into(self, folder: Path) -> None:
        """Leave the port's number in a session's folder. Raises RunFailure."""
        if self.port is not None:
            try:
                self.port.write_into(folder)
            except OSError as error:
                raise RunFailure(
                    f"{folder} could not be written ({(error.strerror or str(error)).lower()})."
                ) from error

    def close(self) -> None:
        """Listen no more."""
        if self.port is not None:
            self.port.close()
