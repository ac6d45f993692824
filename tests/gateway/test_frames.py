"""The site's frames against pyproj's topocentric ones, and their signs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pyproj import Transformer

from gateway.frames import (
    RadarFrame,
    RunwayFrame,
    level_axes,
    polar_from_xyz,
    polar_jacobian,
    turn,
    xyz_from_polar,
)
from gateway.settings import DEMO_SITE, RadarSite, Runway, parse_site

Floats = NDArray[np.float64]

# both hemispheres, both sides of Greenwich, and runways from which the approach crosses the date line
PLACES_DEG = [(31.0, 104.0), (-33.9, 151.2), (51.5, -0.4), (-17.7, 179.9), (64.0, -179.8), (-54.8, -68.3), (0.0, 0.1)]
DIRECTIONS_DEG = [10.0, 90.0, 137.0, 200.0, 283.5]  # at least one in each quadrant


def _runway(latitude_deg: float, longitude_deg: float, direction_deg: float) -> Runway:
    return Runway(math.radians(latitude_deg), math.radians(longitude_deg), 500.0, math.radians(direction_deg))


def _approach_m() -> Floats:
    """100 km of approach in the runway frame, beginning left of the centreline and ending right of it."""
    x = np.linspace(-100_000.0, 2_000.0, 103)
    return np.stack([x, 0.06 * -x - 50.0, 400.0 + 0.05 * -x], axis=-1)


def _topocentric(runway: Runway, latitude: Floats, longitude: Floats, height: Floats) -> Floats:
    """East, north, up by pyproj."""
    latitude_deg, longitude_deg = math.degrees(runway.latitude_rad), math.degrees(runway.longitude_rad)
    pipeline = (
        "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lat_0={latitude_deg!r} +lon_0={longitude_deg!r} +h_0={runway.height_m!r}"
    )
    return np.stack(Transformer.from_pipeline(pipeline).transform(longitude, latitude, height, radians=True), axis=-1)


def _radar(boresight_deg: float = 270.0) -> RadarSite:
    return replace(DEMO_SITE.radars[0], compass_boresight_rad=math.radians(boresight_deg))


@pytest.mark.parametrize("place_deg", PLACES_DEG)
@pytest.mark.parametrize("direction_deg", DIRECTIONS_DEG)
def test_enu_and_runway_agree_with_pyproj(place_deg: tuple[float, float], direction_deg: float) -> None:
    """Along 100 km of approach, ENU and runway positions are pyproj's within a micrometre, and so is the way back."""
    runway = _runway(*place_deg, direction_deg)
    frame, wanted = RunwayFrame(runway), _approach_m()
    latitude, longitude, height = frame.geodetic_from_runway(wanted)
    reference = _topocentric(runway, latitude, longitude, height)
    assert np.abs(frame.enu_from_geodetic(latitude, longitude, height) - reference).max() < 1e-6
    # x along the landing direction, y to its left: written out here from the compass direction alone
    sine, cosine = math.sin(runway.landing_compass_rad), math.cos(runway.landing_compass_rad)
    x, y = reference[:, 0] * sine + reference[:, 1] * cosine, -reference[:, 0] * cosine + reference[:, 1] * sine
    found = frame.runway_from_geodetic(latitude, longitude, height)
    assert np.abs(found - np.stack([x, y, reference[:, 2]], axis=-1)).max() < 1e-6
    assert np.abs(found - wanted).max() < 1e-6


@pytest.mark.parametrize("longitude_deg", [179.9, -179.9])
def test_an_approach_across_the_date_line_is_straight(longitude_deg: float) -> None:
    """Longitudes on both sides of 180 degrees are neighbours, and come back between -180 and 180 degrees."""
    frame = RunwayFrame(_runway(-17.0, longitude_deg, 90.0 if longitude_deg < 0 else 270.0))
    wanted = _approach_m()
    latitude, longitude, height = frame.geodetic_from_runway(wanted)
    assert (longitude > 0.0).any()
    assert (longitude < 0.0).any()
    assert np.abs(longitude).max() <= math.pi
    assert np.abs(frame.runway_from_geodetic(latitude, longitude, height) - wanted).max() < 1e-6
    whole_turns = frame.runway_from_geodetic(
        latitude, np.where(longitude < 0, longitude + 2 * math.pi, longitude), height
    )
    assert np.abs(whole_turns - wanted).max() < 1e-6


def test_the_earth_drops_196_m_at_50_km() -> None:
    """A point at the runway's own height 50 km away is 196 m below the runway's horizontal: no flat-earth shortcut."""
    frame = RunwayFrame(_runway(31.0, 104.0, 90.0))
    latitude, longitude, height = frame.geodetic_from_runway([-50_000.0, 0.0, 0.0])
    assert float(height) - 500.0 == pytest.approx(196.0, abs=0.5)  # 196 is a figure of whole metres
    down = frame.runway_from_geodetic(latitude, longitude, 500.0)
    assert down[2] == pytest.approx(-196.0, abs=0.5)


@pytest.mark.parametrize("direction_deg", DIRECTIONS_DEG)
def test_runway_axes_point_along_left_and_up(direction_deg: float) -> None:
    """One metre in the landing direction is +x; one metre to its left is +y; ENU to runway is a proper rotation."""
    beta = math.radians(direction_deg)
    axes = level_axes(beta)
    ahead = [math.sin(beta), math.cos(beta), 0.0]
    left = [math.sin(beta - math.pi / 2), math.cos(beta - math.pi / 2), 0.0]  # a compass direction less 90 degrees
    # 1e-15: roundings of numbers below one
    assert turn(axes, ahead) == pytest.approx([1.0, 0.0, 0.0], abs=1e-15)
    assert turn(axes, left) == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("direction_deg", DIRECTIONS_DEG)
def test_radar_is_equation_4_with_the_right_sign_of_height(direction_deg: float) -> None:
    """A radar against the landing direction has x_r = -x + x_radar, y_r = -y + y_radar, z_r = z - antenna height."""
    runway = _runway(31.0, 104.0, direction_deg)
    frame = RunwayFrame(runway)
    site = RadarSite(1, 300.0, 150.0, 3.0, runway.landing_compass_rad + math.pi)
    place = _approach_m()
    found = RadarFrame.of(site, frame).from_enu(turn(frame.enu_from_runway, place))
    wanted = np.stack([300.0 - place[:, 0], 150.0 - place[:, 1], place[:, 2] - 3.0], axis=-1)
    assert np.abs(found - wanted).max() < 1e-9  # roundings of 1e5 m are 1.5e-11 m, a few of them


def test_an_aircraft_at_the_antennas_height_has_elevation_zero() -> None:
    """An antenna 3 m above the runway sees an aircraft 3 m above the runway level; on the runway it is 2 mrad down."""
    frame = RunwayFrame(DEMO_SITE.runway)
    radar = RadarFrame.of(DEMO_SITE.radars[0], frame)
    level, low = polar_from_xyz(
        radar.from_enu(turn(frame.enu_from_runway, [[-1200.0, 150.0, 3.0], [-1200.0, 150.0, 0.0]]))
    )
    assert level[2] == pytest.approx(0.0, abs=1e-12)  # roundings of a metre over 1500 m
    assert low[2] == pytest.approx(-math.atan(3.0 / 1500.0), abs=1e-12)


def test_left_of_the_boresight_is_positive_azimuth() -> None:
    """Seen from above, azimuth counts counter-clockwise from the boresight: left is positive, right is negative."""
    radar = RadarFrame.of(_radar(270.0), RunwayFrame(DEMO_SITE.runway))
    west, south_of_west, north_of_west = [-9000.0, 0.0, 0.0], [-9000.0, -1000.0, 0.0], [-9000.0, 1000.0, 0.0]
    enu = np.array([west, south_of_west, north_of_west]) + radar.antenna_enu_m
    azimuth = polar_from_xyz(radar.from_enu(enu))[:, 1]
    # looking west, the south is to the left
    assert azimuth == pytest.approx([0.0, math.atan(1 / 9), -math.atan(1 / 9)], abs=1e-12)


def test_an_aircraft_left_of_its_own_centreline_is_right_of_the_boresight() -> None:
    """Radar and runway look at each other: the pilot's left is the radar's right, so y > 0 gives azimuth < 0."""
    frame = RunwayFrame(DEMO_SITE.runway)
    radar = RadarFrame.of(DEMO_SITE.radars[0], frame)
    azimuth = polar_from_xyz(radar.from_enu(turn(frame.enu_from_runway, [-20_000.0, 6_000.0, 1000.0])))[1]
    assert azimuth < -0.2


@pytest.mark.parametrize("direction_deg", [0.0, 90.0, 137.0, 200.0, 350.0])
def test_a_boresight_that_is_not_given_looks_against_the_landing_direction(direction_deg: float) -> None:
    """Without boresight_deg the radar faces the approach: an aircraft on final straight ahead has azimuth 0."""
    site = parse_site(
        f"[runway]\nlatitude_deg = 31.0\nlongitude_deg = 104.0\nheight_m = 500.0\nlanding_direction_deg = {direction_deg}\n"
        "[[radar]]\nnumber = 1\nalong_m = 300.0\nleft_m = 150.0\nantenna_height_m = 3.0\n"
    )
    frame = RunwayFrame(site.runway)
    radar = RadarFrame.of(site.radars[0], frame)
    polar = polar_from_xyz(radar.from_enu(turn(frame.enu_from_runway, [-9700.0, 150.0, 3.0])))
    assert polar == pytest.approx([10_000.0, 0.0, 0.0], abs=1e-8)  # m; and rad, far below any radar's


@given(st.floats(1.0, 60_000.0), st.floats(-3.14, 3.14), st.floats(-1.5, 1.5))
def test_polar_there_and_back(distance: float, azimuth: float, elevation: float) -> None:
    """Polar to Cartesian to polar is the same place."""
    found = polar_from_xyz(xyz_from_polar([distance, azimuth, elevation]))
    assert found[0] == pytest.approx(distance, rel=1e-14)
    # 1e-13: near the zenith, cos(1.5) = 0.07 makes the roundings of an angle ten times larger
    assert found[1:] == pytest.approx([azimuth, elevation], abs=1e-13)


def test_polar_uses_all_four_quadrants() -> None:
    """Azimuth is right behind the radar as well: an aircraft behind and to the left is beyond +90 degrees."""
    polar = polar_from_xyz([[-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [0.0, 0.0, 5.0]])
    assert polar[:2, 1] == pytest.approx([0.75 * math.pi, -0.75 * math.pi])
    assert polar[2] == pytest.approx([5.0, 0.0, math.pi / 2])


@given(st.floats(-60_000.0, 60_000.0), st.floats(-60_000.0, 60_000.0), st.floats(-100.0, 9_000.0))
def test_polar_jacobian_is_the_derivative(x: float, y: float, z: float) -> None:
    """The Jacobian is the finite difference of the polar coordinates, each component in each direction."""
    if math.hypot(x, y) < 100.0:
        x += 1000.0
    here = np.array([x, y, z])
    step = 1e-2
    for axis in range(3):
        ahead, behind = here.copy(), here.copy()
        ahead[axis] += step
        behind[axis] -= step
        change = polar_from_xyz(ahead) - polar_from_xyz(behind)
        change[1] = math.remainder(change[1], 2.0 * math.pi)
        found = polar_jacobian(here)[:, axis]
        # range: rounding 1.5e-11 m over the step; angles: curvature (step / distance)^2 and roundings 4e-16 rad over it
        assert found[0] == pytest.approx(change[0] / (2.0 * step), abs=5e-9)
        assert found[1:] == pytest.approx(change[1:] / (2.0 * step), abs=1e-9)


def test_polar_jacobian_is_finite_above_the_antenna() -> None:
    """At the zenith, where azimuth has no derivative, the Jacobian stays finite."""
    assert np.isfinite(polar_jacobian([[0.0, 0.0, 500.0], [0.0, 0.0, 0.0]])).all()


def test_far_from_the_runway_the_horizontal_is_tilted() -> None:
    """Vectors turn into the ENU of where the aircraft is: 50 km west, the runway's up leans 0.45 degrees."""
    frame = RunwayFrame(DEMO_SITE.runway)
    latitude, longitude, _ = frame.geodetic_from_enu([-50_000.0, 0.0, 1000.0])
    local = frame.local_from_enu(latitude, longitude)
    assert local @ local.T == pytest.approx(np.eye(3), abs=1e-15)
    lean = turn(local, [0.0, 0.0, 1.0])
    assert math.degrees(math.asin(lean[0])) == pytest.approx(0.449, abs=2e-3)  # 50 km over 6378 km, three digits
    assert abs(lean[1]) < 1e-4  # the meridians converge by 5e-3 rad here, the lean is 8e-3: their product
    # and it is pyproj's: the difference of two positions as seen from there
    there = replace(DEMO_SITE.runway, latitude_rad=float(latitude), longitude_rad=float(longitude))
    ends = frame.geodetic_from_enu([[-50_000.0, 0.0, 1000.0], [-49_900.0, 70.0, 1030.0]])
    seen = _topocentric(there, *ends)
    assert turn(local, [100.0, 70.0, 30.0]) == pytest.approx(seen[1] - seen[0], abs=1e-6)


def test_one_vector_has_the_bits_that_it_has_among_many() -> None:
    """Every conversion of a batch gives each position the very bits that it has alone."""
    runway = _runway(-33.9, 151.2, 137.0)
    frame = RunwayFrame(runway)
    radar = RadarFrame.of(_radar(), frame)
    given_m = _approach_m() + np.random.default_rng(2).normal(0.0, 500.0, (103, 3))

    def all_of(vectors: Floats) -> list[Floats]:
        latitude, longitude, height = frame.geodetic_from_runway(vectors)
        xyz = radar.from_enu(frame.enu_from_geodetic(latitude, longitude, height))
        polar = polar_from_xyz(xyz)
        back = radar.to_enu(xyz_from_polar(polar))
        parts = [latitude, longitude, height, frame.runway_from_geodetic(latitude, longitude, height), xyz, polar, back]
        return [*parts, polar_jacobian(xyz), frame.local_from_enu(latitude, longitude)]

    many = all_of(given_m)
    for i in range(len(given_m)):
        for alone, together in zip(all_of(given_m[i : i + 1]), many, strict=True):
            assert alone[0].tobytes() == together[i].tobytes()
        for alone, together in zip(all_of(given_m[i]), many, strict=True):
            assert np.asarray(alone).tobytes() == together[i].tobytes()
