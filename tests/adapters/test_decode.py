"""Arrivals to what was heard."""

import math
from itertools import islice, pairwise
from pathlib import Path

import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.files import open_recording
from adapters.landing_radar import Header, Plot, encode
from gateway.observation import FlightPlan, GpsReport, Heard, RadarPlot, Timing, Truth

EXCERPT = Path(__file__).parents[1] / "data" / "sitl-landing-excerpt.tlog"
RECORDINGS = Path(__file__).parents[3] / "shared" / "data"
SECOND = 10**9
T0 = 1_790_000_000 * SECOND
RADAR = Source(3, "radar", "radar-1", "udpin:127.0.0.1:30070")


def _decoded(path: Path, most: int | None = None) -> tuple[list[Heard], Decoder]:
    recording = open_recording(path)
    decoder = Decoder(recording.sources)
    return [decoder.feed(arrival) for arrival in islice(recording.arrivals(), most)], decoder


def _shared(name: str) -> Path:
    path = RECORDINGS / name
    if not path.exists():
        pytest.skip(f"the recording {name} is not beside the project")
    return path


def _distance_m(report: GpsReport, truth: Truth) -> float:
    north = (report.latitude_rad - truth.latitude_rad) * 6_371_000
    east = (report.longitude_rad - truth.longitude_rad) * 6_371_000 * math.cos(report.latitude_rad)
    up = (report.altitude_msl_m or 0.0) - (truth.altitude_msl_m or 0.0)
    return math.hypot(north, east, up)


def test_every_report_of_a_flight_is_near_the_truth_of_its_moment() -> None:
    """Median below 1 m: the estimator's own error. None before the fix, none near (0, 0), none on the ground at sea level."""
    heard, _ = _decoded(EXCERPT)
    found = [observation for one in heard for observation in one.observations]
    truths = {one.valid_at // (SECOND // 50): one for one in found if isinstance(one, Truth)}
    errors = sorted(
        _distance_m(one, truths[one.valid_at // (SECOND // 50)])
        for one in found
        if isinstance(one, GpsReport) and one.valid_at // (SECOND // 50) in truths
    )
    assert len(errors) > 700
    assert errors[len(errors) // 2] < 1.0
    assert errors[-1] < 5.0


def test_the_mission_and_home_of_a_flight_become_one_plan_with_its_landing() -> None:
    heard, _ = _decoded(EXCERPT)
    plan = [one for each in heard for one in each.observations if isinstance(one, FlightPlan)][-1]
    assert [point.kind for point in plan.points][:2] == ["home", "take-off"]
    assert plan.points[-1].kind == "landing"
    assert plan.points[0].altitude_msl_m == 584.09


def test_decoding_twice_hears_the_same_to_the_last_bit() -> None:
    assert _decoded(EXCERPT)[0] == _decoded(EXCERPT)[0]


def test_health_tells_age_rate_and_losses() -> None:
    recording = open_recording(EXCERPT)
    decoder = Decoder(recording.sources)
    arrivals = list(recording.arrivals())
    for arrival in arrivals:
        decoder.feed(arrival)
    last = arrivals[-1].received_at
    (health,) = decoder.health(last + 2 * SECOND).sources
    assert health.age_s == 2.0
    assert health.lost > 0  # the messages that the excerpt leaves out
    (now,) = decoder.health(last).sources
    assert 20.0 <= now.rate_hz <= 30.0  # 10 positions, 10 truths, 5 attitudes, 1 heartbeat


def _datagram(sequence: int, at: int, *, key: bytes | None = None) -> bytes:
    return encode(Header("plots", 1, sequence, at), [Plot(3, at, 1000.0, 1.0, 2.0)], key=key)


def test_a_refused_datagram_tells_why_and_the_next_one_is_not_spoiled() -> None:
    decoder = Decoder([RADAR])
    assert decoder.feed(Arrival(T0, 3, _datagram(1, T0)[:-1])).observations == ()
    assert decoder.refused == "length"
    (plot,) = decoder.feed(Arrival(T0 + 4000, 3, _datagram(1, T0))).observations
    assert decoder.refused is None
    assert isinstance(plot, RadarPlot)
    assert plot.timing is Timing.UTC
    decoder.feed(Arrival(T0 + 8000, 3, _datagram(1, T0)))
    assert decoder.refused == "duplicate"
    assert decoder.counters() == {"radar-1 datagrams": 1, "radar-1 duplicate": 1, "radar-1 length": 1}


def test_datagrams_with_a_wrong_tag_are_told_of_once_and_damaged_ones_only_counted() -> None:
    decoder, told = Decoder([RADAR], keys={1: b"key"}), []
    for number in range(6):
        data = _datagram(number, T0 + number, key=b"other" if number % 2 else b"key")
        told += decoder.feed(Arrival(T0 + number, 3, data if number != 4 else data[:-1], "10.0.0.1:5")).notes
    assert decoder.counters() == {"radar-1 datagrams": 2, "radar-1 length": 1, "radar-1 lost": 1, "radar-1 tag": 3}
    sentences = [text for level, text in told if level == "warning"]
    assert len(sentences) == 1
    assert sentences[0].startswith(
        "10.0.0.1:5 on udpin:127.0.0.1:30070: a radar's datagrams without a right tag are refused"
    )


def test_without_its_refused_datagrams_a_replay_hears_the_same() -> None:
    keys = {1: b"key"}
    arrivals = []
    for number in range(60):
        at = T0 + number * SECOND
        arrivals.append(Arrival(at, 3, _datagram(number, at, key=b"key"), "10.0.0.1:5"))
        arrivals.append(
            Arrival(at + 4000, 3, _datagram(number // 2, at, key=b"key" if number % 3 else None), "10.0.0.2:6")
        )
    live, heard, kept = Decoder([RADAR], keys=keys, live=True), [], []
    for arrival in arrivals:
        one = live.feed(arrival)
        if live.refused is None:
            heard.append(one)
            kept.append(arrival)
    replay = Decoder([RADAR], keys=keys)
    assert len(kept) == 60
    assert [replay.feed(arrival) for arrival in kept] == heard


def test_a_radar_of_another_year_alone_takes_the_session_along() -> None:
    decoder = Decoder([RADAR])
    year = 365 * 86_400
    for number in range(10):
        at = T0 + number * SECOND
        heard = decoder.feed(Arrival(at, 3, _datagram(number, at - year * SECOND)))
    assert decoder.epoch_offset_s == -year
    assert heard.now == T0 + 9 * SECOND - year * SECOND


def test_a_watermark_is_the_sessions_time_and_observes_nothing() -> None:
    assert Decoder([RADAR]).watermark(T0) == Heard(T0)


def test_what_is_no_frame_is_counted_and_does_no_harm() -> None:
    decoder = Decoder([Source(0, "mavlink", "mavlink-1", "here")])
    for data in (b"", b"\xfd", b"\xfe\xff", bytes(300)):
        assert decoder.feed(Arrival(T0, 0, data)).observations == ()
    assert decoder.counters() == {"mavlink-1 not a frame": 4}


def test_gps_loss_gives_no_report_until_it_is_back() -> None:
    """GPS is off from 147.8 s to 208.0 s after boot; the autopilot's dead reckoning goes on all the time."""
    heard, _ = _decoded(_shared("sitl-plane-gps-loss.tlog"), 30_000)
    start = heard[0].now
    seconds = [
        (one.valid_at - start) / SECOND for each in heard for one in each.observations if isinstance(one, GpsReport)
    ]
    gaps = [(earlier, later) for earlier, later in pairwise(seconds) if later - earlier > 5]
    assert len(gaps) == 1
    assert gaps[0] == (pytest.approx(148.0, abs=0.7), pytest.approx(208.4, abs=0.5))


def test_a_lossy_radio_with_a_reboot_and_an_outdated_message_is_told_apart_from_damage() -> None:
    _, decoder = _decoded(_shared("copter-lossy-radio.tlog"))
    counters = decoder.counters()
    name = next(iter(counters)).split(" ")[0]
    assert counters[f"{name} reboots"] == 1
    assert counters[f"{name} lost"] == 228
    assert f"{name} crc error" not in counters


def test_a_submarine_without_utc_runs_on_the_envelope_and_its_cameras_definition_differs() -> None:
    heard, decoder = _decoded(_shared("sub-five-components.tlog"))
    timings = [one.timing for each in heard for one in each.observations if isinstance(one, GpsReport)]
    assert timings[-1] is Timing.ENVELOPE
    assert Timing.UTC not in timings
    assert decoder.counters()["sub-five-components definition differs"] == 4
    assert {one.aircraft for each in heard for one in each.observations if isinstance(one, GpsReport)} == {"mavlink:1"}


def test_what_says_nothing_is_none_to_hear_and_an_empty_one_to_feed() -> None:
    recording = open_recording(EXCERPT)
    quick, slow = Decoder(recording.sources), Decoder(recording.sources)
    for arrival in recording.arrivals():
        heard, fed = quick.hear(arrival), slow.feed(arrival)
        assert (heard or Heard(fed.now)) == fed
        assert heard is None or heard.observations or heard.notes
    assert quick.counters() == slow.counters()


class _Guard:
    """Refuses every third frame."""

    def __init__(self) -> None:
        self.judged = 0

    def judge(self, frame: bytes, source: int, now: int) -> str | None:
        self.judged += 1
        return "wrong signature" if self.judged % 3 == 0 else None


def test_frames_that_a_guard_refuses_leave_no_trace_but_their_counter_and_one_sentence() -> None:
    source = Source(0, "mavlink", "link", "udpin:0")
    guarded, other = Decoder([source], signing=_Guard()), Decoder([source])
    notes: list[str] = []
    arrivals = list(open_recording(EXCERPT).arrivals())
    for number, arrival in enumerate(arrivals):
        one = guarded.hear(Arrival(arrival.received_at, 0, arrival.data))
        notes += [] if one is None else [text for _, text in one.notes if "signature" in text]
        assert (guarded.refused == "wrong signature") == (number % 3 == 2)
        if guarded.refused is None:
            expected = other.hear(Arrival(arrival.received_at, 0, arrival.data))
            assert (one and one.observations) == (expected and expected.observations)
    assert len(notes) == 1
    counters = guarded.counters()
    assert counters.pop("link wrong signature") == len(arrivals) // 3
    assert counters == other.counters()


def test_the_clock_is_named_before_the_sessions_time_leaps() -> None:
    """The sentence comes in the time before, and nothing that was told before the leap is judged by the time after it."""
    year = 365 * 86_400 * SECOND
    decoder = Decoder([RADAR])
    heard = [
        decoder.feed(Arrival(T0 + number * SECOND, 3, _datagram(number, T0 + number * SECOND - year)))
        for number in range(10)
    ]
    (named,) = [place for place, one in enumerate(heard) if any("runs on the clock" in text for _, text in one.notes)]
    assert heard[named].now == T0 + named * SECOND
    assert heard[named + 1].now == T0 + (named + 1) * SECOND - year
    before = [one for each in heard[:named] for one in each.observations]
    assert {one.timing for one in before if isinstance(one, RadarPlot)} == {Timing.FOREIGN}
    after = [one for each in heard[named + 1 :] for one in each.observations]
    assert {one.timing for one in after if isinstance(one, RadarPlot)} == {Timing.UTC}
