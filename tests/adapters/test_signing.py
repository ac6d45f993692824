"""MAVLink 2 signing, with pymavlink's own as the reference in both directions."""

import hashlib
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import FrameScanner, encode, parse
from adapters.signing import (
    Signer,
    SigningGuard,
    SigningKeyError,
    advice,
    is_signed,
    read_key,
    sign,
    timestamp_at,
)

KEY = hashlib.sha256(b"correct horse").digest()
OTHER_KEY = hashlib.sha256(b"battery staple").digest()
SECOND = 10**9
NOW = 1_790_000_000 * SECOND
T = timestamp_at(NOW)
MINUTE = 60 * 100_000  # in timestamps


def _attitude(number: int = 0, system: int = 1) -> bytes:
    values = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0.1)
    return encode("ATTITUDE", {"time_boot_ms": 1000 + number, **values}, system=system, sequence=number & 255)


def _heartbeat_of_version_1() -> bytes:
    values = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
    return encode("HEARTBEAT", values, system=1, version=1)


def _signed(timestamp: int, *, number: int = 0, system: int = 1, link_id: int = 0, key: bytes = KEY) -> bytes:
    return sign(_attitude(number, system), key, link_id, timestamp)


def _pymavlink(key: bytes, *, timestamp: int = T, link_id: int = 0, outgoing: bool = True) -> dialect.MAVLink:
    link = dialect.MAVLink(None, srcSystem=7, srcComponent=1)
    link.signing.secret_key, link.signing.timestamp = key, timestamp
    link.signing.link_id, link.signing.sign_outgoing = link_id, outgoing
    return link


def _key_file(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "field.key"
    path.write_bytes(content)
    return path


def test_what_pymavlink_signs_is_believed_whatever_the_message() -> None:
    """Every message of the dialect, with its trailing zeros cut, over two link ids."""
    guard = SigningGuard(KEY, live=True)
    for link_id in (0, 200):
        link = _pymavlink(KEY, link_id=link_id)
        for number, message in dialect.mavlink_map.items():
            payload = bytes(range(256))[: message.unpacker.size // 2].ljust(message.unpacker.size, b"\0")
            packed = dialect.MAVLink_message(number, message.msgname)
            frame = bytes(packed._pack(link, message.crc_extra, payload))
            assert is_signed(frame)
            assert guard.judge(frame, 1, NOW) is None, number
            assert FrameScanner().feed_datagram(frame) == [frame]


def test_what_we_sign_pymavlink_believes() -> None:
    link = _pymavlink(KEY, timestamp=T)
    for number in range(20):
        message = link.parse_buffer(_signed(T + number, number=number))
        assert [one.get_type() for one in message] == ["ATTITUDE"]
    assert link.signing.goodsig_count == 20


def test_what_we_sign_with_another_key_pymavlink_refuses() -> None:
    link = _pymavlink(OTHER_KEY, timestamp=T)
    link.robust_parsing = True
    assert [one.get_type() for one in link.parse_buffer(_signed(T))] == ["BAD_DATA"]


def test_a_signed_frame_is_a_good_frame_with_the_same_content() -> None:
    plain, signed = parse(_attitude(5)), parse(_signed(T, number=5))
    assert plain is not None
    assert signed is not None
    assert signed == plain._replace(signed=True)


def test_any_byte_changed_is_refused() -> None:
    """Also where the changed frame is no longer a signed one at all."""
    frame = _signed(T)
    for place in range(len(frame)):
        for bit in range(8):
            changed = bytearray(frame)
            changed[place] ^= 1 << bit
            assert SigningGuard(KEY).judge(bytes(changed), 1, NOW) in ("wrong signature", "unsigned"), place
    assert SigningGuard(KEY).judge(frame, 1, NOW) is None


def test_unsigned_frames_of_both_versions_are_refused() -> None:
    guard = SigningGuard(KEY)
    assert guard.judge(_attitude(), 1, NOW) == "unsigned"
    assert guard.judge(_heartbeat_of_version_1(), 1, NOW) == "unsigned"


def test_radio_status_alone_may_come_unsigned_but_not_in_the_name_of_one_who_signs() -> None:
    values = dict.fromkeys(("rssi", "remrssi", "txbuf", "noise", "remnoise", "rxerrors", "fixed"), 1)
    guard = SigningGuard(KEY)
    assert guard.judge(_signed(T), 1, NOW) is None
    for version in (1, 2):
        radio = encode("RADIO_STATUS", values, system=51, component=68, version=version)
        assert guard.judge(radio, 1, NOW) is None
        forged = encode("RADIO_STATUS", values, system=1, component=1, version=version)
        assert guard.judge(forged, 1, NOW) == "unsigned"


def test_a_wrong_key_is_a_wrong_signature_and_leaves_no_trace() -> None:
    """Else a stranger with a far timestamp could silence a vehicle."""
    guard = SigningGuard(KEY)
    assert guard.judge(_signed(T), 1, NOW) is None
    assert guard.judge(_signed(T + 10 * MINUTE, key=OTHER_KEY), 1, NOW) == "wrong signature"
    assert guard.newest == T
    assert guard.judge(_signed(T + 1), 1, NOW) is None


def test_a_frame_heard_again_or_an_older_one_is_replayed() -> None:
    guard = SigningGuard(KEY)
    recorded = [_signed(T + number, number=number) for number in range(5)]
    assert [guard.judge(frame, 1, NOW) for frame in recorded] == [None] * 5
    assert [guard.judge(frame, 1, NOW) for frame in recorded] == ["replayed"] * 5
    assert guard.judge(_signed(T + 4, number=9), 1, NOW) == "replayed"


def test_a_recording_sent_from_elsewhere_is_replayed_as_well() -> None:
    guard = SigningGuard(KEY)
    recorded = [_signed(T + number * 100_000, number=number) for number in range(10)]
    for frame in recorded:
        guard.judge(frame, 1, NOW)
    assert [guard.judge(frame, 2, NOW) for frame in recorded[:6]] == ["replayed"] * 6


def test_the_same_frames_over_two_links_of_which_one_lags_are_no_attack_and_taken_once_from_each() -> None:
    """One that the first link lost is taken from the second; 1 s apart at 20 frames a second."""
    guard = SigningGuard(KEY)
    frames = [_signed(T + number * 5_000, number=number) for number in range(100)]
    verdicts: dict[int, list[str | None]] = {1: [], 2: []}
    for number in range(120):
        if number < 100 and number % 7:
            verdicts[1].append(guard.judge(frames[number], 1, NOW))
        if number >= 20:
            verdicts[2].append(guard.judge(frames[number - 20], 2, NOW))
    assert set(verdicts[1]) == set(verdicts[2]) == {None}
    assert guard.judge(frames[99], 2, NOW) == "replayed"


def test_each_stream_has_its_own_time() -> None:
    guard = SigningGuard(KEY)
    assert guard.judge(_signed(T + 1000), 1, NOW) is None
    assert guard.judge(_signed(T, link_id=1), 1, NOW) is None
    assert guard.judge(_signed(T, system=2), 1, NOW) is None


@pytest.mark.parametrize(("behind", "verdict"), [(MINUTE, None), (MINUTE + 1, "too old")])
def test_a_stream_that_begins_more_than_a_minute_behind_what_was_heard_is_too_old(
    behind: int, verdict: str | None
) -> None:
    guard = SigningGuard(KEY)
    assert guard.judge(_signed(T), 1, NOW) is None
    assert guard.judge(_signed(T - behind, system=2), 1, NOW) == verdict


@pytest.mark.parametrize(("live", "verdict"), [(True, "too old"), (False, None)])
def test_the_first_stream_of_a_live_session_is_measured_by_the_clock_and_that_of_a_replay_is_not(
    live: bool, verdict: str | None
) -> None:
    assert SigningGuard(KEY, live=live).judge(_signed(T - MINUTE - 1), 1, NOW) == verdict


def test_a_stream_that_goes_on_is_believed_though_it_falls_behind_the_clock() -> None:
    """An autopilot without GPS counts frames instead of time."""
    guard = SigningGuard(KEY, live=True)
    verdicts = [guard.judge(_signed(T + second), 1, NOW + second * SECOND) for second in range(300)]
    assert verdicts == [None] * 300


def test_a_vehicle_that_restarts_is_believed_as_soon_as_its_time_goes_on() -> None:
    guard = SigningGuard(KEY, live=True)
    assert guard.judge(_signed(T), 1, NOW) is None
    assert guard.judge(_signed(T - 500, number=1), 1, NOW) == "replayed"
    assert guard.judge(_signed(T + 1, number=2), 1, NOW) is None


def test_streams_are_bounded() -> None:
    guard = SigningGuard(KEY)
    verdicts = [
        guard.judge(_signed(T, system=system, link_id=link), 1, NOW) for link in range(3) for system in range(1, 256)
    ]
    assert verdicts.count(None) == 512
    assert verdicts[-1] == "too many streams"


def test_our_own_timestamps_rise_also_when_the_clock_stands_or_steps_back() -> None:
    signer, guard = Signer(KEY), SigningGuard(KEY)
    for clock in (NOW, NOW, NOW - 5 * SECOND, NOW + SECOND):
        assert guard.judge(signer.sign(_attitude(), 0, clock), 1, NOW) is None
    assert signer.last == timestamp_at(NOW + SECOND)


def test_after_a_restart_no_timestamp_is_used_again() -> None:
    guard, before = SigningGuard(KEY), Signer(KEY)
    frames = [before.sign(_attitude(number), 0, NOW + number * SECOND // 50) for number in range(50)]
    after = Signer(KEY)
    frames += [after.sign(_attitude(number), 0, NOW + SECOND + number) for number in range(50)]
    assert [guard.judge(frame, 1, NOW) for frame in frames] == [None] * 100


def test_our_stream_begins_at_what_others_take_for_now() -> None:
    """A vehicle that is an hour ahead of us would refuse it else."""
    vehicle = _pymavlink(KEY, timestamp=T + 60 * MINUTE)
    guard, signer = SigningGuard(KEY), Signer(KEY)
    heartbeat = vehicle.heartbeat_encode(1, 3, 0, 0, 4)
    assert guard.judge(bytes(heartbeat.pack(vehicle)), 1, NOW) is None
    frame = signer.sign(_attitude(system=254), 0, NOW, newest_heard=guard.newest)
    assert [one.get_type() for one in vehicle.parse_buffer(frame)] == ["ATTITUDE"]


@pytest.mark.parametrize("frame", [b"", b"\xfd", _attitude()[:-1], _signed(T), _heartbeat_of_version_1()])
def test_only_a_whole_unsigned_frame_of_version_2_can_be_signed(frame: bytes) -> None:
    with pytest.raises(ValueError, match="can be signed"):
        sign(frame, KEY, 0, T)


@given(frame=st.binary(max_size=300), source=st.integers(0, 100), now=st.integers(0, 2**63))
def test_no_bytes_make_the_guard_raise_or_believe(frame: bytes, source: int, now: int) -> None:
    radio = len(frame) >= 8 and ((frame[0] == 0xFE and frame[5] == 109) or frame[0] == 0xFD)
    assert SigningGuard(KEY, live=True).judge(frame, source, now) is not None or radio


@given(
    size=st.integers(40, 300),
    flips=st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), min_size=1, max_size=4),
)
def test_a_stream_with_flipped_bytes_gives_only_frames_that_were_signed(
    size: int, flips: list[tuple[int, int]]
) -> None:
    frames = [_signed(T + number, number=number) for number in range(size // 20)]
    stream = bytearray(b"".join(frames))
    for place, mask in flips:
        stream[place % len(stream)] ^= mask
    scanner, guard = FrameScanner(), SigningGuard(KEY)
    cut = scanner.feed(bytes(stream)) + scanner.finish()
    believed = [frame for frame in cut if guard.judge(frame, 1, NOW) is None]
    assert set(believed) <= set(frames)


@given(order=st.permutations(range(12)), sources=st.lists(st.integers(1, 3), min_size=12, max_size=12))
def test_no_source_brings_a_frame_twice_or_backwards(order: list[int], sources: list[int]) -> None:
    guard = SigningGuard(KEY)
    newest: dict[int, int] = {}
    for number, source in [*zip(order, sources, strict=True), *zip(order, sources, strict=True)]:
        if guard.judge(_signed(T + number, number=number), source, NOW) is None:
            assert number > newest.get(source, -1)
            newest[source] = number


def test_a_key_of_64_hexadecimal_digits_or_32_bytes_is_the_key_itself(tmp_path: Path) -> None:
    for content in (
        KEY,
        KEY.hex().encode(),
        KEY.hex().upper().encode() + b"\r\n",
        b"\xef\xbb\xbf" + KEY.hex().encode(),
    ):
        assert read_key(_key_file(tmp_path, content)) == KEY


def test_a_random_key_that_ends_like_a_line_is_still_a_key(tmp_path: Path) -> None:
    content = bytes(range(1, 32)) + b"\n"
    assert read_key(_key_file(tmp_path, content)) == content


@pytest.mark.parametrize("passphrase", ["correct horse", "x" * 31, "x" * 33, "g" * 64, "Gänseblümchen"])
def test_a_passphrase_is_hashed_as_ground_stations_do(tmp_path: Path, passphrase: str) -> None:
    """SHA-256 of its UTF-8, whatever ends the line."""
    for end in (b"\n", b"\r\n", b" \t\n"):
        key = read_key(_key_file(tmp_path, passphrase.encode() + end))
        assert key == hashlib.sha256(passphrase.encode()).digest()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b" \n", "is empty"),
        (b"one\ntwo\n", "is not a key file"),
        (b"\xff\xfe\x00", "is not a key file"),
        (b"x" * 5000, "is not a key file"),
        (bytes(32), "all zeros"),
    ],
)
def test_what_is_no_key_is_said_in_one_sentence(tmp_path: Path, content: bytes, words: str) -> None:
    path = _key_file(tmp_path, content)
    with pytest.raises(SigningKeyError, match=words) as caught:
        read_key(path)
    assert str(path) in str(caught.value)


def test_a_key_file_that_is_not_there_is_said_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(SigningKeyError, match="cannot be read: no such file"):
        read_key(tmp_path / "absent.key")


def test_no_key_is_shown_when_something_is_printed() -> None:
    shown = repr(SigningGuard(KEY)) + repr(Signer(KEY)) + repr(SimpleNamespace(guard=SigningGuard(KEY)))
    assert repr(KEY) not in shown
    assert KEY.hex() not in shown


def test_every_refusal_has_a_sentence() -> None:
    for reason in ("unsigned", "wrong signature", "replayed", "too old", "too many streams"):
        assert advice(reason, "udpin:0.0.0.0:14550").startswith("udpin:0.0.0.0:14550: ")
