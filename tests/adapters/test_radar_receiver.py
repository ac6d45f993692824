"""The receiving side of the landing-radar wire: windows, keys, senders."""

import zlib

from adapters.landing_radar import Header, Plot, encode
from adapters.radar import LandingRadarReceiver, Taken

KEY = b"0123456789abcdef"
SECOND = 10**9
START = 1_792_500_000 * SECOND


def _datagram(sequence: int, *, at: int | None = None, radar: int = 1, key: bytes | None = None) -> bytes:
    """Datagram number `sequence` of a radar that sends every 0.4 s."""
    time = START + sequence * 2 * SECOND // 5 if at is None else at
    return encode(Header("plots", radar, sequence % 2**32, time), [Plot(3, time, 1000.0)], key=key)


def _hear(receiver: LandingRadarReceiver, data: bytes, sender: str = "a", now: int = START) -> str:
    """ "taken", or the reason why not."""
    outcome = receiver.hear(data, sender, sender, now)
    return "taken" if isinstance(outcome, Taken) else outcome


def test_gaps_count_as_lost_and_a_late_datagram_is_no_loss() -> None:
    receiver = LandingRadarReceiver()
    assert [_hear(receiver, _datagram(number)) for number in (1, 2, 5, 4, 6)] == ["taken"] * 5
    assert receiver.counters["lost"] == 1
    assert receiver.counters["late"] == 1


def test_the_wrap_of_the_sequence_is_no_loss() -> None:
    receiver = LandingRadarReceiver()
    times = [START + number * SECOND for number in range(4)]
    for number, at in zip((2**32 - 2, 2**32 - 1, 0, 1), times, strict=True):
        assert _hear(receiver, _datagram(number, at=at)) == "taken"
    assert receiver.counters["lost"] == 0


def test_a_duplicate_within_the_window_is_dropped_and_counted() -> None:
    receiver = LandingRadarReceiver()
    for number in range(1000):
        _hear(receiver, _datagram(number))
    assert _hear(receiver, _datagram(0)) == "duplicate"
    assert receiver.counters["duplicate"] == 1
    assert receiver.counters["lost"] == 0


def test_older_than_the_window_but_newer_in_time_is_a_restart() -> None:
    receiver = LandingRadarReceiver()
    for number in range(5000, 5010):
        _hear(receiver, _datagram(number))
    later = START + 5020 * 2 * SECOND // 5
    outcome = receiver.hear(_datagram(0, at=later), "a", "a", START)
    assert isinstance(outcome, Taken)
    assert "restarted" in outcome.notes[0][1]
    assert _hear(receiver, _datagram(1, at=later + SECOND)) == "taken"
    assert receiver.counters["restarted"] == 1
    assert receiver.counters["lost"] == 0


def test_a_radar_that_restarts_within_the_window_is_heard_at_once() -> None:
    """Else a restart after 100 datagrams would look like 100 duplicates."""
    receiver = LandingRadarReceiver()
    for number in range(100):
        _hear(receiver, _datagram(number))
    later = START + 100 * SECOND
    assert [_hear(receiver, _datagram(number, at=later + number * SECOND)) for number in range(3)] == ["taken"] * 3
    assert receiver.counters["restarted"] == 1


def test_a_jump_that_no_radar_could_have_sent_is_a_restart_and_not_billions_lost() -> None:
    receiver = LandingRadarReceiver()
    _hear(receiver, _datagram(7))
    assert _hear(receiver, _datagram(2_000_000_000, at=START + 4 * SECOND)) == "taken"
    assert receiver.counters["lost"] == 0


def test_a_number_and_a_clock_that_leap_together_are_a_restart_too() -> None:
    receiver = LandingRadarReceiver()
    assert _hear(receiver, _datagram(1, at=START)) == "taken"
    assert _hear(receiver, _datagram(2**31 - 1, at=START + 40 * 86_400 * SECOND)) == "taken"
    assert (receiver.counters["restarted"], receiver.counters["lost"]) == (1, 0)


def test_with_a_key_a_sequence_number_seen_before_is_refused_as_replayed() -> None:
    receiver = LandingRadarReceiver({1: KEY})
    recorded = [_datagram(number, key=KEY) for number in range(5)]
    assert [_hear(receiver, data) for data in recorded] == ["taken"] * 5
    assert [_hear(receiver, data, sender="someone else") for data in recorded] == ["replayed"] * 5


def test_with_a_key_nothing_from_before_a_restart_is_taken_again() -> None:
    receiver = LandingRadarReceiver({1: KEY})
    recorded = [_datagram(number, key=KEY) for number in range(2000)]
    for data in recorded:
        _hear(receiver, data)
    later = START + 10_000 * SECOND
    assert _hear(receiver, _datagram(0, at=later, key=KEY)) == "taken"
    assert {_hear(receiver, data) for data in recorded} == {"replayed"}


def test_a_key_of_one_radar_says_nothing_of_another() -> None:
    receiver = LandingRadarReceiver({1: KEY})
    assert _hear(receiver, _datagram(1, radar=2)) == "taken"
    assert _hear(receiver, _datagram(1, radar=1)) == "tag"


def test_on_a_live_link_a_keyed_datagram_over_ten_seconds_off_is_refused() -> None:
    live, replayed = LandingRadarReceiver({1: KEY}, live=True), LandingRadarReceiver({1: KEY})
    data = _datagram(0, at=START, key=KEY)
    assert _hear(live, data, now=START + 10 * SECOND + 1) == "replayed"
    assert _hear(replayed, data, now=START + 10 * SECOND + 1) == "taken"
    assert _hear(live, data, now=START + 10 * SECOND) == "taken"


def test_a_refused_datagram_leaves_no_trace_in_the_window() -> None:
    """Its sequence number can still come with a value that can be."""
    receiver = LandingRadarReceiver()
    _hear(receiver, _datagram(1))
    beyond = encode(Header("plots", 1, 9, START + SECOND), [Plot(3, START, azimuth_deg=190.0)])
    assert _hear(receiver, beyond) == "value"
    assert _hear(receiver, _datagram(2)) == "taken"
    assert receiver.counters["lost"] == 0


def test_a_second_sender_of_a_radar_number_is_counted_and_named() -> None:
    receiver = LandingRadarReceiver()
    _hear(receiver, _datagram(1), sender="10.0.0.1:5")
    outcome = receiver.hear(_datagram(1), "10.0.0.2:6", "10.0.0.2:6", START)
    assert isinstance(outcome, Taken)
    assert receiver.counters["second sender"] == 1
    (note,) = outcome.notes
    assert "10.0.0.1:5" in note[1]
    assert "10.0.0.2:6" in note[1]


def test_a_sender_that_took_over_after_silence_is_no_second_one() -> None:
    receiver = LandingRadarReceiver()
    _hear(receiver, _datagram(1), sender="10.0.0.1:5", now=START)
    _hear(receiver, _datagram(1), sender="10.0.0.1:6", now=START + 11 * SECOND)
    assert receiver.counters["second sender"] == 0


def test_with_a_key_each_kind_of_forgery_is_refused_and_counted() -> None:
    """Unsigned, signed with another key, sent before, sent long before, dated ahead; the right one is still taken."""
    receiver = LandingRadarReceiver({1: KEY}, live=True)
    right = _datagram(1, at=START, key=KEY)
    assert _hear(receiver, _datagram(1, at=START)) == "tag"
    assert _hear(receiver, _datagram(1, at=START, key=b"another key")) == "tag"
    assert _hear(receiver, right) == "taken"
    assert _hear(receiver, right, sender="someone else") == "replayed"
    assert _hear(receiver, _datagram(2, at=START - 11 * SECOND, key=KEY)) == "replayed"
    assert _hear(receiver, _datagram(3, at=START + 11 * SECOND, key=KEY)) == "replayed"
    assert receiver.counters == {"tag": 2, "datagrams": 1, "replayed": 3, "lost": 0}
    assert _hear(receiver, _datagram(2, at=START + SECOND, key=KEY)) == "taken"


def test_with_a_key_any_byte_changed_is_refused() -> None:
    """Also where the checksum was made right again. Bytes 4 and 5 are the radar's number: another radar has no key here."""
    data = _datagram(1, at=START, key=KEY)
    for place in range(len(data) - 4):
        changed = bytearray(data[:-4])
        changed[place] ^= 1
        again = bytes(changed) + zlib.crc32(bytes(changed)).to_bytes(4, "big")
        assert _hear(LandingRadarReceiver({1: KEY}), again) != "taken" or place in (4, 5), place
