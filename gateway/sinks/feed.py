"""Two ways out for what is drawn: a file that never drops, and a server that never makes anybody wait.

The two are recording streams of their own, with the same identity. In one stream with two sinks, a viewer
that stands still stops the file beside it; apart, neither knows of the other.
"""

from __future__ import annotations

import errno
import queue
import struct
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from adapters.reasons import reason_of
from gateway.sinks.scene.entry import Always, Made, Piece, send
from gateway.sinks.serving import free_port

BATCHES_WAITING = 512  # for a viewer that stands still: some 200 s and 20 MB of them, then they are dropped
ENTRIES_WAITING = 30_000  # and no more than these, where batches are those of a crowd
KEPT_AT_MOST = 10_000  # looks and names that wait for it: of some thousand tracks
_STREAM_HEADER = 12
_MESSAGE_HEADER = struct.Struct("<QQ")
STOP_S = 5.0  # a viewer that stands still does not hold up the end of the session for longer


@dataclass(frozen=True, slots=True)
class Identity:
    """What a recording is called; two streams of one identity are one recording to a viewer."""

    application: str
    recording: str
    name: str

    def stream(self) -> rr.RecordingStream:
        """A new stream of this recording, not yet connected to anything."""
        # Rows come in columns that are sent as they are; the tick only moves what is logged row by row.
        batching = rr.ChunkBatcherConfig(flush_tick=0.2)
        return rr.RecordingStream(self.application, recording_id=self.recording, batcher_config=batching)


class FileFeed:
    """An .rrd file, written in the caller's thread: what `send` returned from is in the file.

    Rerun encodes, we write. Its own file sink, on a full disk, writes a line to stderr and goes on without the file, and
    then often never returns from a flush, from the end of the stream or from the end of the program. Here a full disk
    is an OSError, and the file is cut back to its last whole message. The file has no index at its end, like one of a
    program that was killed: it opens all the same, and `gateway.sinks.recording.optimise` writes the index.
    """

    def __init__(self, path: Path, identity: Identity, blueprint: rrb.Blueprint) -> None:
        self.path = path
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115  (lives as long as the session)
        self._length = 0
        self._failed = False
        self._stream = identity.stream()
        self._encoded = rr.binary_stream(self._stream)
        self._stream.send_recording_name(identity.name)
        self._stream.send_blueprint(blueprint, make_active=False, make_default=True)
        self._write()

    def send(self, entries: Sequence[Made]) -> None:
        """Write entries; raises OSError when they did not reach the file."""
        send(self._stream, entries)
        self._write()

    def _write(self) -> None:
        message = self._encoded.read() or b""
        left = memoryview(message_part(message, with_header=self._length == 0))
        whole = self._length
        try:
            while left:
                written = self._file.write(left)
                self._length += written
                left = left[written:]
        except OSError as error:
            self._failed = True
            self._file.truncate(whole)
            self._length = whole
            reason = f"the recording could not be written: {reason_of(error)}"
            raise OSError(error.errno, reason, str(self.path)) from error

    def close(self) -> bool:
        """Let go of the file; whether it was open and is complete. Raises OSError if the last data did not reach it."""
        if self._file.closed:
            return False
        try:
            if not self._failed:  # what failed once was said once
                self._write()
        finally:
            self._file.close()
            self._stream.disconnect()
        return not self._failed


def message_part(encoded: bytes, *, with_header: bool) -> bytes:
    """The messages of a whole .rrd stream, without its end, so that the messages of the next stream can follow.

    A stream is a header of 12 bytes, messages (kind and length as little-endian 64-bit numbers, then the content), and
    as its end a message of kind 0 with the index and 32 bytes that point to it. Raises RuntimeError for anything else.
    """
    if not encoded:
        return b""
    end, kind = _STREAM_HEADER, -1
    while kind != 0 and end + _MESSAGE_HEADER.size <= len(encoded):
        start = end
        kind, length = _MESSAGE_HEADER.unpack_from(encoded, start)
        end = start + _MESSAGE_HEADER.size + length
    if encoded[:4] != b"RRF2" or kind != 0 or end > len(encoded):
        raise RuntimeError("this release of rerun-sdk encodes recordings in a way that Talkdown does not know")
    return encoded[0 if with_header else _STREAM_HEADER : start]


class ServedFeed:
    """A Rerun server that any number of viewers may connect to at any time, fed from a thread of its own.

    `host` is what it listens on, `port` 0 takes a free one; `address` is what a viewer opens. A late viewer
    gets what the `memory_limit` still holds, and the blueprint. `send` never blocks: when a viewer stands
    still and the queue is full, rows are dropped and counted in `dropped`; of what holds at all times the newest is kept.
    Raises OSError if the port is taken.
    """

    def __init__(self, host: str, port: int, identity: Identity, blueprint: rrb.Blueprint, memory_limit: str) -> None:
        port = free_port(host, port)
        shown = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        self.address = f"rerun+http://{shown}:{port}/proxy"
        self.dropped = 0
        self._stream = identity.stream()
        server = rr.GrpcServerSink(host, port, server_memory_limit=memory_limit)
        self._stream.set_sinks(server, default_blueprint=blueprint)
        self._stream.send_recording_name(identity.name)
        try:
            self._stream.flush(timeout_sec=5.0)
        except RuntimeError as error:
            raise OSError(errno.EADDRINUSE, f"the viewer's server could not start on {host}:{port}") from error
        self._waiting: queue.Queue[Sequence[Made] | None] = queue.Queue(BATCHES_WAITING)
        self._kept: list[Made] = []
        self._queued = self._taken = 0  # entries so far; each is counted by one thread alone
        self._thread = threading.Thread(target=self._run, name="viewer feed", daemon=True)
        self._thread.start()

    def send(self, entries: Sequence[Made]) -> None:
        """Queue entries for the viewers, or drop their rows if the queue is full."""
        batch = [*self._kept, *entries]
        try:
            if self._queued - self._taken > ENTRIES_WAITING:
                raise queue.Full
            self._waiting.put_nowait(batch)
            self._queued += len(batch)
            self._kept = []
        except queue.Full:
            always: list[Made] = [entry for entry in batch if isinstance(entry, Always)]
            self._kept = always[-KEPT_AT_MOST:]
            self.dropped += sum(entry.count for entry in entries if isinstance(entry, Piece))

    def _run(self) -> None:
        while (batch := self._waiting.get()) is not None:
            send(self._stream, batch)
            self._taken += len(batch)

    def close(self) -> None:
        """Let the viewers have what waits, as long as they take it, and end the server."""
        if not self._thread.is_alive():
            return
        try:
            self._waiting.put(None, timeout=STOP_S)
        except queue.Full:
            return  # the thread stands still in the stream; it is a daemon and ends with the program
        self._thread.join(STOP_S)
        if not self._thread.is_alive():
            self._stream.disconnect()
