"""What a simulated aircraft says on its MAVLink link, frame by frame, in order of arrival.

HEARTBEAT, SYSTEM_TIME, ATTITUDE and SIM_STATE (the truth) are said at their periods, HIGHRES_IMU and VFR_HUD by aircraft
with an inertial unit; GPS_RAW_INT and
GLOBAL_POSITION_INT carry the time at which the position was so, and arrive as late as the position source is.
A source that gives positions only sends no GLOBAL_POSITION_INT: that message has no way to leave the velocity
out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from adapters.mavlink_frames import FrameEncoder
from gateway.estimators.inertial import from_angles
from gateway.geodesy import wrap_rad
from sim.earth import Flown
from sim.faulty_sensors import faulty_gps, gps_sigma_m
from sim.inertial_sayings import inertial_sayings
from sim.mission_sayings import mission_sayings
from sim.sayings import Fields, Sayings, boot_s, ticks
from sim.scene import Aircraft, Scene
from sim.sensors import GpsMeasured, GpsParameters, gps_phases, gps_times, measure_gps, stream

Floats = NDArray[np.float64]

_TYPES = {"aeroplane": 1, "airliner": 1, "copter": 2, "helicopter": 4, "ship": 11}
_AUTO_MODES = {"aeroplane": 10, "airliner": 10, "copter": 3, "helicopter": 3, "ship": 10}
_ARDUPILOT = 3
_ARMED_AUTO, _DISARMED, _ACTIVE, _STANDBY = 0x9D, 0x1D, 4, 3
_NO_FIX, _FIX_3D = 1, 3
_UNKNOWN_16 = 65535


def frames(scene: Scene, aircraft: Aircraft) -> Iterator[tuple[float, bytes]]:
    """Arrival times (s of the scene, never falling) and frames of one aircraft."""
    start, end = scene.present(aircraft)
    if end <= start:
        return
    sayings = [
        _heartbeats(scene, aircraft),
        _clocks(scene, aircraft),
        _attitudes(scene, aircraft),
        *_truths(scene, aircraft),
        *_positions(scene, aircraft),
        *inertial_sayings(scene, aircraft),
        *mission_sayings(scene, aircraft),
    ]
    arrives = np.concatenate([one.arrives_s for one in sayings])
    which = np.repeat(np.arange(len(sayings)), [len(one.arrives_s) for one in sayings])
    index = np.concatenate([np.arange(len(one.arrives_s)) for one in sayings])
    encoder = FrameEncoder(aircraft.system)
    # a stable sort: said at one instant means said in the order of the list, truth right after attitude
    for place in np.argsort(arrives, kind="stable"):
        if arrives[place] < scene.duration_s:
            saying = sayings[which[place]]
            yield float(arrives[place]), encoder.encode(saying.name, **saying.fields(int(index[place])))


def _boot_ms(scene: Scene, aircraft: Aircraft, time_s: float) -> int:
    return round(boot_s(scene, aircraft, time_s) * 1000.0)


def _heartbeats(scene: Scene, aircraft: Aircraft) -> Sayings:
    at_s = ticks(scene, aircraft, scene.say.heartbeat_period_s)
    moves = np.hypot(*scene.flown(aircraft, at_s).velocity_mps[:, :2].T) > 0.0

    def fields(index: int) -> Fields:
        return {
            "type": _TYPES[aircraft.craft],
            "autopilot": _ARDUPILOT,
            "base_mode": _ARMED_AUTO if moves[index] else _DISARMED,
            "custom_mode": _AUTO_MODES[aircraft.craft],
            "system_status": _ACTIVE if moves[index] else _STANDBY,
            "mavlink_version": 3,
        }

    return Sayings("HEARTBEAT", at_s + scene.say.latency_s, fields)


def _clocks(scene: Scene, aircraft: Aircraft) -> Sayings:
    at_s = ticks(scene, aircraft, scene.say.clock_period_s)

    def fields(index: int) -> Fields:
        time_s = float(at_s[index])
        return {
            "time_unix_usec": scene.told_ns(aircraft.name, time_s) // 1000,
            "time_boot_ms": _boot_ms(scene, aircraft, time_s),
        }

    return Sayings("SYSTEM_TIME", at_s + scene.say.latency_s, fields)


def _attitudes(scene: Scene, aircraft: Aircraft) -> Sayings:
    at_s = ticks(scene, aircraft, scene.say.attitude_period_s)
    flown = scene.flown(aircraft, at_s)
    yaw = wrap_rad(flown.yaw_rad)

    def fields(index: int) -> Fields:
        return {
            "time_boot_ms": _boot_ms(scene, aircraft, float(at_s[index])),
            "roll": float(flown.roll_rad[index]),
            "pitch": float(flown.pitch_rad[index]),
            "yaw": float(yaw[index]),
            "rollspeed": 0.0,
            "pitchspeed": 0.0,
            "yawspeed": float(flown.turn_radps[index]),
        }

    return Sayings("ATTITUDE", at_s + scene.say.latency_s, fields)


def _truths(scene: Scene, aircraft: Aircraft) -> list[Sayings]:
    """SIM_STATE has no time of its own: it is said at once, at the times of attitudes where the periods allow."""
    if scene.say.truth_period_s <= 0.0:
        return []
    at_s = ticks(scene, aircraft, scene.say.truth_period_s)
    flown = scene.flown(aircraft, at_s)
    stands = from_angles(flown.roll_rad, flown.pitch_rad, flown.yaw_rad)
    return [
        Sayings("SIM_STATE", at_s + scene.say.latency_s, lambda index: _sim_state(scene, flown, stands[index], index))
    ]


def _sim_state(scene: Scene, flown: Flown, attitude: Floats, index: int) -> Fields:
    roll, pitch, yaw = (float(angle[index]) for angle in (flown.roll_rad, flown.pitch_rad, flown.yaw_rad))
    latitude_deg, longitude_deg = math.degrees(flown.latitude_rad[index]), math.degrees(flown.longitude_rad[index])
    east, north, up = (float(part) for part in flown.velocity_mps[index])
    return {
        **dict(zip(("q1", "q2", "q3", "q4"), attitude.tolist(), strict=True)),
        **{"roll": roll, "pitch": pitch, "yaw": yaw},
        **dict.fromkeys(("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro"), 0.0),
        "lat": latitude_deg,
        "lon": longitude_deg,
        "alt": float(flown.height_m[index]) - scene.geoid_separation_m,
        "std_dev_horz": 0.0,
        "std_dev_vert": 0.0,
        "vn": north,
        "ve": east,
        "vd": -up,
        "lat_int": round(latitude_deg * 1e7),
        "lon_int": round(longitude_deg * 1e7),
    }


def reports(scene: Scene, aircraft: Aircraft) -> GpsMeasured:
    """Every report of an aircraft's position source, also those that will not be heard."""
    start, end = scene.present(aircraft)
    generator = stream(scene.seed, "gps", aircraft.system)
    gps, faults = aircraft.gps or scene.gps, scene.faults_of(aircraft.name)
    valid = gps_times(gps, start, end, gps_phases(gps, generator))
    sigma_m = gps_sigma_m(faults, gps.sigma_m, valid)
    return faulty_gps(faults, measure_gps(gps, valid, scene.flown(aircraft, valid), generator, sigma_m))


def _positions(scene: Scene, aircraft: Aircraft) -> list[Sayings]:
    measured, gps = reports(scene, aircraft), aircraft.gps or scene.gps
    heard = np.flatnonzero(measured.heard)
    known = np.flatnonzero(measured.heard & measured.fix)
    yaw = scene.flown(aircraft, measured.valid_s).yaw_rad

    def raw(index: int) -> Fields:
        which = int(heard[index])
        return _gps_raw(scene, gps, measured, which, boot_s(scene, aircraft, float(measured.valid_s[which])))

    said = Sayings("GPS_RAW_INT", measured.received_s[heard], raw)
    if not gps.velocity:
        return [said]

    def fields(index: int) -> Fields:
        which = int(known[index])
        boot_ms = _boot_ms(scene, aircraft, float(measured.valid_s[which]))
        return _global_position(scene, measured, which, boot_ms, float(yaw[which]))

    # in this order a receiver knows, when the raw fix comes, that it already has the autopilot's own estimate
    return [Sayings("GLOBAL_POSITION_INT", measured.received_s[known], fields), said]


def _place(scene: Scene, measured: GpsMeasured, index: int) -> Fields:
    return {
        "lat": round(math.degrees(measured.latitude_rad[index]) * 1e7),
        "lon": round(math.degrees(measured.longitude_rad[index]) * 1e7),
        "alt": round((float(measured.height_m[index]) - scene.geoid_separation_m) * 1e3),
    }


def _gps_raw(scene: Scene, gps: GpsParameters, measured: GpsMeasured, index: int, at_boot_s: float) -> Fields:
    (east, north, _), fix = measured.velocity_mps[index], bool(measured.fix[index])
    moves = gps.velocity and fix
    ground_cmps = round(math.hypot(east, north) * 1e2) if moves else _UNKNOWN_16
    course_cdeg = round(math.degrees(math.atan2(east, north)) % 360.0 * 1e2) % 36000 if moves else _UNKNOWN_16
    sigma_mm = round(gps.sigma_m * 1e3) if gps.accuracy_given else 0
    return {
        "time_usec": round(at_boot_s * 1e6),  # as autopilots tell it, though the message would allow UTC
        "fix_type": _FIX_3D if fix else _NO_FIX,
        **_place(scene, measured, index),
        "eph": 80 if fix else _UNKNOWN_16,
        "epv": 120 if fix else _UNKNOWN_16,
        "vel": ground_cmps,
        "cog": course_cdeg,
        "satellites_visible": 12 if fix else 2,
        "alt_ellipsoid": round(float(measured.height_m[index]) * 1e3),
        "h_acc": sigma_mm,
        "v_acc": sigma_mm,
        "vel_acc": round(gps.velocity_sigma_mps * 1e3) if gps.accuracy_given and gps.velocity else 0,
    }


def _global_position(scene: Scene, measured: GpsMeasured, index: int, boot_ms: int, yaw_rad: float) -> Fields:
    east, north, up = measured.velocity_mps[index]
    place = _place(scene, measured, index)
    ground_mm = round((scene.site.runway.height_m - scene.geoid_separation_m) * 1e3)
    return {
        "time_boot_ms": boot_ms,
        **place,
        "relative_alt": place["alt"] - ground_mm,
        "vx": round(north * 1e2),
        "vy": round(east * 1e2),
        "vz": round(-up * 1e2),
        "hdg": round(math.degrees(yaw_rad) % 360.0 * 1e2) % 36000,
    }
