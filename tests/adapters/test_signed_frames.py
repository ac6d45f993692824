"""Signing at the one door from bytes to observations."""

import hashlib

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameEncoder
from adapters.signing import Signer, SigningGuard
from gateway.observation import Attitude

KEY = hashlib.sha256(b"correct horse").digest()
SECOND = 10**9
T0 = 1_790_000_000 * SECOND
LINK, OTHER_LINK = Source(0, "mavlink", "mavlink-1", "udpin:a"), Source(1, "mavlink", "mavlink-2", "udpin:b")


class Vehicle:
    """Signs with a key; 10 attitudes a second."""

    def __init__(self, key: bytes | None, system: int = 1) -> None:
        self.encoder, self.signer, self.number = FrameEncoder(system), None if key is None else Signer(key), 0

    def frame(self) -> tuple[int, bytes]:
        """The next frame and when it is sent."""
        self.number += 1
        angles = dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), self.number / 1000)
        frame = self.encoder.encode("ATTITUDE", time_boot_ms=60_000 + 100 * self.number, **angles)
        now = T0 + self.number * SECOND // 10
        return now, frame if self.signer is None else self.signer.sign(frame, 0, now)


def _decoder() -> Decoder:
    return Decoder([LINK, OTHER_LINK], live=True, signing=SigningGuard(KEY, live=True))


def _attitudes(decoder: Decoder, arrivals: list[Arrival]) -> int:
    return sum(isinstance(one, Attitude) for arrival in arrivals for one in decoder.feed(arrival).observations)


def test_what_is_signed_is_heard_and_not_called_unchecked() -> None:
    vehicle, decoder = Vehicle(KEY), _decoder()
    assert _attitudes(decoder, [Arrival(when, 0, frame) for when, frame in (vehicle.frame() for _ in range(50))]) > 40
    assert decoder.refused is None
    assert decoder.counters()["mavlink-1 frames"] == 50
    assert "mavlink-1 signed, unchecked" not in decoder.counters()


def test_without_a_key_signed_frames_are_heard_and_marked_unchecked() -> None:
    vehicle, decoder = Vehicle(KEY), Decoder([LINK])
    assert _attitudes(decoder, [Arrival(when, 0, frame) for when, frame in (vehicle.frame() for _ in range(50))]) > 40
    assert decoder.counters()["mavlink-1 signed, unchecked"] == 50


def test_what_is_refused_is_counted_said_once_and_leaves_no_other_trace() -> None:
    decoder, notes = _decoder(), []
    for key, reason in ((None, "unsigned"), (bytes(32), "wrong signature")):
        vehicle = Vehicle(key)
        for _ in range(20):
            when, frame = vehicle.frame()
            heard = decoder.feed(Arrival(when, 0, frame))
            notes += heard.notes
            assert heard.observations == ()
            assert decoder.refused == reason
    assert decoder.counters() == {"mavlink-1 unsigned": 20, "mavlink-1 wrong signature": 20}
    assert len(notes) == 2
    assert not decoder.health(T0 + 10 * SECOND).vehicles


def test_a_frame_that_comes_again_is_refused_and_the_next_one_is_heard() -> None:
    vehicle, decoder = Vehicle(KEY), _decoder()
    frames = [vehicle.frame() for _ in range(30)]
    for when, frame in frames:
        decoder.feed(Arrival(when, 0, frame))
    decoder.feed(Arrival(frames[-1][0] + 4000, 0, frames[-1][1]))
    assert decoder.refused == "replayed"
    assert _attitudes(decoder, [Arrival(*_with_source(vehicle.frame()))]) == 1
    assert decoder.counters()["mavlink-1 replayed"] == 1
    assert "mavlink-1 lost" not in decoder.counters()


def _with_source(sent: tuple[int, bytes]) -> tuple[int, int, bytes]:
    return sent[0], 0, sent[1]


def test_one_signing_vehicle_over_two_links_is_one_and_nothing_of_it_is_refused() -> None:
    """The second link lags by 50 ms and has what the first has lost."""
    vehicle, decoder = Vehicle(KEY), _decoder()
    frames = [vehicle.frame() for _ in range(100)]
    first = [Arrival(when, 0, frame) for index, (when, frame) in enumerate(frames) if index % 10 or index < 20]
    second = [Arrival(when + SECOND // 20, 1, frame) for when, frame in frames]
    heard = 0
    for arrival in sorted((*first, *second), key=lambda one: one.received_at):
        heard += _attitudes(decoder, [arrival])
        assert decoder.refused is None
    assert 80 < heard <= 100
    assert len(decoder.health(T0 + 10 * SECOND).vehicles) == 1
    assert decoder.counters()["mavlink-2 heard twice"] > 60
