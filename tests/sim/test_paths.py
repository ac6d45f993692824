"""003's path to the digit, laid on the ellipsoid, and what is derived from it."""

import math

import numpy as np
import pytest
from pyproj import Geod
from scipy.integrate import solve_ivp

from gateway.frames import RunwayFrame, polar_from_xyz
from gateway.geodesy import enu_axes, geodetic_to_ecef
from gateway.settings import DEMO_SITE, Runway
from sim.earth import fly
from sim.paths import Abeam, CasePath, Delayed, Path
from sim.radars import RadarSight
from sim.routes import RoutePath, RoutePoint

RUNWAY = DEMO_SITE.runway
ROUTE = RoutePath(
    [
        RoutePoint(20e3, 8e3, 1500.0, 110.0),
        RoutePoint(-20e3, 8e3, 900.0, 90.0),
        RoutePoint(-20e3, 0.0, 700.0, 80.0),
        RoutePoint(-13e3, 0.0, 680.0, 75.0),
        RoutePoint(0.0, 0.0, 0.0, 0.0),
    ]
)


def test_case_solves_its_differential_equation() -> None:
    """The closed form agrees with a numerical solution of ds/dt = -(72 + 58 clip(...)) to a millimetre."""
    path = CasePath()
    times = np.linspace(0.0, path.end_s, 500)

    def rate(_time: float, s: np.ndarray) -> np.ndarray:
        return -(72.0 + 58.0 * np.clip((s - 5000.0) / 25000.0, 0.0, 1.0))

    solved = solve_ivp(rate, (0.0, path.end_s), [50000.0], t_eval=times, rtol=1e-12, atol=1e-9, max_step=0.5)
    motion = path.motion(times)
    assert np.max(np.abs(-motion.position[:, 0] - solved.y[0])) < 1e-3
    assert np.max(np.abs(motion.velocity[:, 0] + rate(0.0, solved.y[0]))) < 1e-5


def test_case_takes_457_seconds_to_1500_metres() -> None:
    """The approach begins at 50 km and ends at 1500 m after 457 s."""
    path = CasePath()
    assert path.end_s == pytest.approx(457.0, abs=0.5)
    assert path.motion([0.0, path.end_s]).position[:, 0] == pytest.approx([-50000.0, -1500.0], abs=1e-6)


def test_case_follows_the_formulas_of_offset_and_height() -> None:
    """Offset and height are 003's formulas of the ground distance, at 1000 instants."""
    path = CasePath()
    position = path.motion(np.linspace(0.0, path.end_s, 1000)).position
    s = -position[:, 0]
    u = np.clip((s - 25000.0) / 22000.0, 0.0, 1.0)
    assert position[:, 1] == pytest.approx(6000.0 * u**2 * (3.0 - 2.0 * u), abs=1e-9)
    assert position[:, 2] == pytest.approx(np.minimum(1200.0, s * math.tan(math.radians(3.0)) + 15.0), abs=1e-9)


@pytest.mark.parametrize(("latitude_deg", "landing_deg"), [(31.0, 90.0), (-35.4, 353.0), (70.0, 200.0)])
def test_positions_are_ends_of_geodesics(latitude_deg: float, landing_deg: float) -> None:
    """Seen from the runway's centre by an independent inverse, distance and bearing are the plan's."""
    runway = Runway(math.radians(latitude_deg), math.radians(179.9), 100.0, math.radians(landing_deg))
    times = np.linspace(0.0, 450.0, 50)
    plan = CasePath().motion(times).position
    flown = fly(CasePath(), runway, times)
    centre = np.full(50, 179.9), np.full(50, latitude_deg)
    bearing, _, distance = Geod(ellps="WGS84").inv(
        *centre, np.degrees(flown.longitude_rad), np.degrees(flown.latitude_rad)
    )
    assert distance == pytest.approx(np.hypot(plan[:, 0], plan[:, 1]), abs=1e-5)
    expected = landing_deg - np.degrees(np.arctan2(plan[:, 1], plan[:, 0]))
    assert np.cos(np.radians(bearing - expected)) == pytest.approx(np.ones(50), abs=1e-14)
    assert flown.height_m == pytest.approx(100.0 + plan[:, 2], abs=1e-9)


def test_case_begins_left_of_the_approach() -> None:
    """The offset is to the left of the landing direction: positive y of the runway frame, 6 km."""
    flown = fly(CasePath(), RUNWAY, [0.0])
    x, y, z = RunwayFrame(RUNWAY).runway_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)[0]
    assert (x, y) == (pytest.approx(-50000.0, abs=15.0), pytest.approx(6000.0, abs=5.0))
    assert z == pytest.approx(1200.0 - (50000.0**2 + 6000.0**2) / 2 / 6.37e6, abs=3.0)  # the Earth falls away


@pytest.mark.parametrize("path", [CasePath(), CasePath.landing(RUNWAY), Abeam(CasePath(), 0.05, 300.0, 150.0), ROUTE])
def test_velocity_is_the_derivative_of_position(path: Path) -> None:
    """Velocities east, north, up are the derivative of the ECEF position, to 0.1 mm/s where the path is smooth."""
    times, step = np.linspace(2.0, 450.0, 997), 0.01
    before, after = (fly(path, RUNWAY, times + shift) for shift in (-step, step))
    ecef = [geodetic_to_ecef(one.latitude_rad, one.longitude_rad, one.height_m) for one in (before, after)]
    flown = fly(path, RUNWAY, times)
    axes = np.stack([enu_axes(*place) for place in zip(flown.latitude_rad, flown.longitude_rad, strict=True)])
    difference = np.einsum("nij,nj->ni", axes, (ecef[1] - ecef[0]) / (2 * step)) - flown.velocity_mps
    # a central difference over a kink of the paper's path is wrong by up to the kink: 2 in 1000 instants may lie on one
    assert np.sum(np.max(np.abs(difference), axis=1) > 1e-4) <= 2


@pytest.mark.parametrize("path", [CasePath(), CasePath.landing(RUNWAY), ROUTE])
def test_acceleration_is_the_derivative_of_velocity(path: Path) -> None:
    """Accelerations on the plan are the derivative of velocities, away from kinks."""
    times, step = np.linspace(2.0, 450.0, 997), 1e-3
    change = (path.motion(times + step).velocity - path.motion(times - step).velocity) / (2 * step)
    wrong = np.max(np.abs(change - path.motion(times).acceleration), axis=1) > 1e-3
    assert np.sum(wrong) <= 3


def test_attitude_is_that_of_a_coordinated_turn() -> None:
    """In a right turn the right wing is down by atan(v omega / g), and the mode says right."""
    times = np.linspace(0.0, ROUTE.flown_s, 2000)
    flown = fly(ROUTE, RUNWAY, times)
    speed = np.hypot(flown.velocity_mps[:, 0], flown.velocity_mps[:, 1])
    yaw_rate = np.gradient(np.unwrap(flown.yaw_rad), times)
    turning = np.abs(yaw_rate) > 0.01
    assert np.degrees(flown.roll_rad[turning]) == pytest.approx(
        np.degrees(np.arctan(speed * yaw_rate / 9.80665))[turning], abs=1.0
    )
    assert set(flown.mode[yaw_rate < -0.01]) == {"left"}  # both turns of this circuit are to the left
    assert not np.any(yaw_rate > 0.01)


def test_landing_goes_down_to_a_standstill_on_the_runway() -> None:
    """The landing path crosses the threshold at 15 m, touches down on the runway, and stands on its centreline."""
    path = CasePath.landing(RUNWAY)
    times = np.arange(0.0, 600.0, 0.01)
    position = path.motion(times).position
    at_threshold = np.searchsorted(position[:, 0], RUNWAY.threshold_x_m)
    assert position[at_threshold, 2] == pytest.approx(15.0, abs=0.1)
    at_touchdown = np.searchsorted(times, path.touchdown_s)
    assert position[at_touchdown, 2] == pytest.approx(0.0, abs=1e-3)
    assert -1500.0 < position[at_touchdown, 0] < 0.0
    assert abs(position[-1, 0]) < 1500.0
    assert position[-1, 1:] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert np.all(path.motion(times[-1]).velocity == 0.0)
    assert np.max(np.abs(np.diff(position, axis=0))) < 1.4  # it never jumps: 130 m/s over 10 ms


def test_landing_and_case_are_the_same_flight_at_another_place() -> None:
    """Until its flare the landing path is 003's, its distances counted from the threshold."""
    case, landing = CasePath().motion(np.arange(0.0, 450.0)), CasePath.landing(RUNWAY).motion(np.arange(0.0, 450.0))
    assert landing.position - case.position == pytest.approx(np.tile([-1500.0, 0.0, 0.0], (450, 1)), abs=1e-9)


def test_abeam_is_seen_from_the_radar_at_the_same_range_and_elevation() -> None:
    """Turned by 3 degrees about the radar: azimuth 3 degrees to the left, range and elevation within a metre's worth."""
    radar, times = DEMO_SITE.radars[0], np.linspace(0.0, 457.0, 100)
    sight = RadarSight(DEMO_SITE, radar)
    seen = [
        polar_from_xyz(sight.see(fly(path, RUNWAY, times))[0])
        for path in (CasePath(), Abeam(CasePath(), math.radians(3.0), radar.along_m, radar.left_m))
    ]
    difference = seen[1] - seen[0]
    assert np.degrees(difference[:, 1]) == pytest.approx(np.full(100, 3.0), abs=0.01)
    assert difference[:, 0] == pytest.approx(np.zeros(100), abs=3.0)
    assert difference[:, 2] == pytest.approx(np.zeros(100), abs=2e-5)


def test_delayed_is_the_same_later() -> None:
    """A delayed path is where the other was before."""
    late = Delayed(CasePath(), 90.0)
    assert (late.start_s, late.end_s) == (90.0, CasePath().end_s + 90.0)
    assert np.array_equal(late.motion([100.0]).position, CasePath().motion([10.0]).position)
