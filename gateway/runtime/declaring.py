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
from dataclasses import dataclass
from pathlib import Path

from adapters.declared import LONGEST_LINE, decode, says_where, sentence
from adapters.reasons import reason_of
from gateway.observation import Intent
from gateway.runtime.declarable import Known, objection
from gateway.runtime.declared_file import Notes, WatchedFile
from gateway.runtime.setup import RunFailure
from gateway.runtime.urls import LinkError

DECLARE_PORT = 30071
HOST = "127.0.0.1"
PORT_FILE = "declare.json"  # in a session's folder while it runs
_CLIENTS_AT_MOST = 8
_PATIENCE_S = 5.0


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
                raise RunFailure(f"{folder} could not be written ({reason_of(error)}).") from error

    def close(self) -> None:
        """Listen no more."""
        if self.port is not None:
            self.port.close()
