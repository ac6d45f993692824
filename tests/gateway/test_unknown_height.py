"""Reports without a height: the horizontal is used in full, the vertical is neither measured nor written."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.observation import GpsReport, RadarPlot
from gateway.settings import Options

PRESSURE_IS_OFF_M = 250.0  # a day of 1043 hPa


def told(world: Any, course: Any, t_s: float, off_m: float = PRESSURE_IS_OFF_M, **extra: Any) -> GpsReport:
    """A report with a pressure altitude only, which is off by so much."""
    report: GpsReport = world.report(course, t_s, **extra)
    assert report.altitude_msl_m is not None
    return replace(report, altitude_msl_m=None, pressure_altitude_m=report.altitude_msl_m + off_m)


def plots(world: Any, course: Any, seconds: float, **extra: Any) -> list[RadarPlot]:
    """The radar's part of a flight."""
    return [one for one in world.flight(course, seconds, **extra) if isinstance(one, RadarPlot)]


def apart_m(row: dict[str, Any], report: GpsReport) -> float:
    """Horizontal distance of a row and a report."""
    north = (row["latitude_rad"] - report.latitude_rad) * 6.36e6
    east = (row["longitude_rad"] - report.longitude_rad) * 6.38e6 * math.cos(report.latitude_rad)
    return math.hypot(east, north)


@pytest.fixture
def airliner(world: Any) -> Any:
    """90 km away and 9 km up, where the local vertical leans by 0.8 degrees against the runway's."""
    return world.Course(along_m=-90_000.0, left_m=20_000.0, height_m=9000.0, sink_mps=0.0, speed_mps=200.0, swing_m=0.0)


@pytest.mark.parametrize("weighting", ["bias", "literal"])
@pytest.mark.parametrize("off_m", [-800.0, 0.0, 900.0])
def test_the_horizontal_is_right_whatever_the_pressure(world: Any, airliner: Any, weighting: Any, off_m: float) -> None:
    """90 km away a height that is wrong by 900 m would be 13 m of horizontal, if it were measured along."""
    said = [told(world, airliner, float(t), off_m) for t in range(40)]
    run = world.run(said, options=Options(weighting=weighting))
    rows = run.rows(updated_by="gps")
    assert len(rows) == len(said)
    assert apart_m(rows[-1], said[-1]) < 0.05  # noiseless reports of a straight flight
    assert all(math.isnan(row["height_m"]) and math.isnan(row["altitude_msl_m"]) for row in run.rows())
    assert np.isnan(np.concatenate([picture.predict.height_m for picture in run.pictures])).all()


def test_the_pressure_altitude_and_the_callsign_are_written_while_they_are_fresh(world: Any, airliner: Any) -> None:
    said = [told(world, airliner, float(t), callsign="TDN12") for t in range(5)]
    run = world.run(said, until_s=25.0)
    written = list(zip(run.column("time"), run.column("pressure_altitude_m"), run.column("callsign"), strict=True))
    last = said[-1].valid_at
    assert {callsign for _, _, callsign in written} == {"TDN12"}
    fresh = [altitude for time, altitude, _ in written if time <= last + 10 * world.SECOND]
    stale = [altitude for time, altitude, _ in written if time > last + 10 * world.SECOND]
    assert set(fresh) == {one.pressure_altitude_m for one in said}
    assert len(stale) >= 10
    assert all(map(math.isnan, stale))


def test_without_any_altitude_there_is_a_track_all_the_same(world: Any, airliner: Any) -> None:
    said = [replace(told(world, airliner, float(t)), pressure_altitude_m=None) for t in range(40)]
    run = world.run(said)
    assert apart_m(run.rows(updated_by="gps")[-1], said[-1]) < 0.05
    assert all(math.isnan(row["height_m"]) for row in run.rows())
    for row in run.rows():
        assert np.linalg.eigvalsh(row["covariance"].reshape(6, 6)).min() > 0.0


def test_a_guess_said_a_thousand_times_is_still_a_guess(world: Any, airliner: Any) -> None:
    """The vertical never gets surer than the guess: its error is the same every time."""
    run = world.run([told(world, airliner, 0.5 * t) for t in range(400)])
    sigma_m = [math.sqrt(row["covariance"].reshape(6, 6)[2, 2]) for row in run.rows(updated_by="gps")]
    assert min(sigma_m) >= 300.0
    assert max(sigma_m) < 1000.0


def test_a_radar_supplies_the_vertical(world: Any) -> None:
    """Paired by range and azimuth; from then on the height is the radar's, not the pressure's, and null before."""
    course = world.Course()
    run = world.run([*plots(world, course, 60.0), *(told(world, course, t + 0.13) for t in range(60))])
    assert run.said("mavlink:1 is radar track 1/3")
    alone = [row for row in run.rows(aircraft="mavlink:1") if row["state"] == "gps only"]
    fused = [row for row in run.rows(aircraft="mavlink:1") if row["state"] == "fused"]
    assert alone
    assert all(math.isnan(row["height_m"]) for row in alone)
    assert len(fused) > 100
    for row in fused[20:]:
        true_z = course.at((row["time"] - world.START) / world.SECOND)[2]
        assert abs(row["runway_m"][2] - true_z) < 50.0  # 1 mrad at 25 km is 25 m
        assert math.isfinite(row["height_m"])


def test_a_radar_without_elevation_leaves_the_height_unknown(world: Any) -> None:
    course = world.Course()
    flat = [replace(one, elevation_rad=None) for one in plots(world, course, 40.0, missing=False)]
    run = world.run([*flat, *(told(world, course, t + 0.13) for t in range(40))])
    fused = [row for row in run.rows(aircraft="mavlink:1") if row["state"] == "fused"]
    assert len(fused) > 50
    assert all(math.isnan(row["height_m"]) for row in fused)


def test_a_height_that_was_measured_long_ago_is_not_known_any_more(world: Any) -> None:
    course = world.Course()
    seen = plots(world, course, 20.0)
    run = world.run([*seen, *(told(world, course, t + 0.13) for t in range(90))])
    rows = run.rows(aircraft="mavlink:1", updated_by="gps")
    seconds = np.array([(row["time"] - world.START) / world.SECOND for row in rows])
    known = np.array([math.isfinite(row["height_m"]) for row in rows])
    assert known[(seconds > 12.0) & (seconds < 45.0)].all()
    assert not known[seconds > 80.0].any()


def test_a_steep_line_of_sight_allows_for_what_the_guess_does_to_the_range(world: Any) -> None:
    """45 degrees up, 450 m of height are 320 m of range: taken for a height the two would not be paired."""
    course = world.Course(along_m=-3000.0, left_m=0.0, height_m=3300.0, speed_mps=10.0, sink_mps=0.0, swing_m=0.0)
    said = [told(world, course, t + 0.13, off_m=450.0) for t in range(30)]
    assert world.run([*plots(world, course, 30.0), *said]).said("mavlink:1 is radar track 1/3")
    as_height = [replace(one, altitude_msl_m=one.pressure_altitude_m) for one in said]
    assert not world.run([*plots(world, course, 30.0), *as_height]).said("mavlink:1 is radar track 1/3")


def test_who_flies_ten_kilometres_above_is_not_the_one_on_the_approach(world: Any) -> None:
    """Slant range and azimuth agree for a minute; no pressure explains the difference in height."""
    low = world.Course(along_m=-15_000.0, left_m=0.0, height_m=800.0, speed_mps=20.0, sink_mps=0.0, swing_m=0.0)
    slant_m = math.hypot(15_300.0, 800.0)
    ground_m = math.sqrt(slant_m**2 - 10_000.0**2)
    high = world.Course(300.0 - ground_m, 0.0, 10_000.0, 20.0 * 15_300.0 / ground_m, 0.0, 0.0)
    run = world.run([*plots(world, low, 20.0), *(told(world, high, t + 0.13) for t in range(20))])
    assert not run.said("is radar track")
    blind = [replace(told(world, high, t + 0.13), pressure_altitude_m=None) for t in range(20)]
    assert (
        world.run([*plots(world, low, 20.0), *blind]).checks > 0
    )  # they are compared; only the height tells them apart


def test_horizontal_velocity_alone_is_used(world: Any, airliner: Any) -> None:
    """The first row already flies at the speed that was said; the climb, never said, is null."""
    said = [told(world, airliner, float(t), velocity_east_mps=200.0, velocity_north_mps=3.0) for t in range(3)]
    first = world.run(said).rows(updated_by="gps")[0]
    assert first["velocity_mps"][:2] == pytest.approx([200.0, 3.0], abs=1e-6)
    assert math.isnan(first["velocity_mps"][2])
    with_height = [replace(one, height_m=9500.0) for one in said]
    row = world.run(with_height).rows(updated_by="gps")[0]
    assert row["velocity_mps"][:2] == pytest.approx([200.0, 3.0], abs=1e-6)
    assert row["height_m"] == pytest.approx(9500.0, abs=0.01)


def test_coarse_times_make_a_fast_aircraft_less_sure(world: Any, airliner: Any) -> None:
    """0.3 s at 200 m/s are 60 m beside the 15 of the site; a standing one loses nothing."""
    fast = told(world, airliner, 0.0, velocity_east_mps=200.0, velocity_north_mps=0.0, timing_sigma_s=0.3)
    standing = replace(fast, velocity_east_mps=0.0)
    unknown = replace(fast, velocity_east_mps=None, velocity_north_mps=None)
    for report, expected in ((fast, 60.0), (standing, 0.0), (unknown, 30.0)):
        row = world.run([report], options=Options(weighting="covariance")).rows(updated_by="gps")[0]
        assert math.sqrt(row["covariance"].reshape(6, 6)[0, 0]) == pytest.approx(math.hypot(15.0, expected), rel=1e-3)


def test_traffic_that_says_another_velocity_than_it_flies_is_followed(world: Any, airliner: Any) -> None:
    """SITL's does, by 20 m/s; with the 1 m/s of a receiver's own velocity the track would fall far behind."""
    slow = replace(airliner, speed_mps=60.0)
    wrong = {"velocity_east_mps": 60.0, "velocity_north_mps": 20.0, "velocity_up_mps": 0.0}
    said = [told(world, slow, 1.8 * t, timing_sigma_s=0.577, **wrong) for t in range(60)]
    sure = [replace(one, velocity_sigma_mps=1.0) for one in said]
    behind_m = [apart_m(world.run(reports).rows(updated_by="gps")[-1], said[-1]) for reports in (said, sure)]
    assert behind_m[0] < 60.0
    assert behind_m[1] > 3.0 * behind_m[0]


@pytest.mark.parametrize("ticks", ["one", "20 ms"])
def test_ticks_change_no_bit(world: Any, ticks: str) -> None:
    course = world.Course()
    said = [*plots(world, course, 20.0), *(told(world, course, t + 0.13, late_s=0.4) for t in range(20))]
    said += [told(world, course, t + 0.2, aircraft="icao:4840d6", callsign="TDN1") for t in range(20)]
    assert world.run(said, ticks=ticks).bits() == world.run(said).bits()


def test_late_reports_end_where_punctual_ones_do(world: Any, differences: Any) -> None:
    """The last row of each time is that of in-order processing, null heights included."""
    course = world.Course()
    seen = plots(world, course, 30.0)
    punctual = world.run([*seen, *(told(world, course, t + 0.13, late_s=0.01) for t in range(30))], until_s=35.0)
    late = world.run([*seen, *(told(world, course, t + 0.13, late_s=3.0) for t in range(30))], until_s=35.0)

    def rows(run: Any) -> dict[Any, Any]:
        found = run.last(aircraft="mavlink:1")
        return {key: {**row, "received": 0} for key, row in found.items() if row["updated_by"] != "coast"}

    one, other = rows(punctual), rows(late)
    assert one.keys() == other.keys()
    for key, row in one.items():
        assert math.isnan(row["height_m"]) == math.isnan(other[key]["height_m"]), key
        for name in ("runway_m", "covariance"):
            assert np.allclose(row[name], other[key][name], rtol=1e-9, atol=1e-6), key


def test_nothing_is_said_of_the_geoid_where_no_height_is_given(world: Any, airliner: Any) -> None:
    site = replace(world.site, runway=replace(world.site.runway, geoid_separation_m=None))
    assert not world.run([told(world, airliner, 0.0)], site=site).said("geoid")
