"""Mission files told to the gateway, as if somebody had said: this vehicle will fly this."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from adapters import Arrival, Source
from adapters.kinds import FileError
from adapters.mission_files import MissionFileError, read_mission
from adapters.told import ANYBODY, encode_plan

TOLD = "commands"  # the source of what people tell, and its file's stem in a session

Missions = Sequence[tuple[str | None, Path]]
"""Mission files, each with its aircraft ("mavlink:2"); None: of the only vehicle."""


def told_line(path: Path, aircraft: str | None) -> bytes:
    """A mission file as a told line, of an aircraft or of the first one heard. Raises FileError for what is no such file."""
    try:
        points = read_mission(path)
    except MissionFileError as error:
        raise FileError(str(error)) from error
    return encode_plan(aircraft or ANYBODY, points)


def told_plan(path: Path, aircraft: str, source: int, stamp: int) -> Arrival:
    """The same as told by a source at a stamp."""
    return Arrival(stamp, source, told_line(path, aircraft))


def told_source(number: int, missions: Missions) -> Source:
    """The source of what people tell."""
    return Source(number, "told", TOLD, ", ".join(str(path) for _, path in missions))


@dataclass(slots=True)
class ToldInput:
    """Mission files as a recording's beginning; one plan every 4 microseconds."""

    path: Path
    sources: tuple[Source, ...]
    told: tuple[Arrival, ...]
    notes: tuple[str, ...] = ()
    counters: Counter[str] = field(default_factory=Counter)

    def arrivals(self) -> Iterator[Arrival]:
        """Every plan."""
        yield from self.told


def whose(missions: Missions, vehicles: Sequence[str]) -> list[tuple[str, Path]]:
    """Each mission with its aircraft; `vehicles` are those of the recording. Raises FileError where that is not clear."""
    named = []
    for aircraft, path in missions:
        if aircraft is None and len(vehicles) != 1:
            there = f"{len(vehicles)} vehicles ({', '.join(vehicles)})" if vehicles else "no vehicle"
            number = vehicles[0] if vehicles else "mavlink:1"
            raise FileError(f"{path}: the recording has {there}; say whose plan it is with --plan {number}={path}.")
        named.append((aircraft or vehicles[0], path))
    return named
