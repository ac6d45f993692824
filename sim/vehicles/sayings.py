"""What is in each message of a vehicle, by the truth and by what its sensors make of it.

HIGHRES_IMU is the unit that is meant for reckoning. RAW_IMU, coarser, calls itself a second one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gateway.estimators.inertial import from_angles
from gateway.geodesy import STANDARD_GRAVITY_MPS2
from sim.vehicles.motion import Moment, Vehicle
from sim.vehicles.sensing import Sensors, dynamic_pressure_hpa
from sim.vehicles.steering import Plane

Values = dict[str, Any]

_ARDUPILOT, _ARMED, _ACTIVE, _STANDBY = 3, 128, 4, 3
_CUSTOM, _GUIDED, _AUTO, _STABILIZED = 1, 8, 4, 16  # bits of base_mode
_NO_MISSION, _NOT_BEGUN, _UNDER_WAY, _COMPLETE = 1, 2, 3, 5
_ON_GROUND, _IN_AIR = 1, 2
_UNKNOWN_16 = 65535
_SENSES = (
    0x1 | 0x2 | 0x4 | 0x8 | 0x20 | 0x400 | 0x800 | 0x1000 | 0x2000 | 0x4000 | 0x8000 | 0x10000000
)  # MAV_SYS_STATUS_SENSOR
_PREARM = 0x10000000


@dataclass(slots=True)
class Sayings:
    """One vehicle's messages as they would be at its moment. `start_ns`: UTC when it was switched on."""

    vehicle: Vehicle
    sensors: Sensors
    start_ns: int
    _plane: Plane = field(init=False)

    def __post_init__(self) -> None:
        self._plane = Plane.about(self.vehicle.home)

    def now(self, name: str) -> Values | None:
        """The fields of one message now; None where there is nothing to say. Raises KeyError for an unknown one."""
        return SAYS[name](self, self.vehicle.moment)

    @property
    def boot_ms(self) -> int:
        """The vehicle's own clock."""
        return round(self.vehicle.moment.time_s * 1e3)

    @property
    def _unix_us(self) -> int:
        return self.start_ns // 1000 + round(self.vehicle.moment.time_s * 1e6)

    def _heartbeat(self, moment: Moment) -> Values:
        vehicle = self.vehicle
        mode = vehicle.mode
        base = _CUSTOM | (_ARMED if vehicle.is_armed else 0)
        base |= _AUTO | _GUIDED | _STABILIZED if mode in ("AUTO", "RTL", "LAND") else _GUIDED if mode == "GUIDED" else 0
        return {
            "type": vehicle.kind,
            "autopilot": _ARDUPILOT,
            "base_mode": base,
            "custom_mode": vehicle.modes[mode],
            "system_status": _STANDBY if vehicle.is_landed and not vehicle.is_armed else _ACTIVE,
            "mavlink_version": 3,
        }

    def _system_time(self, moment: Moment) -> Values:
        return {"time_unix_usec": self._unix_us, "time_boot_ms": self.boot_ms}

    def _sys_status(self, moment: Moment) -> Values:
        healthy = _SENSES if self.sensors.has_fix else _SENSES & ~0x20 & ~_PREARM
        zero = ("drop_rate_comm", "errors_comm", "errors_count1", "errors_count2", "errors_count3", "errors_count4")
        return {
            "onboard_control_sensors_present": _SENSES,
            "onboard_control_sensors_enabled": _SENSES,
            "onboard_control_sensors_health": healthy,
            "load": 200,
            "voltage_battery": 16000,
            "current_battery": -1,
            "battery_remaining": 90,
            **dict.fromkeys(zero, 0),
        }

    def _extended(self, moment: Moment) -> Values:
        return {"vtol_state": 0, "landed_state": _ON_GROUND if self.vehicle.is_landed else _IN_AIR}

    def _home(self, moment: Moment) -> Values:
        home = self.vehicle.home
        q = from_angles(0.0, 0.0, home.heading_rad).tolist()
        return {
            "latitude": round(math.degrees(home.latitude_rad) * 1e7),
            "longitude": round(math.degrees(home.longitude_rad) * 1e7),
            "altitude": round(home.altitude_msl_m * 1e3),
            **dict.fromkeys(("x", "y", "z", "approach_x", "approach_y", "approach_z"), 0.0),
            "q": q,
            "time_usec": self._unix_us,
        }

    def _current(self, moment: Moment) -> Values:
        mission = self.vehicle.mission
        state = _COMPLETE if mission.is_complete else _UNDER_WAY if self.vehicle.mode == "AUTO" else _NOT_BEGUN
        if len(mission.items) < 2:
            state = _NO_MISSION
        elif mission.current == 0:
            state = _NOT_BEGUN
        total = max(len(mission.items) - 1, 0)
        return {"seq": mission.current, "total": total, "mission_state": state, "mission_mode": 1}

    def _navigation(self, moment: Moment) -> Values | None:
        progress = self.vehicle.progress
        if progress.distance_m is None or progress.bearing_rad is None:
            return None
        bearing = round(math.degrees(progress.bearing_rad))
        return {
            "nav_roll": math.degrees(moment.attitude_rad[0]),
            "nav_pitch": math.degrees(moment.attitude_rad[1]),
            "nav_bearing": bearing,
            "target_bearing": bearing,
            "wp_dist": min(round(progress.distance_m), _UNKNOWN_16),
            "alt_error": progress.height_error_m or 0.0,
            "aspd_error": progress.speed_error_mps or 0.0,
            "xtrack_error": progress.cross_track_m or 0.0,
        }

    def _attitude(self, moment: Moment) -> Values:
        roll, pitch, yaw = moment.attitude_rad
        p, q, r = moment.rate_radps
        return {
            "time_boot_ms": self.boot_ms,
            **{"roll": roll, "pitch": pitch, "yaw": yaw},
            **{"rollspeed": p, "pitchspeed": q, "yawspeed": r},
        }

    def _sim_state(self, moment: Moment) -> Values:
        latitude, longitude = math.degrees(moment.latitude_rad), math.degrees(moment.longitude_rad)
        quaternion = from_angles(*moment.attitude_rad).tolist()
        return {
            **dict(zip(("q1", "q2", "q3", "q4"), quaternion, strict=True)),
            **dict(zip(("roll", "pitch", "yaw"), moment.attitude_rad, strict=True)),
            **dict(zip(("xacc", "yacc", "zacc"), moment.force_mps2, strict=True)),
            **dict(zip(("xgyro", "ygyro", "zgyro"), moment.rate_radps, strict=True)),
            **dict(zip(("vn", "ve", "vd"), moment.velocity_mps, strict=True)),
            **{"lat": latitude, "lon": longitude, "alt": self._altitude(moment)},
            **{"lat_int": round(latitude * 1e7), "lon_int": round(longitude * 1e7)},
            **{"std_dev_horz": 0.0, "std_dev_vert": 0.0},
        }

    def _highres(self, moment: Moment) -> Values:
        rate, force = self.sensors.inertial(moment, self.vehicle.step_s)
        return {
            "time_usec": round(moment.time_s * 1e6),
            **dict(zip(("xgyro", "ygyro", "zgyro"), rate, strict=True)),
            **dict(zip(("xacc", "yacc", "zacc"), force, strict=True)),
            **dict.fromkeys(("xmag", "ymag", "zmag", "abs_pressure", "diff_pressure", "pressure_alt"), 0.0),
            "temperature": 20.0,
            "fields_updated": 0x3F,
            "id": 0,
        }

    def _raw(self, moment: Moment) -> Values:
        rate, force = self.sensors.inertial(moment, self.vehicle.step_s)
        whole = {f"{axis}gyro": round(value * 1e3) for axis, value in zip("xyz", rate, strict=True)}
        whole |= {
            f"{axis}acc": round(value * 1e3 / STANDARD_GRAVITY_MPS2) for axis, value in zip("xyz", force, strict=True)
        }
        return {"time_usec": round(moment.time_s * 1e6), **whole, "xmag": 0, "ymag": 0, "zmag": 0, "id": 1}

    def _pressure(self, moment: Moment) -> Values:
        airspeed = moment.airspeed_mps
        return {
            "time_boot_ms": self.boot_ms,
            "press_abs": self.sensors.pressure_hpa(self._altitude(moment)),
            "press_diff": 0.0 if airspeed is None else dynamic_pressure_hpa(self.sensors.airspeed_mps(airspeed)),
            "temperature": 2000,
        }

    def _hud(self, moment: Moment) -> Values:
        north, east, down = moment.velocity_mps
        ground = math.hypot(north, east)
        airspeed = moment.airspeed_mps
        return {
            "airspeed": ground if airspeed is None else self.sensors.airspeed_mps(airspeed),
            "groundspeed": ground,
            "heading": round(math.degrees(moment.attitude_rad[2])) % 360,
            "throttle": round(100.0 * moment.throttle),
            "alt": self._altitude(moment),
            "climb": -down,
        }

    def _wind(self, moment: Moment) -> Values | None:
        if moment.airspeed_mps is None or self.vehicle.is_landed:
            return None  # who does not fly through the air cannot tell it
        north, east, down = moment.wind_mps
        return {
            "direction": math.degrees(math.atan2(-east, -north)),
            "speed": math.hypot(north, east),
            "speed_z": down,
        }

    def _global_position(self, moment: Moment) -> Values | None:
        if not self.sensors.has_fix:
            return None
        fix = self.sensors.fix(moment, is_smooth=True)
        place = self._place(moment, fix.off_m)
        north, east, down = fix.velocity_mps
        return {
            "time_boot_ms": self.boot_ms,
            **place,
            "relative_alt": place["alt"] - round(self.vehicle.home.altitude_msl_m * 1e3),
            "vx": round(north * 1e2),
            "vy": round(east * 1e2),
            "vz": round(down * 1e2),
            "hdg": round(math.degrees(moment.attitude_rad[2]) * 1e2) % 36000,
        }

    def _gps_raw(self, moment: Moment) -> Values:
        if not self.sensors.has_fix:
            lost = dict.fromkeys(("lat", "lon", "alt", "satellites_visible", "alt_ellipsoid"), 0)
            return {"time_usec": self._unix_us, "fix_type": 1, **lost, **dict.fromkeys(_DILUTIONS, _UNKNOWN_16)}
        fix = self.sensors.fix(moment, is_smooth=False)
        place = self._place(moment, fix.off_m)
        north, east, _ = fix.velocity_mps
        errors = self.sensors.errors
        sigma_mm = round(1e3 * math.hypot(errors.slow_m, errors.position_m))
        return {
            "time_usec": self._unix_us,
            "fix_type": 3,
            **place,
            "eph": 80,
            "epv": 120,
            "vel": round(math.hypot(north, east) * 1e2),
            "cog": round(math.degrees(math.atan2(east, north)) * 1e2) % 36000,
            "satellites_visible": 14,
            "alt_ellipsoid": place["alt"] + round(self.vehicle.home.geoid_separation_m * 1e3),
            "h_acc": sigma_mm,
            "v_acc": round(1.5 * sigma_mm),
            "vel_acc": round(errors.velocity_mps * 1e3),
        }

    def _place(self, moment: Moment, off_m: tuple[float, float, float]) -> Values:
        north, east, down = off_m
        plane = self._plane
        latitude = moment.latitude_rad + north / plane.north_m
        longitude = moment.longitude_rad + east / plane.east_m
        return {
            "lat": round(math.degrees(latitude) * 1e7),
            "lon": round(math.degrees(longitude) * 1e7),
            "alt": round((self._altitude(moment) - down) * 1e3),
        }

    def _altitude(self, moment: Moment) -> float:
        return moment.height_m - self.vehicle.home.geoid_separation_m


_DILUTIONS = ("eph", "epv", "vel", "cog")
SAYS: Mapping[str, Callable[[Sayings, Moment], Values | None]] = {
    "HEARTBEAT": Sayings._heartbeat,
    "SYSTEM_TIME": Sayings._system_time,
    "SYS_STATUS": Sayings._sys_status,
    "EXTENDED_SYS_STATE": Sayings._extended,
    "HOME_POSITION": Sayings._home,
    "MISSION_CURRENT": Sayings._current,
    "NAV_CONTROLLER_OUTPUT": Sayings._navigation,
    "ATTITUDE": Sayings._attitude,
    "SIM_STATE": Sayings._sim_state,
    "HIGHRES_IMU": Sayings._highres,
    "RAW_IMU": Sayings._raw,
    "SCALED_PRESSURE": Sayings._pressure,
    "VFR_HUD": Sayings._hud,
    "WIND": Sayings._wind,
    "GLOBAL_POSITION_INT": Sayings._global_position,
    "GPS_RAW_INT": Sayings._gps_raw,
}
