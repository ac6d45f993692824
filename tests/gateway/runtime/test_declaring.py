"""Declaring to a session that runs: over a port of this machine, and in a watched file."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from adapters.declared import Goal, decode, encode_intent
from gateway.cli.app import run
from gateway.observation import Intent, WeatherArea
from gateway.runtime import declared_file
from gateway.runtime.declarable import goal_of
from gateway.runtime.declared_file import WatchedFile
from gateway.runtime.declaring import DeclaringPort, declare
from gateway.runtime.urls import LinkError
from gateway.settings import SiteError


class Session:
    """What a session knows."""

    def known_aircraft(self) -> tuple[str, ...]:
        return ("mavlink:1", "mavlink:2")

    def known_points(self, aircraft: str) -> tuple[str, ...]:
        return ("IAF", "runway", "3") if aircraft == "mavlink:1" else ("IAF", "runway")


@contextmanager
def listening() -> Iterator[tuple[int, list[bytes]]]:
    """A port that is tended until the end of the block, and what was understood there."""
    port, lines, ends = DeclaringPort(0), list[bytes](), threading.Event()

    def tend() -> None:
        while not ends.wait(0.005):
            lines.extend(port.tend(Session()))

    thread = threading.Thread(target=tend)
    thread.start()
    try:
        yield port.port, lines
    finally:
        ends.set()
        thread.join()
        port.close()


def test_a_declaration_is_taken_and_answered(capsys: pytest.CaptureFixture[str]) -> None:
    """`talkdown declare` tells the gateway one line, says what was taken, and is done."""
    with listening() as (port, lines):
        assert run(["declare", "--aircraft", "mavlink:1", "--to", "iaf", "--port", str(port)]) == 0
    assert capsys.readouterr().out == "mavlink:1 is declared to go to iaf.\n"
    assert lines == [encode_intent("mavlink:1", Goal(name="iaf"))]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--aircraft", "mavlink:9", "--to", "IAF"], "There is no aircraft mavlink:9; there are mavlink:1, mavlink:2."),
        (
            ["--aircraft", "mavlink:1", "--to", "IFA"],
            "Nobody knows a point IFA for mavlink:1; known are IAF, runway, 3, or LATITUDE,LONGITUDE.",
        ),
        (
            ["--aircraft", "mavlink:2", "--to", "3"],
            "Nobody knows a point 3 for mavlink:2; known are IAF, runway, or LATITUDE,LONGITUDE.",
        ),
    ],
)
def test_what_is_not_known_is_refused_with_what_is(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence, exit code 1, and nothing is told."""
    with listening() as (port, lines):
        assert run(["declare", *arguments, "--port", str(port)]) == 1
    assert capsys.readouterr().err.strip() == says
    assert not lines


@pytest.mark.parametrize("sent", [b"GET / HTTP/1.1\r\n", b"\x00\xff\n", b"{}\n", b"", b"x" * 200_000])
def test_strangers_are_sent_away(sent: bytes) -> None:
    """A browser, noise, an endless line: nothing is told, and the port goes on listening."""
    with listening() as (port, lines):
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as stranger:
            try:
                stranger.sendall(sent)
                stranger.shutdown(socket.SHUT_WR)
                stranger.recv(1000)
            except OSError:
                pass
        assert declare(encode_intent("mavlink:1", Goal()), port)[0]
    assert lines == [encode_intent("mavlink:1", Goal())]


def test_without_a_gateway_the_sentence_says_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No gateway on a port, or a folder that is none of a running session."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        assert run(["declare", "--aircraft", "mavlink:1", "--withdraw", "--port", str(port)]) == 1
    assert "No gateway answers on port" in capsys.readouterr().err
    assert run(["declare", "--aircraft", "mavlink:1", "--withdraw", "--session", str(tmp_path)]) == 2
    assert "no session that runs" in capsys.readouterr().err


def test_a_session_folder_tells_the_port_while_it_runs(tmp_path: Path) -> None:
    """Written at the start, gone at the end."""
    port = DeclaringPort(0)
    port.write_into(tmp_path)
    assert str(port.port) in (tmp_path / "declare.json").read_text()
    port.close()
    assert not (tmp_path / "declare.json").exists()


def test_a_port_that_was_asked_for_and_is_taken_is_said() -> None:
    """Without one asked for, another is taken instead."""
    port = DeclaringPort(0)
    with pytest.raises(LinkError, match="is taken"):
        DeclaringPort(port.port)
    port.close()


@pytest.mark.parametrize(
    ("text", "goal"),
    [
        ("IAF", Goal(name="IAF")),
        ("12", Goal(item=12)),
        ("31.5,-104", Goal(latitude_deg=31.5, longitude_deg=-104.0)),
        ("31.5,104,900", Goal(latitude_deg=31.5, longitude_deg=104.0, altitude_msl_m=900.0)),
        ("A,B", Goal(name="A,B")),
    ],
)
def test_a_goal_is_a_name_an_item_or_a_place(text: str, goal: Goal) -> None:
    """As people write it."""
    assert goal_of(text) == goal


def test_a_place_that_is_none_is_wrong_usage() -> None:
    """Beyond the poles is no place."""
    assert run(["declare", "--aircraft", "mavlink:1", "--to", "95,20", "--port", "1"]) == 2


FILE = """
[[declared]]
aircraft = "mavlink:1"
to = "IAF"
[[weather]]
name = "CB"
latitude_deg = 31.0
longitude_deg = 104.0
radius_m = 2000.0
"""


def test_a_file_is_watched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What it declares is told once; what changes is told, what goes is withdrawn; an unknown point is said once."""
    monkeypatch.setattr(declared_file, "_LOOK_EVERY_S", 0.0)
    path = tmp_path / "told.toml"
    path.write_text(FILE)
    file = WatchedFile(path)

    def told() -> tuple[list[Intent | WeatherArea | None], list[str]]:
        lines, notes = [], []
        for _ in range(3):  # a change is read when it has stood for two looks
            more, said = file.tend(Session())
            lines += [decode(line, 0, 0) for line in more]
            notes += [text for _, text in said]
        return lines, notes

    lines, notes = told()
    assert [type(one) for one in lines] == [Intent, WeatherArea]
    assert told() == ([], []) == ([], notes)
    path.write_text(FILE.replace("IAF", "IFA").replace("2000.0", "3000.00"))
    lines, notes = told()
    assert [one.name for one in lines if one is not None] == ["CB"]
    assert len(notes) == 1
    assert "Nobody knows a point IFA for mavlink:1; known are IAF, runway, 3" in notes[0]
    path.write_text("[[declared]]\n")
    assert "What it declared before stays" in told()[1][0]
    path.write_text("# nothing any more\n")
    lines, notes = told()
    withdrawn, gone = lines
    assert isinstance(withdrawn, Intent)
    assert withdrawn.name is None
    assert isinstance(gone, WeatherArea)
    assert gone.area is None


def test_a_file_that_is_not_there_is_said_at_the_start(tmp_path: Path) -> None:
    """Before anything runs."""
    with pytest.raises(SiteError, match="cannot be read"):
        WatchedFile(tmp_path / "none.toml")
