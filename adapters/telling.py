"""A flight log told as the MAVLink frames that the vehicle would have sent, so that all else treats it as a stream.

What .BIN and .ulg share: stamps, the heartbeat and the time once a second, and what happens to values that a frame cannot
hold. A log without UTC is stamped from 2000-01-01 on, always the same, and its SYSTEM_TIME says that there is none.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from statistics import median_low
from typing import Any

from adapters.mavlink_frames import FrameEncoder

STEP_NS = 4_000
NO_UTC_US = 946_684_800 * 10**6  # 2000-01-01
LEAST_UTC_US, GREATEST_UTC_US = 978_307_200 * 10**6, 4_102_444_800 * 10**6  # 2001, 2100
FIXES_FOR_UTC = 31
LONGEST_US = 10**14  # three years since boot: later is damage
_SECOND_US = 10**6
_HIGHRES = (
    *(axis + kind for kind in ("acc", "gyro", "mag") for axis in "xyz"),
    *("abs_pressure", "diff_pressure", "pressure_alt", "temperature"),
)
ACCELERATION, RATE, FIELD, ABSOLUTE_PRESSURE, TEMPERATURE = 0x7, 0x38, 0x1C0, 0x200, 0x1000  # of `updated`
ARMED, _CUSTOM_MODE = 128, 1
_ACTIVE, _STANDBY = 4, 3


@dataclass(frozen=True, slots=True)
class Identity:
    """Whose log it is, told by what stands anywhere in its first minutes."""

    system: int
    component: int
    vehicle_type: int
    autopilot: int
    utc_offset_us: int | None  # UTC minus time since boot


def utc_offset_us(differences_us: list[int]) -> int | None:
    """UTC minus time since boot from several fixes; None where there are none that can be."""
    sane = [one for one in differences_us if LEAST_UTC_US <= one < GREATEST_UTC_US]
    return median_low(sane) if sane else None


@dataclass(slots=True)
class Teller:
    """Collects the frames of one moment after the other. Counts "values not usable"."""

    identity: Identity
    counters: Counter[str]
    armed: bool = False
    custom_mode: int = 0
    landed: int | None = None  # MAV_LANDED_STATE
    frames: list[tuple[int, bytes]] = field(default_factory=list)
    _encoder: FrameEncoder = field(init=False)
    _now_us: int = 0
    _next_second_us: int | None = None
    _last_stamp: int = -1

    def __post_init__(self) -> None:
        self._encoder = FrameEncoder(self.identity.system, self.identity.component)

    def begin(self, time_us: int) -> None:
        """What is told from now on was so at this time since boot; once a second who and when is told first."""
        self._now_us = time_us
        due = self._next_second_us
        if due is None or not due - 10 * _SECOND_US < time_us < due:
            self._next_second_us = time_us // _SECOND_US * _SECOND_US + _SECOND_US
            self._tell_second()

    def _tell_second(self) -> None:
        offset_us = self.identity.utc_offset_us
        utc_us = 0 if offset_us is None else self._now_us + offset_us
        self.tell("SYSTEM_TIME", time_unix_usec=utc_us, time_boot_ms=self.boot_ms)
        self.tell(
            "HEARTBEAT",
            type=self.identity.vehicle_type,
            autopilot=self.identity.autopilot,
            base_mode=_CUSTOM_MODE | (ARMED if self.armed else 0),
            custom_mode=self.custom_mode & 0xFFFFFFFF,
            system_status=_ACTIVE if self.armed else _STANDBY,
            mavlink_version=3,
        )
        if self.landed is not None:
            self.tell("EXTENDED_SYS_STATE", vtol_state=0, landed_state=self.landed)

    @property
    def boot_ms(self) -> int:
        """Milliseconds since boot, as `time_boot_ms` holds them."""
        return self._now_us // 1000 & 0xFFFFFFFF

    @property
    def boot_us(self) -> int:
        """Microseconds since boot."""
        return self._now_us

    def attempt(self, say: Callable[[dict[str, Any]], None], values: dict[str, Any]) -> None:
        """Say something of a log's values; where one is missing, or no frame can hold it, that is counted instead."""
        try:
            say(values)
        except (KeyError, ValueError, OverflowError, TypeError, struct.error):
            self.counters["values not usable"] += 1

    def tell(self, name: str, **values: Any) -> None:
        """One frame. Raises what `attempt` takes."""
        frame = self._encoder.encode(name, **values)
        offset_us = self.identity.utc_offset_us
        stamp = (self._now_us + (NO_UTC_US if offset_us is None else offset_us)) * 1000 // STEP_NS * STEP_NS
        self._last_stamp = max(stamp, self._last_stamp + STEP_NS)
        self.frames.append((self._last_stamp, frame))

    def measure(self, sensor: int, updated: int, **values: float) -> None:
        """A HIGHRES_IMU of the fields that `updated` says; all others are not a number."""
        told = {**dict.fromkeys(_HIGHRES, math.nan), **values}
        self.tell("HIGHRES_IMU", time_usec=self.boot_us, fields_updated=updated, id=sensor, **told)

    def tell_home(self, latitude_deg: float, longitude_deg: float, altitude_msl_m: float) -> None:
        """A HOME_POSITION; which way it faces is not known."""
        unknown = dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), math.nan)
        self.tell(
            "HOME_POSITION",
            latitude=degrees_e7(latitude_deg),
            longitude=degrees_e7(longitude_deg),
            altitude=round(altitude_msl_m * 1000),
            q=[math.nan] * 4,
            time_usec=self.boot_us,
            **unknown,
        )

    def take(self) -> list[tuple[int, bytes]]:
        """What was told since the last time."""
        told, self.frames = self.frames, []
        return told


def degrees_e7(degrees: float) -> int:
    """Degrees as MAVLink tells them. Raises ValueError for what is not a number."""
    return round(degrees * 1e7)


def compass(north: float, east: float) -> float:
    """The direction of a vector, degrees clockwise from north, 0 to 360."""
    return math.degrees(math.atan2(east, north)) % 360.0


def speed_cms(metres_per_second: float | None) -> int:
    """cm/s in 16 bits, 32767 where it is not known."""
    if metres_per_second is None or not math.isfinite(metres_per_second):
        return 32767
    return round(min(max(metres_per_second * 100, -32766), 32766))


def centidegrees(degrees: float | None) -> int:
    """0 to 35999, 65535 where it is not known."""
    return 65535 if degrees is None or not math.isfinite(degrees) else round(degrees % 360.0 * 100) % 36000


def hundredfold(value: float | None) -> int:
    """A dilution or a speed in 16 bits x 100, 65535 where it is not known."""
    return 65535 if value is None or not 0 <= value < 655.35 else round(value * 100)


def millimetres(metres: float | None) -> int:
    """An accuracy in mm, 0 where it is not known."""
    return 0 if metres is None or not 0 < metres < 1e6 else round(metres * 1000)


def number(value: Any) -> float:
    """A measurement, not a number where there is none."""
    return math.nan if value is None else float(value)
