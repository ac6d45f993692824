"""Commands on folders of sessions: what is made of each, where it goes, and who is named."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Generator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from gateway.cli.app import run
from gateway.cli.failures import UsageError
from gateway.cli.session_filters import Filters, Sorting, read_length, read_when
from gateway.runtime import many
from gateway.runtime.folder import Record, write_record
from gateway.runtime.listing import look
from gateway.settings import Options
from gateway.sinks.report_index import Entry, Graded, index
from sim.recording import write_session
from sim.scenes import build_scene

HOUR = 3600 * 10**9
BEGAN = 1_767_225_600 * 10**9  # 2026-01-01
NOW = datetime(2026, 1, 10, 12, tzinfo=UTC)
PLAIN = Record("0.1.0", ("live",), Options(), BEGAN, ended="done", watermark=BEGAN + 60 * 10**9)

Capsys = pytest.CaptureFixture[str]


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work in this process: others cost a second each, and tests/gateway/runtime/test_many.py has them."""

    def one_by_one(job: Any, things: Sequence[Any], workers: int) -> Generator[Any, None, None]:
        for place in reversed(range(len(things))):
            yield place, job.on(things[place])

    monkeypatch.setattr(many, "in_processes", one_by_one)


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions of 13 s, and one that cannot be read."""
    folder = tmp_path_factory.mktemp("simulated")
    for number in range(2):
        start_ns = BEGAN + number * HOUR
        write_session(build_scene("approach", start_ns=start_ns, seed=number, changes=("duration_s=13",)), folder)
    (folder / "spoiled").mkdir()
    (folder / "spoiled" / "session.json").write_text("{")
    return folder


@pytest.mark.usefixtures("at_once")
def test_a_folder_of_sessions_is_replayed_reported_scored_and_read_for_flows(
    simulated: Path, tmp_path: Path, capsys: Capsys
) -> None:
    """Each in the order of their names, the one that cannot be read named, exit code 1; rows as of a replay alone."""
    good = ["20260101T000000Z-approach", "20260101T010000Z-approach"]

    def told(*arguments: str) -> Any:
        assert run([*arguments, "--json"]) == 1
        heard = capsys.readouterr()
        assert heard.err.splitlines()[-1] == "1 of 3 sessions failed."
        assert "spoiled/session.json cannot be read" in heard.err
        document = json.loads(heard.out)
        assert [Path(one["session"]).name for one in document["failed"]] == ["spoiled"]
        return document

    replayed = told("replay", str(simulated), "--archive", str(tmp_path / "again"))
    assert [Path(one["archive"]).name for one in replayed["sessions"]] == good
    assert sorted(os.listdir(tmp_path / "again")) == good
    alone = ["replay", str(simulated / good[1]), "--viewer", "none", "--archive", str(tmp_path / "alone"), "--quiet"]
    assert run(alone) == 0
    (one,) = (tmp_path / "alone").iterdir()
    rows = pq.read_table(tmp_path / "again" / good[1] / "tracks.parquet")
    assert rows.equals(pq.read_table(one / "tracks.parquet"))

    os.rename(simulated / "spoiled", tmp_path / "again" / "spoiled")
    again = str(tmp_path / "again")
    reported = told("report", again, "--html", str(tmp_path / "pages"))
    assert [Path(one["session"]).name for one in reported["sessions"]] == good
    assert sorted(os.listdir(tmp_path / "pages")) == [f"{name}.html" for name in good] + ["index.html"]
    scored = told("score", again)
    assert [Path(one["session"]).name for one in scored["sessions"]] == good
    assert run(["flows", again, "--method", "jaccard"]) == 1
    assert "spoiled/session.json cannot be read" in capsys.readouterr().err


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["replay", "{many}", "--viewer", "web"], "are for one."),
        (["replay", "{many}", "--speed", "2"], "are for one."),
        (["report", "{many}", "nowhere"], "There is no folder nowhere"),
        (["score", "{none}"], "is no session, and holds none"),
        (["score", "{many}", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "--workers is of this machine"),
        (["flows", "{none}", "--from", "Q"], "--from 'Q' is not understood"),  # said before anything is read
        (["flows", "{none}", "--runway", "37"], "--runway '37' is neither a number"),
        (["sessions", "{many}", "--keep", "0s"], "say --yes, or --dry-run"),
        (["sessions", "{many}", "--keep", "soon"], "'soon' is no length of time"),
    ],
)
def test_what_cannot_be_asked_of_many_is_refused_in_one_sentence(
    arguments: list[str], sentence: str, tmp_path: Path, capsys: Capsys
) -> None:
    for name in ("one", "two"):
        (tmp_path / "many" / name).mkdir(parents=True)
        write_record(tmp_path / "many" / name, PLAIN)
    (tmp_path / "none").mkdir()
    assert run([word.format(many=tmp_path / "many", none=tmp_path / "none") for word in arguments]) == 2
    assert sentence in capsys.readouterr().err.splitlines()[-1]


def test_old_sessions_are_removed_among_those_that_are_listed_and_never_without_being_told(
    tmp_path: Path, capsys: Capsys
) -> None:
    """--dry-run removes none; written today is not old, whenever it was flown."""
    for name, vehicle in (("a", "mavlink:1"), ("b", "mavlink:2"), ("fresh", "mavlink:1")):
        (tmp_path / name).mkdir()
        summary = {"aircraft": [vehicle], "site": "Demo field"}
        write_record(tmp_path / name, Record(**{**_fields(PLAIN), "summary": summary}))
        if name != "fresh":
            os.utime(tmp_path / name / "session.json", ns=(BEGAN, BEGAN))
    words = ["sessions", str(tmp_path), "--keep", "30d", "--vehicle", "mavlink:1", "--json"]
    assert run([*words, "--dry-run"]) == 0
    assert [(Path(one["folder"]).name, one["old"], one["removed"]) for one in json.loads(capsys.readouterr().out)] == [
        ("a", True, False),
        ("fresh", False, False),
    ]
    assert run([*words, "--yes"]) == 0
    assert "1 sessions removed" in capsys.readouterr().err
    assert sorted(os.listdir(tmp_path)) == ["b", "fresh"]


def _fields(record: Record) -> dict[str, Any]:
    return {name: getattr(record, name) for name in record.__dataclass_fields__}


def test_filters_and_orders_choose_among_sessions(tmp_path: Path) -> None:
    sessions = []
    for day, (name, vehicle, ended) in enumerate((("Demo", "icao:4840d6", "done"), ("North", "mavlink:1", "killed"))):
        (tmp_path / name).mkdir()
        changes = {"started_at": BEGAN + day * 24 * HOUR, "watermark": BEGAN + day * 24 * HOUR + (90 - day) * 10**9}
        told = {"summary": {"aircraft": [vehicle], "site": f"{name} field"}, "ended": ended}
        write_record(tmp_path / name, Record(**{**_fields(PLAIN), **changes, **told}))
        sessions.append(look(tmp_path / name))
    demo, north = sessions
    both = [demo, north]
    cases: list[tuple[Filters, list[Any]]] = [
        (Filters(), both),
        (Filters(reverse=True), both[::-1]),
        (Filters(sort=Sorting.length), both[::-1]),
        (Filters(vehicle="icao:*"), [demo]),
        (Filters(site="NORTH"), [north]),
        (Filters(ended="kill"), [north]),
        (Filters(longer="1:30"), [demo]),
        (Filters(larger="1MB"), []),
        (Filters(since="2026-01-02"), [north]),
        (Filters(until="2026-01-01"), [demo]),
        (Filters(since="8d"), []),
        (Filters(since="9d"), [north]),
        (Filters(since="2026-01", until="2026-01-01T00:00", site="demo"), [demo]),
    ]
    for filters, expected in cases:
        assert filters.chosen(both, NOW) == expected, filters


def test_dates_and_lengths_are_read_as_people_write_them() -> None:
    """Bounds are those of the day, month or minute that is named."""
    assert read_when("2026-01-01", NOW, "--since") == (BEGAN, BEGAN + 24 * HOUR)
    assert read_when("2026-01", NOW, "--since") == (BEGAN, BEGAN + 31 * 24 * HOUR)
    assert read_when("20260101T0030Z", NOW, "--since") == (BEGAN + HOUR // 2, BEGAN + HOUR // 2 + HOUR // 60)
    assert read_when("yesterday", NOW, "--since") == (BEGAN + 8 * 24 * HOUR, BEGAN + 9 * 24 * HOUR)
    assert read_when("12h", NOW, "--since")[0] == BEGAN + 9 * 24 * HOUR
    assert [read_length(text, "--longer") for text in ("90", "1:30", "1:00:01", "1.5m", "2h", "1w")] == [
        90.0, 90.0, 3601.0, 90.0, 7200.0, 604_800.0,
    ]  # fmt: skip
    for text, read in (("2026-13-01", read_when), ("soon", read_when), ("1:2:3:4", read_length), ("5x", read_length)):
        refused: Callable[..., Any] = read
        with pytest.raises(UsageError, match=re.escape(text)):
            refused(*([text, NOW, "--since"] if read is read_when else [text, "--longer"]))


def test_the_index_leads_to_every_page_and_says_what_each_approach_is_worth() -> None:
    landed = Graded("mavlink:1", BEGAN, "A", ("at the lower gate, 152 m: stabilised",), 312.0, 0.8)
    wild = Graded("<b>", BEGAN, "C", ("no touchdown was seen",), None, None)
    entries = [
        Entry("monday", "monday.html", "Demo field", (landed, wild)),
        Entry("nobody came", "nobody came.html", "Demo field"),
        Entry("spoiled", "spoiled.html", failure="session.json cannot be read"),
    ]
    text = index("sessions", entries)
    assert re.findall(r'<a href="([^"]*)">', text) == [
        "monday.html",
        "monday.html#1",
        "monday.html#2",
        "nobody%20came.html",
    ]
    assert "2 approaches in 3 sessions" in text
    assert "312 m" in text
    assert "&lt;b&gt;" in text
    assert "spoiled: session.json cannot be read" in text
