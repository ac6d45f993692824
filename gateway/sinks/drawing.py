"""A process that draws pictures: into the session's .rrd file, and for viewers that come and go.

python -P -m gateway.sinks.drawing      started by `gateway.sinks.apart`, in which is said why; ends when its input does

It reads messages, a size of 8 bytes and a pickled (what, arguments), and answers each in the same way: (the address for
viewers, rows that they did not take, None or what an OSError says). After one of those it ends.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
from typing import Any, BinaryIO

from gateway.sinks.apart import SIZE_BYTES, pictures
from gateway.sinks.rerun import RerunSink

_NICENESS = 10  # where there is one core only, pictures are made first and drawn afterwards


def _next(source: BinaryIO) -> tuple[str, tuple[Any, ...]] | None:
    """What is asked for; None: nothing any more."""
    size = int.from_bytes(source.read(SIZE_BYTES), "little")
    message = source.read(size)
    if not size or len(message) < size:
        return None
    what, about = pickle.loads(message)
    return what, about


def _answer(target: BinaryIO, sink: RerunSink | None, refused: tuple[Any, ...] | None = None) -> None:
    told = (sink.address, sink.dropped, refused) if sink is not None else (None, 0, refused)
    message = pickle.dumps(told)
    target.write(len(message).to_bytes(SIZE_BYTES, "little") + message)
    target.flush()


def _give_way() -> None:
    """With all threads that are begun from here on: on Linux each has a niceness of its own, and the viewer's has many."""
    if hasattr(os, "nice"):
        os.nice(_NICENESS)


def draw(source: BinaryIO, target: BinaryIO) -> None:
    """Do what is asked until nothing is asked any more. Raises BrokenPipeError: nobody waits for an answer."""
    sink: RerunSink | None = None
    try:
        while (asked := _next(source)) is not None:
            what, about = asked
            if what == "open":
                site, arguments = about
                _give_way()
                sink = RerunSink(site, **arguments)
            elif what == "write_all":
                assert sink is not None
                sink.write_all(pictures(*about))
            else:
                getattr(sink, what)(*about)
            _answer(target, sink)
    except OSError as error:
        if isinstance(error, BrokenPipeError):
            raise
        _answer(target, sink, (error.errno, error.strerror, error.filename))
    finally:
        if sink is not None:
            with contextlib.suppress(OSError):  # the first one has been told
                sink.abandon()


if __name__ == "__main__":
    # Who started us decides when we end; until then we draw for it, whatever the terminal or the system tells everybody.
    for _name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, _name):
            signal.signal(getattr(signal, _name), signal.SIG_IGN)
    _told = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what anybody prints is no answer
    try:
        draw(sys.stdin.buffer, _told)
    except BrokenPipeError:
        sys.exit(1)
