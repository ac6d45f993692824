"""The process that draws: what it draws is what would be drawn here, and whatever happens to it is said."""

from __future__ import annotations

import os
import resource
import signal
import socket
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from gateway.observation import Attitude
from gateway.picture import Picture
from gateway.settings import DEMO_SITE
from gateway.sinks import apart as apart_module
from gateway.sinks.apart import Apart
from gateway.sinks.hold import is_held
from gateway.sinks.rerun import RerunSink


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file of this process and those that it starts may grow beyond 400 kB: what a full disk looks like to a writer."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def write_all(sink: Apart | RerunSink, made: list[Picture]) -> None:
    for picture in made:
        sink.write(picture)


def without_row_ids(entities: dict) -> dict:
    """The rows of a recording without what tells recordings of the same things apart."""
    bare = {
        path: sorted(
            ({name: value for name, value in row.items() if "RowId" not in name} for row in rows),
            key=lambda row: (row.get("utc", 0), row.get("step", 0), str(row)),
        )
        for path, rows in entities.items()
    }
    return {path: rows for path, rows in bare.items() if not path.startswith("/__properties")}


@pytest.fixture
def waited_for(monkeypatch):
    """Nothing is gathered while the process draws: each picture waits until those before are drawn."""
    monkeypatch.setattr(apart_module, "_GATHERED_AT_MOST", 1)


def test_the_same_is_drawn_as_here_whatever_the_terminal_tells_everybody(tmp_path, pictures, read, waited_for):
    """Whatever is not carried over is not drawn either. Ctrl-C reaches every process; who started this one ends it."""
    made = pictures(20.0, end=True)
    here = RerunSink(DEMO_SITE, path=tmp_path / "here.rrd", modes=True)
    write_all(here, made)
    here.close()
    apart = Apart(DEMO_SITE, path=tmp_path / "apart.rrd", serve=("127.0.0.1", 0), modes=True)
    assert apart.address is None
    write_all(apart, made[:50])
    assert apart.address is not None  # as soon as a viewer can connect
    port = int(apart.address.removesuffix("/proxy").rsplit(":", 1)[1])
    with socket.create_connection(("127.0.0.1", port), timeout=5.0):
        pass
    path = tmp_path / "apart.rrd"
    assert is_held(path, path)  # by the process that draws
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(apart.process, number)
    write_all(apart, made[50:])
    apart.close()
    apart.close()  # which does nothing
    assert apart._child.returncode == 0
    assert not is_held(path, path)
    drawn = {name: without_row_ids(read(tmp_path / f"{name}.rrd")) for name in ("here", "apart")}
    assert drawn["apart"].keys() == drawn["here"].keys()
    assert repr(drawn["apart"]) == repr(drawn["here"])  # as text, where what is not known equals itself


def test_while_the_process_draws_pictures_gather_and_nobody_waits(tmp_path, pictures, read):
    """A process that is stopped takes nothing; everything is drawn once it goes on."""
    path, made = tmp_path / "session.rrd", pictures(20.0)
    sink = Apart(DEMO_SITE, path=path, serve=None)
    os.kill(sink.process, signal.SIGSTOP)
    write_all(sink, made)
    assert sink._gathered.count == len(made)  # nothing has been answered yet, not even that it is open
    os.kill(sink.process, signal.SIGCONT)
    sink.close()
    assert made[-1].now - max(row["utc"] for row in read(path)["/fuse/1"] if row.get("utc")) < 2_000_000_000


def test_of_attitudes_that_come_thick_fifty_a_second_of_each_aircraft_are_carried_over(pictures, monkeypatch):
    """To carry five hundred over takes longer than to draw them, and nobody sees a symbol turn so often."""
    carried: list[Picture] = []
    monkeypatch.setattr(
        Apart,
        "_tell",
        lambda self, what, *about: carried.extend(apart_module.pictures(*about) if what == "write_all" else ()),
    )
    sink = Apart(DEMO_SITE, path=None, serve=None)
    made = pictures(1.0)[0]
    thick = [
        Attitude(f"mavlink:{number}", made.now + place * 2_000_000, made.now, 0.0, 0.0, place / 100)
        for place in range(500)
        for number in (1, 2)
    ]
    sink.write(replace(made, observations=(*made.observations, *thick[:400])))
    sink.write(replace(made, observations=tuple(thick[400:]), now=made.now + 10**9))
    sink._end()
    for name in ("mavlink:1", "mavlink:2"):
        told = [
            one
            for picture in carried
            for one in picture.observations
            if isinstance(one, Attitude) and one.aircraft == name and one.yaw_rad == (one.valid_at - made.now) / 2e8
        ]
        assert len(told) == 50
        assert max(after.valid_at - before.valid_at for before, after in pairwise(told)) == 20_000_000


def test_a_port_that_is_taken_raises_at_once():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"127.0.0.1:{port}"):
            Apart(DEMO_SITE, path=None, serve=("127.0.0.1", port))


def test_a_disk_that_takes_no_more_is_said_once(tmp_path, pictures, small_disk, waited_for):
    sink = Apart(DEMO_SITE, path=tmp_path / "session.rrd", serve=None)
    with pytest.raises(OSError, match=r"recording could not be written.*session\.rrd"):
        write_all(sink, pictures(60.0))
    sink.close()
    assert 300_000 < (tmp_path / "session.rrd").stat().st_size <= 400_000


def test_a_process_that_is_killed_is_said(tmp_path, pictures, waited_for):
    sink = Apart(DEMO_SITE, path=tmp_path / "session.rrd", serve=None)
    made = pictures(20.0)
    write_all(sink, made[:50])
    os.kill(sink.process, signal.SIGKILL)
    with pytest.raises(OSError, match="the process that draws has ended by signal 9"):
        write_all(sink, made[50:])
    sink.close()


def test_when_the_gateway_is_killed_everything_that_was_handed_over_is_drawn(tmp_path, pictures, read, waited_for):
    """What is left of the gateway then is the end of the pipe; the file can be read without an index."""
    path: Path = tmp_path / "session.rrd"
    sink = Apart(DEMO_SITE, path=path, serve=None, period_s=3600.0)
    made = pictures(20.0)
    write_all(sink, made)
    sink._end()
    assert sink._child.returncode == 0
    rows = read(path)["/fuse/1"]
    assert made[-1].now - max(row["utc"] for row in rows if row.get("utc")) < 2_000_000_000
