"""The recorder: a session's inputs, byte for byte, and session.json. It never drops: a full disk ends the session."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from adapters import Arrival, Source
from adapters.pcap import PcapWriter
from adapters.tlog import TlogWriter
from gateway.runtime.folder import INPUTS, InputFile, Record, write_record
from gateway.runtime.hold import Hold
from gateway.runtime.wholefile import WholeFile


class _Input:
    """One source's file, and the one for what was refused, which is only made when something is."""

    def __init__(self, folder: Path, source: Source) -> None:
        suffix = "tlog" if source.kind == "mavlink" else "pcap"
        self.described = InputFile(
            source.number, source.kind, source.name, source.origin, f"{INPUTS}/{source.name}.{suffix}"
        )
        self._folder = folder
        self._whole = WholeFile(folder / self.described.file)
        self._refused_whole: WholeFile | None = None
        self._writer = TlogWriter(self._whole) if source.kind == "mavlink" else PcapWriter(self._whole)
        self._refused: PcapWriter | None = None
        self._arrivals = 0
        self._refusals = 0

    def write(self, arrival: Arrival) -> None:
        self._writer.write(arrival.received_at, arrival.data, arrival.peer)
        self._arrivals += 1

    def refuse(self, arrival: Arrival) -> None:
        if self._refused is None:
            self._refused_whole = WholeFile(self._folder / INPUTS / f"{self.described.name}.refused.pcap")
            self._refused = PcapWriter(self._refused_whole)
        self._refused.write(arrival.received_at, arrival.data, arrival.peer)
        self._refusals += 1

    def flush(self) -> InputFile:
        self._whole.flush()
        if self._refused_whole is not None:
            self._refused_whole.flush()
        return replace(self.described, arrivals=self._arrivals, refused=self._refusals)

    def close(self) -> None:
        try:
            self._whole.close()
        finally:
            if self._refused_whole is not None:
                self._refused_whole.close()


class Recorder:
    """Writes one session's folder, which exists and is its own. Every method raises OSError when the disk refuses."""

    def __init__(self, folder: Path, record: Record) -> None:
        self.folder = folder
        self.record = record
        self._inputs: dict[int, _Input] = {}
        self._hold = Hold(folder)
        write_record(folder, record)

    def add(self, source: Source) -> None:
        """Make the file of a source that is new."""
        self._inputs[source.number] = _Input(self.folder, source)

    def keep(self, arrival: Arrival) -> None:
        """Record one arrival."""
        self._inputs[arrival.source].write(arrival)

    def refuse(self, arrival: Arrival) -> None:
        """Record a datagram that was refused, apart: it is never replayed."""
        self._inputs[arrival.source].refuse(arrival)

    def describe(self, **changes: Any) -> None:
        """Change what session.json will say at the next flush."""
        self.record = replace(self.record, **changes)

    def flush_inputs(self) -> None:
        """Hand the inputs to the operating system: before what came of them, so that a killed session can be replayed."""
        for recorded in self._inputs.values():
            recorded.flush()

    def flush(self, watermark: int, counters: Mapping[str, int]) -> None:
        """Hand everything to the operating system; session.json then says how far it goes."""
        sources = tuple(self._inputs[number].flush() for number in sorted(self._inputs))
        self.record = replace(self.record, sources=sources, watermark=watermark, counters=dict(counters))
        write_record(self.folder, self.record)

    def close(self) -> None:
        """Close the inputs, all of them, whatever one of them says, and let go of the folder."""
        failure: OSError | None = None
        for recorded in self._inputs.values():
            try:
                recorded.close()
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
            write_record(self.folder, replace(self.record, ended=ended))
        with contextlib.suppress(OSError):
            self.close()
