"""Positions with a covariance, and which of a vehicle's position messages is believed."""

import math
from typing import Any

import pytest

from gateway.observation import GpsReport, Timing

PLACE = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 500_000, "relative_alt": 100_000}
UTM_FLAGS = 1 | 4 | 8


def _covariance(*diagonal: float) -> list[float]:
    matrix = [0.0] * 36
    for place, variance in enumerate(diagonal):
        matrix[place * 7] = variance
    return matrix


def _say(plane: Any, **values: Any) -> tuple[Any, ...]:
    plane.second += 0.2
    told = {"time_usec": plane.boot_ms * 1000, "covariance": _covariance(4, 12, 9, 1, 1, 4), "estimator_type": 5}
    found: tuple[Any, ...] = plane.say("GLOBAL_POSITION_INT_COV", **(PLACE | told | values))
    return found


def test_a_covariance_gives_a_sigma_an_axis_and_velocities_are_metres_a_second_down(plane: Any) -> None:
    """Variances 4 and 12 m2: the root of their mean is 2.83 m; 9: 3 m; 1, 1, 4: the root of 2."""
    (report,) = _say(plane, vx=10.5, vy=-2.5, vz=0.75)
    assert report.horizontal_sigma_m == pytest.approx(math.sqrt(8))
    assert report.vertical_sigma_m == 3.0
    assert report.velocity_sigma_mps == pytest.approx(math.sqrt(2))
    assert (report.velocity_north_mps, report.velocity_east_mps, report.velocity_up_mps) == (10.5, -2.5, -0.75)
    assert report.altitude_msl_m == 500.0
    assert report.height_m is None
    assert report.compass_heading_rad is None
    assert plane.health().words["position"] == "GLOBAL_POSITION_INT_COV"
    assert plane.health().words["estimator"] == "GPS and inertial unit"
    assert plane.health().readings["horizontal sigma, m"] == pytest.approx(math.sqrt(8))


@pytest.mark.parametrize("diagonal", [(math.nan, 4, 4, 4, 4, 4), (0, 0, 0, 0, 0, 0)], ids=["NaN first", "all zero"])
def test_a_covariance_that_is_not_given_is_none_and_the_receivers_accuracy_stands_in(
    plane: Any, diagonal: tuple[float, ...]
) -> None:
    (report,) = _say(plane, covariance=_covariance(*diagonal))
    assert report.horizontal_sigma_m is report.vertical_sigma_m is report.velocity_sigma_mps is None
    plane.fix(h_acc=2500, v_acc=4000, vel_acc=300)
    (report,) = _say(plane, covariance=_covariance(*diagonal))
    assert (report.horizontal_sigma_m, report.vertical_sigma_m, report.velocity_sigma_mps) == (2.5, 4.0, 0.3)


def test_a_naive_estimators_covariance_means_nothing(plane: Any) -> None:
    assert _say(plane, estimator_type=1)[0].horizontal_sigma_m is None


@pytest.mark.parametrize("variance", [-1.0, math.inf])
def test_a_variance_that_cannot_be_is_refused_and_the_rest_of_the_report_is_good(plane: Any, variance: float) -> None:
    (report,) = _say(plane, covariance=_covariance(variance, 4, 9, 1, 1, 1))
    assert report.horizontal_sigma_m is None
    assert report.vertical_sigma_m == 3.0
    assert plane.counter("covariance out of range") == 1


def test_a_velocity_that_is_no_number_is_left_out_of_a_report_with_covariance(plane: Any) -> None:
    (report,) = _say(plane, vx=math.nan, vy=1.0)
    assert report.velocity_east_mps is report.velocity_north_mps is report.velocity_up_mps is None
    assert plane.counter("velocity out of range") == 1


def test_its_time_is_since_boot_or_utc_by_its_magnitude(plane: Any) -> None:
    (since_boot,) = _say(plane)
    (utc,) = _say(plane, time_usec=plane.T0 // 1000 + round((plane.second + 0.2) * 1e6) - 300_000)
    assert abs(since_boot.valid_at - since_boot.received_at) < 2_000_000
    assert abs(utc.received_at - utc.valid_at - 300_000_000) < 10_000
    assert since_boot.timing is utc.timing is Timing.UTC


def test_the_estimate_is_refused_without_a_fix_unless_it_needs_none(plane: Any) -> None:
    plane.fix(fix_type=1)
    assert _say(plane) == ()
    assert plane.counter("no fix") == 1
    assert isinstance(_say(plane, estimator_type=6)[0], GpsReport)  # motion capture


def test_a_report_with_covariance_that_comes_twice_counts_once(plane: Any) -> None:
    _say(plane)
    usec = plane.boot_ms * 1000
    assert _say(plane, time_usec=usec) == ()
    assert plane.counter("repeated") == 1


def _utm(plane: Any) -> tuple[Any, ...]:
    usec = plane.T0 // 1000 + round(plane.second * 1e6)
    place = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 460_000}
    found: tuple[Any, ...] = plane.say("UTM_GLOBAL_POSITION", time=usec, flags=UTM_FLAGS, **place)
    return found


def _drone_id(plane: Any) -> tuple[Any, ...]:
    seconds = (plane.T0 // 10**9 + plane.second) % 3600
    place = {"latitude": 310_000_000, "longitude": 1_040_000_000, "altitude_geodetic": 460.0}
    unknown = {"direction": 36_100, "speed_horizontal": 25_500, "speed_vertical": 6300, "altitude_barometric": -1000.0}
    found: tuple[Any, ...] = plane.say("OPEN_DRONE_ID_LOCATION", timestamp=seconds, **place, **unknown)
    return found


def _high_latency(plane: Any) -> tuple[Any, ...]:
    place = {"latitude": 310_000_000, "longitude": 1_040_000_000, "altitude": 500}
    found = plane.say("HIGH_LATENCY2", timestamp=plane.boot_ms, autopilot=3, type=1, temperature_air=-128, **place)
    return tuple(one for one in found if isinstance(one, GpsReport))


def _covered(plane: Any) -> tuple[Any, ...]:
    return _say(plane)


def _estimate(plane: Any) -> tuple[Any, ...]:
    found: tuple[Any, ...] = plane.estimate()
    return found


def _fix(plane: Any) -> tuple[Any, ...]:
    found: tuple[Any, ...] = plane.fix()
    return found


KINDS = [_covered, _estimate, _utm, _drone_id, _high_latency, _fix]


@pytest.mark.parametrize("better", range(5))
def test_while_a_better_kind_of_position_comes_the_lower_ones_are_not_used(plane: Any, better: int) -> None:
    """COV > GLOBAL_POSITION_INT > UTM > Remote ID > HIGH_LATENCY2 > GPS_RAW_INT; 13 s of silence end a kind's reign."""
    plane.second += 6.0
    assert KINDS[better](plane)
    for lower in KINDS[better + 1 :]:
        plane.second += 1.0
        assert lower(plane) == ()
    plane.second += 13.0
    assert KINDS[better + 1](plane)
    assert KINDS[better](plane), "and the better kind is used as soon as it comes again"


def test_what_yields_to_a_better_kind_is_counted(plane: Any) -> None:
    plane.estimate()
    _utm(plane)
    assert plane.counter("better position kind is used") == 1


def test_a_better_kind_that_says_nothing_stands_in_nobodys_way(plane: Any) -> None:
    assert _say(plane, lat=0, lon=0) == ()
    assert _say(plane, lat=2_000_000_000) == ()
    assert plane.estimate()
