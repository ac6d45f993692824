"""What a recording is, told by what is in it."""

from itertools import pairwise
from pathlib import Path

import pytest

from adapters.files import FileError, kind_of, open_recording
from adapters.landing_radar import Header, encode
from adapters.mavlink_frames import FrameEncoder
from adapters.pcap import PcapWriter
from adapters.tlog import TlogWriter

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
T0 = 1_790_000_000 * 10**9


class Records(list[bytes]):
    """Takes records as a file does."""

    def write(self, record: bytes) -> int:
        self.append(record)
        return len(record)


def _mavlink(system: int = 1) -> bytes:
    return FrameEncoder(system).encode("SYSTEM_TIME", time_unix_usec=5, time_boot_ms=7)


def _radar(sequence: int = 0) -> bytes:
    return encode(Header("plots", 1, sequence, T0), [])


def _capture(path: Path, *datagrams: tuple[bytes, str]) -> Path:
    sink = Records()
    writer = PcapWriter(sink)
    for number, (data, peer) in enumerate(datagrams):
        writer.write(T0 + number * 4000, data, peer)
    path.write_bytes(b"".join(sink))
    return path


def test_a_recording_is_known_whatever_it_is_called(tmp_path: Path) -> None:
    path = tmp_path / "telemetry.pcap"
    path.write_bytes(EXCERPT.read_bytes())
    assert kind_of(path) == "tlog"
    assert kind_of(_capture(tmp_path / "radar.tlog", (_radar(), "10.0.0.1:5"))) == "pcap"


def test_a_tlog_of_a_single_frame_is_one(tmp_path: Path) -> None:
    path, sink = tmp_path / "short", Records()
    TlogWriter(sink).write(T0, _mavlink())
    path.write_bytes(b"".join(sink))
    assert kind_of(path) == "tlog"


def test_a_session_is_a_folder_with_session_json(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"without session\.json"):
        kind_of(tmp_path)
    (tmp_path / "session.json").write_text("{}")
    assert kind_of(tmp_path) == "session"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is empty"),
        (b"\0\1\2", "too short"),
        (b"time,lat,lon\n1,2,3\n" * 20, "text file"),
        (b'{"mission": [1, 2, 3], "version": 1}', "JSON"),
        (bytes(range(256)) * 8, "not a recording"),
        (_mavlink() * 5, "MAVLink frames without times"),
        (b"\x1f\x8b\x08" + bytes(100), "gzip, to be unpacked first"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n" * 9, "not the .BIN that it was made from"),
    ],
)
def test_what_is_no_recording_is_said_in_one_sentence(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "recording.tlog"
    path.write_bytes(content)
    with pytest.raises(FileError, match=expected) as error:
        kind_of(path)
    assert "\n" not in str(error.value)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="cannot be read"):
        kind_of(tmp_path / "nowhere.tlog")


def test_other_logs_are_known_by_their_first_bytes(tmp_path: Path) -> None:
    for beginning, kind in (
        (b"\xa3\x95\x80\x80", "BIN"),
        (b"ULog\x01\x12\x35\x01", "ulg"),
        (b"\x0a\x0d\x0d\x0a", "pcapng"),
    ):
        path = tmp_path / kind
        path.write_bytes(beginning + bytes(64))
        assert kind_of(path) == kind


def test_mission_files_are_known_and_are_no_recordings(tmp_path: Path) -> None:
    for content, kind in ((b"QGC WPL 110\n", "waypoints"), (b'{\n "fileType": "Plan",\n "version": 1}', "plan")):
        path = tmp_path / "mission.tlog"
        path.write_bytes(content)
        assert kind_of(path) == kind
        with pytest.raises(FileError, match="mission file"):
            open_recording(path)


def test_a_tlog_is_one_source_with_increasing_stamps() -> None:
    recording = open_recording(EXCERPT, first_number=4)
    arrivals = list(recording.arrivals())
    assert [source.kind for source in recording.sources] == ["mavlink"]
    assert {arrival.source for arrival in arrivals} == {4}
    stamps = [arrival.received_at for arrival in arrivals]
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert all(stamp % 4000 == 0 for stamp in stamps)
    assert len(arrivals) == 2841


def test_a_capture_has_a_source_for_the_radar_and_one_for_each_sender_of_mavlink(tmp_path: Path) -> None:
    path = _capture(
        tmp_path / "mixed.pcap",
        (_mavlink(1) + _mavlink(1), "10.0.0.1:5"),
        (_radar(0), "10.0.0.9:7"),
        (b"something else", "10.0.0.3:5"),
        (_mavlink(2), "10.0.0.2:5"),
        (_radar(1), "10.0.0.9:7"),
    )
    recording = open_recording(path)
    arrivals = list(recording.arrivals())
    assert [source.kind for source in recording.sources] == ["radar", "mavlink", "mavlink"]
    assert [arrival.source for arrival in arrivals] == [1, 1, 0, 2, 0]
    assert [arrival.peer for arrival in arrivals] == ["", "", "10.0.0.9:7", "", "10.0.0.9:7"]
    assert len({arrival.received_at for arrival in arrivals}) == 5
    assert recording.counters["other datagrams"] == 1


def test_damaged_radar_datagrams_of_a_radar_capture_reach_the_radars_counters(tmp_path: Path) -> None:
    path = _capture(tmp_path / "radar.pcap", (_radar(), "10.0.0.9:7"), (b"LX" + _radar()[2:], "10.0.0.9:7"))
    assert len(list(open_recording(path).arrivals())) == 2


def test_a_capture_without_either_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="no landing-radar and no MAVLink"):
        open_recording(_capture(tmp_path / "dns.pcap", (b"something else", "10.0.0.3:53")))


def test_every_shared_recording_is_what_its_name_says() -> None:
    if not RECORDINGS.exists():
        pytest.skip("the recordings are not beside the project")
    for path in sorted(RECORDINGS.iterdir()):
        if path.suffix in (".tlog", ".BIN", ".ulg"):
            assert kind_of(path) == path.suffix[1:]
        else:
            with pytest.raises(FileError):
                kind_of(path)
