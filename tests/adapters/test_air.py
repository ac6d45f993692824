"""What vehicles say of the air: speeds, pressures, and winds by where they blow to."""

import math
from typing import Any

import pytest

from gateway.observation import AirData


def test_the_displays_numbers_are_what_they_are(plane: Any) -> None:
    air = plane.one("VFR_HUD", airspeed=22.5, groundspeed=25.0, alt=584.5, climb=-1.5, heading=90, throttle=50)
    assert isinstance(air, AirData)
    assert (air.airspeed_mps, air.groundspeed_mps, air.climb_mps, air.altitude_msl_m) == (22.5, 25.0, -1.5, 584.5)
    assert air.compass_heading_rad == pytest.approx(math.pi / 2.0)
    assert air.wind_east_mps is air.static_pressure_pa is None
    assert air.received_at - air.valid_at <= 1_000_000_000, "it holds at its receipt"
    assert plane.health().readings["airspeed, m/s"] == 22.5
    assert plane.health().readings["climb, m/s"] == -1.5


@pytest.mark.parametrize(
    ("values", "field", "reason"),
    [
        ({"airspeed": math.nan}, "airspeed_mps", "not a number"),
        ({"airspeed": -1.0}, "airspeed_mps", "air data out of range"),
        ({"groundspeed": math.inf}, "groundspeed_mps", "air data out of range"),
        ({"climb": 1e9}, "climb_mps", "air data out of range"),
        ({"alt": 1e6}, "altitude_msl_m", "air data out of range"),
    ],
)
def test_a_number_that_cannot_be_is_left_out_and_counted(
    plane: Any, values: dict[str, float], field: str, reason: str
) -> None:
    air = plane.one("VFR_HUD", **values)
    names = ("airspeed_mps", "groundspeed_mps", "climb_mps", "altitude_msl_m")
    assert [name for name in names if getattr(air, name) is None] == [field]
    assert plane.counter(reason) == 1


def test_a_heading_that_nobody_knows_is_none(plane: Any) -> None:
    assert plane.one("VFR_HUD", airspeed=22.5, heading=-1).compass_heading_rad is None


def test_a_display_without_numbers_says_nothing(plane: Any) -> None:
    assert plane.say("VFR_HUD", **dict.fromkeys(("airspeed", "groundspeed", "alt", "climb"), math.nan)) == ()


def test_pressures_become_pascals_and_kelvins(plane: Any) -> None:
    plane.second += 0.5
    air = plane.one(
        "SCALED_PRESSURE", time_boot_ms=plane.boot_ms - 300, press_abs=945.5, press_diff=3.25, temperature=-1250
    )
    assert (air.static_pressure_pa, air.differential_pressure_pa, air.temperature_k) == (94_550.0, 325.0, 260.65)
    assert air.received_at - air.valid_at == pytest.approx(3e8, abs=2e6)
    assert plane.health().readings["static pressure, hPa"] == 945.5


@pytest.mark.parametrize("pressure", [0.0, -5.0, math.nan, 5000.0])
def test_a_pressure_that_cannot_be_is_left_out(plane: Any, pressure: float) -> None:
    air = plane.one("SCALED_PRESSURE", time_boot_ms=plane.boot_ms, press_abs=pressure, press_diff=1.0)
    assert (air.static_pressure_pa, air.differential_pressure_pa) == (None, 100.0)


@pytest.mark.parametrize(
    ("direction", "east", "north"), [(0, 0, -8), (90, -8, 0), (180, 0, 8), (-90, 8, 0)], ids=["N", "E", "S", "W"]
)
def test_a_wind_from_the_north_blows_to_the_south(plane: Any, direction: float, east: float, north: float) -> None:
    """speed_z is down: a sinking wind has wind_up below 0."""
    air = plane.one("WIND", direction=direction, speed=8.0, speed_z=0.5)
    assert (air.wind_east_mps, air.wind_north_mps) == (pytest.approx(east, abs=1e-9), pytest.approx(north, abs=1e-9))
    assert air.wind_up_mps == -0.5
    assert plane.health().readings["wind from, degrees"] == pytest.approx(direction % 360)
    assert plane.health().readings["wind, m/s"] == pytest.approx(8.0)


def test_wind_components_point_where_the_air_goes(plane: Any) -> None:
    air = plane.one("WIND_COV", time_usec=plane.boot_ms * 1000, wind_x=3.0, wind_y=-4.0, wind_z=0.25)
    assert (air.wind_north_mps, air.wind_east_mps, air.wind_up_mps) == (3.0, -4.0, -0.25)
    assert plane.health().readings["wind from, degrees"] == pytest.approx(126.87, abs=0.01)


def test_a_wind_that_is_not_known_is_none(plane: Any) -> None:
    assert plane.say("WIND_COV", wind_x=math.nan, wind_y=1.0) == ()
    assert plane.counter("not a number") == 0, "that is how it is told"
    assert plane.one("WIND_COV", wind_x=1.0, wind_y=1.0, wind_z=math.nan).wind_up_mps is None


@pytest.mark.parametrize("values", [{"speed": math.nan}, {"speed": 500.0}, {"speed": -1.0}, {"direction": math.nan}])
def test_a_wind_that_cannot_be_is_refused(plane: Any, values: dict[str, float]) -> None:
    assert plane.say("WIND", **values) == ()
    assert plane.counter("not a number") + plane.counter("air data out of range") == 1
