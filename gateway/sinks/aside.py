"""A sink that works in a thread of its own, so that what it waits for holds up no picture.

Its one job is to wait for the process that draws (`apart`), which takes the load but answers late: to draw a hundred aircraft
takes a quarter of a second, and between two pictures that is far too long.
"""

from __future__ import annotations

import threading
from collections import deque

from gateway.picture import Picture
from gateway.sinks import Sink

WAITING = 100_000  # pictures and rows: half a minute of a hundred aircraft; then the next picture waits too


class Aside:
    """Hands every picture to another sink, in their order, in a thread that it has for itself.

    Nothing is dropped: where the other sink falls behind by `most` pictures and rows, `write` waits for it. What it raises is
    raised by the next `write` or by `close`.
    """

    def __init__(self, sink: Sink, most: int = WAITING) -> None:
        self._sink, self._most = sink, most
        self._waiting: deque[tuple[Picture, int]] = deque()
        self._size = 0
        self._ending = False
        self._failure: BaseException | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=f"{type(sink).__name__} aside", daemon=True)
        self._thread.start()

    def write(self, picture: Picture) -> None:
        """Take one picture; raises what the other sink raised at an earlier one."""
        size = 1 + len(picture.fuse.time) + len(picture.align.report_time) + len(picture.align.plot_time)
        with self._changed:
            self._changed.wait_for(lambda: self._failure is not None or self._size < self._most)
            self._complain()
            self._waiting.append((picture, size))
            self._size += size
            self._changed.notify_all()

    def flush(self, now: int) -> None:
        """Nothing by itself: the other sink writes out what waits when its pictures come."""

    def close(self) -> None:
        """Wait until everything has been taken, and close the other sink; calling it again does nothing."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()
        try:
            self._sink.close()
        finally:
            self._complain()

    def _complain(self) -> None:
        """Raise what the other sink raised, once."""
        failure, self._failure = self._failure, None
        if failure is not None:
            self._ending = True
            raise failure

    def _run(self) -> None:
        while (picture := self._next()) is not None:
            try:
                self._sink.write(picture)
            except BaseException as error:  # raised again in the thread that writes
                with self._changed:
                    self._failure = error
                    self._waiting.clear()
                    self._size = 0
                    self._changed.notify_all()
                return

    def _next(self) -> Picture | None:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ending)
            if not self._waiting:
                return None
            picture, size = self._waiting.popleft()
            self._size -= size
            self._changed.notify_all()
            return picture
