"""What the simulated sensors measure: the right amount of the right noise, and each from a stream of its own.

Tolerances of a mean of n samples are 4 sigma / sqrt(n), of a standard deviation 4 sigma / sqrt(2 n): with fixed seeds a right
sensor passes for ever, and one that is off by 5 % fails.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, turn
from gateway.settings import DEMO_SITE
from sim.cases import case_003
from sim.earth import fly
from sim.paths import CasePath
from sim.sensors import (
    GpsParameters,
    RadarParameters,
    draw_clutter,
    during,
    gps_phases,
    gps_times,
    measure_gps,
    measure_radar,
    scan_times,
    stream,
)

RUNS = 100
CASE = case_003(RUNS, seed=7, abeam_deg=3.0)
SIGMAS = np.array([15.0, 1e-3, 1e-3])


def _true_polar() -> np.ndarray:
    """The truth in the radar's frame, by the gateway's own frames."""
    radar = RadarFrame.of(DEMO_SITE.radars[0], RunwayFrame(DEMO_SITE.runway))
    return polar_from_xyz(radar.from_enu(CASE.true_enu_m))


def test_radar_noise_is_what_was_asked_for() -> None:
    """Range, azimuth, elevation errors have mean 0 and sigmas 15 m, 1 mrad, 1 mrad."""
    errors = CASE.plots.polar - _true_polar()
    for axis, sigma in enumerate(SIGMAS):
        found = errors[..., axis][np.isfinite(errors[..., axis])]
        assert abs(np.mean(found)) < 4 * sigma / math.sqrt(len(found))
        assert abs(np.std(found) - sigma) < 4 * sigma / math.sqrt(2 * len(found))


def test_radar_components_are_missing_as_often_as_asked_for() -> None:
    """Range is missing in 5 %, azimuth and elevation in 20 %, each on its own."""
    missing = np.isnan(CASE.plots.polar)
    count = missing[..., 0].size
    for axis, share in enumerate((0.05, 0.2, 0.2)):
        assert abs(np.mean(missing[..., axis]) - share) < 4 * math.sqrt(share * (1 - share) / count)
    both = np.mean(missing[..., 1] & missing[..., 2])
    assert abs(both - 0.04) < 4 * math.sqrt(0.04 * 0.96 / count)


def test_gps_error_is_the_constant_and_the_noise() -> None:
    """Reports are off by east 35, north 40, up 28 m on average, with 15 m an axis about it."""
    true = fly(CasePath(), CASE.site.runway, CASE.gps.valid_s)
    frame = RunwayFrame(CASE.site.runway)
    at = [(CASE.gps.latitude_rad, CASE.gps.longitude_rad, CASE.gps.height_m)]
    at.append((true.latitude_rad, true.longitude_rad, true.height_m))
    said, real = (frame.enu_from_geodetic(*place) for place in at)
    turned = np.einsum("...ij,...j->...i", frame.local_from_enu(true.latitude_rad, true.longitude_rad), said - real)
    for axis, error in enumerate((35.0, 40.0, 28.0)):
        found = turned[..., axis].ravel()
        assert abs(np.mean(found) - error) < 4 * 15.0 / math.sqrt(len(found))
        assert abs(np.std(found) - 15.0) < 4 * 15.0 / math.sqrt(2 * len(found))


def test_gps_latency_is_uniform() -> None:
    """Reports come 0.8 to 2.0 s late, uniformly."""
    latency = CASE.gps.received_s - CASE.gps.valid_s
    assert 0.8 <= np.min(latency) < 0.81
    assert 1.99 < np.max(latency) <= 2.0
    assert abs(np.mean(latency) - 1.4) < 4 * 1.2 / math.sqrt(12 * latency.size)


def test_gps_is_valid_at_the_times_of_the_paper() -> None:
    """Without another wish reports are valid at 0.13, 5.13, 10.13 s and so on, until the end."""
    assert CASE.gps.valid_s[0] == pytest.approx(np.arange(0.13, 457.14, 5.0))


def test_variants_of_the_case_differ_in_nothing_else() -> None:
    """Without the constant error the reports move by it and nothing else changes; a missing component leaves the others."""
    clean, blind = case_003(RUNS, seed=7, gps_error=False), case_003(RUNS, seed=7, missing="azimuth")
    assert np.array_equal(clean.plots.polar, CASE.plots.polar, equal_nan=True)
    assert CASE.gps.height_m - clean.gps.height_m == pytest.approx(np.full(CASE.gps.height_m.shape, 28.0), abs=1e-9)
    assert np.all(np.isnan(blind.plots.polar[..., 1]))
    assert np.array_equal(blind.plots.polar[..., [0, 2]], CASE.plots.polar[..., [0, 2]], equal_nan=True)
    assert np.array_equal(blind.gps.latitude_rad, CASE.gps.latitude_rad)


def test_case_refuses_components_that_no_radar_has() -> None:
    """A misspelt component is an error, not a case without anything missing."""
    with pytest.raises(ValueError, match="azimut"):
        case_003(1, missing="azimut")


def test_case_can_shift_its_fixes() -> None:
    """Fixes can be valid 0.8, 5.8, ... s after the first plot, or each run at its own phase within a period."""
    assert case_003(2, first_fix_s=0.8).gps.valid_s[1, :3] == pytest.approx([0.8, 5.8, 10.8])
    first = case_003(400, random_phase=True).gps.valid_s[:, 0]
    assert 0.0 <= np.min(first) < 0.1
    assert 4.9 < np.max(first) < 5.0
    assert abs(np.mean(first) - 2.5) < 4 * 5.0 / math.sqrt(12 * 400)


def test_aircraft_abeam_is_seen_three_degrees_to_the_left() -> None:
    """The second aircraft's plots are at the same range and elevation and 3 degrees more azimuth."""
    assert CASE.abeam is not None
    difference = np.nanmean(CASE.abeam.polar - CASE.plots.polar, axis=0)
    assert np.degrees(np.mean(difference[:, 1])) == pytest.approx(3.0, abs=0.01)
    assert np.mean(difference[:, 0]) == pytest.approx(0.0, abs=1.0)
    assert np.mean(difference[:, 2]) == pytest.approx(0.0, abs=2e-5)


def test_left_of_the_approach_is_positive_azimuth_from_the_left() -> None:
    """Facing the approach, an aircraft to the right hand of the landing pilot is to the left of the radar's boresight."""
    frame = RunwayFrame(DEMO_SITE.runway)
    radar = RadarFrame.of(DEMO_SITE.radars[0], frame)
    right_of_pilot = turn(frame.enu_from_runway, [-20e3, 150.0 - 1000.0, 500.0])
    measured = measure_radar(
        RadarParameters(azimuth_sigma_rad=0.0, missing_azimuth=0.0), [0.0], radar.from_enu([right_of_pilot]),
        np.zeros((1, 3)), stream(0, "radar"),
    )  # fmt: skip
    assert measured.polar[0, 1] == pytest.approx(math.atan2(1000.0, 20300.0))


def _plots(parameters: RadarParameters, count: int = 4000) -> np.ndarray:
    position = np.tile([20e3, 3e3, 900.0], (count, 1))
    velocity = np.tile([-100.0, 0.0, 0.0], (count, 1))
    return measure_radar(parameters, np.arange(count) * 0.4, position, velocity, stream(3, "radar")).polar


def test_constant_errors_shift_plots() -> None:
    """Constant errors of a radar are added to every plot and change no noise."""
    off = RadarParameters(range_error_m=150.0, azimuth_error_rad=0.01, elevation_error_rad=-0.004)
    shift = _plots(off) - _plots(RadarParameters())
    assert np.nanmax(np.abs(shift - [150.0, 0.01, -0.004])) < 1e-9


def test_a_probability_changes_no_noise() -> None:
    """Where two settings of the missing shares both measured, they measured the same."""
    often, seldom = _plots(RadarParameters(missing_azimuth=0.6)), _plots(RadarParameters(missing_azimuth=0.1))
    both = np.isfinite(often) & np.isfinite(seldom)
    assert np.array_equal(often[both], seldom[both])
    assert np.isfinite(often[:, 1]).mean() < 0.5 < np.isfinite(seldom[:, 1]).mean()


def test_a_radar_sees_no_further_than_it_can() -> None:
    """Beyond its range, outside its sector, in a dropout and below its detection probability there are no plots."""
    assert not np.isfinite(_plots(RadarParameters(maximum_range_m=20e3))).any()
    assert not np.isfinite(_plots(RadarParameters(sector_rad=0.1))).any()
    seen = np.isfinite(_plots(RadarParameters(dropouts=((100.0, 200.0),), detection_probability=0.7))).any(axis=1)
    assert not seen[250:500].any()
    assert np.mean(np.delete(seen, np.s_[250:500])) == pytest.approx(0.7, abs=4 * math.sqrt(0.21 / 3750) + 0.002)


def test_radial_velocity_is_negative_for_an_approaching_target() -> None:
    """Radial velocity is positive when receding, with its own noise, and only where it is asked for."""
    position, velocity = np.tile([20e3, 0.0, 0.0], (900, 1)), np.tile([-100.0, 30.0, 0.0], (900, 1))
    times = np.arange(900.0)
    given = RadarParameters(radial_velocity=True)
    measured = measure_radar(given, times, position, velocity, stream(1, "radar")).radial_mps
    assert np.nanmean(measured) == pytest.approx(-100.0, abs=4 * 0.5 / 30)
    silent = measure_radar(RadarParameters(), times, position, velocity, stream(1, "radar")).radial_mps
    assert np.isnan(silent).all()


def test_a_burst_is_in_the_scans_of_its_time() -> None:
    """From 4 s to 4.8 s every scan has so many false plots more; the others have none."""
    parameters = RadarParameters(bursts=((4.0, 4.8),), burst_plots=300)
    scan, _ = draw_clutter(parameters, 0.4 * np.arange(20), stream(0, "clutter"))
    assert np.bincount(scan, minlength=20).tolist() == [0] * 10 + [300] * 2 + [0] * 8


def test_clutter_fills_the_coverage() -> None:
    """The number of false plots is Poisson, and they are uniform over range, sector and the lowest 10 degrees."""
    parameters = RadarParameters(clutter_per_scan=5.0, sector_rad=0.5)
    scan, polar = draw_clutter(parameters, 0.4 * np.arange(2000), stream(0, "clutter"))
    per_scan = np.bincount(scan, minlength=2000)
    assert np.mean(per_scan) == pytest.approx(5.0, abs=4 * math.sqrt(5.0 / 2000))
    assert np.var(per_scan) == pytest.approx(5.0, abs=1.0)
    assert np.min(polar, axis=0) == pytest.approx([500.0, -0.5, 0.0], abs=60.0)
    assert np.mean(polar, axis=0) == pytest.approx(
        [30250.0, 0.0, math.radians(5.0)], abs=4 * 60e3 / math.sqrt(12 * 1e4)
    )
    assert np.max(np.abs(polar[:, 1])) <= 0.5


def test_a_source_may_have_an_error_of_its_own() -> None:
    """With error_sigma_m each aircraft's source is off by one constant of its own, of that sigma over the aircraft."""
    gps = GpsParameters(sigma_m=0.0, error_east_m=0.0, error_north_m=0.0, error_up_m=0.0, error_sigma_m=10.0)
    valid = np.broadcast_to(np.arange(1.0, 4.0), (2000, 3))
    flown = fly(CasePath(), DEMO_SITE.runway, valid)
    up = measure_gps(gps, valid, flown, stream(0, "gps")).height_m - flown.height_m
    assert np.ptp(up, axis=1) == pytest.approx(np.zeros(2000), abs=1e-9)
    assert np.std(up[:, 0]) == pytest.approx(10.0, abs=4 * 10.0 / math.sqrt(4000))


def test_a_position_only_source_gives_no_velocity() -> None:
    """Without velocity it is NaN, never 0, and the positions are the same."""
    valid = gps_times(GpsParameters(), 0.0, 100.0, 0.13)
    flown = fly(CasePath(), DEMO_SITE.runway, valid)
    with_it, without = (
        measure_gps(replace(GpsParameters(), velocity=given), valid, flown, stream(0, "gps")) for given in (True, False)
    )
    assert np.isnan(without.velocity_mps).all()
    assert np.std(with_it.velocity_mps - flown.velocity_mps) == pytest.approx(0.5, rel=0.4)
    assert np.array_equal(with_it.latitude_rad, without.latitude_rad)


def test_reports_are_lost_in_dropouts_and_by_chance() -> None:
    """A dropout loses every report in it, `missing` its share of the others."""
    gps = GpsParameters(period_s=0.1, missing=0.3, dropouts=((100.0, 200.0),))
    valid = gps_times(gps, 0.0, 450.0, 0.0)
    heard = measure_gps(gps, valid, fly(CasePath(), DEMO_SITE.runway, valid), stream(0, "gps")).heard
    within = during(gps.dropouts, valid)
    assert not heard[within].any()
    assert np.mean(heard[~within]) == pytest.approx(0.7, abs=4 * math.sqrt(0.21 / 3500))


def test_times_are_multiples_of_the_period_after_the_phase() -> None:
    """Reports and scans begin with the first multiple at or after the start, and end before the end."""
    assert gps_times(GpsParameters(period_s=2.0), 3.0, 9.13, 0.13) == pytest.approx([4.13, 6.13, 8.13])
    assert scan_times(RadarParameters(), 0.0, 2.0) == pytest.approx([0.0, 0.4, 0.8, 1.2, 1.6])
    assert scan_times(RadarParameters(phase_s=0.1), 0.2, 1.3) == pytest.approx([0.5, 0.9])


def test_streams_are_independent_and_stay() -> None:
    """A stream is decided by its seed and name; other names and seeds give other numbers."""
    first = stream(1, "gps", 3).normal(size=1000)
    assert np.array_equal(first, stream(1, "gps", 3).normal(size=1000))
    for other in (stream(2, "gps", 3), stream(1, "gps", 4), stream(1, "radar:1", 3)):
        assert abs(np.corrcoef(first, other.normal(size=1000))[0, 1]) < 0.15


def test_a_set_phase_is_everybodys_and_a_random_one_is_not() -> None:
    """Phases are as set unless they are asked to be random."""
    assert gps_phases(GpsParameters(), stream(0, "gps"), (3,)).tolist() == [0.13] * 3
    assert len(set(gps_phases(GpsParameters(random_phase=True), stream(0, "gps"), (3,)).tolist())) == 3
