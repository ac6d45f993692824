"""What an aircraft tells of the forces and rates that its inertial unit measures (HIGHRES_IMU), and of its airspeed (VFR_HUD).

The airspeed is the indicated one: in thin air less than the true one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import from_angles
from sim.inertial import Errors, Ride, measured, ride
from sim.sayings import Fields, Sayings, boot_s, ticks
from sim.scene import Aircraft, Scene
from sim.sensors import stream

Floats = NDArray[np.float64]

_UPDATED = 0b111111  # accelerations and rates
_THROTTLE = 50


def inertial_sayings(scene: Scene, aircraft: Aircraft) -> list[Sayings]:
    """HIGHRES_IMU and, of what has wings, VFR_HUD; nothing where the scene's units have no rate."""
    imu, (start, end) = scene.imu, scene.present(aircraft)
    if imu.rate_hz <= 0.0 or end - start < 2.0 / imu.rate_hz:
        return []
    generator = stream(scene.seed, "imu", aircraft.system)
    way = _ride(scene, aircraft, start + np.arange(int((end - start) * imu.rate_hz)) / imu.rate_hz)
    errors = Errors(imu.rate_bias_radps, imu.force_bias_mps2, imu.rate_noise_radps, imu.force_noise_mps2)
    rate, force = measured(way, errors, generator)
    middle_s = 0.5 * (way.time_s[1:] + way.time_s[:-1])

    def sample(index: int) -> Fields:
        return {
            "time_usec": round(boot_s(scene, aircraft, float(middle_s[index])) * 1e6),
            **dict(zip(("xacc", "yacc", "zacc"), force[index].tolist(), strict=True)),
            **dict(zip(("xgyro", "ygyro", "zgyro"), rate[index].tolist(), strict=True)),
            **dict.fromkeys(
                ("xmag", "ymag", "zmag", "abs_pressure", "diff_pressure", "pressure_alt", "temperature"), 0.0
            ),
            "fields_updated": _UPDATED,
        }

    samples = Sayings("HIGHRES_IMU", way.time_s[1:] + scene.say.latency_s, sample)
    return [samples, _hud(scene, aircraft, generator)] if aircraft.craft in ("aeroplane", "airliner") else [samples]


def _ride(scene: Scene, aircraft: Aircraft, time_s: Floats) -> Ride:
    """The way of an aircraft as its inertial unit feels it."""
    flown = scene.flown(aircraft, time_s)
    east, north, up = flown.velocity_mps.T
    attitude = from_angles(flown.roll_rad, flown.pitch_rad, flown.yaw_rad)
    begins = float(flown.latitude_rad[0]), float(flown.longitude_rad[0]), float(flown.height_m[0])
    return ride(time_s, np.stack([north, east, -up], axis=-1), attitude, begins, np.zeros((len(time_s), 2)))


def _hud(scene: Scene, aircraft: Aircraft, generator: np.random.Generator) -> Sayings:
    at_s = ticks(scene, aircraft, scene.imu.airspeed_period_s)
    flown = scene.flown(aircraft, at_s)
    thin = (
        1.0 - 2.255_77e-5 * flown.height_m
    ) ** 2.127_95  # root of the standard atmosphere's density against sea level
    indicated = np.maximum(
        flown.airspeed_mps * thin + scene.imu.airspeed_sigma_mps * generator.standard_normal(len(at_s)), 0.0
    )

    def fields(index: int) -> Fields:
        east, north, up = flown.velocity_mps[index]
        return {
            "airspeed": float(indicated[index]),
            "groundspeed": float(np.hypot(east, north)),
            "heading": round(float(np.degrees(flown.yaw_rad[index]))) % 360,
            "throttle": _THROTTLE,
            "alt": float(flown.height_m[index]) - scene.geoid_separation_m,
            "climb": float(up),
        }

    return Sayings("VFR_HUD", at_s + scene.say.latency_s, fields)
