"""A site proposed from what aircraft say."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from adapters.decode import Decoder
from adapters.files import open_recording
from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, GpsReport, Observation, PlanPoint
from gateway.offline.site import propose_site

EXCERPT = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"
SECOND = 10**9
LATITUDE, LONGITUDE = math.radians(31.0), math.radians(104.0)


def _standing(count: int = 10, **values: float | None) -> list[GpsReport]:
    report = GpsReport("mavlink:1", 0, 0, LATITUDE, LONGITUDE, altitude_msl_m=500.0, compass_heading_rad=1.0)
    return [replace(report, valid_at=second * SECOND, received_at=second * SECOND, **values) for second in range(count)]  # type: ignore[arg-type]


def _plan(*points: PlanPoint) -> FlightPlan:
    return FlightPlan("mavlink:1", 0, 0, points)


HOME = PlanPoint(0, "home", LATITUDE, LONGITUDE, altitude_msl_m=510.0)
FINAL = PlanPoint(1, "waypoint", LATITUDE, LONGITUDE - 1e-3, altitude_above_home_m=100.0)
LANDING = PlanPoint(2, "landing", LATITUDE, LONGITUDE, altitude_above_home_m=0.0)


def _recorded() -> list[Observation]:
    recording = open_recording(EXCERPT)
    decoder = Decoder(recording.sources)
    return [one for arrival in recording.arrivals() for one in decoder.feed(arrival).observations]


def test_a_sitl_flight_lands_on_its_home_runway_at_353_degrees() -> None:
    """Home of the recording: -35.363261, 149.165230, 584 m; the runway's heading is 353 degrees true."""
    proposal = propose_site(_recorded())
    assert proposal is not None
    runway = proposal.site.runway
    assert math.degrees(runway.landing_compass_rad) == pytest.approx(353.0, abs=0.5)
    assert runway.height_m == pytest.approx(584.1, abs=0.2)
    aiming = RunwayFrame(runway).geodetic_from_runway((runway.aiming_point_x_m, 0.0, 0.0))
    assert math.degrees(float(aiming[0])) == pytest.approx(-35.363261, abs=2e-6)
    assert math.degrees(float(aiming[1])) == pytest.approx(149.165230, abs=2e-6)
    assert proposal.site.radars == ()


def test_the_landing_item_is_the_aiming_point_and_its_last_leg_the_direction() -> None:
    proposal = propose_site([*_standing(1), _plan(HOME, FINAL, LANDING)])
    assert proposal is not None
    runway = proposal.site.runway
    assert math.degrees(runway.landing_compass_rad) == pytest.approx(90.0, abs=0.1)
    assert runway.height_m == 510.0
    along, left, _ = RunwayFrame(runway).runway_from_geodetic(LATITUDE, LONGITUDE, 510.0)
    assert along == pytest.approx(runway.aiming_point_x_m, abs=0.01)
    assert left == pytest.approx(0.0, abs=0.01)
    assert "landing item" in proposal.origin


def test_without_a_landing_item_home_is_the_runway_and_the_nose_its_direction() -> None:
    proposal = propose_site([*_standing(), _plan(HOME)])
    assert proposal is not None
    runway = proposal.site.runway
    assert (runway.latitude_rad, runway.longitude_rad, runway.height_m) == (LATITUDE, LONGITUDE, 510.0)
    assert runway.landing_compass_rad == 1.0
    assert "home position" in proposal.origin


def test_without_home_the_runway_is_where_the_aircraft_stands() -> None:
    proposal = propose_site(_standing())
    assert proposal is not None
    assert proposal.site.runway.height_m == 500.0
    assert "stands" in proposal.origin


def test_a_geoid_separation_that_is_given_is_in_the_site_and_one_that_is_not_is_said() -> None:
    given = propose_site([*_standing(height_m=465.0), _plan(HOME)])
    assert given is not None
    assert given.site.runway.geoid_separation_m == -35.0
    assert given.site.runway.height_m == 475.0
    assert "geoid" not in given.origin
    absent = propose_site([*_standing(), _plan(HOME)])
    assert absent is not None
    assert absent.site.runway.geoid_separation_m == 0.0
    assert "geoid separation is not given" in absent.origin


def test_as_long_as_nothing_tells_of_a_place_there_is_no_proposal() -> None:
    assert propose_site([]) is None
    assert propose_site([_plan(HOME, FINAL, LANDING)]) is None
    assert propose_site(_standing(3)) is None
    assert propose_site([*_standing(3), _plan(HOME)]) is None


def test_who_never_stood_still_lands_after_a_minute_where_it_was_heard_first() -> None:
    flying = _standing(70, velocity_east_mps=0.0, velocity_north_mps=-30.0)
    assert propose_site(flying[:50]) is None
    proposal = propose_site(flying)
    assert proposal is not None
    assert math.degrees(proposal.site.runway.landing_compass_rad) == pytest.approx(180.0)
    assert "no better hint" in proposal.origin


def test_the_first_report_of_a_short_recording_must_do_when_nothing_more_will_come() -> None:
    """Ten seconds in flight tell no place to a link that goes on, and one to a recording that ends there."""
    flown = [
        replace(report, latitude_rad=LATITUDE + second * 1e-5, velocity_north_mps=60.0)
        for second, report in enumerate(_standing())
    ]
    assert propose_site(flown) is None
    proposal = propose_site(flown, complete=True)
    assert proposal is not None
    assert proposal.site.runway.latitude_rad == LATITUDE
