"""A sink in a thread of its own: everything reaches it in order, nobody waits for it, and what it raises is told."""

from __future__ import annotations

import threading
import time

import pytest

from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.settings import DEMO_SITE
from gateway.sinks.aside import Aside, AtOnce, SinkAside


def _pictures(count: int) -> list[Picture]:
    """Empty ones."""
    state, made = initial(DEMO_SITE), []
    for _ in range(count):
        state, picture = step(state, [])
        made.append(picture)
    return made


class _Slow:
    """Takes a picture when it is let, and remembers in which thread; refuses one of them."""

    def __init__(self, refused: int = -1) -> None:
        self.taken: list[int] = []
        self.threads: set[str] = set()
        self.closed = 0
        self.let = threading.Event()
        self._refused = refused

    def write(self, picture: Picture) -> None:
        self.let.wait()
        if picture.step == self._refused:
            raise OSError(28, "no space left")
        self.threads.add(threading.current_thread().name)
        self.taken.append(picture.step)

    def flush(self, now: int) -> None:
        raise AssertionError("nobody asks for it")

    def close(self) -> None:
        self.closed += 1


def test_everything_arrives_in_order_and_nobody_waits() -> None:
    """While the other sink stands still pictures are taken all the same; at the end it has every one, in their order."""
    slow = _Slow()
    aside = SinkAside(slow)
    for picture in _pictures(50):
        aside.write(picture)
    assert slow.taken == []
    slow.let.set()
    aside.close()
    assert slow.taken == list(range(50))
    assert slow.threads == {"_Slow aside"}
    assert slow.closed == 1


def test_so_much_waits_and_no_more() -> None:
    """Whoever writes more than may wait is held up until the other sink has gone on; nothing is dropped."""
    slow = _Slow()
    aside, pictures = SinkAside(slow, most=3), _pictures(10)
    written = threading.Event()

    def write_all() -> None:
        for picture in pictures:
            aside.write(picture)
        written.set()

    writer = threading.Thread(target=write_all)
    writer.start()
    assert not written.wait(0.1)
    slow.let.set()
    writer.join()
    aside.close()
    assert slow.taken == list(range(10))


def test_what_the_other_sink_raises_is_raised_here_once() -> None:
    """A full disk is told by the next write, or by the end, and after it the other sink is closed."""
    slow = _Slow(refused=2)
    aside, pictures = SinkAside(slow), _pictures(5)
    for picture in pictures[:3]:
        aside.write(picture)
    slow.let.set()
    with pytest.raises(OSError, match="no space left"):
        aside.close()
    assert slow.taken == [0, 1]
    assert slow.closed == 1
    aside.close()


def test_a_write_after_a_failure_tells_it() -> None:
    """Who goes on writing is told before long, and what comes later is not taken."""
    slow = _Slow(refused=0)
    aside, pictures = SinkAside(slow), _pictures(3)
    aside.write(pictures[0])
    slow.let.set()

    def go_on() -> None:
        for _ in range(10_000):
            aside.write(pictures[1])
            time.sleep(1e-3)

    with pytest.raises(OSError, match="no space left"):
        go_on()
    aside.close()
    assert slow.taken == []


def test_jobs_behind_one_that_fails_are_done_all_the_same() -> None:
    """What the first one raised is told once, by whoever waits; after the end a job is done at once."""
    aside, done, let = Aside("jobs"), list[int](), threading.Event()

    def refuse() -> None:
        let.wait()
        raise OSError(28, "no space left")

    aside.do(refuse)
    aside.do(lambda: done.append(1))
    let.set()
    with pytest.raises(OSError, match="no space left"):
        aside.wait()
    aside.do(lambda: done.append(2))
    aside.wait()
    assert done == [1, 2]
    aside.close()
    aside.do(lambda: done.append(3))
    assert done == [1, 2, 3]


def test_without_a_thread_a_job_is_done_at_once() -> None:
    """The same words, for who need not wait for anything; what a job raises is raised where it was given."""
    done: list[int] = []
    at_once = AtOnce()
    at_once.do(lambda: done.append(1))
    assert done == [1]
    with pytest.raises(ZeroDivisionError):
        at_once.do(lambda: 1 // 0)
    at_once.wait()
    at_once.close()
