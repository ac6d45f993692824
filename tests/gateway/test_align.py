"""Align: a radar track at a report's time, heights by the geoid, radars' places by their own word."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gateway.align import (
    SECOND,
    Geoid,
    Plot,
    bracket,
    contradiction,
    draw,
    place_plot,
    place_reports,
    radar_from_status,
)
from gateway.frames import RadarFrame
from gateway.observation import GpsReport, RadarPlot, RadarStatus, Timing
from gateway.settings import DEMO_SITE, RadarSite

NAN = math.nan
T = 1_790_000_000 * SECOND
Polar = tuple[float, float, float]


def _plot(t_s: float, polar: Polar, sigma: Polar = (15.0, 1e-3, 2e-3)) -> Plot:
    return Plot(T + round(t_s * SECOND), 0, 0, 1, 3, polar, sigma)


def _at(plots: list[Plot], t_s: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    value, sigma = bracket(plots, T + round(t_s * SECOND), 1.0)
    return np.array(value), np.array(sigma)


# bracket ------------------------------------------------------------------------------------------------------------


def test_a_track_is_interpolated_between_the_plots_on_both_sides() -> None:
    """A quarter of the way between two plots the value is a quarter of the way, each component its own."""
    value, sigma = _at([_plot(-0.1, (1000.0, 0.1, 0.02)), _plot(0.3, (1040.0, 0.14, 0.01))])
    assert value == pytest.approx([1010.0, 0.11, 0.0175], rel=1e-12)
    # independent noises with weights 3/4 and 1/4
    assert sigma == pytest.approx(np.array([15.0, 1e-3, 2e-3]) * math.hypot(0.75, 0.25), rel=1e-12)


def test_each_component_comes_from_the_plots_that_have_it() -> None:
    """A component missing in the nearest plot is interpolated from the next ones out; the others are not touched."""
    plots = [
        _plot(-0.6, (1000.0, 0.10, 0.010)),
        _plot(-0.2, (1040.0, NAN, 0.030)),
        _plot(0.2, (1080.0, 0.18, NAN)),
        _plot(0.6, (1120.0, 0.22, 0.070)),
    ]
    value, _ = _at(plots)
    assert value == pytest.approx([1060.0, 0.16, 0.040], rel=1e-12)


def test_a_component_that_nobody_measured_is_not_there() -> None:
    """A component missing throughout is NaN, in value and sigma; the others are there."""
    value, sigma = _at([_plot(-0.2, (1000.0, NAN, 0.01)), _plot(0.2, (1080.0, NAN, 0.01))])
    assert np.isnan(value).tolist() == np.isnan(sigma).tolist() == [False, True, False]


def test_only_without_a_later_plot_it_is_extrapolated() -> None:
    """The two plots before carry on when none follows within the wait; one that follows later does not count."""
    before = [_plot(-0.6, (1000.0, 0.10, 0.0)), _plot(-0.2, (1040.0, 0.12, 0.0))]
    extrapolated, wide = _at(before)
    assert extrapolated[:2] == pytest.approx([1060.0, 0.13], rel=1e-12)
    beyond, _ = _at([*before, _plot(1.001, (9000.0, 0.9, 0.0))])
    assert beyond.tolist() == extrapolated.tolist()
    interpolated, narrow = _at([*before, _plot(0.2, (1100.0, 0.16, 0.0))])
    assert interpolated[:2] == pytest.approx([1070.0, 0.14], rel=1e-12)
    # weights of 3/2 and -1/2 against 1/2 and 1/2: 2.2 times as uncertain, and said so
    assert wide / narrow == pytest.approx([math.sqrt(5.0)] * 3, rel=1e-12)


def test_azimuth_is_interpolated_through_half_a_turn() -> None:
    """Between +179 and -179 degrees lies 180, not 0."""
    one, other = math.radians(179.0), math.radians(-179.0)
    value, _ = _at([_plot(-0.2, (1000.0, one, 0.0)), _plot(0.2, (1000.0, other, 0.0))])
    assert math.cos(value[1]) == pytest.approx(-1.0, abs=1e-12)
    back, _ = _at([_plot(-0.2, (1000.0, other, 0.0)), _plot(0.6, (1000.0, one, 0.0))])
    assert math.remainder(math.degrees(back[1]) + 179.5, 360.0) == pytest.approx(0.0, abs=1e-9)


def test_a_plot_of_the_very_instant_is_taken_as_it_is() -> None:
    """At a plot's own time its value and sigma stand, whatever is beside it."""
    value, sigma = _at(
        [_plot(-0.4, (900.0, 0.0, 0.0)), _plot(0.0, (1000.0, 0.1, 0.01)), _plot(0.4, (1300.0, 0.3, 0.02))]
    )
    assert value.tolist() == [1000.0, 0.1, 0.01]
    assert sigma.tolist() == [15.0, 1e-3, 2e-3]


def test_nothing_near_gives_nothing() -> None:
    """No plots, plots only afterwards, one plot alone that is old, or plots of 3 s ago say nothing."""
    for plots in (
        [],
        [_plot(0.2, (1000.0, 0.0, 0.0)), _plot(0.6, (1000.0, 0.0, 0.0))],
        [_plot(-0.6, (1000.0, 0.0, 0.0))],
        [_plot(-3.8, (1000.0, 0.0, 0.0)), _plot(-3.4, (1000.0, 0.0, 0.0))],
    ):
        value, sigma = _at(plots)
        assert np.isnan(value).all()
        assert np.isnan(sigma).all()


def test_one_plot_of_just_now_stands_alone() -> None:
    """A single plot of a moment ago is taken as it is."""
    value, _ = _at([_plot(-0.3, (1000.0, 0.1, 0.01))])
    assert value.tolist() == [1000.0, 0.1, 0.01]


def test_two_plots_of_one_instant_do_not_divide_by_zero() -> None:
    """Two plots of the same time cannot be extrapolated: the newer one stands for a moment, and not for longer."""
    plots = [_plot(-0.3, (1000.0, 0.1, 0.01)), _plot(-0.3, (1010.0, 0.1, 0.01))]
    assert _at(plots)[0].tolist() == [1010.0, 0.1, 0.01]
    assert np.isnan(_at(plots, 0.3)[0]).all()


@given(st.floats(0.0, 1.0), st.floats(-3.1, 3.1), st.floats(-0.5, 0.5))
def test_an_interpolation_lies_between_its_plots(share: float, azimuth: float, change: float) -> None:
    """Wherever the instant falls between two plots, azimuth lies on the short way between theirs."""
    start = _plot(-share, (1000.0, azimuth, 0.0))
    end = _plot(1.0 - share, (1000.0, math.remainder(azimuth + change, 2.0 * math.pi), 0.0))
    value, _ = _at([start, end])
    along = math.remainder(float(value[1]) - azimuth, 2.0 * math.pi)
    assert min(0.0, change) - 1e-9 <= along <= max(0.0, change) + 1e-9  # times are whole nanoseconds


# geoid --------------------------------------------------------------------------------------------------------------


def _report(msl_m: float | None, height_m: float | None = None) -> GpsReport:
    return GpsReport("mavlink:1", T, T, 0.5, 1.8, msl_m, height_m)


def _learnt(site_m: float | None, *separations_m: float) -> Geoid:
    geoid = Geoid(site_m)
    for separation_m in separations_m:
        geoid = geoid.learn(_report(100.0, 100.0 + separation_m))
    return geoid


def test_the_sites_geoid_wins() -> None:
    """A site's separation turns altitude into height, whatever height the stream gives of its own."""
    geoid = _learnt(-35.0, 12.0, 12.0)
    assert geoid.height_m(_report(1000.0)) == 965.0
    assert geoid.height_m(_report(1000.0, 1012.0)) == 965.0
    assert geoid.contradiction_m == 47.0


def test_without_a_site_the_streams_median_counts() -> None:
    """The median of the stream's separations serves reports without a height; one that has its own keeps it."""
    geoid = _learnt(None, 19.0, 20.0, 500.0)
    assert geoid.separation_m == 20.0
    assert geoid.height_m(_report(1000.0)) == 1020.0
    assert geoid.height_m(_report(1000.0, 1033.0)) == 1033.0
    assert geoid.contradiction_m == 0.0


def test_nothing_known_is_no_separation() -> None:
    """Without site and stream heights are altitudes; a report of a height alone keeps it; of nothing, none."""
    geoid = _learnt(None)
    assert geoid.separation_m == 0.0
    assert geoid.height_m(_report(1000.0)) == 1000.0
    assert geoid.height_m(_report(None, 950.0)) == 950.0
    assert math.isnan(geoid.height_m(_report(None)))


def test_the_geoid_is_learnt_from_reports_of_both_heights_only_and_not_for_ever() -> None:
    """A report that gives one height teaches nothing, and after enough reports the separation stands."""
    geoid = _learnt(None, *[20.0] * Geoid.KEEP)
    assert geoid.learn(_report(100.0)).learn(_report(None, 100.0)) is geoid
    assert geoid.learn(_report(100.0, 900.0)) is geoid


# two sites that differ by their geoid only ----------------------------------------------------------------------------


def test_two_sites_of_different_geoid_differ_by_it_in_height_and_in_nothing_else(world: Any) -> None:
    """Separations 19.3 m apart give heights 19.3 m apart, the same altitude_msl_m, and no error laid on the radar."""
    heights, altitudes, misses = [], [], []
    for more_m in (0.0, 19.3):
        # The same airfield, written down with another geoid: its runway and radar stand at the same altitude.
        runway = replace(
            DEMO_SITE.runway, geoid_separation_m=-35.0 + more_m, height_m=DEMO_SITE.runway.height_m + more_m
        )
        there = world.with_site(replace(DEMO_SITE, runway=runway))
        ran = there.run(there.flight(seconds=25.0, missing=False))
        rows = ran.rows(updated_by="gps")
        heights.append([row["height_m"] for row in rows])
        altitudes.append([row["altitude_msl_m"] for row in rows])
        misses.append(np.concatenate([picture.associate.check_difference for picture in ran.pictures]))
    # 1 mm: 19.3 m higher a degree is 3e-6 longer, and the Earth's 49 m of drop at 25 km with it
    assert np.array(heights[1]) - heights[0] == pytest.approx(np.full(len(heights[0]), 19.3), abs=1e-3)
    assert altitudes[1] == pytest.approx(altitudes[0], abs=1e-3)
    assert len(misses[0]) > 2
    assert misses[1] == pytest.approx(misses[0], abs=1e-3)


def test_a_geoid_that_contradicts_the_site_is_said_once(world: Any) -> None:
    """Streams that differ from the site by more than 5 m are said once; by less they are not."""
    for off_m, times in ((6.0, 1), (4.0, 0)):
        course = world.Course()
        reports = [world.report(course, t) for t in range(1, 9)]
        reports = [replace(r, height_m=r.altitude_msl_m - 35.0 + off_m) for r in reports]
        ran = world.run(reports)
        assert len(ran.said("geoid separation is")) == times
        # and the site's is used
        assert ran.rows()[0]["altitude_msl_m"] == pytest.approx(reports[0].altitude_msl_m, abs=1e-6)


def test_a_geoid_that_nobody_gives_is_said(world: Any) -> None:
    """Without any separation, heights equal altitudes, and that is said once."""
    there = world.with_site(replace(DEMO_SITE, runway=replace(DEMO_SITE.runway, geoid_separation_m=None)))
    ran = there.run([there.report(there.Course(), t) for t in range(1, 9)])
    assert len(ran.said("neither site nor stream")) == 1
    for row in ran.rows():
        assert row["height_m"] == row["altitude_msl_m"]


# reports and plots ----------------------------------------------------------------------------------------------------


def test_a_report_arrives_where_it_said(world: Any) -> None:
    """A report becomes ENU metres at the runway with its stream's sigmas and its velocity turned to the runway's axes."""
    course = world.Course(along_m=-60_000.0)
    report = world.report(course, 5.0, horizontal_sigma_m=4.0, vertical_sigma_m=7.0, velocity_sigma_mps=0.3)
    east, north, up = 81.0, -2.0, -3.0
    report = replace(report, velocity_east_mps=east, velocity_north_mps=north, velocity_up_mps=up)
    height = report.altitude_msl_m - 35.0
    (fix,) = place_reports([report], [1], [height], DEMO_SITE, world.frame)
    wanted = world.frame.enu_from_runway @ course.at(5.0)
    assert fix.enu_m == pytest.approx(wanted, abs=1e-6)
    assert fix.sigma_m.tolist() == [4.0, 4.0, 7.0]
    assert fix.velocity_sigma_mps == 0.3
    # two positions a second apart along that velocity, there
    ahead = world.frame.local_from_enu(report.latitude_rad, report.longitude_rad).T @ [east, north, up]
    assert fix.velocity_mps == pytest.approx(ahead, abs=1e-9)
    # the runway's up leans 0.54 degrees there: flying east at 81 m/s and level is climbing 0.76 m/s in its frame
    assert fix.velocity_mps[2] - up == pytest.approx(81.0 * math.sin(60_000.0 / 6.38e6), abs=0.01)


def test_a_report_without_its_own_accuracy_has_the_sites(world: Any) -> None:
    """Sigmas that the stream does not give are the site's; ones too good to be true are held at 0.3 m and 0.1 m/s."""
    bare = world.report(world.Course(), 1.0)
    proud = replace(bare, horizontal_sigma_m=0.01, velocity_sigma_mps=0.001)
    first, second = place_reports([bare, proud], [1, 2], [900.0, 900.0], DEMO_SITE, world.frame)
    assert first.sigma_m.tolist() == [15.0] * 3
    assert first.velocity_sigma_mps == 1.0
    assert np.isnan(first.velocity_mps).all()
    assert second.sigma_m.tolist() == [0.3] * 3
    assert second.velocity_sigma_mps == 0.1


@pytest.mark.parametrize(
    ("timing", "comparable"),
    [(Timing.UTC, True), (Timing.ENVELOPE, True), (Timing.PROVISIONAL, False), (Timing.FOREIGN, False)],
)
def test_only_a_settled_clock_is_compared(world: Any, timing: Timing, comparable: bool) -> None:
    """A report is compared with radar only when its clock is UTC or the settled envelope."""
    (fix,) = place_reports([world.report(world.Course(), 1.0, timing=timing)], [1], [900.0], DEMO_SITE, world.frame)
    assert fix.comparable is comparable


def test_many_reports_have_the_bits_of_one(world: Any) -> None:
    """Reports placed together have the very bits that each has alone."""
    course = world.Course()
    reports = [
        world.report(course, t, velocity_east_mps=80.0 + t, velocity_north_mps=t / 7.0, velocity_up_mps=-3.0)
        for t in np.arange(0.3, 60.0, 1.7)
    ]
    heights = [report.altitude_msl_m - 35.0 for report in reports]
    for fix, report, height in zip(
        place_reports(reports, range(len(reports)), heights, DEMO_SITE, world.frame), reports, heights, strict=True
    ):
        (alone,) = place_reports([report], [1], [height], DEMO_SITE, world.frame)
        assert fix.enu_m.tobytes() == alone.enu_m.tobytes()
        assert fix.velocity_mps.tobytes() == alone.velocity_mps.tobytes()
    assert place_reports([], [], [], DEMO_SITE, world.frame) == []


def test_a_plot_has_the_correction_taken_off_and_its_own_sigmas_before_the_sites() -> None:
    """What a radar measures too much is subtracted, its lateness too; what is missing stays so."""
    said = RadarPlot(1, 3, T, T, 1000.0, None, 0.05, azimuth_sigma_rad=5e-4)
    plot = place_plot(said, 7, DEMO_SITE.radars[0], (10.0, 0.01, 0.02, 0.05))
    assert list(plot.polar) == pytest.approx([990.0, NAN, 0.03], nan_ok=True)
    site = DEMO_SITE.radars[0]
    assert list(plot.sigma) == [site.range_sigma_m, 5e-4, site.elevation_sigma_rad]
    assert (plot.at, plot.serial, plot.radar, plot.number) == (T - 50_000_000, 7, 1, 3)


def test_raw_positions_are_drawn_where_they_are(world: Any) -> None:
    """Reports and complete plots become points of the runway frame; a plot without a component has none."""
    course = world.Course()
    fix, plot, half = world.fix(course, 3.0), world.plot(course, 4.0), world.plot(course, 5.0, missing="e")
    found = draw([fix], [plot, half], world.frame, world.radars)
    assert found.report_runway_m[0] == pytest.approx(course.at(3.0), abs=1e-6)
    assert found.plot_runway_m[0] == pytest.approx(course.at(4.0), abs=1e-6)
    assert np.isnan(found.plot_runway_m[1]).all()
    assert found.plot_radar_track == ("1/3", "1/3")
    assert draw([], [], world.frame, world.radars).report_runway_m.shape == (0, 3)


# radars ---------------------------------------------------------------------------------------------------------------


def _status(world: Any, radar: RadarSite, **changed: Any) -> RadarStatus:
    """What a radar that stands there would say of itself."""
    latitude, longitude, height = world.frame.geodetic_from_runway(
        [radar.along_m, radar.left_m, radar.antenna_height_m]
    )
    place = (float(latitude), float(longitude), float(height), radar.compass_boresight_rad)
    return replace(RadarStatus(radar.number, T, T, "operating", "precision approach", 0.4, *place), **changed)


def test_a_radars_own_word_is_its_place_in_the_runway_frame(world: Any) -> None:
    """Latitude, longitude, height and boresight of a status are the site file's along, left, height and boresight."""
    site = DEMO_SITE.radars[0]
    found = radar_from_status(_status(world, site), world.frame)
    assert (found.along_m, found.left_m, found.antenna_height_m) == pytest.approx((300.0, 150.0, 3.0), abs=1e-6)
    assert RadarFrame.of(found, world.frame).antenna_enu_m == pytest.approx(world.radars[1].antenna_enu_m, abs=1e-6)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"along_m": 329.0}, None),
        ({"along_m": 331.0}, "31 m elsewhere"),
        ({"compass_boresight_rad": math.radians(270.09)}, None),
        ({"compass_boresight_rad": math.radians(270.2)}, "+0.20 degrees"),
        ({"compass_boresight_rad": math.radians(-90.0)}, None),
        ({"left_m": 450.0, "compass_boresight_rad": math.radians(269.0)}, "elsewhere and looks -1.00 degrees"),
    ],
)
def test_a_contradiction_is_beyond_30_m_or_a_tenth_of_a_degree(changed: dict[str, float], words: str | None) -> None:
    """Smaller differences, and whole turns, are none."""
    found = contradiction(DEMO_SITE.radars[0], replace(DEMO_SITE.radars[0], **changed))
    assert (found is None) if words is None else (found is not None and words in found)


@pytest.mark.parametrize("known", [False, True])
def test_a_radar_is_used_from_the_file_else_from_its_status(
    world: Any, known: bool, differences: Callable[..., float]
) -> None:
    """Without a site entry a radar's status serves, and is said; with one the file is used, the contradiction said once."""
    flight = world.flight(seconds=25.0)
    site = DEMO_SITE.radars[0]
    elsewhere = replace(site, along_m=500.0) if known else site
    statuses = [replace(_status(world, elsewhere), valid_at=world.at(t), received_at=world.at(t)) for t in (0.0, 5.0)]
    ran = world.run([*statuses, *flight], site=DEMO_SITE if known else replace(DEMO_SITE, radars=()))
    wanted, found = world.run(flight).last(updated_by="radar"), ran.last(updated_by="radar")
    assert wanted.keys() == found.keys()
    assert len(ran.said("the site file is used")) == int(known)
    assert len(ran.said("taken to stand where its status says")) == int(not known)
    # from the status: its place is rounded through geodetic coordinates, and it gives no sigmas but the usual
    assert differences(found, wanted) < (1e-9 if known else 0.1)


def test_a_radar_that_nobody_placed_is_counted_and_said_once(world: Any) -> None:
    """Plots of a radar that is in no file and has said nothing are counted, and that is one sentence."""
    flight = world.flight(seconds=8.0, aircraft=None)
    ran = world.run(flight, site=replace(DEMO_SITE, radars=()))
    assert ran.state.counters == {"plots of an unknown radar": len(flight)}
    assert len(ran.said("radar 1 is not in the site file")) == 1
    assert ran.rows() == []
