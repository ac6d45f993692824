"""A sky full of aircraft that circle before the runway, as their telemetry and two radars tell of it, over UDP.

python -m bench.sky KIND AIRCRAFT SECONDS MAVLINK_PORT RADAR_PORT      prints, as JSON, what was sent, and how late

KIND `vehicles`: each tells its position 10 times a second (GLOBAL_POSITION_INT), and two radars plot all of them every
0.4 s, ten plots a datagram, as a beam that sweeps over them would. KIND `traffic`: a receiver tells of each once a second
(ADSB_VEHICLE). Everything is made before the first of it is sent.
"""

from __future__ import annotations

import json
import math
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adapters import landing_radar
from adapters.mavlink_frames import FrameEncoder
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.settings import DEMO_SITE, Site

SPACING_M, RADIUS_M, SPEED_MPS = 4000.0, 1500.0, 80.0
SCAN_S, PLOTS_A_DATAGRAM = 0.4, 10
POSITIONS_HZ = 10
GPS_SIGMA_M, RANGE_SIGMA_M, ANGLE_SIGMA_RAD = 1.5, 15.0, 0.001
MAKING_S = 2.5e-4  # for each datagram, and some seconds to start with: sending begins when all are made

SITE = replace(
    DEMO_SITE,
    radars=(
        *DEMO_SITE.radars,
        replace(DEMO_SITE.radars[0], number=2, along_m=-400.0, left_m=-300.0),
    ),
)
"""The demo's site with a second radar."""

Floats = NDArray[np.float64]
Datagram = tuple[float, str, bytes]  # s since the start, "mavlink" or "radar", bytes


class Sky:
    """Where everybody is: circles on a grid west of the runway, each at a height of its own."""

    def __init__(self, aircraft: int, site: Site = SITE) -> None:
        self.frame = RunwayFrame(site.runway)
        self.radars = {radar.number: RadarFrame.of(radar, self.frame) for radar in site.radars}
        self._geoid_m = site.runway.geoid_separation_m or 0.0
        rows = math.isqrt(aircraft - 1) + 1
        number = np.arange(aircraft)
        along, left = -6000.0 - SPACING_M * (number // rows), SPACING_M * (number % rows - 0.5 * (rows - 1))
        self._centre = np.stack([along, left, 800.0 + 7.0 * (number % 100)], axis=1)
        self._phase = number * 2.4
        self._random = np.random.default_rng(1)

    def place_m(self, number: int, second: float) -> Floats:
        """In the runway frame, (3,)."""
        angle = self._phase[number] + SPEED_MPS / RADIUS_M * second
        return np.asarray(self._centre[number] + [RADIUS_M * math.cos(angle), RADIUS_M * math.sin(angle), 0.0])

    def told(self, number: int, second: float) -> tuple[int, int, int, Floats]:
        """Latitude and longitude (1e-7 degrees), altitude (mm above mean sea level), velocity (m/s ENU)."""
        noise = self._random.normal(0.0, GPS_SIGMA_M, 3)
        latitude, longitude, height = self.frame.geodetic_from_runway(self.place_m(number, second) + noise)
        angle = self._phase[number] + SPEED_MPS / RADIUS_M * second
        velocity = self.frame.enu_from_runway @ [-SPEED_MPS * math.sin(angle), SPEED_MPS * math.cos(angle), 0.0]
        degrees = (round(math.degrees(float(one)) * 1e7) for one in (latitude, longitude))
        return (*degrees, round((float(height) - self._geoid_m) * 1e3), velocity)

    def plot(self, radar: int, number: int, second: float, time_ns: int) -> landing_radar.Plot:
        """What a radar measures of an aircraft; its track numbers are those of the aircraft, from 1."""
        enu = self.frame.enu_from_runway @ self.place_m(number, second)
        spread = (RANGE_SIGMA_M, ANGLE_SIGMA_RAD, ANGLE_SIGMA_RAD)
        polar = polar_from_xyz(self.radars[radar].from_enu(enu)) + self._random.normal(0.0, spread)
        angles = (math.degrees(math.remainder(float(angle), 2.0 * math.pi)) for angle in polar[1:])
        return landing_radar.Plot(number + 1, time_ns, float(polar[0]), *angles)


def vehicles(count: int, seconds: int, start_ns: int) -> Iterator[Datagram]:
    """What so many vehicles and two radars say."""
    sky, encoders = Sky(count), [FrameEncoder(number + 1) for number in range(count)]
    for tick in range(seconds * POSITIONS_HZ):
        for number, encoder in enumerate(encoders):
            second = (tick + number / count) / POSITIONS_HZ
            boot_ms = round((second + 100.0) * 1e3)
            if tick % POSITIONS_HZ == 0:
                usec = (start_ns + round(second * 1e9)) // 1000
                yield second, "mavlink", encoder.encode("SYSTEM_TIME", time_unix_usec=usec, time_boot_ms=boot_ms)
                yield (
                    second,
                    "mavlink",
                    encoder.encode(
                        "HEARTBEAT",
                        type=1,
                        autopilot=3,
                        base_mode=217,
                        custom_mode=10,
                        system_status=4,
                        mavlink_version=3,
                    ),
                )
            latitude, longitude, altitude, velocity = sky.told(number, second)
            east, north, up = (round(100.0 * float(part)) for part in velocity)
            yield second, "mavlink", encoder.encode(
                "GLOBAL_POSITION_INT", time_boot_ms=boot_ms, lat=latitude, lon=longitude, alt=altitude,
                relative_alt=altitude - 535_000, vx=north, vy=east, vz=-up, hdg=65535,
            )  # fmt: skip
    sequence = 0
    for scan in range(int(seconds / SCAN_S)):
        for first in range(0, count, PLOTS_A_DATAGRAM):
            second = (scan + (first + PLOTS_A_DATAGRAM) / count) * SCAN_S
            time_ns, sequence = start_ns + round(second * 1e9), sequence + 1
            some = range(first, min(first + PLOTS_A_DATAGRAM, count))
            for radar in sky.radars:
                header = landing_radar.Header("plots", radar, sequence, time_ns)
                plots = [sky.plot(radar, number, second, time_ns) for number in some]
                yield second, "radar", landing_radar.encode(header, plots)


def traffic(count: int, seconds: int, start_ns: int) -> Iterator[Datagram]:
    """What a receiver says of so many aircraft."""
    sky, receiver = Sky(count), FrameEncoder(1)
    for second in range(seconds):
        usec = start_ns // 1000 + second * 1_000_000
        yield (
            second,
            "mavlink",
            receiver.encode("SYSTEM_TIME", time_unix_usec=usec, time_boot_ms=100_000 + second * 1000),
        )
        for number in range(count):
            when = second + number / count
            latitude, longitude, altitude, (east, north, _) = sky.told(number, when)
            course = round(100.0 * math.degrees(math.atan2(east, north))) % 36000
            yield when, "mavlink", receiver.encode(
                "ADSB_VEHICLE", ICAO_address=0x400000 + number, lat=latitude, lon=longitude, altitude_type=1,
                altitude=altitude - 35_000, heading=course, hor_velocity=round(100.0 * math.hypot(east, north)),
                ver_velocity=0, callsign=f"T{number}".encode(), emitter_type=1, tslc=0, flags=159, squawk=0,
            )  # fmt: skip


KINDS = {"vehicles": vehicles, "traffic": traffic}


def send(kind: str, aircraft: int, seconds: int, ports: dict[str, int]) -> dict[str, float]:
    """Make and send everything; what was sent, and by how much the latest datagram was late."""
    each = 16 if kind == "vehicles" else 1
    start_ns = time.time_ns() + round((2.0 + MAKING_S * each * aircraft * seconds) * 1e9)
    datagrams = sorted(KINDS[kind](aircraft, seconds, start_ns), key=lambda one: one[0])
    sockets = {name: socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for name in ports}
    for name, port in ports.items():
        sockets[name].connect(("127.0.0.1", port))
    late_s = 0.0
    for second, name, data in datagrams:
        wait_s = 1e-9 * (start_ns - time.time_ns()) + second
        if wait_s > 1e-4:
            time.sleep(wait_s)
        late_s = max(late_s, -wait_s)
        sockets[name].send(data)
    return {"sent": len(datagrams), "latest_s": late_s}


if __name__ == "__main__":
    _mavlink, _radar = (int(word) for word in sys.argv[4:6])
    print(json.dumps(send(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), {"mavlink": _mavlink, "radar": _radar})))
