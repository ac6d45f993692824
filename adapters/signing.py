"""MAVLink 2 signing: the key, frames that are signed with it, and which of the frames heard are believed.

A signed frame has bit 0 of its incompatibility flags set, and 13 bytes after its checksum:

    link id[1] | timestamp[6], little-endian, in 10 us since 2015-01-01 UTC | signature[6]

The signature is the first 6 bytes of SHA-256(key[32], the frame from its magic to its checksum, link id, timestamp). The
timestamp rises with every frame of a stream, and a stream is a (system, component, link id): so nothing that was recorded
can be sent again. MAVLink 1 cannot be signed.

Refused, in this order:

    unsigned          no signature. RADIO_STATUS alone may come without one, as the specification says: telemetry radios
                      put it in and know no key. Not in the name of a component that signs.
    wrong signature   made with another key, or changed on its way
    replayed          its timestamp is not newer than what its stream has said before
    too old           the first of its stream, and more than a minute behind the newest time that is known: the newest
                      timestamp believed so far and, on a live link, this machine's clock
    too many streams  more than any field has; only a holder of the key can cause it

A vehicle heard over two links through a router sends the same frames twice, and one link lags. That is no attack: another
source may be up to 2 s behind the newest timestamp of the stream, but never behind what it has brought itself. So each
frame is believed at most once from each source, and the picture uses what it hears twice once.

Deviation: the specification also has a list in which every frame, not only the first of its stream, is refused when it is
a minute behind this machine's clock. An autopilot that has lost its GPS counts frames instead of time and would fall
silent after a minute, just when it matters; the C library and pymavlink do not do it either.
"""

from __future__ import annotations

import hashlib
import hmac
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fastcrc.crc16 import mcrf4xx
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import V1, V2
from adapters.reasons import reason_of

KEY_BYTES = 32
REFUSED_UNSIGNED, REFUSED_SIGNATURE, REFUSED_REPLAYED, REFUSED_OLD, REFUSED_STREAMS = (
    "unsigned", "wrong signature", "replayed", "too old", "too many streams",
)  # fmt: skip

_MESSAGES: dict[int, Any] = dialect.mavlink_map
_RADIO_STATUS = int(dialect.MAVLINK_MSG_ID_RADIO_STATUS)
_SIGNED = 0x01
_TICK_NS = 10_000
_EPOCH_NS = 1_420_070_400 * 10**9  # 2015-01-01 UTC
_SECOND = 100_000  # in timestamps
_NEW_STREAM_BEHIND = 60 * _SECOND
_OTHER_LINK_BEHIND = 2 * _SECOND
_STREAMS_AT_MOST = 512
_LARGEST_KEY_FILE = 4096
_LARGEST_TIMESTAMP = (1 << 48) - 1


class SigningKeyError(ValueError):
    """A key that cannot be used; the message is one plain sentence with what to do."""


def read_key(path: Path) -> bytes:
    """The 32 bytes of the key in a file.

    64 hexadecimal digits are the key itself, and so are exactly 32 bytes. Anything else is one line with a passphrase, and
    the key is its SHA-256, as in Mission Planner and MAVProxy; white space at its end does not count. (A passphrase that
    has 32 characters must therefore end its line, and one that is 64 hexadecimal digits cannot be used.)
    Raises SigningKeyError.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_KEY_FILE + 1)
    except OSError as error:
        raise SigningKeyError(f"The key file {path} cannot be read: {reason_of(error)}.") from error
    key = _key_of(content, path)
    if not any(key):
        raise SigningKeyError(f"The key in {path} is all zeros, which MAVLink takes for no key; make another one.")
    return key


def _key_of(content: bytes, path: Path) -> bytes:
    line = content.removeprefix(b"\xef\xbb\xbf").rstrip()
    if len(content) == KEY_BYTES and not (content.endswith(b"\n") and _is_text(line)):
        return content
    if not line:
        raise SigningKeyError(f"The key file {path} is empty; write a passphrase or 64 hexadecimal digits into it.")
    if len(content) > _LARGEST_KEY_FILE or not _is_text(line):
        raise SigningKeyError(
            f"{path} is not a key file: it needs one line with a passphrase, 64 hexadecimal digits, or exactly 32 bytes."
        )
    if len(line) == 2 * KEY_BYTES:
        try:
            return bytes.fromhex(line.decode())
        except ValueError:
            pass  # a passphrase of that length
    return hashlib.sha256(line).digest()


def _is_text(line: bytes) -> bool:
    """Whether this is one line that a person can have typed."""
    try:
        return line.decode().isprintable()
    except UnicodeDecodeError:
        return False


def timestamp_at(utc_ns: int) -> int:
    """The timestamp of an instant (ns since 1970 UTC), in 10 us since 2015; 0 for all before."""
    return min(max((utc_ns - _EPOCH_NS) // _TICK_NS, 0), _LARGEST_TIMESTAMP)


def is_signed(frame: bytes) -> bool:
    """Whether a frame carries a signature, right or wrong."""
    return len(frame) >= 25 and frame[0] == V2 and bool(frame[2] & _SIGNED) and len(frame) == frame[1] + 25


def sign(frame: bytes, key: bytes, link_id: int, timestamp: int) -> bytes:
    """The signed form of an unsigned MAVLink 2 frame. The caller sees to it that no stream uses a timestamp twice.

    Raises ValueError for anything but a whole unsigned MAVLink 2 frame of a known message, and OverflowError where link id
    or timestamp do not fit their 8 and 48 bits.
    """
    if len(frame) < 12 or frame[0] != V2 or frame[2] or len(frame) != frame[1] + 12:
        raise ValueError("only a whole, unsigned MAVLink 2 frame can be signed")
    message = _message(frame)
    if message not in _MESSAGES:
        raise ValueError(f"message {message} is not known, so that its checksum cannot be made")
    content = frame[1:2] + bytes([_SIGNED]) + frame[3:-2]
    checksum = mcrf4xx(bytes([_MESSAGES[message].crc_extra]), mcrf4xx(content))  # the flag is a part of what it checks
    body = b"".join(
        (
            frame[:1],
            content,
            checksum.to_bytes(2, "little"),
            link_id.to_bytes(1, "little"),
            timestamp.to_bytes(6, "little"),
        )
    )
    return body + _signature(key, body)


def _message(frame: bytes) -> int:
    """The message id of a MAVLink 2 frame."""
    return frame[7] | frame[8] << 8 | frame[9] << 16


def _signature(key: bytes, body: bytes) -> bytes:
    return hashlib.sha256(key + body).digest()[:6]


@dataclass(slots=True)
class Signer:
    """Signs what we send, with a timestamp that was never used before, not even before a restart: the clock's, or later."""

    key: bytes = field(repr=False)
    last: int = 0

    def sign(self, frame: bytes, link_id: int, now_ns: int, newest_heard: int = 0) -> bytes:
        """The signed frame; see `sign`. `newest_heard`: others refuse a stream that begins a minute behind what they know."""
        self.last = max(self.last + 1, timestamp_at(now_ns), newest_heard)
        return sign(frame, self.key, link_id, self.last)


@dataclass(slots=True)
class _Stream:
    """What one (system, component, link id) has said: the newest timestamp, of all and of each source."""

    newest: int = -1
    by_source: dict[int, int] = field(default_factory=dict)

    def takes(self, timestamp: int, source: int) -> bool:
        """Whether this is new, or the same stream over another link that lags a little."""
        if timestamp <= self.by_source.get(source, -1) or timestamp < self.newest - _OTHER_LINK_BEHIND:
            return False
        self.by_source[source] = timestamp
        self.newest = max(self.newest, timestamp)
        return True


@dataclass(slots=True)
class SigningGuard:
    """Which frames of a session are believed: those signed with the key, each one once. Bounded, whatever comes.

    `live`: a stream that begins more than a minute behind this machine's clock is refused too; a replay does not repeat
    that. `newest` is the newest timestamp that was believed.
    """

    key: bytes = field(repr=False)
    live: bool = False
    newest: int = 0
    _streams: dict[tuple[int, int, int], _Stream] = field(default_factory=dict)
    _signing: set[tuple[int, int]] = field(default_factory=set)  # (system, component) that sign

    def judge(self, frame: bytes, source: int, now: int) -> str | None:
        """Why a frame of a source is refused, or None: it is believed. What is refused leaves no trace. Never raises.

        `now` is the frame's stamp, ns since 1970 UTC.
        """
        if not is_signed(frame):
            return None if self._may_be_unsigned(frame) else REFUSED_UNSIGNED
        signature = frame[-6:]
        if not hmac.compare_digest(_signature(self.key, frame[:-6]), signature):
            return REFUSED_SIGNATURE
        key, timestamp = (frame[5], frame[6], frame[-13]), int.from_bytes(frame[-12:-6], "little")
        stream = self._streams.get(key)
        if stream is None:
            known = max(self.newest, timestamp_at(now)) if self.live else self.newest
            if timestamp < known - _NEW_STREAM_BEHIND:
                return REFUSED_OLD
            if len(self._streams) >= _STREAMS_AT_MOST:
                return REFUSED_STREAMS
            stream = self._streams[key] = _Stream()
            self._signing.add(key[:2])
        if not stream.takes(timestamp, source):
            return REFUSED_REPLAYED
        self.newest = max(self.newest, timestamp)
        return None

    def _may_be_unsigned(self, frame: bytes) -> bool:
        if len(frame) >= 12 and frame[0] == V2:
            message, sender = _message(frame), (frame[5], frame[6])
        elif len(frame) >= 8 and frame[0] == V1:
            message, sender = frame[5], (frame[3], frame[4])
        else:
            return False
        return message == _RADIO_STATUS and sender not in self._signing


def advice(reason: str, origin: str) -> str:
    """What to tell a person the first time that a source's frame is refused for a reason."""
    return f"{origin}: {_ADVICE.get(reason, f'frames are refused ({reason}).')}"


_ADVICE = {
    REFUSED_UNSIGNED: "frames without a signature are refused; set up signing there with the same key, or leave the key away.",
    REFUSED_SIGNATURE: "frames with a wrong signature are refused; is the key file the one that was set up there?",
    REFUSED_REPLAYED: "frames that were sent before are refused; is somebody playing a recording?",
    REFUSED_OLD: "signed frames that are more than a minute old are refused; wait until its clock is set by GPS. "
    "A recording cannot be played into a live session with a key.",
    REFUSED_STREAMS: "signed frames of too many components are refused.",
}
