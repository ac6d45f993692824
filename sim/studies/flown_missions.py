"""Missions drawn at random and flown in closed loop: aeroplanes, multirotors, helicopters and ships, as a gateway hears them.

Each has a speed, a wind with gusts, corners, legs and a way to end of its own, and tells what real ones tell over MAVLink, as
often as recordings do or a little less. The wind that it tells is one that it works out, since nobody measures it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mission_writing import LAND, TAKE_OFF, WAYPOINT, MissionItem
from gateway.align import SECOND
from gateway.observation import Heard
from gateway.settings import DEMO_SITE
from sim.scene import STAMP_STEP_NS
from sim.ships.fitting_out import vessel
from sim.vehicles.aeroplane import AeroplaneParameters
from sim.vehicles.flying import HELICOPTER, QUADROTOR, aeroplane, rotorcraft
from sim.vehicles.motion import Arm, ChangeSpeed, Home, SetMode, Vehicle
from sim.vehicles.recording import Station, is_done
from sim.vehicles.rotorcraft import HELI, RotorcraftParameters
from sim.vehicles.sayings import Values
from sim.vehicles.speaking import Speaker, sensors_of
from sim.vehicles.steering import Plane
from sim.vehicles.wind import WindParameters

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STARTS = 1_767_225_600 * SECOND
KINDS = ("aeroplane", "aeroplane", "copter", "aeroplane", "ship", "aeroplane", "helicopter", "aeroplane")  # and anew
APART_M = 3_000.0  # homes, on a line: nobody is far from the middle of the frame
RATES_HZ = {
    **{"HEARTBEAT": 1.0, "SYSTEM_TIME": 1.0, "HOME_POSITION": 0.2, "MISSION_CURRENT": 1.0, "VFR_HUD": 1.0},
    **{"GLOBAL_POSITION_INT": 4.0, "GPS_RAW_INT": 1.0, "EXTENDED_SYS_STATE": 1.0},
}
TRUTH_EVERY_S = 0.26
AIR_SPEED_ERROR, COMPASS_ERROR_RAD = 0.02, math.radians(2.0)  # of an instrument, one standard deviation
WIND_LEARNT_S, WIND_TOLD_S = 60.0, 1.0


@dataclass(frozen=True, slots=True)
class FlownMission:
    """What one vehicle was, when its way was recorded (t,) ns, and where it was: latitude, longitude rad, height m (t,)."""

    aircraft: str
    kind: str
    time: Ints
    latitude: Floats
    longitude: Floats
    height: Floats


@dataclass(slots=True)
class _Wind:
    """The wind that an aeroplane works out: what its speed over the ground has more than the one through the air, slowly."""

    draws: np.random.Generator
    _at: tuple[float, float] | None = None
    _off: tuple[float, float] = field(init=False)

    def __post_init__(self) -> None:
        speed, compass = self.draws.standard_normal(2).tolist()
        self._off = 1.0 + AIR_SPEED_ERROR * speed, COMPASS_ERROR_RAD * compass

    def told(self, vehicle: Vehicle) -> Values | None:
        """WIND, a second after the last."""
        moment = vehicle.moment
        if moment.airspeed_mps is None or vehicle.is_landed:
            return None
        north, east, _ = moment.velocity_mps
        yaw, through = moment.attitude_rad[2] + self._off[1], moment.airspeed_mps * self._off[0]
        blows = north - through * math.cos(yaw), east - through * math.sin(yaw)
        if self._at is None:
            self._at = blows
        gain = WIND_TOLD_S / WIND_LEARNT_S
        north, east = (before + gain * (now - before) for before, now in zip(self._at, blows, strict=True))
        self._at = north, east
        direction = math.degrees(math.atan2(-east, -north))
        return {"direction": direction, "speed": math.hypot(north, east), "speed_z": 0.0}


def fly(count: int, longest_s: float, seed: int) -> tuple[list[FlownMission], list[Heard]]:
    """Some vehicles' missions, drawn with a seed and flown until done or so long; and all that a gateway hears of them."""
    arrivals: list[Arrival] = []
    flown = []
    for number in range(1, count + 1):
        kind, speaker, wind = _drawn(number, seed)
        mission, said = _flown(number, kind, speaker, wind, longest_s)
        flown.append(mission)
        arrivals += said
    decoder = Decoder(
        [Source(number, "mavlink", f"mavlink-{number}", "simulated vehicle") for number in range(1, count + 1)]
    )
    heard = (decoder.hear(one) for one in sorted(arrivals))
    return flown, [one for one in heard if one is not None]


def _drawn(number: int, seed: int) -> tuple[str, Speaker, _Wind]:
    """One vehicle that has just begun its mission."""
    kind, draws = KINDS[(number - 1) % len(KINDS)], np.random.default_rng([seed, number])
    speed = _speed_mps(kind, draws)
    vehicle = _vehicle(kind, speed, number, seed, draws)
    speaker = Speaker.of(number, vehicle, sensors_of(seed, number), STARTS, tells_truth=False)
    teller = speaker.answerer.teller
    for name in ("SYS_STATUS", "NAV_CONTROLLER_OUTPUT", "ATTITUDE", "HIGHRES_IMU", "SCALED_PRESSURE", "WIND"):
        teller.set_interval(name, None)
    for name, rate in RATES_HZ.items():
        teller.set_interval(name, 1.0 / rate)
    return kind, speaker, _Wind(draws)


def _speed_mps(kind: str, draws: np.random.Generator) -> float:
    least, most = {"aeroplane": (17.0, 35.0), "copter": (6.0, 14.0), "helicopter": (15.0, 30.0), "ship": (5.0, 10.0)}[
        kind
    ]
    return float(draws.uniform(least, most))


def _vehicle(kind: str, speed: float, number: int, seed: int, draws: np.random.Generator) -> Vehicle:
    runway = DEMO_SITE.runway
    base = Home(runway.latitude_rad, runway.longitude_rad, runway.height_m, 0.0, runway.geoid_separation_m or 0.0)
    home = Plane.about(base).beside(base, APART_M * number)
    heading = float(draws.uniform(0.0, 2.0 * math.pi))
    home = Home(home.latitude_rad, home.longitude_rad, home.height_m, heading, home.geoid_separation_m)
    items = _items(kind, home, speed, draws)
    gusts = float(draws.uniform(0.2, 1.5)), float(draws.uniform(100.0, 400.0))
    wind = WindParameters(float(draws.uniform(0.0, 0.3)) * min(speed, 25.0), float(draws.uniform(0.0, 6.28)), *gusts)
    if kind == "ship":
        ship = vessel(home, items, seed=seed, system=number)
        ship.order(ChangeSpeed(speed))
        ship.get_under_way()
        return ship
    if kind == "aeroplane":
        like = AeroplaneParameters(speed, 0.68 * speed, 1.45 * speed, 0.82 * speed)
        flyer = aeroplane(home, items, parameters=like, wind=wind, seed=seed, system=number)
        flyer.settings["WP_RADIUS"] = round(float(draws.uniform(1.0, 2.5)) * speed)
        flyer.settings["NAVL1_PERIOD"] = round(float(draws.uniform(12.0, 20.0)))
    else:
        like_rotor = HELI if kind == "helicopter" else RotorcraftParameters()
        craft = HELICOPTER if kind == "helicopter" else QUADROTOR
        flyer = rotorcraft(home, items, parameters=like_rotor, kind=craft, wind=wind, seed=seed, system=number)
        flyer.order(ChangeSpeed(speed))
    flyer.order(Arm(True))
    flyer.order(SetMode("AUTO"))
    return flyer


def _items(kind: str, home: Home, speed: float, draws: np.random.Generator) -> tuple[MissionItem, ...]:
    """Legs of half a minute to two, corners of up to 120 degrees; a landing, or an end on the way."""
    plane = Plane.about(home)
    slowly = 3.0 if kind == "ship" else 1.0
    north, east, course = 0.0, 0.0, home.heading_rad
    height = 0.0 if kind == "ship" else float(draws.uniform(80.0, 200.0))

    def item(command: int, up: float, *parameters: float) -> MissionItem:
        latitude, longitude = home.latitude_rad + north / plane.north_m, home.longitude_rad + east / plane.east_m
        four = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
        return MissionItem(
            command,
            math.degrees(latitude),
            math.degrees(longitude),
            up,
            parameters=(four[0], four[1], four[2], four[3]),
        )

    def go(seconds: float) -> None:
        nonlocal north, east
        north, east = north + seconds * speed * math.cos(course), east + seconds * speed * math.sin(course)

    items = [] if kind == "ship" else [MissionItem(TAKE_OFF, altitude_m=0.4 * height)]
    for leg in range(int(draws.integers(5, 9))):
        course += 0.0 if leg == 0 else float(draws.uniform(-1.0, 1.0)) * math.radians(120.0)
        go(slowly * float(draws.uniform(30.0, 120.0)))
        items.append(item(WAYPOINT, height))
    if kind != "ship" and draws.random() < 0.6:
        course += float(draws.uniform(-1.0, 1.0)) * math.radians(60.0)
        go(30.0)
        items.append(item(WAYPOINT, height))
        go(height / (0.06 * speed))
        items.append(item(LAND, 0.0))
    return tuple(items)


def _flown(
    number: int, kind: str, speaker: Speaker, wind: _Wind, longest_s: float
) -> tuple[FlownMission, list[Arrival]]:
    vehicle, station = speaker.vehicle, Station(speaker)
    began, last = STARTS + number * 1000, 0
    said: list[Arrival] = []
    truth: list[tuple[float, ...]] = []
    wind_s, truth_s = 0.0, 0.0
    while (now_s := vehicle.moment.time_s) < longest_s and not (now_s > 10.0 and is_done(speaker)):
        moment = vehicle.step()
        at = began + round(moment.time_s * 1e9)
        frames = [*speaker.say(at), *station.exchange(at)]
        if moment.time_s >= wind_s:
            wind_s += WIND_TOLD_S
            told = wind.told(vehicle)
            frames += [] if told is None else [speaker.encoder.encode("WIND", **told)]
        if moment.time_s >= truth_s:
            truth_s += TRUTH_EVERY_S
            truth.append((at, moment.latitude_rad, moment.longitude_rad, moment.height_m))
        for frame in frames:
            last = max(at // STAMP_STEP_NS * STAMP_STEP_NS, last + STAMP_STEP_NS)
            said.append(Arrival(last, number, frame))
    times = np.array([int(row[0]) for row in truth], dtype=np.int64)
    places = np.array([row[1:] for row in truth])
    return FlownMission(f"mavlink:{number}", kind, times, *places.T), said
