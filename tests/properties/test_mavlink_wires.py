"""Properties of the MAVLink side: any bytes, any cut, any damage."""

from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameScanner, encode, fields, parse
from adapters.tlog import TlogReader
from gateway.observation import GpsReport

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
with EXCERPT.open("rb") as _file:
    FRAMES = [frame for _, frame in TlogReader(_file)][:400]
T0 = 1_790_000_000 * 10**9
SOURCE = Source(0, "mavlink", "mavlink-1", "here")
MAGICAL = st.one_of(st.binary(max_size=60), st.lists(st.sampled_from([0xFD, 0xFE, 0, 1, 255]), max_size=60).map(bytes))


@settings(max_examples=80)
@given(st.lists(st.sampled_from(FRAMES), max_size=12), st.lists(MAGICAL, max_size=12), st.data())
def test_junk_between_frames_and_any_cut_of_the_stream_lose_no_frame(
    frames: list[bytes], junk: list[bytes], data: st.DataObject
) -> None:
    """Every intact frame is found, in order. (Junk that is itself a frame, to its checksum, does not happen by chance.)"""
    stream = b"".join(frame + (junk[index] if index < len(junk) else b"") for index, frame in enumerate(frames))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    scanner, found = FrameScanner(), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += scanner.feed(stream[begin:end])
    found += scanner.finish()
    known = [frame for frame in found if (taken := parse(frame)) is not None and taken.verdict == "good"]
    assert known == frames


@settings(max_examples=150)
@given(MAGICAL | st.binary(max_size=400))
def test_no_bytes_raise_in_the_scanner_or_the_decoder(data: bytes) -> None:
    scanner = FrameScanner()
    found = scanner.feed(data) + scanner.finish() + FrameScanner().feed_datagram(data)
    decoder = Decoder([SOURCE])
    for frame in [*found, data]:
        decoder.feed(Arrival(T0, 0, frame))
    assert decoder.refused is None


@settings(max_examples=80)
@given(st.integers(0, len(FRAMES) - 1), st.data())
def test_a_flipped_byte_is_never_decoded(index: int, data: st.DataObject) -> None:
    """CRC-16 finds every change within one byte; a change of the id or the length can make it another kind of failure."""
    frame = FRAMES[index]
    at, flip = data.draw(st.integers(0, len(frame) - 1)), data.draw(st.integers(1, 255))
    taken = parse(frame[:at] + bytes([frame[at] ^ flip]) + frame[at + 1 :])
    assert taken is None or taken.verdict != "good"


FIELD = st.integers(-(2**31), 2**31 - 1)
SPEED = st.integers(-32768, 32767)


@settings(max_examples=150)
@given(
    st.integers(0, 2**32 - 1),
    st.tuples(FIELD, FIELD, FIELD, FIELD),
    st.tuples(SPEED, SPEED, SPEED),
    st.integers(0, 65535),
)
def test_whatever_a_position_says_it_is_a_sane_report_or_none(
    boot_ms: int, place: tuple[int, int, int, int], speed: tuple[int, int, int], heading: int
) -> None:
    values = {"time_boot_ms": boot_ms, "hdg": heading}
    values |= dict(zip(("lat", "lon", "alt", "relative_alt", "vx", "vy", "vz"), place + speed, strict=True))
    frame = encode("GLOBAL_POSITION_INT", values, system=1)
    _, read = fields("GLOBAL_POSITION_INT", *values)
    taken = parse(frame)
    assert taken is not None
    assert read(taken.payload) == tuple(values.values())
    for report in Decoder([SOURCE]).feed(Arrival(T0, 0, frame)).observations:
        assert isinstance(report, GpsReport)
        assert abs(report.latitude_rad) <= 1.5707963267948968
        assert abs(report.longitude_rad) <= 3.1415926535897936
        assert (report.latitude_rad, report.longitude_rad) != (0.0, 0.0)
        assert report.altitude_msl_m is None or -10_000 < report.altitude_msl_m < 100_000
        assert report.velocity_up_mps is None or abs(report.velocity_up_mps) < 327.67
