"""Work that is done in a thread of its own, so that what it waits for holds up no picture.

The archive waits for the disk; and the process that draws (`apart`) takes the load but answers late: to draw a hundred
aircraft takes a quarter of a second. Between two pictures both are far too long.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from functools import partial

from gateway.picture import Picture
from gateway.sinks import Sink

WAITING = 100_000  # pictures, rows and records: half a minute of a hundred aircraft; then the next one waits too

Job = Callable[[], object]


class AtOnce:
    """Does every job at once: the same as `Aside`, without a thread."""

    def do(self, job: Job, size: int = 1) -> None:
        """Do it; raises what it raises."""
        job()

    def wait(self) -> None:
        """Nothing waits."""

    def close(self) -> None:
        """Nothing waits."""


class Aside:
    """Does jobs in their order, in a thread that it has for itself.

    Nothing is dropped: where it falls behind by `most`, `do` waits for it. The first thing that a job raises is raised by
    the next `do`, `wait` or `close`, once; the jobs behind it are done all the same.
    """

    def __init__(self, name: str, most: int = WAITING) -> None:
        self._most = most
        self._waiting: deque[tuple[Job, int]] = deque()
        self._size = 0  # of the jobs that are not done
        self._ending = False
        self._failure: BaseException | None = None
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def do(self, job: Job, size: int = 1) -> None:
        """Have a job of so many rows or records done, after the end at once; raises what an earlier one raised."""
        if self._ending:
            job()
            return
        with self._changed:
            self._changed.wait_for(lambda: self._size < self._most)
            self._waiting.append((job, size))
            self._size += size
            self._changed.notify_all()
            self._complain()

    def wait(self) -> None:
        """Until everything is done; raises what a job raised."""
        with self._changed:
            self._changed.wait_for(lambda: not self._size)
            self._complain()

    def close(self) -> None:
        """Wait until everything is done, and end the thread; calling it again does nothing."""
        with self._changed:
            self._ending = True
            self._changed.notify_all()
        self._thread.join()
        self._complain()

    def _complain(self) -> None:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure

    def _run(self) -> None:
        while (waiting := self._next()) is not None:
            job, size = waiting
            failure = None
            try:
                job()
            except BaseException as error:  # raised again in the thread that gives the jobs
                failure = error
            with self._changed:
                self._failure = self._failure or failure
                self._size -= size
                self._changed.notify_all()

    def _next(self) -> tuple[Job, int] | None:
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._ending)
            return self._waiting.popleft() if self._waiting else None


class SinkAside:
    """Hands every picture to another sink in a thread of its own; what that raises is told by the next `write` or `close`.

    After that it takes nothing more.
    """

    def __init__(self, sink: Sink, most: int = WAITING) -> None:
        self._sink, self._has_refused = sink, False
        self._aside = Aside(f"{type(sink).__name__} aside", most)

    def write(self, picture: Picture) -> None:
        """Take one picture; raises what the other sink raised at an earlier one."""
        self._aside.do(partial(self._take, picture), size_of(picture))

    def flush(self, now: int) -> None:
        """Nothing by itself: the other sink writes out what waits when its pictures come."""

    def close(self) -> None:
        """Wait until everything has been taken, and close the other sink; calling it again does nothing."""
        try:
            self._aside.close()
        finally:
            self._sink.close()

    def _take(self, picture: Picture) -> None:
        if self._has_refused:
            return
        try:
            self._sink.write(picture)
        except BaseException:
            self._has_refused = True
            raise


def size_of(picture: Picture) -> int:
    """How much a picture is, in rows."""
    return 1 + len(picture.fuse.time) + len(picture.align.report_time) + len(picture.align.plot_time)
