"""Recordings, whatever they are: sources and arrivals. Flight logs are told as the frames that the vehicle would have sent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from adapters import Arrival, Source
from adapters.captures import CaptureRecording
from adapters.kinds import FileError, kind_of
from adapters.tlog import TlogReader

__all__ = ["FileError", "Recording", "kind_of", "open_recording"]

Frames = Iterable[tuple[int, bytes]]


@dataclass(slots=True)
class Recording:
    """A file that is one MAVLink source: a .tlog or a vehicle's own log. `notes`: what a person should know of it."""

    path: Path
    sources: tuple[Source, ...]
    read: Callable[[Counter[str]], Frames]
    notes: tuple[str, ...] = ()
    counters: Counter[str] = field(default_factory=Counter)

    def arrivals(self) -> Iterator[Arrival]:
        """Every arrival in the file's order, stamps strictly increasing multiples of 4 microseconds.

        Raises FileError when there is none.
        """
        (source,), found = self.sources, False
        for stamp, frame in self.read(self.counters):
            found = True
            yield Arrival(stamp, source.number, frame)
        if not found:
            raise FileError(f"{self.path} holds nothing that can be replayed.")


def open_recording(path: Path, first_number: int = 0) -> Recording | CaptureRecording:
    """A .tlog, .BIN, .ulg or capture to be replayed; its sources are numbered from `first_number` on.

    Raises FileError for what is none; `kind_of` tells sessions and mission files before.
    """
    kind = kind_of(path)
    if kind in ("pcap", "pcapng"):
        return CaptureRecording(path, first_number)
    sources = (Source(first_number, "mavlink", path.stem or "input", str(path)),)
    if kind == "tlog":
        return Recording(path, sources, lambda counters: _of_tlog(path, counters))
    if kind == "BIN":
        return _dataflash(path, sources)
    if kind == "ulg":
        return _ulog(path, sources)
    raise FileError(f"{path} is no recording: it is {'a mission file' if kind != 'session' else 'a session'}.")


def _of_tlog(path: Path, counters: Counter[str]) -> Iterator[tuple[int, bytes]]:
    with path.open("rb") as file:
        yield from TlogReader(file, counters)


def _dataflash(path: Path, sources: tuple[Source, ...]) -> Recording:
    from adapters.dataflash import DataflashFrames  # pymavlink's log tables take 0.2 s to load
    from adapters.dataflash_identity import identity_of

    with path.open("rb") as file:
        identity = identity_of(file)

    def read(counters: Counter[str]) -> Iterator[tuple[int, bytes]]:
        with path.open("rb") as file:
            yield from DataflashFrames(file, identity, counters)

    return Recording(path, sources, read, _without_utc(path, identity.utc_offset_us))


def _ulog(path: Path, sources: tuple[Source, ...]) -> Recording:
    from adapters.ulog import UlogDamaged, UlogFrames, UlogMissing

    try:
        log = UlogFrames(path)
    except UlogMissing as error:
        raise FileError(f"{path}: {error}") from error
    except UlogDamaged as error:
        raise FileError(f"{path} cannot be read: {error}.") from error
    return Recording(path, sources, log.frames, _without_utc(path, log.identity.utc_offset_us))


def _without_utc(path: Path, utc_offset_us: int | None) -> tuple[str, ...]:
    if utc_offset_us is not None:
        return ()
    return (f"{path} does not tell the date (no GPS time in it): it is stamped as if it had begun on 2000-01-01.",)
