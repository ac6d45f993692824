"""What a recording is, told from what is in it, never from its name; and its arrivals.

Kinds of recordings:

    .tlog               from the first record on: stamp, frame, stamp, frame
    .pcap, .pcapng      by their magic; a capture can hold landing-radar datagrams, MAVLink datagrams, or both
    .BIN                ArduPilot dataflash: A3 95 80 (its format message comes first)
    .ulg                PX4: "ULog" 01 12 35
    session folder      holds session.json
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from adapters import Arrival, Source
from adapters.mavlink_frames import V1, V2, FrameScanner, parse
from adapters.pcap import Captured, PcapReader, is_capture
from adapters.tlog import STEP_NS, TlogReader, record_end

Kind = Literal["tlog", "pcap", "pcapng", "BIN", "ulg", "session"]

_BEGINNING = 1 << 16
_LOOK_AT = 2000  # datagrams of a capture that are looked at to tell what it holds


class FileError(ValueError):
    """A file that cannot be replayed; the message is one plain sentence."""


def kind_of(path: Path) -> Kind:
    """What a file or folder is.

    Raises FileError when it does not exist, is empty or is no recording that we know.
    """
    if path.is_dir():
        if (path / "session.json").is_file():
            return "session"
        raise FileError(f"{path} is a folder without session.json: name a session's folder or a recording.")
    try:
        with path.open("rb") as file:
            beginning = file.read(_BEGINNING)
    except OSError as error:
        raise FileError(f"{path} cannot be read ({(error.strerror or str(error)).lower()}).") from error
    if not beginning:
        raise FileError(f"{path} is empty.")
    if is_capture(beginning):
        return "pcapng" if beginning[:4] == b"\x0a\x0d\x0d\x0a" else "pcap"
    if beginning[:3] == b"\xa3\x95\x80":
        return "BIN"
    if beginning[:7] == b"ULog\x01\x12\x35":
        return "ulg"
    if _is_tlog(beginning):
        return "tlog"
    raise FileError(
        f"{path} is {_what_else(beginning)}: a .tlog, .pcap or .pcapng file, or a session's folder, can be replayed."
    )


def _is_tlog(beginning: bytes) -> bool:
    """Whether records stand here: three in a row, or as many as there are, at least one good by its checksum."""
    for start in range(min(len(beginning), 2048)):
        if start + 8 < len(beginning) and beginning[start + 8] not in (V1, V2):
            continue
        at, good, count = start, 0, 0
        while count < 20 and (end := record_end(beginning, at)) is not None:
            frame = parse(beginning[at + 8 : end])
            good += frame is not None and frame.verdict == "good"
            at, count = end, count + 1
        if good and (count >= 3 or (start == 0 and at == len(beginning))):
            return True
    return False


def _what_else(beginning: bytes) -> str:
    if any(frame for frame in FrameScanner().feed_datagram(beginning)):
        return "a stream of MAVLink frames without times"
    if len(beginning) < 24:
        return "too short to be a recording"
    if beginning.lstrip()[:1] in (b"{", b"[") and _is_json(beginning):
        return "a JSON file, not a recording"
    text = beginning[:512]
    return (
        "a text file, not a recording" if all(byte >= 32 or byte in b"\t\r\n" for byte in text) else "not a recording"
    )


def _is_json(beginning: bytes) -> bool:
    try:
        json.JSONDecoder().raw_decode(beginning.decode("utf-8", "ignore").lstrip())
    except ValueError:
        return len(beginning) == _BEGINNING  # cut by us, most likely
    return True


@dataclass(slots=True)
class Recording:
    """A .tlog or capture: its sources, numbered from `first_number`, and its arrivals.

    A .tlog is one source. A capture has one for its landing-radar datagrams and one for each sender of MAVLink.
    """

    path: Path
    kind: Kind
    first_number: int = 0
    counters: Counter[str] = field(default_factory=Counter)
    sources: tuple[Source, ...] = ()
    _numbers: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = self.path.stem or "input"
        if self.kind == "tlog":
            self.sources = (Source(self.first_number, "mavlink", name, str(self.path)),)
            return
        with self.path.open("rb") as file:
            senders = _senders(PcapReader(file))
        number, sources = self.first_number, []
        if "" in senders:
            sources.append(Source(number, "radar", f"{name}-radar" if len(senders) > 1 else name, str(self.path)))
        for index, sender in enumerate(sender for sender in senders if sender):
            sources.append(
                Source(number + len(sources), "mavlink", f"{name}-mavlink-{index + 1}", f"{sender} in {self.path}")
            )
        self._numbers = {sender: source.number for sender, source in zip(senders, sources, strict=True)}
        self.sources = tuple(sources)
        if not sources:
            raise FileError(f"{self.path} holds no landing-radar and no MAVLink datagrams.")

    def arrivals(self) -> Iterator[Arrival]:
        """Every arrival in the file's order, stamps strictly increasing multiples of 4 microseconds.

        Raises FileError when there is none.
        """
        found = False
        with self.path.open("rb") as file:
            if self.kind == "tlog":
                for stamp, frame in TlogReader(file, self.counters):
                    found = True
                    yield Arrival(stamp, self.first_number, frame)
            else:
                for arrival in self._captured(PcapReader(file, self.counters)):
                    found = True
                    yield arrival
        if not found:
            raise FileError(f"{self.path} holds no whole MAVLink frame and no radar datagram.")

    def _captured(self, reader: PcapReader) -> Iterator[Arrival]:
        scanners: dict[str, FrameScanner] = {}
        last = -1
        for captured in reader:
            sender = _sender_of(captured)
            number = self._numbers.get(sender) if sender is not None else self._numbers.get(captured.sender)
            if sender is None and number is None and self._radar_only():
                number = self.first_number  # damaged radar datagrams belong to the radar's counters
            if number is None:
                self.counters["other datagrams"] += 1
                continue
            is_radar = self.sources[number - self.first_number].kind == "radar"
            if is_radar:
                parts = [captured.data]
            else:
                scanner = scanners.setdefault(captured.sender, FrameScanner(self.counters))
                parts = scanner.feed_datagram(captured.data)
            for part in parts:
                last = max(captured.received_at // STEP_NS * STEP_NS, last + STEP_NS if last >= 0 else 0)
                yield Arrival(last, number, part, captured.sender if is_radar else "")

    def _radar_only(self) -> bool:
        return len(self.sources) == 1 and self.sources[0].kind == "radar"


def _senders(reader: PcapReader) -> list[str]:
    """Who sends what: "" stands for the radar link, else a MAVLink sender's address; in order of appearance."""
    found: dict[str, None] = {}
    for index, captured in enumerate(reader):
        sender = _sender_of(captured)
        if sender is not None:
            found.setdefault(sender)
        if index >= _LOOK_AT and found:
            break
    return sorted(found, key=lambda sender: sender != "")


def _sender_of(captured: Captured) -> str | None:
    """The sender's address for MAVLink, an empty text for a landing-radar datagram, None for something else."""
    if captured.data[:2] == b"LR":
        return ""
    if captured.data[:1] not in (b"\xfd", b"\xfe"):
        return None
    return captured.sender if FrameScanner().feed_datagram(captured.data) else None


def open_recording(path: Path, first_number: int = 0) -> Recording:
    """A .tlog or capture to be replayed; its sources are numbered from `first_number` on.

    Raises FileError for what is none; `kind_of` tells sessions, .BIN and .ulg before.
    """
    kind = kind_of(path)
    if kind not in ("tlog", "pcap", "pcapng"):
        raise FileError(
            f"{path} is a .{kind} file, which cannot be replayed yet: give the .tlog of the same flight, or a .pcap or .pcapng."
        )
    return Recording(path, kind, first_number)
