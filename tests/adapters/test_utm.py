"""UTM_GLOBAL_POSITION: what its flags allow, above the ellipsoid, and the next waypoint as an intent."""

import math
from typing import Any

import pytest

from gateway.observation import GpsReport, Intent

EVERYTHING = 255
PLACE = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 460_000, "vx": 1000, "vy": -250, "vz": 75}
ACCURACY = {"h_acc": 2500, "v_acc": 4000, "vel_acc": 30}
NEXT = {"next_lat": 311_000_000, "next_lon": 1_041_000_000, "next_alt": 465_000}


def _say(plane: Any, **values: Any) -> tuple[Any, ...]:
    plane.second += 1.0
    usec = plane.T0 // 1000 + round(plane.second * 1e6)
    told = {"time": usec, "flags": EVERYTHING, "flight_state": 3, **PLACE, **ACCURACY, **NEXT}
    found: tuple[Any, ...] = plane.say("UTM_GLOBAL_POSITION", **(told | values))
    return found


def test_a_report_is_above_the_ellipsoid_with_its_own_accuracies(plane: Any) -> None:
    """h_acc and v_acc are mm, vel_acc is cm/s."""
    report, intent = _say(plane)
    assert isinstance(report, GpsReport)
    assert (report.height_m, report.altitude_msl_m) == (460.0, None)
    assert (report.velocity_north_mps, report.velocity_east_mps, report.velocity_up_mps) == (10.0, -2.5, -0.75)
    assert (report.horizontal_sigma_m, report.vertical_sigma_m, report.velocity_sigma_mps) == (2.5, 4.0, 0.3)
    assert abs(report.valid_at - report.received_at) < 1_000_000
    assert isinstance(intent, Intent)
    assert plane.health().words["landed"] == "in air"
    assert plane.health().words["position"] == "UTM_GLOBAL_POSITION"


def test_the_next_waypoint_is_an_intent_told_once(plane: Any) -> None:
    _, intent = _say(plane)
    assert intent.told_by == "utm"
    assert math.degrees(intent.latitude_rad) == pytest.approx(31.1, abs=1e-9)
    assert math.degrees(intent.longitude_rad) == pytest.approx(104.1, abs=1e-9)
    assert (intent.height_m, intent.altitude_msl_m, intent.sequence) == (465.0, None, None)
    assert len(_say(plane)) == 1
    assert _say(plane, next_lat=312_000_000)[1].latitude_rad == pytest.approx(math.radians(31.2))
    assert _say(plane, flags=127)[1].latitude_rad is None, "withdrawn"
    assert len(_say(plane, flags=127)) == 1
    assert len(_say(plane, next_lat=312_000_000)) == 2, "told again after there was none"


@pytest.mark.parametrize(
    ("missing", "fields"),
    [
        (8, ("height_m",)),
        (32, ("velocity_east_mps", "velocity_north_mps")),
        (64, ("velocity_up_mps",)),
    ],
)
def test_what_its_flags_do_not_vouch_for_is_not_measured(plane: Any, missing: int, fields: tuple[str, ...]) -> None:
    report = _say(plane, flags=EVERYTHING - missing)[0]
    values = ("height_m", "velocity_east_mps", "velocity_north_mps", "velocity_up_mps")
    assert {name for name in values if getattr(report, name) is None} == set(fields)


def test_without_a_valid_position_there_is_no_report_but_still_an_intent(plane: Any) -> None:
    (intent,) = _say(plane, flags=EVERYTHING - 4)
    assert isinstance(intent, Intent)
    assert plane.counter("position marked invalid") == 1


def test_without_a_valid_time_it_holds_at_its_receipt(plane: Any) -> None:
    report = _say(plane, flags=EVERYTHING - 1, time=12345)[0]
    assert abs(report.valid_at - report.received_at) < 1_100_000_000


@pytest.mark.parametrize("accuracy", [0, 65535])
def test_an_accuracy_of_none_or_of_all_ones_is_not_given(plane: Any, accuracy: int) -> None:
    report = _say(plane, h_acc=accuracy, v_acc=accuracy, vel_acc=accuracy)[0]
    assert report.horizontal_sigma_m is report.vertical_sigma_m is report.velocity_sigma_mps is None


def test_a_next_waypoint_that_is_no_place_is_refused(plane: Any) -> None:
    assert len(_say(plane, next_lat=0, next_lon=0)) == 1
    assert plane.counter("next waypoint out of range") == 1


def test_an_emergency_is_said_once(plane: Any) -> None:
    _say(plane, flight_state=16)
    _say(plane, flight_state=16)
    assert [note for note in plane.notes if "emergency" in note] == ["mavlink:1 says of itself: emergency."]


def test_who_tells_only_this_message_settles_the_session_on_its_time(speaker: Any) -> None:
    """A year behind: the session follows once the source's clock is known to run as ours does."""
    drone = speaker()
    year = 365 * 86_400 * 10**6
    reports = []
    for _ in range(12):
        drone.second += 1.0
        usec = drone.T0 // 1000 + round(drone.second * 1e6) - year
        reports += [one for one in _say(drone, time=usec) if isinstance(one, GpsReport)]
    assert drone.decoder.epoch_offset_s == pytest.approx(-year // 10**6, abs=2)
    assert reports[-1].valid_at == usec * 1000
