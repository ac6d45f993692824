"""The command line: help, exit codes, and one plain sentence for what people do wrong."""

import subprocess
import sys
from types import ModuleType

import pytest

from gateway import __version__
from gateway.cli.app import check_packages, run
from gateway.cli.failures import Failure
from gateway.cli.live import live
from gateway.cli.live_options import Links
from gateway.cli.options import Viewer
from gateway.cli.replay_options import read_speed
from gateway.cli.viewing import chosen

COMMANDS = (
    "demo",
    "live",
    "replay",
    "simulate",
    "play",
    "check",
    "columns",
    "reconstruct",
    "report",
    "site",
    "study",
    "sessions",
)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([command, "--help"]) == 0
    told = capsys.readouterr().out
    assert f"\n   talkdown {command}" in told
    assert "[]" not in told, "a [[table]] was taken for markup"


def test_without_arguments_the_commands_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 0
    told = capsys.readouterr().out
    assert all(command in told for command in COMMANDS)


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == 0
    assert capsys.readouterr().out == f"talkdown {__version__}\n"


@pytest.mark.parametrize(
    ("line", "says"),
    [
        (["fly"], "fly"),
        (["live"], "give --mavlink"),
        (["live", "--mavlink", "udp:0.0.0.0:14550", "--viewer", "none"], "udpin:0.0.0.0:14550 to listen"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--viewer", "none", "--serve", "9876"], "--serve '9876'"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--site", "no.toml"], "There is no site file no.toml"),
        (["replay"], "FILE"),
        (["replay", "x.tlog", "--speed", "fast"], "--speed 'fast'"),
        (["replay", "x.tlog", "--weighting", "heavy"], "heavy"),
        (["replay", "x.tlog", "--estimator", "guess"], "guess"),
        (["play", "x.tlog", "--mavlink", "tcp:127.0.0.1:5760"], "needs udpout:HOST:PORT"),
        (["simulate", "circus"], "circus"),
        (["simulate", "radar"], "--watch"),
        (["simulate", "approach", "--set", "gps.colour=3"], "gps.colour"),
        (["study", "history"], "no study 'history'"),
        (["sessions", "/nowhere/at/all"], "no folder /nowhere/at/all"),
        (["site", "/nowhere/at/all.tlog"], "cannot be read"),
        (["check", "/nowhere/at/all.tlog"], "cannot be read"),
        (["columns", "/nowhere/at/all.tlog", "--out", "x"], "cannot be read"),
        (["reconstruct", "flows", "/nowhere/at/all.tlog"], "cannot be read"),
        (["reconstruct", "x.tlog", "--close-on", "home"], "lift-off, threshold, nothing, or degrees"),
        (["reconstruct", "x.tlog", "--close-on", "threshold"], "--site"),
        (["reconstruct", "x.tlog", "--lift-off", "91,0"], "--lift-off '91,0'"),
        (["reconstruct", "x.tlog", "--take-off-speed", "9", "--landing-speed", "9"], "below the take-off speed"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--key", "/nowhere/at/all.key"], "all.key"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--allow-peer", "home"], "'home' is not a peer"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--allow-system", "0"], "'0'"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--plan", "/nowhere/at/all.plan"], "all.plan"),
        (["live", "--mavlink", "udpin:127.0.0.1:0", "--publish", "qgc"], "'qgc' is not a link"),
    ],
)
def test_wrong_usage_is_one_plain_sentence_and_exit_code_2(
    line: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(line) == 2
    told = capsys.readouterr()
    assert says in told.err
    assert len(told.err.strip().splitlines()) == 1
    assert told.out == ""


def test_another_distributions_package_adapters_is_recognised(monkeypatch: pytest.MonkeyPatch) -> None:
    stranger = ModuleType("adapters")
    stranger.__file__ = "/somewhere/adapters/__init__.py"
    monkeypatch.setitem(sys.modules, "adapters", stranger)
    with pytest.raises(Failure, match=r"another distribution's.*virtual environment of its own"):
        check_packages()


def test_help_imports_nothing_heavy() -> None:
    """What the help needs is small: numpy, rerun, pyarrow and pymavlink wait for a command."""
    script = "import sys; from gateway.cli import app; print([name for name in sys.modules])"
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout
    assert not {"numpy", "rerun", "pyarrow", "pymavlink", "scipy"} & {name.strip(" '[]\n") for name in told.split(",")}


@pytest.mark.parametrize(("text", "speed"), [("max", None), ("1", 1.0), ("0.5", 0.5), ("20", 20.0), (None, 3.0)])
def test_a_speed_is_a_factor_or_max(text: str | None, speed: float | None) -> None:
    assert read_speed(text, 3.0) == speed


@pytest.mark.parametrize("text", ["0", "-1", "nan", "inf", ""])
def test_a_speed_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(Failure, match="--speed"):
        read_speed(text, None)


def test_the_viewer_is_a_window_only_where_there_is_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.cli.viewing.has_screen", lambda: False)
    assert chosen(None) is Viewer.web
    assert chosen(Viewer.none) is Viewer.none
    monkeypatch.setattr("gateway.cli.viewing.has_screen", lambda: True)
    assert chosen(None) is Viewer.native


def test_live_without_a_link_is_refused_before_anything_is_opened() -> None:
    with pytest.raises(Failure, match="needs something to listen to"):
        live(Links())


@pytest.mark.parametrize(
    ("mavlink", "radar"),
    [
        (["udpin:127.0.0.1:14550", "udpin:0.0.0.0"], None),
        (["udpin:127.0.0.1:30070"], ["udpin:127.0.0.1"]),
        (["serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:115200"], None),
    ],
)
def test_one_port_given_twice_is_told_from_one_that_another_program_has(
    mavlink: list[str], radar: list[str] | None
) -> None:
    with pytest.raises(Failure, match="this port is given twice"), Links(mavlink, radar).opened():
        pass
