"""A .pcap or .pcapng as a recording: one source for its landing-radar datagrams, one for each sender of MAVLink."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from adapters import Arrival, Source
from adapters.kinds import FileError
from adapters.mavlink_frames import FrameScanner
from adapters.pcap import Captured, PcapReader
from adapters.tlog import SECOND, STEP_NS

_JUMP_NS = 3_600 * SECOND  # a single stamp further off than this is damage
_YEAR_2200 = 7_258_118_400 * SECOND
_LOOK_AT = 2000  # datagrams of a capture that are looked at to tell what it holds


@dataclass(slots=True)
class CaptureRecording:
    """A capture: its sources, numbered from `first_number`, and its arrivals. Raises FileError where it holds neither.

    Counters: those of PcapReader and FrameScanner, "bad timestamps", "other datagrams".
    """

    path: Path
    first_number: int = 0
    counters: Counter[str] = field(default_factory=Counter)
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    _numbers: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = self.path.stem or "input"
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
            for arrival in self._captured(PcapReader(file, self.counters)):
                found = True
                yield arrival
        if not found:
            raise FileError(f"{self.path} holds no whole MAVLink frame and no radar datagram.")

    def _captured(self, reader: PcapReader) -> Iterator[Arrival]:
        scanners: dict[str, FrameScanner] = {}
        last = -1
        for stamp, captured in _stamped(reader):
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
                last = max(stamp // STEP_NS * STEP_NS, last + STEP_NS if last >= 0 else 0)
                yield Arrival(last, number, part, captured.sender if is_radar else "")

    def _radar_only(self) -> bool:
        return len(self.sources) == 1 and self.sources[0].kind == "radar"


def _stamped(reader: PcapReader) -> Iterator[tuple[int, Captured]]:
    """Each datagram with its stamp; one that cannot be, or leaps by more than an hour and back, takes the one before."""
    datagrams, before = iter(reader), -1
    held = next(datagrams, None)
    while held is not None:
        coming, stamp = next(datagrams, None), held.received_at
        returns = before >= 0 and coming is not None and abs(coming.received_at - before) < _JUMP_NS
        if not 0 <= stamp < _YEAR_2200 or (returns and abs(stamp - before) > _JUMP_NS):
            reader.counters["bad timestamps"] += 1
            stamp = max(before, 0)
        else:
            before = stamp
        yield stamp, held
        held = coming


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
