"""Whatever the payload of a message that we read: no exception, no number that is none, no place off the globe."""

import math
import random
from collections import Counter
from dataclasses import fields
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.epoch import SessionEpoch
from adapters.mavlink import MavlinkObserver
from adapters.mavlink_frames import Frame, definitions, encode, message_name, padded, parse
from gateway.observation import GpsReport, Observation

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
WANTED = sorted(MavlinkObserver(SessionEpoch()).wanted)
# what goes wrong in practice: zeros, ones, signs, NaN and infinities, half of everything
WORDS = (b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f", b"\xff\xff\xff\x7f", b"\0\0\0\x80")


def _frame(message: int, payload: bytes, sequence: int = 0) -> Frame:
    heartbeat = parse(encode("HEARTBEAT", {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0,
                                           "system_status": 4, "mavlink_version": 3}, system=1))  # fmt: skip
    assert heartbeat is not None
    if message == 0 and not payload:
        return heartbeat
    return heartbeat._replace(message=message, payload=padded(payload, message), sequence=sequence)


def _numbers(observation: Observation) -> list[float]:
    values: list[Any] = [getattr(observation, one.name) for one in fields(observation)]
    flat = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
    return [one for one in flat if isinstance(one, float)]


def _is_sane(observation: Observation) -> bool:
    """Whether every number is one, and every place on the globe."""
    on_the_globe = not isinstance(observation, GpsReport) or (
        abs(observation.latitude_rad) <= math.pi / 2 + 1e-9 and abs(observation.longitude_rad) <= math.pi + 1e-9
    )
    return on_the_globe and all(math.isfinite(number) for number in _numbers(observation))


def _mistakes(observer: MavlinkObserver, frame: Frame, at: int) -> list[Observation]:
    return [one for one in observer.hear(0, frame, at, Counter()) if not _is_sane(one)]


@pytest.mark.parametrize("message", WANTED, ids=[message_name(one) for one in WANTED])
def test_no_payload_of_a_message_raises_or_gives_a_number_that_is_none(message: int) -> None:
    """150 payloads of each, seeded by the message's number: of any bytes, and of words that go wrong in practice."""
    random_bytes = random.Random(message)
    size = definitions()[message].unpacker.size
    observer = MavlinkObserver(SessionEpoch(), {0: "a link"})
    mistakes = _mistakes(observer, _frame(0, b""), T0)
    for number in range(150):
        if number % 2:
            payload = random_bytes.randbytes(random_bytes.randint(0, size + 3))
        else:
            payload = b"".join(random_bytes.choice(WORDS) for _ in range(size // 4 + 1))[:size]
        mistakes += _mistakes(observer, _frame(message, payload, number & 255), T0 + number * SECOND // 10)
    assert mistakes == []


@settings(max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(WANTED), st.binary(max_size=60), st.integers(0, 10**10)), max_size=40))
def test_no_succession_of_messages_raises(told: list[tuple[int, bytes, int]]) -> None:
    observer = MavlinkObserver(SessionEpoch(), {0: "a link"})
    mistakes = _mistakes(observer, _frame(0, b""), T0)
    for number, (message, payload, after) in enumerate(told):
        mistakes += _mistakes(observer, _frame(message, payload, number & 255), T0 + after)
    assert mistakes == []
