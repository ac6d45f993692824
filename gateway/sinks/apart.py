"""Our side of the process that draws (`drawing`): a sink that hands every picture to it and hears what became of them.

What is drawn holds the interpreter for long: of a hundred aircraft half a core, in pieces of tens of milliseconds. In a
process of its own it holds up no picture and no datagram, and where there is one core only it comes after them.
"""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.fuse import Fused
from gateway.observation import Attitude, FlightPlan, GpsReport, Intent, Observation, RadarPlot, WeatherArea
from gateway.picture import Health, Picture
from gateway.settings import Site
from gateway.sinks.serving import free_port

SIZE_BYTES = 8
_GATHERED_NS = 100_000_000  # of session time: a message costs the same for one picture as for ten
_GATHERED_AT_MOST = 16_000_000  # bytes that wait while the process draws: a crowd's ten seconds; then it is waited for
_HEALTH_NS = 1_000_000_000  # as often as it is drawn
_ATTITUDE_NS = 20_000_000  # of one aircraft: a symbol that turns 50 times a second turns smoothly
_DRAWN = GpsReport | RadarPlot | FlightPlan | Intent | WeatherArea


class Gathered:
    """Pictures that wait to be handed over, each pickled as it comes: many at once would hold the interpreter for long.

    What they share, such as names and what stays the same from step to step, is written once.
    """

    def __init__(self) -> None:
        self.count = 0
        self._content = io.BytesIO()
        self._pickler = pickle.Pickler(self._content, pickle.HIGHEST_PROTOCOL)

    def add(self, picture: Picture) -> None:
        """One more."""
        self._pickler.dump(picture)
        self.count += 1

    @property
    def size(self) -> int:
        """Bytes."""
        return self._content.tell()

    @property
    def content(self) -> bytes:
        """As `pictures` reads it."""
        return self._content.getvalue()


def pictures(count: int, content: bytes) -> list[Picture]:
    """What was gathered."""
    unpickler = pickle.Unpickler(io.BytesIO(content))
    return [unpickler.load() for _ in range(count)]


class Apart:
    """Draws pictures in another process: see `gateway.sinks.rerun.RerunSink`, whose arguments these are.

    Nothing is dropped: a message is sent when the one before has been taken, and until then pictures are gathered. A crowd
    takes seconds to draw: whoever waited for that would have all their pictures to pickle at once, and hold up the next ones.
    `write` and `close` raise OSError when the file could not be written, or the process has ended by itself. Raises OSError if
    it cannot be started, or the port is taken.
    """

    def __init__(self, site: Site, *, path: Path | None, serve: tuple[str, int] | None, **arguments: Any) -> None:
        if serve is not None:
            serve = serve[0], free_port(*serve)
        self._path = path
        self._gathered = Gathered()
        self._since: int | None = None
        self._health_at: int | None = None
        self._attitude_at: dict[str, int] = {}
        self._unanswered = 0
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._is_open = True
        self.address: str | None = None  # what a viewer opens, once it can
        self.dropped = 0  # rows that viewers did not take in time; the file has them
        search = os.pathsep.join(one or os.getcwd() for one in sys.path)
        self._child = subprocess.Popen(
            [sys.executable, "-P", "-m", "gateway.sinks.drawing"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": search},
        )
        threading.Thread(target=self._listen, name="answers of the process that draws", daemon=True).start()
        self._tell("open", site, {"path": path, "serve": serve, **arguments})

    @property
    def process(self) -> int:
        """Its number."""
        return self._child.pid

    def write(self, picture: Picture) -> None:
        """Take one picture; raises OSError for what became of those before."""
        self._gathered.add(self._as_drawn(picture))
        if self._since is None:
            self._since = picture.now
        waited = picture.now - self._since
        is_busy = self._unanswered > 0 and self._answers.empty()
        if self._gathered.size >= _GATHERED_AT_MOST or not (0 <= waited < _GATHERED_NS or is_busy):
            self._hand_over()
            self._since = picture.now

    def flush(self, now: int) -> None:
        """Nothing by itself: what is gathered goes with a picture a tenth of a second later, once the last ones are drawn."""

    def write_smoothed(self, fused: Fused, step: NDArray[np.int64]) -> None:
        """Draw smoothed rows of one track in the order of time, and the numbers of their pictures; raises OSError."""
        self._hand_over()
        self._tell("write_smoothed", fused, step)

    def end_smoothed(self, track: int, at: int, step: int) -> None:
        """A track ended then, in that picture, and leaves the scene; raises OSError."""
        self._tell("end_smoothed", track, at, step)

    def close(self) -> None:
        """Have what waits drawn, the file ended and made small, the server ended; calling it again does nothing."""
        if not self._is_open:
            return
        try:
            self._hand_over()
            self._tell("close")
            self._hear()
        finally:
            self._end()

    def _as_drawn(self, picture: Picture) -> Picture:
        """The picture without what is not drawn: most of what would have to be carried over."""
        last = self._health_at
        is_told = last is None or not 0 <= picture.now - last < _HEALTH_NS
        if is_told:
            self._health_at = picture.now
        return replace(
            picture,
            observations=tuple(filter(self._is_drawn, picture.observations)),
            fuse=replace(picture.fuse, settled=()),
            health=picture.health if is_told else Health(),
        )

    def _is_drawn(self, one: Observation) -> bool:
        """Whether it is drawn; of attitudes that come thick, some."""
        if not isinstance(one, Attitude):
            return isinstance(one, _DRAWN)
        last = self._attitude_at.get(one.aircraft)
        if last is not None and 0 <= one.valid_at - last < _ATTITUDE_NS:
            return False
        self._attitude_at[one.aircraft] = one.valid_at
        return True

    def _hand_over(self) -> None:
        gathered, self._gathered = self._gathered, Gathered()
        if gathered.count:
            self._tell("write_all", gathered.count, gathered.content)

    def _tell(self, what: str, *about: Any) -> None:
        """Ask the process to do something, once it has answered for all before."""
        if not self._is_open:
            return
        while self._unanswered:
            self._hear()
        message = pickle.dumps((what, about), pickle.HIGHEST_PROTOCOL)
        try:
            assert self._child.stdin is not None
            self._child.stdin.write(len(message).to_bytes(SIZE_BYTES, "little"))
            self._child.stdin.write(message)
            self._child.stdin.flush()
        except BrokenPipeError:
            self._unexpected_end()
        self._unanswered += 1

    def _listen(self) -> None:
        """Take the process's answers as they come, b"" being its end; in a thread, so that others can see if there is one."""
        assert self._child.stdout is not None
        with self._child.stdout as answers:
            while True:
                size = int.from_bytes(answers.read(SIZE_BYTES), "little")
                answer = answers.read(size)
                if not size or len(answer) < size:
                    break
                self._answers.put(answer)
        self._answers.put(b"")

    def _hear(self) -> None:
        """What became of what was asked."""
        answer = self._answers.get()
        if not answer:
            self._unexpected_end()
        self._unanswered -= 1
        self.address, self.dropped, refused = pickle.loads(answer)
        if refused is not None:
            self._end()
            raise OSError(*refused)

    def _unexpected_end(self) -> None:
        self._end()
        number = self._child.returncode
        how = f"by signal {-number}" if number < 0 else f"with code {number}"
        raise OSError(0, f"the process that draws has ended {how}", str(self._path) if self._path else None)

    def _end(self) -> None:
        """Let the process end; it does when nobody tells it anything any more."""
        self._is_open = False
        assert self._child.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._child.stdin.close()
        self._child.wait()
