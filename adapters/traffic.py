"""ADSB_VEHICLE (246): what a receiver has heard of other aircraft. The key is the ICAO address, whoever reports it.

    ICAO_address     24 bits; 0 and more than 24 bits are none, and those that gateways make up (published.py) tell no news
    lat, lon         degE7                                                   flag 1
    altitude         mm; altitude_type 0 of pressure, 1 geometric: above     flag 2
                     the ellipsoid. The two are never mixed
    heading          cdeg, the COURSE over ground                            flag 4
    hor_velocity     cm/s                                                    flag 8
    ver_velocity     cm/s, UP                                                flag 128
    callsign         8 characters, padded with spaces or NUL                 flag 16
    squawk           the four digits as a decimal number                     flag 32
    tslc             whole seconds since the aircraft was last heard: it was there at the time of receipt - tslc

Receivers tell the last report of an aircraft again and again, with a tslc that grows (or, ArduPilot, does not). The same
report again, also by another receiver, is dropped. Of an aircraft that moves it is known by being at the same place.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass, field

from adapters.fixes import is_place
from adapters.mavlink_frames import fields
from adapters.meters import SECOND
from adapters.moments import Moments, Observations
from adapters.positions import DEGE7, is_altitude
from adapters.published import is_made_up
from gateway.observation import GpsReport

_REPORT = ("ICAO_address", "lat", "lon", "altitude_type", "altitude", "heading", "hor_velocity", "ver_velocity")
_REST = ("callsign", "tslc", "flags", "squawk")
ADSB_VEHICLE, _read = fields("ADSB_VEHICLE", *_REPORT, *_REST)

_COORDINATES, _ALTITUDE, _HEADING, _VELOCITY, _CALLSIGN, _SQUAWK, _VERTICAL = 1, 2, 4, 8, 16, 32, 128
_GREATEST_ADDRESS = 0xFFFFFF
_GEOMETRIC = 1
_MOVING_CMS = 100
_SAME_REPORT_NS = 3 * SECOND // 2  # tslc counts whole seconds, and messages take their time
_REMEMBERED_NS = 60 * SECOND
_MOST_AIRCRAFT = 2048
_SQUAWKS = {7500: "unlawful interference", 7600: "radio failure", 7700: "emergency"}
# tslc counts the whole seconds that have passed: the truth is up to 1 s older, the root of the mean square is 1/sqrt(3) s
TIMING_SIGMA_S = 1 / math.sqrt(3)


@dataclass(slots=True)
class Heard:
    """What was lately said of one aircraft."""

    squawk: int = 0
    reports: deque[tuple[tuple[int, ...], int]] = field(default_factory=lambda: deque(maxlen=16))

    def is_repeat(self, content: tuple[int, ...], valid_at: int, *, moving: bool) -> bool:
        """Whether this has been said before; remembers it. Who stands still may say the same anew."""
        within = _REMEMBERED_NS if moving else _SAME_REPORT_NS
        if any(said == content and abs(valid_at - then) < within for said, then in self.reports):
            return True
        self.reports.append((content, valid_at))
        return False


@dataclass(slots=True)
class Traffic:
    """All aircraft that others report, the longest silent first."""

    _aircraft: dict[str, Heard] = field(default_factory=dict)

    def of(self, name: str) -> Heard:
        """What was lately said of this aircraft. Of more than 2048 the longest silent is forgotten."""
        heard = self._aircraft.pop(name, None) or Heard()
        self._aircraft[name] = heard
        if len(self._aircraft) > _MOST_AIRCRAFT:
            del self._aircraft[next(iter(self._aircraft))]
        return heard

    def hear_adsb(self, moments: Moments, payload: bytes, received_at: int, counters: Counter[str]) -> Observations:
        """An ADSB_VEHICLE as a report."""
        address, latitude, longitude, kind, altitude, course, speed, climb, callsign, tslc, flags, squawk = _read(
            payload
        )
        reason = _refusal(address, latitude, longitude, flags)
        if reason:
            counters[reason] += 1
            return ()
        name = f"icao:{address:06x}"
        heard = self.of(name)
        received, timing = moments.of_traffic(received_at)
        valid_at = received - tslc * SECOND
        content = (latitude, longitude, kind, altitude, course, speed, climb, flags & 0xFF)
        if heard.is_repeat(content, valid_at, moving=bool(flags & _VELOCITY) and speed >= _MOVING_CMS):
            counters["repeated"] += 1
            return ()
        if flags & _SQUAWK and squawk != heard.squawk:
            heard.squawk = squawk
            if squawk in _SQUAWKS:
                moments.notes.append(("warning", f"{name} squawks {squawk}: {_SQUAWKS[squawk]}."))
        has_altitude = bool(flags & _ALTITUDE) and kind <= _GEOMETRIC and is_altitude(altitude, counters)
        east, north = _velocity(course, speed, flags, counters)
        return (
            GpsReport(
                name,
                valid_at,
                received_at,
                latitude * DEGE7,
                longitude * DEGE7,
                height_m=altitude / 1000 if has_altitude and kind == _GEOMETRIC else None,
                velocity_east_mps=east,
                velocity_north_mps=north,
                velocity_up_mps=climb / 100 if flags & _VERTICAL and abs(climb) < 32767 else None,
                timing=timing,
                pressure_altitude_m=altitude / 1000 if has_altitude and kind != _GEOMETRIC else None,
                timing_sigma_s=TIMING_SIGMA_S,
                callsign=_callsign(callsign) if flags & _CALLSIGN else None,
            ),
        )


def _refusal(address: int, latitude: int, longitude: int, flags: int) -> str:
    """Why this is no report; empty where it is one."""
    if not 0 < address <= _GREATEST_ADDRESS:
        return "no ICAO address"
    if is_made_up(address):
        return "address that a gateway made up"
    if not flags & _COORDINATES:
        return "position marked invalid"
    if not is_place(latitude, longitude) or latitude == longitude == 0:
        return "position out of range"
    return ""


def _velocity(
    course_cdeg: int, speed_cms: int, flags: int, counters: Counter[str]
) -> tuple[float | None, float | None]:
    """East and north, m/s; None where course or speed are not given."""
    if not flags & _VELOCITY or not (flags & _HEADING or speed_cms == 0):
        return None, None
    if course_cdeg > 36000 or speed_cms == 65535:
        counters["velocity out of range"] += 1
        return None, None
    angle = math.radians(course_cdeg / 100)
    return speed_cms / 100 * math.sin(angle), speed_cms / 100 * math.cos(angle)


def _callsign(text: bytes) -> str | None:
    """Without its padding; None where it is empty or not of printable characters."""
    said = text.split(b"\0")[0].decode("latin-1").strip()
    return said if said and said.isascii() and said.isprintable() else None
