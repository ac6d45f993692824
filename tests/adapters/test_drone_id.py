"""OPEN_DRONE_ID_LOCATION: the sender's own place, and that of drones it has heard."""

import math
from typing import Any

import pytest

from gateway.observation import GpsReport, Timing

SECOND = 10**9
MAC = [0x0A, 0x1B, 0x2C, 0x3D, 0x4E, 0x5F] + [0] * 14
LOCATION = {
    "id_or_mac": MAC, "status": 2, "direction": 18_000, "speed_horizontal": 1200, "speed_vertical": 150,
    "latitude": 310_000_000, "longitude": 1_040_000_000, "altitude_barometric": 505.0, "altitude_geodetic": 461.5,
    "horizontal_accuracy": 10, "vertical_accuracy": 4, "speed_accuracy": 3, "timestamp_accuracy": 5,
}  # fmt: skip


def _say(speaker: Any, late_s: float = 0.0, **values: Any) -> tuple[Any, ...]:
    seconds = (speaker.T0 // SECOND + speaker.second - late_s) % 3600
    found: tuple[Any, ...] = speaker.say("OPEN_DRONE_ID_LOCATION", **(LOCATION | {"timestamp": seconds} | values))
    return found


def test_a_heard_drone_is_known_by_its_address_with_sigmas_of_its_accuracy_classes(plane: Any) -> None:
    """Classes: within 10 m in the plane, 10 m in height, 1 m/s and 0.5 s in 95 of 100 cases."""
    (report,) = _say(plane, late_s=0.8)
    assert isinstance(report, GpsReport)
    assert report.aircraft == "odid:0a1b2c3d4e5f"
    assert (report.height_m, report.pressure_altitude_m, report.altitude_msl_m) == (461.5, 505.0, None)
    assert report.velocity_north_mps == pytest.approx(-12.0)
    assert report.velocity_east_mps == pytest.approx(0.0, abs=1e-9)
    assert report.velocity_up_mps == 1.5
    assert report.horizontal_sigma_m == pytest.approx(10 / 2.4477, rel=1e-4)
    assert report.vertical_sigma_m == pytest.approx(10 / 1.96)
    assert report.velocity_sigma_mps == pytest.approx(1 / 1.96)
    assert report.timing_sigma_s == pytest.approx(0.5 / 1.96)
    assert report.received_at - report.valid_at == pytest.approx(0.8 * SECOND, abs=2e6)
    assert report.timing is Timing.UTC


def test_an_identity_of_zeros_is_the_sender_itself(plane: Any) -> None:
    (report,) = _say(plane, id_or_mac=[0] * 20)
    assert report.aircraft == "mavlink:1"
    assert plane.health().words["position"] == "OPEN_DRONE_ID_LOCATION"
    assert plane.health().words["landed"] == "in air"


def test_a_transmitter_beside_the_autopilot_tells_of_the_same_vehicle(plane: Any, speaker: Any) -> None:
    transmitter = speaker(plane.decoder, system=1, component=236)
    transmitter.second = plane.second
    assert _say(transmitter, id_or_mac=[0] * 20)[0].aircraft == "mavlink:1"
    alone = speaker(plane.decoder, system=9, component=236)
    assert _say(alone, id_or_mac=[0] * 20)[0].aircraft == "mavlink:9"


@pytest.mark.parametrize(
    ("values", "fields"),
    [
        ({"altitude_geodetic": -1000.0}, {"height_m"}),
        ({"altitude_barometric": -1000.0}, {"pressure_altitude_m"}),
        ({"direction": 36_100}, {"velocity_east_mps", "velocity_north_mps"}),
        ({"speed_horizontal": 25_500}, {"velocity_east_mps", "velocity_north_mps"}),
        ({"speed_vertical": 6300}, {"velocity_up_mps"}),
        ({"horizontal_accuracy": 0}, {"horizontal_sigma_m"}),
        ({"vertical_accuracy": 0}, {"vertical_sigma_m"}),
        ({"speed_accuracy": 0}, {"velocity_sigma_mps"}),
    ],
)
def test_what_is_told_as_unknown_is_not_measured(plane: Any, values: dict[str, Any], fields: set[str]) -> None:
    (report,) = _say(plane, **values)
    names = ("height_m", "pressure_altitude_m", "velocity_east_mps", "velocity_north_mps", "velocity_up_mps",
             "horizontal_sigma_m", "vertical_sigma_m", "velocity_sigma_mps")  # fmt: skip
    assert {name for name in names if getattr(report, name) is None} == fields


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"altitude_geodetic": math.nan}, "not a number"),
        ({"altitude_geodetic": 40_000.0}, "altitude out of range"),
        ({"speed_horizontal": 25_425}, "velocity out of range"),
        ({"speed_vertical": -6200}, "velocity out of range"),
        ({"horizontal_accuracy": 13}, "accuracy class unknown"),
    ],
)
def test_a_value_that_cannot_be_is_counted_and_the_rest_is_good(
    plane: Any, values: dict[str, Any], reason: str
) -> None:
    assert len(_say(plane, **values)) == 1
    assert plane.counter(reason) == 1


@pytest.mark.parametrize("own", [True, False], ids=["own", "another's"])
def test_no_position_is_no_report(plane: Any, own: bool) -> None:
    identity = [0] * 20 if own else MAC
    assert _say(plane, latitude=0, longitude=0, id_or_mac=identity) == ()
    assert _say(plane, latitude=-2_000_000_000, id_or_mac=identity) == ()
    assert (plane.counter("no position yet"), plane.counter("position out of range")) == (1, 1)


def test_the_same_location_told_again_is_dropped(plane: Any) -> None:
    assert _say(plane)
    plane.second += 1.0
    assert _say(plane, late_s=1.0) == ()
    assert plane.counter("repeated") == 1
    assert _say(plane)


@pytest.mark.parametrize("timestamp", [65535.0, math.nan, -1.0])
def test_without_a_time_it_holds_at_its_receipt(plane: Any, timestamp: float) -> None:
    (report,) = _say(plane, timestamp=timestamp)
    assert report.valid_at == report.received_at


def test_seconds_of_the_hour_are_of_the_nearest_hour(plane: Any) -> None:
    """Told just before the full hour, heard just after it."""
    plane.second = 3600 - plane.T0 // SECOND % 3600 + 0.5
    (report,) = _say(plane, late_s=1.5)
    assert report.received_at - report.valid_at == pytest.approx(1.5 * SECOND, abs=2e6)


def test_a_drone_of_another_time_is_foreign_and_named_once(plane: Any) -> None:
    assert _say(plane, late_s=600.0)[0].timing is Timing.FOREIGN
    plane.second += 1.0
    assert _say(plane, late_s=600.0)[0].timing is Timing.FOREIGN
    assert [note for note in plane.notes if "odid" in note] == [
        "The clock of odid:0a1b2c3d4e5f is 600 s behind the session's: it is shown, not fused; "
        "set that clock, or begin a new session."
    ]
