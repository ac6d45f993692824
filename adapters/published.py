"""What the gateway says of its tracks on MAVLink: ADSB_VEHICLE (246), and the HEARTBEAT (0) of an ADS-B component.

    ICAO_address   the aircraft's own where it is known, else one that we make up: 0xB00000 and the track's number
    lat, lon       degE7
    altitude       mm above mean sea level, as the definition says ("ASL") and as ground stations and autopilots take it,
                   type 1 (geometric); type 0 (pressure) where only a pressure altitude is known. (What receivers hand
                   on under type 1 is what aircraft say, which is above the ellipsoid: traffic.py reads it so.)
    heading        course over ground, cdeg, below 36000; invalid below 1 m/s, where a course means nothing
    hor_velocity   cm/s; ver_velocity cm/s, UP; both held at the ends of what fits
    callsign       8 characters and a zero
    tslc           whole seconds since the instant at which all of this held
    flags          exactly what is valid; never a squawk

ICAO Annex 10 III gives no state the addresses that begin with 1011 ("reserved for future use"): nobody flies with one.
Those that begin with 1101 are as free, but FLARM's are taken from them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from adapters.mavlink_frames import FrameEncoder, fields, parse

FIRST_MADE_UP = 0xB00000
_MADE_UP = 1 << 20  # addresses; a track's number may be larger, two tracks of one address never live at once
COMPONENT = 156  # MAV_COMP_ID_ADSB
TYPE_UAV, TYPE_UNKNOWN = 14, 0  # ADSB_EMITTER_TYPE
_HEARTBEAT = {"type": 27, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
_PRESSURE, _GEOMETRIC = 0, 1
_COORDINATES, _ALTITUDE, _HEADING, _VELOCITY, _CALLSIGN, _SIMULATED, _VERTICAL = 1, 2, 4, 8, 16, 64, 128
_LEAST_SPEED_MPS = 1.0
_ADSB_VEHICLE, _read_key = fields("ADSB_VEHICLE", "ICAO_address", "lat", "lon", "altitude")

Key = tuple[int, int, int, int]
"""Address, latitude and longitude (degE7) and altitude (mm): what stays the same when somebody passes a report on."""


def made_up_address(track: int) -> int:
    """The address that a track goes by when its aircraft has none, the same as long as it lives."""
    return FIRST_MADE_UP + track % _MADE_UP


def is_made_up(address: int) -> bool:
    """Whether no aircraft can have this address: it comes from a gateway such as this one, and tells nothing new."""
    return FIRST_MADE_UP <= address < FIRST_MADE_UP + _MADE_UP


@dataclass(frozen=True, slots=True)
class Traffic:
    """One aircraft as others are told of it. None is what is not known; altitude above mean sea level, or pressure's."""

    address: int
    latitude_rad: float
    longitude_rad: float
    age_s: int
    altitude_msl_m: float | None = None
    pressure_altitude_m: float | None = None
    velocity_east_mps: float | None = None
    velocity_north_mps: float | None = None
    velocity_up_mps: float | None = None
    callsign: str = ""
    emitter_type: int = TYPE_UNKNOWN
    is_simulated: bool = False


def heartbeat(encoder: FrameEncoder) -> bytes:
    """The next frame: an ADS-B receiver is here."""
    return encoder.encode("HEARTBEAT", **_HEARTBEAT)


def adsb_vehicle(encoder: FrameEncoder, traffic: Traffic) -> bytes:
    """The next frame: one aircraft."""
    flags = _COORDINATES | (_SIMULATED if traffic.is_simulated else 0)
    altitude_type, altitude_m = _GEOMETRIC, traffic.altitude_msl_m
    if altitude_m is None and traffic.pressure_altitude_m is not None:
        altitude_type, altitude_m = _PRESSURE, traffic.pressure_altitude_m
    altitude_mm = 0
    if altitude_m is not None:
        flags |= _ALTITUDE
        altitude_mm = _held(altitude_m * 1000.0, -(1 << 31), (1 << 31) - 1)
    east, north, up = traffic.velocity_east_mps, traffic.velocity_north_mps, traffic.velocity_up_mps
    course_cdeg, speed_cmps, climb_cmps = 0, 0, 0
    if east is not None and north is not None:
        flags |= _VELOCITY
        speed_cmps = _held(math.hypot(east, north) * 100.0, 0, 65535)
        if speed_cmps >= _LEAST_SPEED_MPS * 100.0:
            flags |= _HEADING
            course_cdeg = round(math.degrees(math.atan2(east, north)) * 100.0) % 36000
    if up is not None:
        flags |= _VERTICAL
        climb_cmps = _held(up * 100.0, -32768, 32767)
    callsign = _callsign(traffic.callsign)
    return encoder.encode(
        "ADSB_VEHICLE",
        ICAO_address=traffic.address,
        lat=_degrees_e7(traffic.latitude_rad),
        lon=_degrees_e7(traffic.longitude_rad),
        altitude_type=altitude_type,
        altitude=altitude_mm,
        heading=course_cdeg,
        hor_velocity=speed_cmps,
        ver_velocity=climb_cmps,
        callsign=callsign,
        emitter_type=traffic.emitter_type,
        tslc=_held(traffic.age_s, 0, 255),
        flags=flags | (_CALLSIGN if callsign else 0),
        squawk=0,
    )


def key_of(frame: bytes) -> Key | None:
    """What tells an ADSB_VEHICLE frame again whoever passed it on; None for every other frame, and for damage."""
    if frame[:1] == b"\xfd":
        if frame[7:10] != b"\xf6\0\0":
            return None
    elif frame[:1] != b"\xfe" or frame[5:6] != b"\xf6":
        return None
    taken = parse(frame)
    if taken is None or taken.verdict != "good" or taken.message != _ADSB_VEHICLE:
        return None
    address, latitude, longitude, altitude = _read_key(taken.payload)
    return (address, latitude, longitude, altitude)


def _held(value: float, least: int, most: int) -> int:
    return min(max(round(value), least), most)


def _degrees_e7(angle_rad: float) -> int:
    return round(math.degrees(math.remainder(angle_rad, 2.0 * math.pi)) * 1e7)


def _callsign(text: str) -> bytes:
    """At most 8 printable characters of ASCII; the ninth of the field is the zero that ends it."""
    plain = "".join(letter if letter.isascii() and letter.isprintable() else "?" for letter in text.strip())
    return plain[:8].strip().encode("ascii")
