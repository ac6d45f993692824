"""Places about one home, and missions there."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from adapters.mission_writing import MissionItem
from sim.vehicles.motion import Arm, Home, SetMode, Vehicle
from sim.vehicles.steering import Plane

Place = Callable[..., MissionItem]


@pytest.fixture
def home() -> Home:
    """A field, pointing to the north, with the geoid 48 m above the ellipsoid."""
    return Home(math.radians(47.4), math.radians(8.5), 500.0, 0.0, 48.0)


@pytest.fixture
def place(home: Home) -> Place:
    """An item so many metres north and east of home, and above it."""
    plane = Plane.about(home)

    def made(north_m: float, east_m: float, above_m: float, command: int = 16, *parameters: float) -> MissionItem:
        latitude, longitude = home.latitude_rad + north_m / plane.north_m, home.longitude_rad + east_m / plane.east_m
        told = (*parameters, 0.0, 0.0, 0.0, 0.0)[:4]
        return MissionItem(command, math.degrees(latitude), math.degrees(longitude), above_m, 3, told)

    return made


@pytest.fixture
def begin() -> Callable[[Vehicle], None]:
    """Arm a vehicle and start its mission."""

    def start(vehicle: Vehicle) -> None:
        for order in (Arm(True), SetMode("AUTO")):
            assert vehicle.order(order).result == "accepted"

    return start
