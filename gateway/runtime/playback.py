"""Recordings and archived sessions as one stream of arrivals, in the order they came in: (stamp, source, place in file).

Read as it is needed: ten hours of recording take no more memory than ten minutes.
"""

from __future__ import annotations

import heapq
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from operator import attrgetter
from pathlib import Path
from typing import Protocol

from adapters import Arrival, Source
from adapters.files import FileError, kind_of, open_recording
from adapters.tlog import STEP_NS
from gateway.predict import ArrivalFlow
from gateway.register import Remembered
from gateway.runtime.folder import InputFile, read_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.places import Overview, look_over
from gateway.runtime.seeking import SECOND, Span
from gateway.runtime.sessions import mend
from gateway.runtime.setup import Place, Setup
from gateway.runtime.told_plans import Missions, ToldInput, told_plan, told_source, whose
from gateway.settings import Options, SiteError, parse_site

_BYTES_A_RECORD = 8  # of a .tlog beside the frame; a capture has more, which only makes the progress a little early


class Readable(Protocol):
    """A file with arrivals; adapters.files.Recording is one."""

    path: Path
    counters: Counter[str]
    sources: tuple[Source, ...]
    notes: tuple[str, ...]

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
    remembered: Remembered | None = None  # what was known of the radars' errors at the session's start
    flows: tuple[ArrivalFlow, ...] = ()  # ways that arrivals come, as they were known then
    signing_key: bytes | None = None  # with one, only frames that are signed with it tell of the place
    _read_bytes: int = 0
    _overview: Overview | None = None

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

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of the files before they are replayed."""
        return tuple(note for file in self.files for note in file.notes) + self._apart()

    def overview(self) -> Overview:
        """What all of it tells; read once, when it is first asked for."""
        if self._overview is None:
            self._overview = look_over(self.sources, self.arrivals(), self.signing_key)
        return self._overview

    def find_place(self) -> Place | None:
        """The place that the recordings tell of when all of them is known, or None."""
        return self.overview().place

    def setup(self, place: Place | None = None) -> Setup:
        """How it was run, so that it can be run again; at `place`, else its own, else where the recording tells it was."""
        return Setup(
            place=place or self.place or self.find_place(),
            options=self.options,
            remembered=self.remembered,
            flows=self.flows,
        )

    def span(self) -> Span:
        """From when to when it goes."""
        found = self.overview()
        last = max(last for _, last in found.extents.values()) if self.watermark is None else self.watermark
        return Span(self.started_at, last, found.epoch_offset_s * SECOND)

    def _apart(self) -> tuple[str, ...]:
        """Which files begin after all others have ended: their clocks may differ, and nobody shifts them."""
        if len(self.files) < 2 or self.watermark is not None:
            return ()
        extents = self.overview().extents
        spans = []
        for file in self.files:
            heard = [extents[one.number] for one in file.sources if one.kind != "told" and one.number in extents]
            if heard:
                spans.append((min(first for first, _ in heard), max(last for _, last in heard), file.path))
        spans.sort()
        notes, ended = [], spans[0][1]
        for began, last, path in spans[1:]:
            if began > ended:
                gap_s = (began - ended) / SECOND
                notes.append(
                    f"{path} begins {gap_s:.0f} s after the others have ended: nothing is shifted to join them."
                )
            ended = max(ended, last)
        return tuple(notes)


_order = attrgetter("received_at", "source")


def open_playback(paths: Sequence[Path], plans: Missions = (), signing_key: bytes | None = None) -> Playback:
    """Recordings with mission files among them or as `plans`, or one archived session (completed first, if killed).

    `signing_key`: with one, frames that are not signed with it tell nothing of the recordings' place and vehicles.
    Raises FileError or FolderError, one sentence, for what cannot be replayed.
    """
    kinds = {path: kind_of(path) for path in paths}
    if "session" not in kinds.values():
        missions = [(None, path) for path in paths if kinds[path] in ("plan", "waypoints")]
        recordings = [path for path in paths if kinds[path] not in ("plan", "waypoints")]
        return _of_files(recordings, (*missions, *plans), signing_key)
    if len(paths) > 1 or plans:
        raise FileError("A session is replayed alone: name one folder, or files.")
    return _of_session(paths[0])


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
    return Playback(
        inputs, record.started_at, record.watermark, place, record.options, record.registration, record.flows
    )


def _input(folder: Path, described: InputFile) -> SessionInput:
    path = folder / described.file
    try:
        is_there = path.is_file()
    except OSError:  # no name that a file can have
        is_there = False
    if not is_there:
        raise FileError(f"{path} is missing: the session cannot be replayed without it.")
    return SessionInput(path, described.source)


def _of_files(paths: Sequence[Path], missions: Missions, signing_key: bytes | None) -> Playback:
    if not paths:
        raise FileError("A mission file is told along with a recording: name that too.")
    files: list[Readable] = []
    number = 0
    for path in paths:
        recording = open_recording(path, number)
        number += len(recording.sources)
        files.append(recording)
    playback = Playback(tuple(files), 0, signing_key=signing_key)
    _name_apart(files)
    first = next(playback.arrivals())  # raises FileError when there is none
    playback.started_at = first.received_at
    if not missions:
        return playback
    vehicles = playback.overview().vehicles if any(aircraft is None for aircraft, _ in missions) else ()
    stamps = count(first.received_at, STEP_NS)
    told = tuple(told_plan(path, aircraft, number, next(stamps)) for aircraft, path in whose(missions, vehicles))
    files.append(ToldInput(missions[0][1], (told_source(number, missions),), told))
    _name_apart(files)
    return Playback(tuple(files), playback.started_at, signing_key=signing_key)


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
