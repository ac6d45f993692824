"""Work on many things at once, such as the sessions of a folder: in processes of this machine, or on a Dask cluster.

The unit of work is a plain function of one thing, both of which can be pickled. A thing that cannot be worked on does not
stop the others: its outcome says why. Outcomes stand in the order of the things, whoever worked on them and when.

Processes are ours and not the standard library's pool: there, one that dies takes all that others work on with it, nobody
knows which thing killed it, and workers outlive a parent that was killed. Here each has a pipe of its own: its end tells on
what it died, and the parent's end tells it to leave.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

from gateway.runtime.interpreter import collect_rarely

Thing = TypeVar("Thing")
Result = TypeVar("Result")

_ATTEMPTS = 2  # at what a process died on: it may have been killed for another's sake
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[Result]):
    """What came of one thing: its result, or in one plain sentence why there is none."""

    result: Result | None = None
    failure: str | None = None


@dataclass(frozen=True, slots=True)
class Job(Generic[Thing, Result]):
    """What is done to each thing. `tells` is what `work` raises to say, in one sentence, that it cannot be done."""

    work: Callable[[Thing], Result]
    tells: type[Exception]

    def on(self, thing: Thing) -> Outcome[Result]:
        """Do it to one thing. Raises what is an error of the program."""
        try:
            return Outcome(self.work(thing))
        except self.tells as failure:
            return Outcome(failure=str(failure))


Ended = tuple[int, Outcome[Any]]
"""The place of a thing and what came of it."""


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def gathered(ended: Iterable[Ended], count: int, tell: Callable[[int], None]) -> list[Outcome[Any]]:
    """Outcomes in the order of `count` things; `tell` hears how many are done."""
    outcomes: list[Outcome[Any]] = [Outcome()] * count
    for done, (place, outcome) in enumerate(ended, 1):
        outcomes[place] = outcome
        tell(done)
    return outcomes


def in_processes(job: Job[Thing, Any], things: Sequence[Thing], workers: int) -> Generator[Ended, None, None]:
    """Work on things in so many processes at once; each outcome as it comes.

    What a process died on is tried once more by another one. Closed early, it ends the processes, whatever they do.
    """
    waiting = deque((place, 1) for place in range(len(things)))
    crew = [_Worker(job) for _ in range(min(workers, len(things)))]
    try:
        while waiting or any(one.at is not None for one in crew):
            for one in crew:
                if one.at is None and waiting:
                    one.begin(*waiting.popleft(), things)
            busy = {one.end: one for one in crew if one.at is not None}
            for end in wait(list(busy)):
                one = busy[end]  # type: ignore[index]
                place, attempt = one.leave()
                outcome, goes_on = one.hear()
                if not goes_on:
                    crew[crew.index(one)] = _Worker(job)
                if outcome is None and attempt < _ATTEMPTS:
                    waiting.appendleft((place, attempt + 1))
                else:
                    yield place, outcome or Outcome(failure=_died(one.buried()))
    finally:
        for one in crew:
            one.dismiss()


def _died(how: int) -> str:
    reason = f"was ended by signal {-how}" if how < 0 else f"ended with code {how}"
    hint = "; perhaps it needs more memory than there is" if how == -signal.SIGKILL else ""
    return f"Each of the {_ATTEMPTS} processes that worked on it {reason}{hint}."


class _Worker:
    """Our side of one process. `at` is what it works on: the thing's place and which attempt it is; None: nothing."""

    def __init__(self, job: Job[Any, Any]) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would copy locks that other threads hold
        self.end, theirs = context.Pipe()
        self.at: tuple[int, int] | None = None
        self._process = context.Process(target=_serve, args=(theirs, job), daemon=True)
        with _one_thread_each():
            self._process.start()
        theirs.close()

    def begin(self, place: int, attempt: int, things: Sequence[Any]) -> None:
        """Hand it one thing; that it has died is heard when the outcome is waited for."""
        self.at = place, attempt
        with contextlib.suppress(ConnectionError):
            self.end.send(things[place])

    def leave(self) -> tuple[int, int]:
        """What it worked on until now."""
        assert self.at is not None
        at, self.at = self.at, None
        return at

    def hear(self) -> tuple[Outcome[Any] | None, bool]:
        """What came of it, None if the process died on it; and whether the process goes on."""
        try:
            told: tuple[Outcome[Any], bool] = self.end.recv()
        except (EOFError, ConnectionError):
            return None, False
        return told

    def buried(self) -> int:
        """How a process that died has ended: minus the signal, or its exit code."""
        self._process.join()
        return self._process.exitcode or 0

    def dismiss(self) -> None:
        """End it, whatever it does."""
        self.end.close()
        self._process.kill()
        self._process.join()


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that begin in here have libraries with one thread: there is one process a core."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _serve(end: Connection, job: Job[Any, Any]) -> None:
    """A process's life: things in, outcomes out, until nobody is at the other end any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's affair, who ends us
    collect_rarely()
    while True:
        try:
            thing = end.recv()
        except (EOFError, ConnectionError):
            return
        try:
            outcome = job.on(thing)
        except Exception as error:
            end.send((Outcome(failure=program_error(error)), False))
            raise
        with contextlib.suppress(ConnectionError):
            end.send((outcome, True))


def program_error(error: BaseException) -> str:
    """What is said of an exception that should not be."""
    return f"An error of the program: {type(error).__name__}: {error}"
