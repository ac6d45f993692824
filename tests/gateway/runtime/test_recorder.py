"""What is recorded is read back byte for byte, whatever kind of source it came from."""

import threading
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from adapters import Arrival, Source
from adapters.mavlink_frames import FrameEncoder
from gateway.runtime.folder import INPUTS, Record, read_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.recorder import Recorder
from gateway.settings import Options
from gateway.sinks.aside import Aside

T0 = 1_767_225_600_000_004_000
ENCODER = FrameEncoder(1)
FRAMES = [ENCODER.encode("SYSTEM_TIME", time_unix_usec=n, time_boot_ms=n) for n in range(50)]
LINES = [b'{"told": "plan", "aircraft": "mavlink:1", "points": []}', b"{}", '{"told":"x","text":"B\u00f6e"}'.encode()]
SOURCES = (
    Source(0, "mavlink", "mavlink-1", "udpin"),
    Source(1, "radar", "radar-1", "udpin"),
    Source(2, "told", "commands", "--plan"),
)


@pytest.fixture
def recorder(tmp_path: Path) -> Recorder:
    (tmp_path / INPUTS).mkdir()
    made = Recorder(tmp_path, Record("0", (), Options(), T0))
    for source in SOURCES:
        made.add(source)
    return made


def read_back(recorder: Recorder, source: Source, suffix: str, refused: str = "") -> list[Arrival]:
    path = recorder.folder / INPUTS / f"{source.name}{refused}.{suffix}"
    reading = SessionInput(path, source)
    found = list(reading.arrivals())
    assert not +reading.counters
    return found


def test_every_kind_of_source_is_read_back_as_it_was(recorder: Recorder) -> None:
    """Frames, datagrams with their senders, and told lines, over several flushes."""
    given = {
        0: [Arrival(T0 + n * 4000, 0, frame) for n, frame in enumerate(FRAMES)],
        1: [Arrival(T0 + n * 8000, 1, b"LR" + bytes(n), f"10.0.0.{n}:30070") for n in range(9)],
        2: [Arrival(T0 + n * 4000, 2, line) for n, line in enumerate(LINES)],
    }
    for number, arrivals in given.items():
        for index, arrival in enumerate(arrivals):
            recorder.keep(arrival)
            if index % 7 == number:
                recorder.flush_inputs()
    recorder.close()
    for source, suffix in zip(SOURCES, ("tlog", "pcap", "jsonl"), strict=True):
        assert read_back(recorder, source, suffix) == given[source.number]


def test_recorded_aside_it_is_the_same_and_in_its_order(tmp_path: Path) -> None:
    """While the disk takes nothing a flush waits for nobody; what is written then is what was given, session.json last."""
    (tmp_path / INPUTS).mkdir()
    aside, disk = Aside("archive"), threading.Event()
    recorder = Recorder(tmp_path, Record("0", (), Options(), T0), aside)
    recorder.add(SOURCES[0])
    aside.do(disk.wait)
    given = [Arrival(T0 + n * 4000, 0, frame) for n, frame in enumerate(FRAMES)]
    for arrival in given:
        recorder.keep(arrival)
        recorder.flush_inputs()
    recorder.flush(given[-1].received_at, {"lost": 3})
    assert read_record(tmp_path).sources == ()
    disk.set()
    recorder.close()
    assert [row.arrivals for row in read_record(tmp_path).sources] == [len(given)]
    assert read_back(recorder, SOURCES[0], "tlog") == given
    aside.close()


def test_what_was_refused_lies_beside_it_and_is_counted_apart(recorder: Recorder) -> None:
    """A frame that signing refused, a datagram and a line: each in a file of its kind, none among the kept."""
    refused = [Arrival(T0, 0, FRAMES[0]), Arrival(T0, 1, b"LRx"), Arrival(T0, 2, LINES[0])]
    for arrival in refused:
        recorder.refuse(arrival)
    recorder.keep(Arrival(T0 + 4000, 0, FRAMES[1]))
    recorder.flush(T0, {})
    recorder.close()
    rows = read_record(recorder.folder).sources
    assert [(row.arrivals, row.refused) for row in rows] == [(1, 1), (0, 1), (0, 1)]
    for source, suffix in zip(SOURCES, ("tlog", "pcap", "jsonl"), strict=True):
        found = read_back(recorder, source, suffix, ".refused")
        assert [arrival.data for arrival in found] == [refused[source.number].data]
    assert [arrival.data for arrival in read_back(recorder, SOURCES[0], "tlog")] == [FRAMES[1]]


def test_a_commands_file_that_was_cut_or_spoilt_gives_the_lines_that_are_whole(tmp_path: Path) -> None:
    path, source = tmp_path / "commands.jsonl", SOURCES[2]
    lines = [
        b'{"stamp": %d, "n": 1}\n' % T0,
        b"nonsense\n",
        b'{"stamp": 5, "n": 2}\n',
        b'{"stamp": %d}\n' % (T0 + 4000),
    ]
    path.write_bytes(b"".join(lines) + b'{"stamp": %d, "n"' % (T0 + 8000))
    counters: Counter[str] = Counter()
    arrivals = list(SessionInput(path, source, counters).arrivals())
    assert [arrival.data for arrival in arrivals] == [b'{"n": 1}', b"{}"]
    assert counters["lines not understood"] == 3
    assert all(later.received_at > earlier.received_at for earlier, later in pairwise(arrivals))
