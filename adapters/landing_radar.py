"""The landing-radar wire, version 1: UDP datagrams of one precision-approach radar. Everything is big-endian.

Datagram (exactly 24 + count x record size + tag + 4 bytes):

    offset  size  field        meaning
    0       2     magic        4C 52 ("LR")
    2       1     version      1
    3       1     kind         1 plots, 2 status
    4       2     radar        uint16, 1..65535
    6       2     flags        bit 0: a 16-byte tag stands before the checksum; bit 1: simulated; others ignored
    8       4     sequence     uint32, +1 a datagram of this radar, wraps
    12      8     time         uint64 ns since 1970 UTC, the datagram's reference time
    20      2     count        records (plots 0..40, status 1)
    22      2     record size  bytes a record (plots >= 32, status >= 24; the surplus of each record is ignored)
    24            records
            0|16  tag          first 16 bytes of HMAC-SHA256(key, everything before the tag)
            4     checksum     CRC-32 (zlib) of everything before it

Plot record (32): track u16 | measured u16 | time offset i32 us | range u32 cm | azimuth i32 1e-7 deg |
    elevation i32 1e-7 deg | radial velocity i16 cm/s | SNR u16 0.01 dB | sigmas: range u16 cm, azimuth u16 urad,
    elevation u16 urad (0: not given) | reserved u16.
    measured: bit 0 range, 1 azimuth, 2 elevation, 3 radial velocity, 4 SNR; a field whose bit is 0 is ignored.
Status record (24): state u8 | mode u8 | period u16 ms | latitude i32 1e-7 deg | longitude i32 1e-7 deg |
    height i32 mm (ellipsoid) | boresight u32 1e-7 deg true | reserved u32.

A datagram that breaks a rule is refused whole; the first rule broken, in the order of `REASONS`, names the refusal.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

Reason = Literal[
    "length", "magic", "version", "checksum", "kind", "radar", "tag", "too many radars", "replayed", "value", "duplicate",
]  # fmt: skip
REASONS: tuple[Reason, ...] = get_args(Reason)
STATES = ("off", "standby", "operating", "fault")
MODES = ("search", "precision approach")
MAXIMUM_PLOTS = 40

_HEADER = struct.Struct(">2sBBHHIQHH")
_PLOT = struct.Struct(">HHiIiihHHHHH")
_STATUS = struct.Struct(">BBHiiiII")
_TAG_SIZE, _CHECKSUM_SIZE = 16, 4
_SHORTEST = _HEADER.size + _CHECKSUM_SIZE
_TAGGED, _SIMULATED = 1, 2
_PLOTS, _STATUS_KIND = 1, 2
_YEAR_2200 = 7_258_118_400 * 10**9
_HALF_TURN, _QUARTER_TURN = 180 * 10**7, 90 * 10**7  # in the wire's 1e-7 degrees


@dataclass(frozen=True, slots=True)
class Header:
    """What a datagram says of itself. `time` is ns since 1970 UTC; `authenticated`: its tag was checked with a key."""

    kind: Literal["plots", "status"]
    radar: int
    sequence: int
    time: int
    simulated: bool = False
    authenticated: bool = False


@dataclass(frozen=True, slots=True)
class Plot:
    """One plot record in the wire's units divided by their powers of ten. `time` is the measurement's, ns UTC."""

    track_number: int
    time: int
    range_m: float | None = None
    azimuth_deg: float | None = None
    elevation_deg: float | None = None
    radial_velocity_mps: float | None = None
    snr_db: float | None = None
    range_sigma_m: float | None = None
    azimuth_sigma_rad: float | None = None
    elevation_sigma_rad: float | None = None


@dataclass(frozen=True, slots=True)
class Status:
    """The status record. Height above the ellipsoid; boresight true, clockwise from north."""

    state: str
    mode: str
    update_period_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    boresight_deg: float


Record = Plot | Status


@dataclass(frozen=True, slots=True)
class Datagram:
    """A datagram that keeps every rule."""

    header: Header
    records: tuple[Record, ...]


def examine(data: bytes, key: bytes | None = None) -> Header | Reason:
    """Everything but the records' values: the header, or the first of the reasons up to "tag".

    With a key the tag must be there and right; without one a tag is ignored.
    """
    if len(data) < _SHORTEST:
        return "length"
    magic, version, kind, radar, flags, sequence, time, count, size = _HEADER.unpack_from(data)
    if magic != b"LR":
        return "magic"
    if version != 1:
        return "version"
    tag_size = _TAG_SIZE if flags & _TAGGED else 0
    if len(data) != _SHORTEST + count * size + tag_size:
        return "length"
    if kind == _PLOTS and (count > MAXIMUM_PLOTS or size < _PLOT.size):
        return "length"
    if kind == _STATUS_KIND and (count != 1 or size < _STATUS.size):
        return "length"
    if zlib.crc32(data[:-_CHECKSUM_SIZE]) != int.from_bytes(data[-_CHECKSUM_SIZE:], "big"):
        return "checksum"
    if kind not in (_PLOTS, _STATUS_KIND):
        return "kind"
    if radar == 0:
        return "radar"
    if key is not None:
        end = len(data) - _CHECKSUM_SIZE - _TAG_SIZE
        if not tag_size or not hmac.compare_digest(_tag(key, data[:end]), data[end:-_CHECKSUM_SIZE]):
            return "tag"
    kind_name: Literal["plots", "status"] = "plots" if kind == _PLOTS else "status"
    return Header(kind_name, radar, sequence, time, bool(flags & _SIMULATED), key is not None)


def records(data: bytes, header: Header) -> tuple[Record, ...] | Literal["value"]:
    """The records of a datagram that `examine` has passed, or "value" where one of them cannot be."""
    if header.time >= _YEAR_2200:
        return "value"
    count, size = struct.unpack_from(">HH", data, 20)
    read = _read_plot if header.kind == "plots" else _read_status
    found: list[Record] = []
    for index in range(count):
        record = read(data, 24 + index * size, header.time)
        if record is None:
            return "value"
        found.append(record)
    return tuple(found)


def decode(data: bytes, key: bytes | None = None) -> Datagram | Reason:
    """One datagram by itself: what it holds, or why it is refused. Never raises, whatever the bytes."""
    header = examine(data, key)
    if isinstance(header, str):
        return header
    found = records(data, header)
    return found if isinstance(found, str) else Datagram(header, found)


def encode(header: Header, content: Sequence[Record], *, key: bytes | None = None) -> bytes:
    """The bytes of a datagram: tagged when a key is given, fields that were not measured all zero.

    Raises ValueError where a quantity does not fit its field or the records are not of the header's kind.
    """
    plots = header.kind == "plots"
    if (plots and len(content) > MAXIMUM_PLOTS) or (not plots and len(content) != 1):
        raise ValueError(f"{len(content)} records do not make a {header.kind} datagram")
    flags = (_SIMULATED if header.simulated else 0) | (_TAGGED if key is not None else 0)
    size = _PLOT.size if plots else _STATUS.size
    try:
        body = [
            _HEADER.pack(
                b"LR", 1, _PLOTS if plots else _STATUS_KIND, header.radar, flags, header.sequence,
                header.time, len(content), size,
            )
        ]  # fmt: skip
        for record in content:
            if isinstance(record, Plot) != plots:
                raise ValueError(f"a {type(record).__name__} does not belong into a {header.kind} datagram")
            body.append(_plot_bytes(record, header.time) if isinstance(record, Plot) else _status_bytes(record))
    except struct.error as error:
        raise ValueError(f"does not fit the wire: {error}") from error
    data = b"".join(body)
    if key is not None:
        data += _tag(key, data)
    return data + zlib.crc32(data).to_bytes(_CHECKSUM_SIZE, "big")


def _tag(key: bytes, data: bytes) -> bytes:
    return hmac.new(key, data, hashlib.sha256).digest()[:_TAG_SIZE]


def _read_plot(data: bytes, at: int, time: int) -> Plot | None:
    (track, measured, offset_us, range_cm, azimuth, elevation, velocity, snr, *sigmas, _) = _PLOT.unpack_from(data, at)
    if (measured & 2 and abs(azimuth) > _HALF_TURN) or (measured & 4 and abs(elevation) > _QUARTER_TURN):
        return None
    return Plot(
        track,
        time + offset_us * 1000,
        range_cm / 100 if measured & 1 else None,
        azimuth / 10**7 if measured & 2 else None,
        elevation / 10**7 if measured & 4 else None,
        velocity / 100 if measured & 8 else None,
        snr / 100 if measured & 16 else None,
        sigmas[0] / 100 if sigmas[0] else None,
        sigmas[1] / 10**6 if sigmas[1] else None,
        sigmas[2] / 10**6 if sigmas[2] else None,
    )


def _read_status(data: bytes, at: int, _time: int) -> Status | None:
    state, mode, period_ms, latitude, longitude, height_mm, boresight, _ = _STATUS.unpack_from(data, at)
    if state >= len(STATES) or mode >= len(MODES):
        return None
    return Status(
        STATES[state],
        MODES[mode],
        period_ms / 1000,
        latitude / 10**7,
        longitude / 10**7,
        height_mm / 1000,
        boresight / 10**7,
    )


def _scaled(value: float | None, per_unit: int) -> int:
    return 0 if value is None else round(value * per_unit)


def _plot_bytes(plot: Plot, time: int) -> bytes:
    fields = (plot.range_m, plot.azimuth_deg, plot.elevation_deg, plot.radial_velocity_mps, plot.snr_db)
    measured = sum(1 << bit for bit, value in enumerate(fields) if value is not None)
    return _PLOT.pack(
        plot.track_number,
        measured,
        (plot.time - time) // 1000,
        _scaled(plot.range_m, 100),
        _scaled(plot.azimuth_deg, 10**7),
        _scaled(plot.elevation_deg, 10**7),
        _scaled(plot.radial_velocity_mps, 100),
        _scaled(plot.snr_db, 100),
        _scaled(plot.range_sigma_m, 100),
        _scaled(plot.azimuth_sigma_rad, 10**6),
        _scaled(plot.elevation_sigma_rad, 10**6),
        0,
    )


def _status_bytes(status: Status) -> bytes:
    return _STATUS.pack(
        STATES.index(status.state),
        MODES.index(status.mode),
        _scaled(status.update_period_s, 1000),
        _scaled(status.latitude_deg, 10**7),
        _scaled(status.longitude_deg, 10**7),
        _scaled(status.height_m, 1000),
        _scaled(status.boresight_deg, 10**7),
        0,
    )
