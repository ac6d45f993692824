"""What happens to bytes: blind damage, and damage with what checks it made right again, so that it reaches further in."""

from __future__ import annotations

import random
import re
import zlib
from dataclasses import dataclass, field

import corpus

from adapters.mavlink_frames import Frame
from adapters.signing import sign

# what goes wrong in practice: zeros, ones, signs, NaN and infinities, tiny and huge numbers, wraps
WORDS = (
    b"\0\0\0\0", b"\xff\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f",
    b"\x00\x00\x80\xff", b"\x01\0\0\0", b"\xff\xff\x7f\x7f", b"\xff\x7f", b"\0\x80", b"\xff\xff", b"\x7f", b"\xff", b"\0",
    b"\0\0\0\0\0\0\xf8\x7f", b"\0\0\0\0\0\0\xf0\xff", b"\xff\xff\xff\xff\xff\xff\xef\x7f", b"\xff" * 8, b"\0" * 8,
)  # fmt: skip
TEXTS = (
    b"null", b"NaN", b"-Infinity", b"1e999", b"-1", b"1e308", b"65536", b"0.5", b'""', b"[]", b"{}", b"true", b'"\\ud800"',
    b"9" * 5000, b"[" * 2000, b'{"a":' * 2000, b"\xff\xfe", b"\t", b"\n", b",", b'"',
)  # fmt: skip
# messages that begin with a time since boot, and how many bytes of it
TIMED = {2: 4, 26: 4, 27: 8, 24: 8, 29: 4, 30: 4, 31: 4, 32: 4, 33: 4, 63: 8, 105: 8, 116: 4, 129: 4, 231: 8, 340: 8}
_NUMBER = re.compile(rb"-?\d+(\.\d+)?")
_VALUE = re.compile(rb'"[^"]*"|-?\d+(\.\d+)?|true|false|null')


def damaged(source: random.Random, data: bytes, others: list[bytes]) -> bytes:
    """Blind damage: flips, cuts, junk, repetition, a part of another one."""
    kind, size = source.randrange(7), max(len(data), 1)
    at = source.randrange(size)
    if kind == 0:
        return data[:at] + bytes((data[at] ^ 1 << source.randrange(8),)) + data[at + 1 :] if data else data
    if kind == 1:
        return data[:at]
    if kind == 2:
        return data[:at] + source.randbytes(source.randrange(1, 40)) + data[at:]
    if kind == 3:
        other = source.choice(others)
        return data[:at] + other[source.randrange(max(len(other), 1)) :]
    if kind == 4:
        end = min(at + source.randrange(1, 64), size)
        return data[:end] + data[at:]
    if kind == 5:
        word = source.choice(WORDS)
        return data[:at] + word + data[at + len(word) :]
    end = min(at + source.randrange(1, 64), size)
    return data[:at] + data[end:]


def damaged_much(source: random.Random, data: bytes, others: list[bytes], most: int) -> bytes:
    """The same, several times."""
    for _ in range(source.randint(1, most)):
        data = damaged(source, data, others)
    return data


def payload(source: random.Random, content: bytes, size: int) -> bytes:
    """Another payload of a message whose own is `size` bytes."""
    bent = bytearray(content.ljust(size, b"\0")[:size] if source.random() < 0.9 else content)
    for _ in range(source.randint(1, 4)):
        if not bent:
            break
        at = source.randrange(len(bent))
        kind = source.randrange(4)
        if kind == 0:
            bent[at] ^= 1 << source.randrange(8)
        elif kind == 1:
            bent[at] = source.randrange(256)
        else:
            word = source.choice(WORDS)
            at -= at % (len(word) if kind == 2 else 1)
            bent[at : at + len(word)] = word[: len(bent) - at]
    if source.random() < 0.1:
        return bytes(bent[: source.randrange(len(bent) + 1)])
    if source.random() < 0.02:
        return bytes(bent + source.randbytes(source.randrange(255 - len(bent) + 1)))
    return bytes(bent)[:255]


@dataclass
class Telemetry:
    """MAVLink datagrams: mutated frames, most of them with a right checksum, some rightly signed; and blind damage."""

    source: random.Random
    frames: list[Frame]
    wild: float = 0.03  # of frames that come from anybody
    now: int = corpus.BEGIN
    _sequences: dict[int, int] = field(default_factory=dict)
    _ticks: int = 10**13
    _lately: list[bytes] = field(default_factory=lambda: [b"\xfd"])

    def next(self) -> bytes:
        """The next datagram."""
        source = self.source
        kind = source.random()
        if kind < 0.68:
            return self._remember(self._sound(mutate=True))
        if kind < 0.82:
            return self._remember(self._sound(mutate=False))
        if kind < 0.85:
            return b"".join(self._sound(mutate=source.random() < 0.5) for _ in range(source.randrange(2, 6)))
        if kind < 0.88:
            return source.choice(self._lately)  # once more, or late
        return damaged_much(source, source.choice(self._lately), self._lately, 3)

    def next_plain(self) -> bytes:
        """The next one of those that most senders send: one MAVLink 2 frame that is right by its checksum."""
        return self._sound(mutate=self.source.random() < 0.5, luck=self.source.uniform(0.1, 0.5))

    def _timed(self, message: int, content: bytes) -> bytes:
        """With the time of now, as far as links tell it."""
        boot_ms = (self.now - corpus.BEGIN) // 10**6 + 100_000 - self.source.randrange(50)
        told = (boot_ms & 0xFFFFFFFF).to_bytes(4, "little")
        if TIMED[message] == 8:
            told = (boot_ms * 1000).to_bytes(8, "little")
        if message == 2:
            told = (self.now // 1000).to_bytes(8, "little") + told[:4]
        return told + content[len(told) :]

    def _remember(self, frame: bytes) -> bytes:
        if len(self._lately) < 256:
            self._lately.append(frame)
        else:
            self._lately[self.source.randrange(256)] = frame
        return frame

    def _sound(self, *, mutate: bool, luck: float | None = None) -> bytes:
        """A frame that is right by its checksum. `luck` decides who sends it, and how."""
        source, frame = self.source, self.source.choice(self.frames)
        content, message = frame.payload, frame.message
        if mutate and (message or source.random() < 0.1):  # else nobody would stay a vehicle
            content = payload(source, content, corpus.SIZE[message])
        if message in TIMED and source.random() < 0.9:
            content = self._timed(message, content)
        luck = source.random() if luck is None else luck
        system, component = (
            (1 + int(luck * 300) % 3, 1) if luck > self.wild else (source.randrange(256), source.randrange(256))
        )
        sequence = self._sequences.get(system, 0) + 1 & 255
        if source.random() < 0.02:
            sequence = source.randrange(256)
        self._sequences[system] = sequence
        if message > 255 or luck < 0.9:
            version = 2
            content = content.rstrip(b"\0") or content[:1] if luck < 0.6 else content
        else:
            version = 1
        if luck > 0.995:
            message = source.randrange(1 << 24)
        made = corpus.frame_bytes(
            message, content, system=system, component=component, sequence=sequence, version=version
        )
        if 0.5 < luck < 0.6 and version == 2 and message in corpus.EXTRA:
            self._ticks += source.randrange(3) if source.random() < 0.99 else source.randrange(10**9)
            return sign(made, corpus.KEY, source.randrange(3), self._ticks)
        return made


@dataclass
class Radar:
    """Radar datagrams: mutated ones with a right CRC-32, some with a right tag; and blind damage."""

    source: random.Random
    datagrams: list[bytes]
    _sequence: int = 0
    _time: int = corpus.BEGIN

    def next(self) -> bytes:
        """The next datagram."""
        import hashlib
        import hmac

        source = self.source
        data = bytearray(source.choice(self.datagrams))
        if source.random() < 0.15:
            return damaged_much(source, bytes(data), self.datagrams, 3)
        tagged = data[7] & 1
        end = len(data) - (20 if tagged else 4)
        self._sequence += source.choice((1, 1, 1, 1, 1, 0, 2, -3, 5000, 1 << 31)) if source.random() < 0.2 else 1
        self._time += 2 * 10**8 if source.random() < 0.97 else source.choice((-(10**10), 10**10, 1 << 60, -(1 << 59)))
        self._time %= 1 << 64
        data[8:20] = (self._sequence & 0xFFFFFFFF).to_bytes(4, "big") + self._time.to_bytes(8, "big")
        if source.random() < 0.7:
            for _ in range(source.randint(1, 3)):
                word = source.choice(WORDS)[::-1]
                at = source.randrange(24, end) if end > 24 and source.random() < 0.9 else source.randrange(2, 24)
                data[at : at + len(word)] = word[: len(data) - at]
        body = bytes(data[:end])
        if tagged:
            key = corpus.RADAR_KEYS.get(int.from_bytes(body[4:6], "big"), b"another")
            body += hmac.new(key, body, hashlib.sha256).digest()[:16]
        return body + zlib.crc32(body).to_bytes(4, "big")


def text(source: random.Random, data: bytes) -> bytes:
    """Another JSON or table: some of its values become others, or what is none."""
    for _ in range(source.randint(1, 3)):
        found = list((_NUMBER if source.random() < 0.5 else _VALUE).finditer(data))
        if not found or source.random() < 0.25:
            data = damaged(source, data, [data])
            continue
        place = source.choice(found)
        data = data[: place.start()] + source.choice(TEXTS) + data[place.end() :]
    return data
