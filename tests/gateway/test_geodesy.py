"""WGS-84 conversions against pyproj, at every latitude, and the same bits for one position and for many."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import Transformer

from gateway.geodesy import ecef_to_geodetic, enu_axes, geodetic_to_ecef, prime_vertical_radius_m, wrap_rad

# Forward only: pyproj's own inverse errs by 4e-5 m close to the poles, more than what is asked for here.
CART = Transformer.from_pipeline("+proj=cart +ellps=WGS84")

LATITUDES_DEG = [-90.0, -89.999999, -60.0, -45.0, -1e-9, 0.0, 1e-9, 1.0, 31.0, 45.0, 89.0, 89.999999, 90.0]
LONGITUDES_DEG = [-180.0, -179.999999, -90.0, 0.0, 104.0, 179.999999, 180.0]
HEIGHTS_M = [-400.0, 0.0, 500.0, 12000.0, 60000.0]


@pytest.fixture(scope="module")
def places() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Latitude, longitude (rad) and height (m) of a grid over the whole Earth, poles, equator and date line included."""
    grid = np.meshgrid(np.radians(LATITUDES_DEG), np.radians(LONGITUDES_DEG), HEIGHTS_M, indexing="ij")
    latitude, longitude, height = (axis.ravel() for axis in grid)
    return latitude, longitude, height


def _reference_ecef(latitude: np.ndarray, longitude: np.ndarray, height: np.ndarray) -> np.ndarray:
    return np.stack(CART.transform(longitude, latitude, height, radians=True), axis=-1)


def test_geodetic_to_ecef_is_pyprojs(places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Earth-centred positions agree with pyproj's everywhere on Earth."""
    # 1e-8 m: ten units in the last place of an Earth radius (9.3e-10 m), far inside the micrometre that is asked for
    assert np.abs(geodetic_to_ecef(*places) - _reference_ecef(*places)).max() < 1e-8


def test_ecef_to_geodetic_inverts_pyproj_everywhere(places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """Latitude and longitude come back within 1e-9 rad and height within 1e-5 m, at 0 and 90 degrees as well."""
    latitude, longitude, height = places
    found = ecef_to_geodetic(_reference_ecef(*places))
    assert np.abs(found[0] - latitude).max() < 1e-9
    assert np.abs(found[2] - height).max() < 1e-5
    off_pole = np.abs(np.cos(latitude)) > 1e-12  # at a pole every longitude is right
    turned = np.remainder(found[1] - longitude + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(turned[off_pole]).max() < 1e-9


@settings(max_examples=300)
@given(
    st.floats(-90.0, 90.0),
    st.floats(-180.0, 180.0),
    st.floats(-5000.0, 100_000.0),
)
def test_there_and_back_is_where_it_began(latitude_deg: float, longitude_deg: float, height_m: float) -> None:
    """Any place on Earth, taken to ECEF and back, is the same place."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    ecef = geodetic_to_ecef(latitude, longitude, height_m)
    found_latitude, found_longitude, found_height = ecef_to_geodetic(ecef)
    # 1e-14 rad is 0.1 micrometre, and what the iteration promises; heights are good to roundings of an Earth radius
    assert abs(float(found_latitude) - latitude) < 1e-14
    assert abs(float(found_height) - height_m) < 2e-8
    # the angle's worth on the ground: near a pole a longitude means little
    east = math.remainder(float(found_longitude) - longitude, 2.0 * math.pi) * math.cos(latitude)
    assert abs(east) < 1e-9


def test_prime_vertical_radius_at_equator_and_pole() -> None:
    """The prime-vertical radius is a at the equator and a^2/b at a pole."""
    semi_major, semi_minor = 6378137.0, 6356752.314245179  # WGS-84's defining and derived values
    found = prime_vertical_radius_m([0.0, math.pi / 2, -math.pi / 2])
    pole = semi_major**2 / semi_minor
    assert found == pytest.approx([semi_major, pole, pole], abs=1e-6)  # b is given to 1e-9 m


@pytest.mark.parametrize(("latitude_deg", "longitude_deg"), [(0, 0), (31, 104), (-45, -180), (90, 0), (-90, 77)])
def test_enu_axes_are_a_rotation(latitude_deg: float, longitude_deg: float) -> None:
    """East, north and up are perpendicular, of length one and right-handed, and up is the ellipsoid's normal."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    axes = enu_axes(latitude, longitude)
    # 1e-15: a rounding or two of numbers below one
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-15)
    normal = geodetic_to_ecef(latitude, longitude, 1000.0) - geodetic_to_ecef(latitude, longitude, 0.0)
    assert axes[2] == pytest.approx(normal / 1000.0, abs=1e-11)  # the ECEF difference is good to 2e-9 m in 1000 m


def test_east_points_east_and_north_points_north() -> None:
    """A step to the east is positive on the first axis, a step to the north on the second, at any longitude."""
    for longitude_deg in (-179.9, -90.0, 0.0, 104.0, 179.9):
        latitude, longitude = math.radians(-33.0), math.radians(longitude_deg)
        axes, here = enu_axes(latitude, longitude), geodetic_to_ecef(latitude, longitude, 0.0)
        eastwards = axes @ (geodetic_to_ecef(latitude, longitude + 1e-5, 0.0) - here)
        northwards = axes @ (geodetic_to_ecef(latitude + 1e-5, longitude, 0.0) - here)
        # 1e-5 rad is about 53 m to the east and 64 m to the north; the others bend by less than a millimetre
        assert eastwards[0] > 50.0
        assert np.abs(eastwards[1:]).max() < 1e-3
        assert northwards[1] > 60.0
        assert np.abs(northwards[[0, 2]]).max() < 1e-3


def test_one_position_has_the_bits_that_it_has_among_many() -> None:
    """Converting a batch gives each position the very bits that it has alone, in both directions, at any layout."""
    random = np.random.default_rng(1)
    latitude = random.uniform(-math.pi / 2, math.pi / 2, 257)
    longitude = random.uniform(-math.pi, math.pi, 257)
    height = random.uniform(-400.0, 20000.0, 257)
    many = geodetic_to_ecef(latitude, longitude, height)
    back = np.stack(ecef_to_geodetic(many), axis=-1)
    strided = np.stack(ecef_to_geodetic(np.asfortranarray(many)), axis=-1)
    for i in range(257):
        alone = geodetic_to_ecef(latitude[i], longitude[i], height[i])
        assert alone.tobytes() == many[i].tobytes()
        assert np.stack(ecef_to_geodetic(alone)).tobytes() == back[i].tobytes()
        assert back[i].tobytes() == strided[i].tobytes()


def test_shapes_are_those_of_the_leading_axes() -> None:
    """Leading axes are batch axes, and scalars broadcast against arrays."""
    ecef = geodetic_to_ecef(np.zeros((4, 1)), np.zeros(5), 10.0)
    assert ecef.shape == (4, 5, 3)
    assert [part.shape for part in ecef_to_geodetic(ecef)] == [(4, 5)] * 3


@given(st.floats(-50.0, 50.0))
def test_wrapped_angle_is_the_same_direction_in_one_turn(angle: float) -> None:
    """A wrapped angle lies in (-pi, pi], points the same way, and keeps its bits if it was there already."""
    wrapped = float(wrap_rad(angle))
    assert -math.pi < wrapped <= math.pi + 1e-14  # one rounding of a subtraction of several turns
    assert math.cos(wrapped - angle) > 1.0 - 1e-12
    if -math.pi < angle <= math.pi:
        assert wrapped == angle


def test_half_a_turn_is_written_positive() -> None:
    """Both half turns are written as +pi."""
    assert wrap_rad([math.pi, -math.pi]).tolist() == [math.pi, math.pi]
