"""Live sessions over real UDP on the loopback: how they end, and that a replay gives the same."""

import contextlib
import json
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from gateway.runtime.folder import read_record
from gateway.runtime.links import open_link
from gateway.runtime.loop import run_live, run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.run import Run
from gateway.runtime.setup import Place, Serve, Setup
from gateway.runtime.summary import Summary
from gateway.runtime.urls import Url
from gateway.settings import parse_site
from sim.run import play

from sim.scenes import build_scene  # isort: skip

Start = Callable[..., "subprocess.Popen[str]"]
Eventually = Callable[[Callable[[], Any], str], Any]
Talkdown = Callable[..., Any]


@contextlib.contextmanager
def approach_on(mavlink_port: int, radar_port: int) -> Iterator[None]:
    """An approach that is sent to these ports at real speed while the context lasts."""
    import time

    changes = ["gps.period_s=0.2", "gps.latency_high_s=0.2"]
    scene = build_scene("approach", start_ns=time.time_ns() // 4000 * 4000, seed=5, changes=changes)
    stop = threading.Event()
    urls = Url("udpout", "127.0.0.1", mavlink_port), Url("udpout", "127.0.0.1", radar_port)
    sender = threading.Thread(target=play, args=(scene, *urls), kwargs={"stop": stop}, daemon=True)
    sender.start()
    try:
        yield
    finally:
        stop.set()
        sender.join()


@pytest.fixture
def site_file(approach: Path, tmp_path: Path) -> Path:
    """The site of the simulated approach as a file."""
    path = tmp_path / "field.toml"
    path.write_text(str(read_record(approach).site))
    return path


@pytest.fixture
def session(
    start: Start, eventually: Eventually, free_ports: tuple[int, int], site_file: Path, tmp_path: Path
) -> Iterator[tuple["subprocess.Popen[str]", Path]]:
    """A live session in a process of its own, with tracks in its archive already; the process and its folder."""
    mavlink, radar = (f"udpin:127.0.0.1:{port}" for port in free_ports)
    archive = tmp_path / "archive"
    links = ("--mavlink", mavlink, "--radar", radar, "--site", site_file)
    with approach_on(*free_ports):
        process = start("live", *links, "--viewer", "none", "--archive", archive, "--json")

        def grown() -> list[Path]:
            assert process.poll() is None, process.communicate()
            return [path for path in archive.glob("*/tracks.arrows") if path.stat().st_size > 6000]

        (stream,) = eventually(grown, "tracks in the archive")
        yield process, stream.parent


def rows(folder: Path) -> int:
    return int(pq.read_metadata(folder / "tracks.parquet").num_rows)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_and_sigterm_end_a_session_cleanly(
    session: tuple["subprocess.Popen[str]", Path], number: signal.Signals
) -> None:
    process, folder = session
    process.send_signal(number)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    assert json.loads(out)["archive"] == str(folder)
    assert str(read_record(folder).ended).startswith("stopped by")
    assert rows(folder) > 0
    assert not list(folder.glob("*.arrows"))


def test_a_second_ctrl_c_ends_at_once_and_loses_nothing_that_was_written(
    session: tuple["subprocess.Popen[str]", Path], talkdown: Talkdown
) -> None:
    process, folder = session
    written = (folder / "inputs" / "mavlink-1.tlog").stat().st_size
    for _ in range(2):
        process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode in (0, 1), err
    assert "Traceback" not in err
    assert (folder / "inputs" / "mavlink-1.tlog").stat().st_size >= written
    assert talkdown("sessions", folder.parent).code == 0
    assert rows(folder) > 0


def test_what_was_archived_before_kill_9_is_completed_by_the_next_command(
    session: tuple["subprocess.Popen[str]", Path], talkdown: Talkdown
) -> None:
    process, folder = session
    (running,) = talkdown("sessions", folder.parent, "--json").summary
    assert running["running"]
    assert (folder / "tracks.arrows").exists()  # a session that runs is left alone
    process.kill()
    process.communicate()
    (listed,) = talkdown("sessions", folder.parent, "--json").summary
    assert listed["ended"] == "killed"
    assert not listed["running"]
    assert rows(folder) > 5
    assert not list(folder.glob("*.arrows"))
    again = talkdown("replay", folder, "--viewer", "none", "--archive", folder.parent.parent / "again", "--json")
    assert again.code == 0
    killed = pq.read_table(folder / "tracks.parquet")
    whole = pq.read_table(Path(again.summary["archive"]) / "tracks.parquet")
    assert whole.num_rows >= killed.num_rows
    assert killed["time"].equals(whole["time"].slice(0, killed.num_rows))


def test_a_port_in_use_is_refused_with_what_to_do(talkdown: Talkdown, tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        ended = talkdown("live", "--mavlink", f"udpin:127.0.0.1:{port}", "--viewer", "none", "--archive", tmp_path)
    assert ended.code == 2
    assert "another program has this port already; close it" in ended.sentence
    assert not list(tmp_path.iterdir())


def test_a_viewers_port_in_use_is_refused_with_what_to_do(talkdown: Talkdown, site_file: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        serve = f"127.0.0.1:{taken.getsockname()[1]}"
        links = ("--mavlink", "udpin:127.0.0.1:0", "--site", site_file)
        ended = talkdown("live", *links, "--viewer", "none", "--serve", serve, "--seconds", "1")
    assert ended.code == 2
    assert "give --serve another one" in ended.err.strip().splitlines()[-1]


def live(
    setup: Setup,
    seconds: float,
    watch: Callable[[Run, Any], None] = lambda run, picture: None,
    asked_to_stop: Callable[[], str | None] = lambda: None,
) -> Summary:
    mavlink, radar = (open_link(Url("udpin", "127.0.0.1")) for _ in range(2))
    with approach_on(mavlink.url.port, radar.url.port):
        return run_live([mavlink], [radar], setup, seconds=seconds, watch=watch, asked_to_stop=asked_to_stop)


@pytest.fixture
def place(approach: Path) -> Place:
    text = str(read_record(approach).site)
    return Place(parse_site(text), text, "test")


def test_a_replay_of_a_live_session_gives_its_numbers_to_the_bit(place: Place, tmp_path: Path) -> None:
    first = live(Setup(place=place, archive=tmp_path / "live", live=True), 4.0)
    assert first.archive is not None
    assert first.track_rows > 20
    for archive in ("once", "twice"):
        playback = open_playback([first.archive])
        setup = Setup(place=playback.place, options=playback.options, archive=tmp_path / archive, is_watched=False)
        again = run_replay(playback, setup)
        assert again.archive is not None
        for table in ("tracks.parquet", "predictions.parquet", "truth.parquet"):
            assert pq.read_table(first.archive / table).equals(pq.read_table(again.archive / table)), table


def test_viewers_that_vanish_in_the_middle_disturb_nothing(place: Place, tmp_path: Path) -> None:
    """Connections that are reset, again and again, as those of killed viewers are."""
    seen: list[int] = []

    def connect_and_vanish(run: Run, picture: Any) -> None:
        if run.outputs is None or run.outputs.address is None:
            return
        port = int(run.outputs.address.rpartition(":")[2].partition("/")[0])
        with socket.create_connection(("127.0.0.1", port)) as viewer:
            viewer.sendall(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\4\0\0\0\0\0")
            viewer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
        seen.append(port)

    setup = Setup(place=place, archive=tmp_path, serve=Serve(), live=True)
    summary = live(setup, 30.0, connect_and_vanish, lambda: "the test" if len(seen) > 50 else None)
    assert len(seen) > 50
    assert summary.ended == "stopped by the test"
    assert summary.archive is not None
    assert rows(summary.archive) == summary.track_rows > 5
