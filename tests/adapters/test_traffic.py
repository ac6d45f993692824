"""ADSB_VEHICLE: other aircraft by their ICAO address, whoever reports them."""

import math
from typing import Any

import pytest

from gateway.observation import GpsReport, Timing

SECOND = 10**9
EVERYTHING = 1 | 2 | 4 | 8 | 16 | 32 | 128
REPORT = {
    "ICAO_address": 0x4840D6, "lat": 310_000_000, "lon": 1_040_000_000, "altitude_type": 0, "altitude": 1_000_500,
    "heading": 9000, "hor_velocity": 10_000, "ver_velocity": -250, "callsign": b"KLM1023 ", "tslc": 2,
    "flags": EVERYTHING, "squawk": 1234,
}  # fmt: skip


def _say(reporter: Any, **values: Any) -> tuple[Any, ...]:
    found: tuple[Any, ...] = reporter.say("ADSB_VEHICLE", **(REPORT | values))
    return found


def test_a_report_is_keyed_by_its_address_and_aged_by_tslc(plane: Any) -> None:
    """Course 90 degrees at 100 m/s is east; ver_velocity is up; the aircraft was there 2 s before the receipt."""
    (report,) = _say(plane)
    assert isinstance(report, GpsReport)
    assert report.aircraft == "icao:4840d6"
    assert report.received_at - report.valid_at == 2 * SECOND
    assert report.timing is Timing.UTC
    assert report.timing_sigma_s == pytest.approx(1 / math.sqrt(3))
    assert math.degrees(report.latitude_rad) == pytest.approx(31.0, abs=1e-9)
    assert report.velocity_east_mps == pytest.approx(100.0)
    assert report.velocity_north_mps == pytest.approx(0.0, abs=1e-9)
    assert report.velocity_up_mps == -2.5
    assert report.compass_heading_rad is None, "the field called heading is the course"
    assert report.callsign == "KLM1023"
    assert report.horizontal_sigma_m is None


@pytest.mark.parametrize(("kind", "pressure", "height"), [(0, 1000.5, None), (1, None, 1000.5), (2, None, None)])
def test_pressure_altitude_and_height_are_never_mixed(
    plane: Any, kind: int, pressure: float | None, height: float | None
) -> None:
    (report,) = _say(plane, altitude_type=kind)
    assert (report.pressure_altitude_m, report.height_m, report.altitude_msl_m) == (pressure, height, None)


@pytest.mark.parametrize(
    ("flag", "fields"),
    [
        (2, {"pressure_altitude_m"}),
        (4, {"velocity_east_mps", "velocity_north_mps"}),
        (8, {"velocity_east_mps", "velocity_north_mps"}),
        (16, {"callsign"}),
        (128, {"velocity_up_mps"}),
    ],
)
def test_what_its_flags_do_not_vouch_for_is_not_measured(plane: Any, flag: int, fields: set[str]) -> None:
    (report,) = _say(plane, flags=EVERYTHING - flag)
    values = ("pressure_altitude_m", "velocity_east_mps", "velocity_north_mps", "velocity_up_mps", "callsign")
    assert {name for name in values if getattr(report, name) is None} == fields


def test_without_valid_coordinates_there_is_no_report(plane: Any) -> None:
    assert _say(plane, flags=EVERYTHING - 1) == ()
    assert plane.counter("position marked invalid") == 1


@pytest.mark.parametrize("address", [0, 0x1000000, 0xFFFFFFFF])
def test_what_is_no_address_is_refused(plane: Any, address: int) -> None:
    assert _say(plane, ICAO_address=address) == ()
    assert plane.counter("no ICAO address") == 1


@pytest.mark.parametrize(("latitude", "longitude"), [(0, 0), (900_000_001, 0), (0, -1_800_000_001)])
def test_a_place_on_no_globe_is_refused(plane: Any, latitude: int, longitude: int) -> None:
    assert _say(plane, lat=latitude, lon=longitude) == ()
    assert plane.counter("position out of range") == 1


@pytest.mark.parametrize("grows", [True, False], ids=["with a growing tslc", "with the tslc it had"])
def test_the_same_report_told_again_is_dropped(plane: Any, grows: bool) -> None:
    _say(plane)
    for second in (1, 2, 3):
        plane.second += 1.0
        assert _say(plane, tslc=2 + second * grows) == ()
    assert plane.counter("repeated") == 3
    assert _say(plane, lat=310_000_900, tslc=0)


def test_one_aircraft_heard_by_two_receivers_is_reported_once_each_time(plane: Any, speaker: Any) -> None:
    other = speaker(plane.decoder, source=1, system=2)
    other.second = plane.second + 0.3
    assert _say(plane)
    assert _say(other) == ()
    assert other.counter("repeated") == 1
    (report,) = _say(other, lat=310_000_900)
    assert report.aircraft == "icao:4840d6"
    plane.second += 0.5
    assert _say(plane, lat=310_000_900) == ()


def test_who_stands_still_is_heard_anew(plane: Any) -> None:
    """The same place and no speed: a report that is newer by 2 s is no repetition."""
    still = {"hor_velocity": 0, "ver_velocity": 0, "tslc": 0}
    assert _say(plane, **still)
    plane.second += 1.0
    assert _say(plane, **still | {"tslc": 1}) == ()
    plane.second += 1.0
    (report,) = _say(plane, **still)
    assert (report.velocity_east_mps, report.velocity_north_mps) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("kind", "autopilot", "component"), [(27, 8, 156), (6, 8, 190), (18, 8, 191)], ids=["ADS-B", "station", "computer"]
)
def test_whoever_reports_need_not_be_a_vehicle(speaker: Any, kind: int, autopilot: int, component: int) -> None:
    receiver = speaker(system=7, component=component)
    receiver.heartbeat(kind, autopilot)
    (report,) = _say(receiver)
    assert report.aircraft == "icao:4840d6"
    assert report.timing is Timing.PROVISIONAL, "nobody's clock has settled the session's time"
    receiver.second += 16.0
    (report,) = _say(receiver, lat=310_000_900)
    assert report.timing is Timing.ENVELOPE


def test_a_report_of_a_minute_ago_is_delivered_with_its_time(plane: Any) -> None:
    (report,) = _say(plane, tslc=60)
    assert report.received_at - report.valid_at == 60 * SECOND


def test_an_emergency_squawk_is_said_once(plane: Any) -> None:
    for number in range(3):
        _say(plane, squawk=7700, lat=310_000_000 + 900 * number)
    assert [note for note in plane.notes if "squawks" in note] == ["icao:4840d6 squawks 7700: emergency."]


@pytest.mark.parametrize("callsign", [b"", b"        ", b"\xff\xfe", b"A\tB"])
def test_a_callsign_that_cannot_be_read_is_none(plane: Any, callsign: bytes) -> None:
    (report,) = _say(plane, callsign=callsign)
    assert report.callsign is None


def test_memory_of_traffic_is_bounded(plane: Any) -> None:
    for address in range(1, 2500):
        _say(plane, ICAO_address=address)
    assert len(plane.decoder._mavlink._traffic._aircraft) == 2048
