"""The inputs of an archived session, read back as the arrivals that they were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from adapters import Arrival, Source
from adapters.files import FileError
from adapters.pcap import PcapReader
from adapters.reasons import reason_of
from adapters.tlog import TlogReader
from gateway.runtime.commands import read_commands


@dataclass(slots=True)
class SessionInput:
    """One source's file of an archived session; it may be empty. Read as what it was recorded as."""

    path: Path
    source: Source
    counters: Counter[str] = field(default_factory=Counter)
    sources: tuple[Source, ...] = field(init=False)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.sources = (self.source,)

    def arrivals(self) -> Iterator[Arrival]:
        """Every arrival. Raises FileError when the file is gone, or is none of its source's kind."""
        try:
            with self.path.open("rb") as file:
                if self.source.kind == "mavlink":
                    for stamp, frame in TlogReader(file, self.counters):
                        yield Arrival(stamp, self.source.number, frame)
                elif self.source.kind == "told":
                    for stamp, line in read_commands(file, self.counters):
                        yield Arrival(stamp, self.source.number, line)
                elif file.read(1):
                    file.seek(0)
                    for captured in PcapReader(file, self.counters):
                        yield Arrival(captured.received_at, self.source.number, captured.data, captured.sender)
        except OSError as error:
            raise FileError(f"{self.path} cannot be read ({reason_of(error)}).") from error
        except ValueError as error:
            raise FileError(f"{self.path} is not what {self.source.name} can have sent ({error}).") from error
