"""Flights rebuilt from what an aircraft said: gathered, cut into sorties, closed, compared."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from gateway.estimators.flight_path import standard_pressure
from gateway.observation import AirData, Attitude, GpsReport, Observation
from gateway.offline.ends import Unplaced, Unreachable, closing, roll_along
from gateway.offline.parameters import Flown, Parameters
from gateway.offline.reconstruction import How, Sortie, reconstructed
from gateway.settings import Runway

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
LIFT_OFF = (math.radians(47.0), math.radians(8.0))
WIND = (4.0, -3.0)
METRES_A_RADIAN = 6_371_000.0


def _said(*, positions: bool = True, pressure: bool = True, circles: int = 2) -> Iterator[Observation]:
    """A minute on the ground, circles at 25 m/s in a wind at 300 m above sea level, a minute on the ground; 5 Hz."""
    east = north = 0.0
    flying_s = 200.0 * circles
    for tick in range(round((120.0 + flying_s) * 5.0)):
        second = tick / 5.0 - 60.0
        at = START + tick * SECOND // 5
        flying = 0.0 <= second < flying_s
        heading = 2.0 * math.pi * second / 200.0 if flying else 0.0
        speed = 25.0 if flying else 0.0
        high = 300.0 + (50.0 * math.sin(math.pi * second / flying_s) if flying else 0.0)
        pascal = float(standard_pressure(high))
        calibrated = speed * math.sqrt(pascal / 101_325.0 * 288.15 / (288.15 - 0.0065 * high))
        yield AirData("mavlink:1", at, at, airspeed_mps=calibrated, static_pressure_pa=pascal if pressure else None)
        yield Attitude("mavlink:1", at, at, 0.3, 0.0, (heading + math.pi) % (2.0 * math.pi) - math.pi)
        if positions and tick % 5 == 0:
            place = LIFT_OFF[0] + north / METRES_A_RADIAN, LIFT_OFF[1] + east / METRES_A_RADIAN / math.cos(LIFT_OFF[0])
            yield GpsReport("mavlink:1", at, at, *place, altitude_msl_m=high)
        if flying:
            east += 0.2 * (speed * math.sin(heading) + WIND[0])
            north += 0.2 * (speed * math.cos(heading) + WIND[1])


def _gathered(**changes: bool | int) -> Parameters:
    parameters = Parameters()
    for observation in _said(**changes):  # type: ignore[arg-type]
        parameters.take(observation)
    return parameters


def _only(parameters: Parameters, how: How) -> Sortie:
    (sortie,) = reconstructed(parameters, how)
    return sortie


def _end() -> tuple[float, float]:
    """Where it touches down: the wind has carried it for 400 s."""
    north, east = WIND[1] * 400.0, WIND[0] * 400.0
    return LIFT_OFF[0] + north / METRES_A_RADIAN, LIFT_OFF[1] + east / METRES_A_RADIAN / math.cos(LIFT_OFF[0])


def test_closed_on_its_end_it_is_where_the_positions_were_and_tells_the_wind() -> None:
    """Within 10 m of 10 km (the positions stand on a sphere); through the air alone it is more than a kilometre off."""
    sortie = _only(_gathered(), How(close_on=_end()))
    assert sortie.compared is not None
    assert sortie.took_off
    assert sortie.landed
    assert sortie.compared.rmse_m < 10.0
    assert sortie.compared.open_rmse_m > 1000.0
    assert sortie.end_error_m == pytest.approx(math.hypot(*WIND) * 400.0, rel=0.02)
    np.testing.assert_allclose(sortie.wind_mps.mean(axis=0), WIND, atol=0.1)
    assert sortie.duration_s == pytest.approx(400.0, abs=3.0)
    assert sortie.height_by == "pressure"
    assert sortie.compared.height_rmse_m < 1.0


def test_positions_tie_the_path_where_they_are_not_muted() -> None:
    """With two minutes of positions at either end the rest is found; the places that are muted tie nothing."""
    muted = ((START + 120 * SECOND, START + 400 * SECOND),)
    sortie = _only(_gathered(), How(close_on="nothing", fixes=True, muted=muted))
    assert sortie.compared is not None
    assert 100 <= sortie.fixes <= 130
    assert sortie.compared.rmse_m < 10.0
    assert np.isfinite(sortie.sigma_m).all()


def test_a_recording_that_stops_in_the_air_is_not_closed() -> None:
    """Where it would have landed nobody knows."""
    parameters = Parameters()
    for observation in _said():
        if observation.valid_at < START + 300 * SECOND:
            parameters.take(observation)
    sortie = _only(parameters, How())
    assert not sortie.landed
    assert math.isnan(sortie.end_error_m)
    assert np.isnan(sortie.wind_mps).all()


def test_without_positions_the_path_is_in_metres_from_lift_off() -> None:
    """It is closed on lift-off all the same; on a place on earth it cannot be."""
    sortie = _only(_gathered(positions=False), How())
    assert sortie.lift_off is None
    assert sortie.geodetic_deg is None
    assert sortie.compared is None
    assert np.abs(sortie.path_m[-1]).max() < 1e-6
    with pytest.raises(Unplaced):
        reconstructed(_gathered(positions=False), How(close_on=_end()))
    told = _only(_gathered(positions=False), How(lift_off=LIFT_OFF, close_on=_end()))
    assert told.geodetic_deg is not None
    np.testing.assert_allclose(np.radians(told.geodetic_deg[-1]), _end(), atol=1e-8)


def test_a_flight_that_lands_elsewhere_is_closed_on_where_positions_say_it_touched_down() -> None:
    """Unless lift-off was asked for; either way a sentence says how far away it was. Beside its lift-off that is no matter."""
    told = _only(_gathered(), How())
    assert told.compared is not None
    assert told.closed_on == "touchdown"
    assert told.compared.rmse_m < 10.0
    assert "touched down 2.0 km from where it lifted off: the path is closed on where" in told.doubts[0]
    asked = _only(_gathered(), How(close_on="lift-off"))
    assert np.abs(asked.path_m[-1]).max() < 1e-6
    assert "touched down 2.0 km from where it lifted off, and the path is closed on lift-off" in asked.doubts[0]
    circle = np.array([[0.0, 0.0], [5000.0, 0.0], [0.0, 10.0]])
    beside = LIFT_OFF[0] + 290.0 / METRES_A_RADIAN, LIFT_OFF[1]
    near = closing(None, circle, 400.0, LIFT_OFF, beside)
    assert (near.on, near.doubt) == ("lift-off", None)


def test_closing_that_takes_a_way_for_wind_is_doubted() -> None:
    """Straight on at 25 m/s and no position at the end; a path that returns half of its way is not."""
    straight = closing(None, np.array([[0.0, 0.0], [10_000.0, 0.0]]), 400.0, LIFT_OFF, None)
    assert straight.doubt is not None
    assert "a wind of 25 m/s at an airspeed of 25 m/s: it probably ended elsewhere" in straight.doubt
    assert closing(None, np.array([[0.0, 0.0], [7000.0, 0.0], [4000.0, 0.0]]), 400.0, LIFT_OFF, None).doubt is None


@pytest.mark.parametrize(
    ("kilometres", "degrees", "said"),
    [
        (1.0, 5.0, None),
        (20.0, 5.0, "20.0 km from the site's runway"),
        (None, 5.0, "nothing tells whether"),
        (1.0, 62.0, "62 degrees across"),
    ],
)
def test_a_runway_tells_of_the_heading_only_where_the_flight_lifted_off_from_it(
    kilometres: float | None, degrees: float, said: str | None
) -> None:
    """Within a kilometre of its ends, and along it; a direction that was given is believed whatever it is."""
    time = START + np.arange(20) * SECOND
    speed, compass = np.linspace(1.0, 20.0, 20), np.full(20, math.radians(90.0 + degrees))
    none = np.full(20, math.nan)
    flown = Flown(time, speed, none, none, compass, none, none, none)
    runway = Runway(*LIFT_OFF, height_m=0.0, landing_compass_rad=math.radians(270.0), length_m=1000.0)
    lift_off = None if kilometres is None else (LIFT_OFF[0] + kilometres * 1000.0 / METRES_A_RADIAN, LIFT_OFF[1])
    rolled = roll_along(flown, 19, 20.0, runway, lift_off)
    if said is None:
        assert rolled.doubt is None
        assert rolled.bias_rad == pytest.approx(math.radians(degrees))
    else:
        assert rolled.doubt is not None
        assert said in rolled.doubt
        assert math.isnan(rolled.bias_rad)
    given = roll_along(flown, 19, 20.0, math.radians(90.0), lift_off)
    assert given.bias_rad == pytest.approx(math.radians(degrees))


def test_a_place_that_no_wind_reaches_is_refused() -> None:
    """A degree further north after 400 s would be a wind of 278 m/s."""
    end = _end()
    with pytest.raises(Unreachable, match=r"wind of 27[0-9] m/s"):
        reconstructed(_gathered(), How(close_on=(end[0] + math.radians(1.0), end[1])))


def test_without_pressure_and_altitude_the_height_is_that_of_the_pitch() -> None:
    """And it says so; a level flight by its pitch stays level."""
    sortie = _only(_gathered(pressure=False), How())
    assert sortie.height_by == "pitch"
    assert np.abs(sortie.height_m).max() == 0.0


def test_what_is_missing_is_named() -> None:
    """A path needs airspeed and attitude."""
    parameters = Parameters()
    assert parameters.lacks() == "airspeed and attitude"
    for second in range(3):
        parameters.take(Attitude("mavlink:1", START + second * SECOND, START, 0.0, 0.0, 0.0))
    assert parameters.lacks() == "airspeed"


def test_an_aircraft_that_never_flies_has_no_sortie() -> None:
    """Airspeed that stays near nought is no flight."""
    parameters = Parameters()
    for second in range(300):
        at = START + second * SECOND
        parameters.take(AirData("mavlink:1", at, at, airspeed_mps=0.0))
        parameters.take(Attitude("mavlink:1", at, at, 0.0, 0.0, 0.0))
    assert reconstructed(parameters) == []


def test_over_a_long_silence_nothing_is_integrated() -> None:
    """Ten seconds and more without airspeed part a flight into two, of which neither is closed."""
    parameters = Parameters()
    for observation in _said():
        if not START + 200 * SECOND < observation.valid_at < START + 260 * SECOND:
            parameters.take(observation)
    before, after = reconstructed(parameters)
    assert (before.took_off, before.landed, after.took_off, after.landed) == (True, False, False, True)
    assert math.isnan(before.end_error_m)
    assert math.isnan(after.end_error_m)
