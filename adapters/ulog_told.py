"""What each topic of a .ulg log becomes as MAVLink; the table stands in ulog.py."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from adapters.telling import (
    ABSOLUTE_PRESSURE,
    ACCELERATION,
    FIELD,
    RATE,
    Teller,
    centidegrees,
    degrees_e7,
    hundredfold,
    millimetres,
    number,
    speed_cms,
)

Values = dict[str, Any]

_ARMED_STATE = 2
_ON_GROUND, _IN_AIR = 1, 2
_FRESH_US = 500_000  # a velocity or heading older than this is not the position's
_MODES = {  # nav_state to PX4's main and sub mode, as HEARTBEAT.custom_mode holds them
    0: (1, 0), 1: (2, 0), 2: (3, 0), 3: (4, 4), 4: (4, 3), 5: (4, 5), 10: (5, 0), 12: (4, 6), 14: (6, 0), 15: (7, 0),
    17: (4, 2), 18: (4, 6), 19: (4, 8), 20: (4, 9), 21: (3, 1), 22: (4, 10),
}  # fmt: skip


@dataclass(slots=True)
class UlogTeller:
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
            "vehicle_magnetometer": self._field,
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
        self.teller.measure(
            0,
            ACCELERATION | RATE,
            **{f"{axis}acc": sample[f"accelerometer_m_s2[{place}]"] for place, axis in enumerate("xyz")},
            **{f"{axis}gyro": sample[f"gyro_rad[{place}]"] for place, axis in enumerate("xyz")},
        )

    def _field(self, sample: Values) -> None:
        gauss = {f"{axis}mag": sample[f"magnetometer_ga[{place}]"] for place, axis in enumerate("xyz")}
        self.teller.measure(0, FIELD, **gauss)

    def _pressure(self, air: Values) -> None:
        self.teller.measure(0, ABSOLUTE_PRESSURE, abs_pressure=air["baro_pressure_pa"] / 100)

    def _air(self, air: Values) -> None:
        names = ("calibrated_airspeed_m_s", "equivalent_airspeed_m_s", "indicated_airspeed_m_s")
        airspeed = next(air[name] for name in names if name in air)
        local = self._recent("vehicle_local_position")
        heading = local.get("heading", local.get("yaw"))
        place, pressure = self._recent("vehicle_global_position"), self._recent("vehicle_air_data")
        self.teller.tell(
            "VFR_HUD",
            airspeed=airspeed,
            groundspeed=math.hypot(number(local.get("vx")), number(local.get("vy"))),
            heading=-1 if heading is None else round(math.degrees(heading)) % 360,
            throttle=0,
            alt=number(place.get("alt", pressure.get("baro_alt_meter"))),
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
        self.teller.tell_home(home["lat"], home["lon"], home["alt"])

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
