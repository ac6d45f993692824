"""The recorder: a session's inputs, byte for byte, and session.json. It never drops: a full disk ends the session."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from adapters import Arrival, Kind, Source
from adapters.arrivals import Arrivals
from adapters.pcap import PcapWriter
from adapters.tlog import TlogWriter, tlog_records
from gateway.runtime.commands import CommandsWriter
from gateway.runtime.folder import INPUTS, InputFile, Record, write_record
from gateway.runtime.wholefile import WholeFile
from gateway.sinks.aside import Aside, AtOnce
from gateway.sinks.hold import Hold

_SUFFIXES: dict[Kind, str] = {"mavlink": "tlog", "radar": "pcap", "told": "jsonl"}
_WRITERS: dict[Kind, type[TlogWriter] | type[PcapWriter] | type[CommandsWriter]] = {
    "mavlink": TlogWriter,
    "radar": PcapWriter,
    "told": CommandsWriter,
}


class _File:
    """One file of arrivals of one kind; they are written at a flush."""

    def __init__(self, path: Path, kind: Kind) -> None:
        self.count = 0
        self._whole = WholeFile(path)
        self._writer = _WRITERS[kind](self._whole)
        self.close = self._whole.close

    def keep(self, arrival: Arrival) -> None:
        self.count += 1
        self._writer.write(arrival.received_at, arrival.data, arrival.peer)

    def keep_records(self, records: list[bytes]) -> None:
        """What is a record of this file already."""
        self.count += len(records)
        self._whole.write_all(records)

    def flush(self, aside: Aside | AtOnce) -> None:
        if records := self._whole.taken():
            aside.do(partial(self._whole.put, records), len(records))


class _Input:
    """One source's file, and the one for what was refused, which is only made when something is."""

    def __init__(self, folder: Path, source: Source) -> None:
        suffix = _SUFFIXES[source.kind]
        self._folder = folder / INPUTS
        self._refused_name = f"{source.name}.refused.{suffix}"
        self.described = InputFile(
            source.number, source.kind, source.name, source.origin, f"{INPUTS}/{source.name}.{suffix}"
        )
        self.kept = _File(folder / self.described.file, source.kind)
        self._refused: _File | None = None

    def refuse(self, arrival: Arrival) -> None:
        if self._refused is None:
            self._refused = _File(self._folder / self._refused_name, self.described.kind)
        self._refused.keep(arrival)

    def flush(self, aside: Aside | AtOnce) -> InputFile:
        self.kept.flush(aside)
        if self._refused is not None:
            self._refused.flush(aside)
        refused = 0 if self._refused is None else self._refused.count
        return replace(self.described, arrivals=self.kept.count, refused=refused)

    def close(self) -> None:
        try:
            self.kept.close()
        finally:
            if self._refused is not None:
                self._refused.close()


class Recorder:
    """Writes one session's folder, which exists and is its own. Every method raises OSError when the disk refuses.

    What a flush writes is written `aside`: whoever waits for the disk is not who receives.
    """

    def __init__(self, folder: Path, record: Record, aside: Aside | AtOnce | None = None) -> None:
        self.folder = folder
        self.record = record
        self._aside = aside or AtOnce()
        self._inputs: dict[int, _Input] = {}
        self._hold = Hold(folder)
        write_record(folder, record)

    def add(self, source: Source) -> None:
        """Make the file of a source that is new."""
        self._inputs[source.number] = _Input(self.folder, source)

    def keep(self, arrival: Arrival) -> None:
        """Record one arrival; it reaches the disk with the next flush."""
        self._inputs[arrival.source].kept.keep(arrival)

    def keep_all(self, arrivals: Sequence[Arrival], refused: Collection[int] = ()) -> None:
        """Record many arrivals; those at the places `refused` apart."""
        for place in refused:
            self.refuse(arrivals[place])
        apart, columns = frozenset(refused), Arrivals.of(arrivals)
        records = tlog_records(columns.received_at, columns.data)
        for source, places in columns.by_source():
            recorded = self._inputs[source]
            left = [place for place in places if place not in apart] if apart else places
            if recorded.described.kind == "mavlink":
                recorded.kept.keep_records([records[place] for place in left])
            else:
                for place in left:
                    recorded.kept.keep(columns[place])

    def refuse(self, arrival: Arrival) -> None:
        """Record a datagram that was refused, apart: it is never replayed."""
        self._inputs[arrival.source].refuse(arrival)

    def describe(self, **changes: Any) -> None:
        """Change what session.json will say at the next flush."""
        self.record = replace(self.record, **changes)

    def flush_inputs(self) -> None:
        """Hand the inputs to the operating system: before what came of them, so that a killed session can be replayed."""
        for recorded in self._inputs.values():
            recorded.flush(self._aside)

    def flush(self, watermark: int, counters: Mapping[str, int]) -> None:
        """Hand everything to the operating system; session.json then says how far it goes."""
        sources = tuple(self._inputs[number].flush(self._aside) for number in sorted(self._inputs))
        self.record = replace(self.record, sources=sources, watermark=watermark, counters=dict(counters))
        self._aside.do(partial(write_record, self.folder, self.record))

    def close(self) -> None:
        """Close the inputs, all of them, whatever one of them says, and let go of the folder."""
        failure: OSError | None = None
        for step in (self._aside.wait, *(recorded.close for recorded in self._inputs.values())):
            try:
                step()
            except OSError as error:
                failure = error
        self._hold.release()
        if failure is not None:
            raise failure

    def abandon(self, ended: str) -> None:
        """Save what the disk still takes after it refused something, and let go of the folder."""
        with contextlib.suppress(OSError):
            self.flush(self.record.watermark or self.record.started_at, self.record.counters)
        with contextlib.suppress(OSError):
            self._aside.wait()
        with contextlib.suppress(OSError):
            write_record(self.folder, replace(self.record, ended=ended))
        with contextlib.suppress(OSError):
            self.close()
