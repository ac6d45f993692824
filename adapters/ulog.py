"""PX4's .ulg log told as MAVLink; read by pyulog, which the extra `ulog` installs. What becomes what:

    vehicle_status                            HEARTBEAT (each second)
    vehicle_land_detected                     EXTENDED_SYS_STATE (each second)
    vehicle_gps_position, else sensor_gps     GPS_RAW_INT; its UTC becomes that of SYSTEM_TIME
    vehicle_global_position                   GLOBAL_POSITION_INT; velocity and heading where it has none: vehicle_local_position
    vehicle_attitude                          ATTITUDE_QUATERNION
    sensor_combined                           HIGHRES_IMU
    vehicle_air_data                          SCALED_PRESSURE
    airspeed_validated, else airspeed         VFR_HUD
    wind, else wind_estimate                  WIND_COV
    home_position                             HOME_POSITION
    mission, navigator_mission_item           MISSION_CURRENT, MISSION_ITEM_INT

What a log does not hold is not told. pyulog holds a log's wanted topics in memory.
"""

from __future__ import annotations

import contextlib
import heapq
import io
import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from adapters.telling import (
    FIXES_FOR_UTC,
    Identity,
    Teller,
    centidegrees,
    degrees_e7,
    hundredfold,
    millimetres,
    number,
    speed_cms,
    utc_offset_us,
)

Values = dict[str, Any]

_CHOICES = (  # the first of each line that the log holds
    ("vehicle_status",),
    ("vehicle_land_detected",),
    ("vehicle_gps_position", "sensor_gps"),
    ("vehicle_local_position",),
    ("vehicle_global_position",),
    ("vehicle_attitude",),
    ("sensor_combined",),
    ("vehicle_air_data",),
    ("airspeed_validated", "airspeed"),
    ("wind", "wind_estimate"),
    ("home_position",),
    ("mission",),
    ("navigator_mission_item",),
)
_PX4 = 12
_ARMED_STATE = 2
_ON_GROUND, _IN_AIR = 1, 2
_ACCELERATION_AND_RATE = 0x3F
_FRESH_US = 500_000  # a velocity or heading older than this is not the position's
_MODES = {  # nav_state to PX4's main and sub mode, as HEARTBEAT.custom_mode holds them
    0: (1, 0), 1: (2, 0), 2: (3, 0), 3: (4, 4), 4: (4, 3), 5: (4, 5), 10: (5, 0), 12: (4, 6), 14: (6, 0), 15: (7, 0),
    17: (4, 2), 18: (4, 6), 19: (4, 8), 20: (4, 9), 21: (3, 1), 22: (4, 10),
}  # fmt: skip


class UlogMissing(RuntimeError):
    """pyulog is not installed; the message is one plain sentence."""


class UlogDamaged(ValueError):
    """pyulog could not read the log; the message says why."""


@dataclass(slots=True)
class UlogFrames:
    """A .ulg log, read when it is made: raises UlogMissing and UlogDamaged."""

    path: Path
    identity: Identity = field(init=False)
    _topics: dict[str, Any] = field(init=False)
    _is_damaged: bool = False

    def __post_init__(self) -> None:
        log = _load(self.path)
        self._is_damaged = bool(log.file_corruption)
        present = {data.name: data for data in reversed(log.data_list) if data.multi_id == 0}
        chosen = [next((name for name in names if name in present), None) for names in _CHOICES]
        self._topics = {name: present[name].data for name in chosen if name is not None}
        status = self._first("vehicle_status")
        parameters = log.initial_parameters
        self.identity = Identity(
            _byte(status.get("system_id"), parameters.get("MAV_SYS_ID"), 1),
            _byte(status.get("component_id"), parameters.get("MAV_COMP_ID"), 1),
            _byte(status.get("system_type"), parameters.get("MAV_TYPE"), 0),
            _PX4,
            self._utc_offset_us(),
        )

    def _first(self, name: str) -> Values:
        return next((values for _, _, values in self._entries(name)), {})

    def _utc_offset_us(self) -> int | None:
        differences: list[int] = []
        for name in ("vehicle_gps_position", "sensor_gps"):
            for at_us, _, fix in self._entries(name):
                if fix.get("fix_type", 0) >= 3 and fix.get("time_utc_usec", 0) and len(differences) < FIXES_FOR_UTC:
                    differences.append(int(fix["time_utc_usec"]) - at_us)
        return utc_offset_us(differences)

    def _entries(self, name: str) -> Iterator[tuple[int, int, Values]]:
        """Time, the topic's place in order, and values of every entry of a topic."""
        columns = self._topics.get(name)
        if columns is None or "timestamp" not in columns:
            return
        order = list(self._topics).index(name)
        names = list(columns)
        at = names.index("timestamp")
        for row in zip(*(columns[column] for column in names), strict=False):
            yield int(row[at]), order, {column: value.item() for column, value in zip(names, row, strict=True)}

    def frames(self, counters: Counter[str]) -> Iterator[tuple[int, bytes]]:
        """Stamp (ns since 1970 UTC, strictly increasing multiples of 4000) and frame.

        Counters: "values not usable", "damaged parts".
        """
        if self._is_damaged:
            counters["damaged parts"] += 1
        teller = _UlogTeller(Teller(self.identity, counters))
        names = list(self._topics)
        merged = heapq.merge(*(self._entries(name) for name in names), key=lambda entry: entry[:2])
        for at_us, order, values in merged:
            yield from teller.hear(at_us, names[order], values)


def _load(path: Path) -> Any:
    try:
        from pyulog import ULog
    except ImportError as error:
        raise UlogMissing("Reading a .ulg log needs pyulog: pip install talkdown[ulog].") from error
    wanted = [name for names in _CHOICES for name in names]
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # pyulog prints what it stumbles over
            return ULog(str(path), wanted)
    except Exception as error:
        raise UlogDamaged(f"it is damaged ({type(error).__name__.lower()}: {error})") from error


def _byte(*candidates: Any) -> int:
    """The first that a MAVLink header can hold."""
    return next(int(one) for one in candidates if isinstance(one, int | float) and 0 <= one <= 255)


@dataclass(slots=True)
class _UlogTeller:
    """One entry after the other to frames."""

    teller: Teller
    latest: dict[str, tuple[int, Values]] = field(default_factory=dict)
    _tellers: dict[str, Callable[[Values], None]] = field(init=False)

    def __post_init__(self) -> None:
        self._tellers = {
            "vehicle_gps_position": self._fix,
            "sensor_gps": self._fix,
            "vehicle_global_position": self._position,
            "vehicle_attitude": self._attitude,
            "sensor_combined": self._inertial,
            "vehicle_air_data": self._pressure,
            "airspeed_validated": self._air,
            "airspeed": self._air,
            "wind": self._wind,
            "wind_estimate": self._wind,
            "home_position": self._home,
            "mission": self._mission,
            "navigator_mission_item": self._item,
        }

    def hear(self, at_us: int, name: str, values: Values) -> list[tuple[int, bytes]]:
        """An entry of a topic; the frames that it makes."""
        teller = self.teller
        self.latest[name] = (at_us, values)
        if name == "vehicle_status":
            teller.armed = values.get("arming_state") == _ARMED_STATE
            main, sub = _MODES.get(values.get("nav_state", -1), (0, 0))
            teller.custom_mode = main << 16 | sub << 24
        elif name == "vehicle_land_detected":
            teller.landed = _ON_GROUND if values.get("landed") else _IN_AIR
        teller.begin(at_us)
        say = self._tellers.get(name)
        if say is not None:
            teller.attempt(say, values)
        return teller.take()

    def _recent(self, name: str) -> Values:
        found = self.latest.get(name)
        return found[1] if found is not None and self.teller.boot_us - found[0] <= _FRESH_US else {}

    def _fix(self, fix: Values) -> None:
        in_degrees = "latitude_deg" in fix  # since PX4 1.14
        latitude = degrees_e7(fix["latitude_deg"]) if in_degrees else fix["lat"]
        longitude = degrees_e7(fix["longitude_deg"]) if in_degrees else fix["lon"]
        altitude = round(fix["altitude_msl_m"] * 1000) if in_degrees else fix["alt"]
        ellipsoid = round(fix["altitude_ellipsoid_m"] * 1000) if in_degrees else fix.get("alt_ellipsoid", 0)
        self.teller.tell(
            "GPS_RAW_INT",
            time_usec=self.teller.boot_us,
            fix_type=fix["fix_type"],
            lat=latitude,
            lon=longitude,
            alt=altitude,
            eph=hundredfold(fix.get("hdop")),
            epv=hundredfold(fix.get("vdop")),
            vel=hundredfold(fix.get("vel_m_s")),
            cog=centidegrees(math.degrees(number(fix.get("cog_rad")))),
            satellites_visible=fix.get("satellites_used", 255),
            alt_ellipsoid=ellipsoid,
            h_acc=millimetres(fix.get("eph")),
            v_acc=millimetres(fix.get("epv")),
            vel_acc=millimetres(fix.get("s_variance_m_s")),
        )

    def _position(self, place: Values) -> None:
        local, home = self._recent("vehicle_local_position"), self.latest.get("home_position", (0, {}))[1]
        heading = place.get("yaw", local.get("heading", local.get("yaw")))
        altitude_m = place["alt"]
        self.teller.tell(
            "GLOBAL_POSITION_INT",
            time_boot_ms=self.teller.boot_ms,
            lat=degrees_e7(place["lat"]),
            lon=degrees_e7(place["lon"]),
            alt=round(altitude_m * 1000),
            relative_alt=round((altitude_m - home.get("alt", 0.0)) * 1000),
            vx=speed_cms(place.get("vel_n", local.get("vx"))),
            vy=speed_cms(place.get("vel_e", local.get("vy"))),
            vz=speed_cms(place.get("vel_d", local.get("vz"))),
            hdg=centidegrees(None if heading is None else math.degrees(heading)),
        )

    def _attitude(self, attitude: Values) -> None:
        sample = self._recent("sensor_combined")
        self.teller.tell(
            "ATTITUDE_QUATERNION",
            time_boot_ms=self.teller.boot_ms,
            **{f"q{place + 1}": attitude[f"q[{place}]"] for place in range(4)},
            rollspeed=number(sample.get("gyro_rad[0]")),
            pitchspeed=number(sample.get("gyro_rad[1]")),
            yawspeed=number(sample.get("gyro_rad[2]")),
        )

    def _inertial(self, sample: Values) -> None:
        missing = ("xmag", "ymag", "zmag", "abs_pressure", "diff_pressure", "pressure_alt", "temperature")
        self.teller.tell(
            "HIGHRES_IMU",
            time_usec=self.teller.boot_us,
            **{f"{axis}acc": sample[f"accelerometer_m_s2[{place}]"] for place, axis in enumerate("xyz")},
            **{f"{axis}gyro": sample[f"gyro_rad[{place}]"] for place, axis in enumerate("xyz")},
            **dict.fromkeys(missing, math.nan),
            fields_updated=_ACCELERATION_AND_RATE,
            id=0,
        )

    def _pressure(self, air: Values) -> None:
        temperature_c = number(air.get("baro_temp_celcius", air.get("ambient_temperature", 0.0)))
        self.teller.tell(
            "SCALED_PRESSURE",
            time_boot_ms=self.teller.boot_ms,
            press_abs=air["baro_pressure_pa"] / 100,
            press_diff=0.0,
            temperature=round(temperature_c * 100),
        )

    def _air(self, air: Values) -> None:
        names = ("calibrated_airspeed_m_s", "equivalent_airspeed_m_s", "indicated_airspeed_m_s")
        airspeed = next(air[name] for name in names if name in air)
        local = self._recent("vehicle_local_position")
        heading = local.get("heading", local.get("yaw"))
        self.teller.tell(
            "VFR_HUD",
            airspeed=airspeed,
            groundspeed=math.hypot(number(local.get("vx")), number(local.get("vy"))),
            heading=-1 if heading is None else round(math.degrees(heading)) % 360,
            throttle=0,
            alt=number(self._recent("vehicle_global_position").get("alt")),
            climb=-number(local.get("vz")),
        )

    def _wind(self, wind: Values) -> None:
        north, east = wind["windspeed_north"], wind["windspeed_east"]
        variances = wind.get("variance_north", math.nan), wind.get("variance_east", math.nan)
        if north == east == 0.0 and variances == (0.0, 0.0):
            return  # not estimated yet
        unknown = dict.fromkeys(("var_vert", "wind_alt", "horiz_accuracy", "vert_accuracy"), math.nan)
        self.teller.tell(
            "WIND_COV",
            time_usec=self.teller.boot_us,
            wind_x=north,
            wind_y=east,
            wind_z=0.0,
            var_horiz=sum(variances) / 2,
            **unknown,
        )

    def _home(self, home: Values) -> None:
        if not home.get("valid_hpos", True) or not home.get("valid_alt", True):
            return
        unknown = dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), math.nan)
        self.teller.tell(
            "HOME_POSITION",
            latitude=degrees_e7(home["lat"]),
            longitude=degrees_e7(home["lon"]),
            altitude=round(home["alt"] * 1000),
            q=[math.nan] * 4,
            time_usec=self.teller.boot_us,
            **unknown,
        )

    def _mission(self, mission: Values) -> None:
        if mission.get("count", 0) > 0 and mission["current_seq"] >= 0:
            self.teller.tell("MISSION_CURRENT", seq=mission["current_seq"], total=mission["count"])

    def _item(self, item: Values) -> None:
        is_relative = item.get("altitude_is_relative", False)
        self.teller.tell(
            "MISSION_ITEM_INT",
            target_system=255,
            target_component=190,
            seq=item["sequence_current"],
            frame=6 if is_relative else 5,
            command=item["nav_cmd"],
            current=0,
            autocontinue=1,
            **dict.fromkeys(("param1", "param2", "param3", "param4"), math.nan),
            x=degrees_e7(item["latitude"]),
            y=degrees_e7(item["longitude"]),
            z=item["altitude"],
        )
