"""Recordings and archived sessions as one stream of arrivals, in the order they came in: (stamp, source, place in file).

Read as it is needed: ten hours of recording take no more memory than ten minutes.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import Protocol

from adapters import Arrival, Source
from adapters.files import FileError, kind_of, open_recording
from gateway.runtime.folder import InputFile, read_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.places import PlaceFinder
from gateway.runtime.sessions import mend
from gateway.runtime.setup import Place
from gateway.settings import Options, SiteError, parse_site

_BYTES_A_RECORD = 8  # of a .tlog beside the frame; a capture has more, which only makes the progress a little early


class Readable(Protocol):
    """A file with arrivals; adapters.files.Recording is one."""

    path: Path
    counters: Counter[str]
    sources: tuple[Source, ...]

    def arrivals(self) -> Iterator[Arrival]:
        """Every arrival, stamps increasing."""


@dataclass(slots=True)
class Playback:
    """What can be replayed. `arrivals` may be called again; each call reads from the start.

    `place`, `options` and `watermark` come from an archived session; of plain recordings they are None, the defaults
    and the last arrival's stamp.
    """

    files: tuple[Readable, ...]
    started_at: int
    watermark: int | None = None
    place: Place | None = None
    options: Options = field(default_factory=Options)
    _read_bytes: int = 0

    @property
    def sources(self) -> tuple[Source, ...]:
        """All sources, in order of their numbers."""
        found = [source for file in self.files for source in file.sources]
        return tuple(sorted(found, key=attrgetter("number")))

    def arrivals(self) -> Iterator[Arrival]:
        """Every arrival up to the watermark. Raises FileError when a file holds none, or cannot be read any more."""
        self._read_bytes = 0
        for file in self.files:
            file.counters.clear()
        for arrival in heapq.merge(*(file.arrivals() for file in self.files), key=_order):
            if self.watermark is not None and arrival.received_at > self.watermark:
                return
            self._read_bytes += len(arrival.data) + _BYTES_A_RECORD
            yield arrival

    def fraction(self) -> float:
        """How much has been read, from 0 to 1."""
        return min(self._read_bytes / max(sum(file.path.stat().st_size for file in self.files), 1), 1.0)

    def counters(self) -> dict[str, int]:
        """What the last reading found wrong in the files, by file and reason."""
        counted = {f"{file.path.name}: {why}": number for file in self.files for why, number in file.counters.items()}
        return {reason: number for reason, number in sorted(counted.items()) if number}

    def find_place(self) -> Place | None:
        """The place that the recordings tell of when all of them is known, or None."""
        return PlaceFinder().search(self.sources, self.arrivals())


_order = attrgetter("received_at", "source")


def open_playback(paths: Sequence[Path]) -> Playback:
    """Recordings, or one archived session (completed first, if it was killed).

    Raises FileError or FolderError, one sentence, for what cannot be replayed.
    """
    folders = [path for path in paths if kind_of(path) == "session"]
    if not folders:
        return _of_files(paths)
    if len(paths) > 1:
        raise FileError("A session is replayed alone: name one folder, or files.")
    return _of_session(folders[0])


def _of_session(folder: Path) -> Playback:
    mend(folder)
    record = read_record(folder)
    place = None
    if record.site is not None:
        try:
            place = Place(parse_site(record.site, f"{folder}, site"), record.site, record.site_origin)
        except SiteError as error:
            raise FileError(str(error)) from error
    inputs = tuple(_input(folder, one) for one in record.sources)
    return Playback(inputs, record.started_at, record.watermark, place, record.options)


def _input(folder: Path, described: InputFile) -> SessionInput:
    path = folder / described.file
    if not path.is_file():
        raise FileError(f"{path} is missing: the session cannot be replayed without it.")
    return SessionInput(path, described.source)


def _of_files(paths: Sequence[Path]) -> Playback:
    files: list[Readable] = []
    number = 0
    for path in paths:
        recording = open_recording(path, number)
        number += len(recording.sources)
        files.append(recording)
    playback = Playback(tuple(files), 0)
    _name_apart(files)
    first = next(playback.arrivals())  # raises FileError when there is none
    return replace(playback, started_at=first.received_at)


def _name_apart(files: Sequence[Readable]) -> None:
    """Two files of one name in different folders: their sources get names of their own."""
    taken: set[str] = set()
    for file in files:
        named = []
        for source in file.sources:
            name, count = source.name, 1
            while name in taken:
                count += 1
                name = f"{source.name}-{count}"
            taken.add(name)
            named.append(replace(source, name=name))
        file.sources = tuple(named)
