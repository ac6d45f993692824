"""A full disk is said; a port that is taken is said; a viewer that stands still is not waited for."""

from __future__ import annotations

import resource
import socket
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from gateway.settings import DEMO_SITE
from gateway.sinks import feed
from gateway.sinks.rerun import RerunSink


@pytest.fixture
def small_disk() -> Iterator[None]:
    """No file of this process may grow beyond 400 kB: what a full disk looks like to a writer."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (400_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def write_all(sink: RerunSink, pictures: list) -> None:
    for picture in pictures:
        sink.write(picture)


def test_a_disk_that_takes_no_more_raises_and_is_said_once(tmp_path, pictures, small_disk):
    sink = RerunSink(DEMO_SITE, path=tmp_path / "session.rrd")
    with pytest.raises(OSError, match=r"recording could not be written.*session\.rrd"):
        write_all(sink, pictures(60.0))
    sink.close()


def test_a_folder_that_is_not_there_raises_at_once(tmp_path):
    with pytest.raises(OSError, match="absent"):
        RerunSink(DEMO_SITE, path=tmp_path / "absent" / "session.rrd")


def test_a_free_port_is_found_and_told():
    sink = RerunSink(DEMO_SITE, serve=("127.0.0.1", 0))
    address = sink.address
    assert address is not None
    assert address.startswith("rerun+http://127.0.0.1:")
    port = int(address.removesuffix("/proxy").rsplit(":", 1)[1])
    with socket.create_connection(("127.0.0.1", port), timeout=5.0):
        pass
    sink.close()


def test_a_port_that_is_taken_raises():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(OSError, match=f"127.0.0.1:{port}"):
            RerunSink(DEMO_SITE, serve=("127.0.0.1", port))


def test_without_a_server_there_is_no_address(tmp_path):
    sink = RerunSink(DEMO_SITE, path=tmp_path / "session.rrd")
    assert sink.address is None
    assert sink.dropped == 0
    sink.close()


@pytest.mark.parametrize("limit", [("BATCHES_WAITING", 8), ("ENTRIES_WAITING", 100)])
def test_a_viewer_that_takes_nothing_costs_rows_for_viewers_and_none_for_the_file(
    tmp_path, pictures, monkeypatch, limit
):
    """The thread of the viewers stands still, as it does behind a stopped viewer; the file gets all."""
    go_on = threading.Event()
    sending = feed.send

    def stuck(stream, entries):
        if threading.current_thread().name == "viewer feed":
            go_on.wait(30.0)
        sending(stream, entries)

    monkeypatch.setattr(feed, "send", stuck)
    monkeypatch.setattr(feed, *limit)
    path: Path = tmp_path / "session.rrd"
    sink = RerunSink(DEMO_SITE, path=path, serve=("127.0.0.1", 0))
    made = pictures(30.0)
    write_all(sink, made)
    assert sink.dropped > 0
    go_on.set()
    sink.close()
    alone = tmp_path / "alone.rrd"
    other = RerunSink(DEMO_SITE, path=alone)
    write_all(other, made)
    other.close()
    assert path.stat().st_size == pytest.approx(alone.stat().st_size, rel=0.01)


def test_behind_a_viewer_that_takes_nothing_not_everything_waits(tmp_path, pictures, monkeypatch):
    """Of the looks of new tracks, which are not dropped, a bounded number waits."""
    go_on = threading.Event()
    monkeypatch.setattr(feed, "send", lambda stream, entries: go_on.wait(30.0))
    monkeypatch.setattr(feed, "BATCHES_WAITING", 1)
    monkeypatch.setattr(feed, "KEPT_AT_MOST", 5)
    sink = RerunSink(DEMO_SITE, serve=("127.0.0.1", 0))
    write_all(sink, pictures(10.0))
    assert len(sink._served._kept) <= 5
    go_on.set()
    sink.close()


def test_closing_twice_is_closing_once(tmp_path, pictures):
    sink = RerunSink(DEMO_SITE, path=tmp_path / "session.rrd", serve=("127.0.0.1", 0))
    sink.write(pictures(0.2)[0])
    sink.close()
    written = (tmp_path / "session.rrd").read_bytes()
    sink.close()
    assert (tmp_path / "session.rrd").read_bytes() == written


def test_what_is_not_the_known_encoding_is_refused_in_plain_words():
    """A release of Rerun that encodes otherwise must not leave files that nobody can open."""
    for encoded in (b"RRF3" + bytes(60), b"RRF2" + bytes(8) + b"\x02" + bytes(7) + b"\xff" * 8, b"RRF2"):
        with pytest.raises(RuntimeError, match="does not know"):
            feed.message_part(encoded, with_header=True)


def test_a_recording_on_a_full_disk_ends_with_a_whole_message(tmp_path, pictures, small_disk):
    path = tmp_path / "session.rrd"
    sink = RerunSink(DEMO_SITE, path=path)
    with pytest.raises(OSError, match="recording"):
        write_all(sink, pictures(60.0))
    sink.close()
    assert 300_000 < path.stat().st_size <= 400_000
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the index is missing
        assert sum(chunk.num_rows for chunk in RrdReader(path).stream()) > 100
