"""Routes through points: bounded bank, straight legs flown straight, ends where they should be."""

import math

import numpy as np
import pytest

from gateway.settings import DEMO_SITE
from sim.earth import fly
from sim.routes import RoutePath, RoutePoint
from sim.scenes import build_scene


def _legs(*points: tuple[float, float, float, float]) -> list[RoutePoint]:
    return [RoutePoint(*point) for point in points]


CIRCUIT = _legs(
    (20e3, 8e3, 1500.0, 110.0), (-20e3, 8e3, 900.0, 90.0), (-20e3, 0.0, 700.0, 80.0), (-5e3, 0.0, 262.0, 70.0)
)


def test_route_begins_and_ends_at_its_points() -> None:
    """Time 0 is the first point at its speed; the last point is reached at the end, on the last leg."""
    path = RoutePath(CIRCUIT)
    motion = path.motion([0.0, path.flown_s])
    assert motion.position[0, :2] == pytest.approx([20e3, 8e3], abs=1e-6)
    assert motion.position[1, :2] == pytest.approx([-5e3, 0.0], abs=0.05)
    assert np.hypot(*motion.velocity[:, :2].T) == pytest.approx([110.0, 70.0], abs=0.05)


def test_route_is_straight_between_its_turns() -> None:
    """From 4 km after a corner to 4 km before the next, the track is the leg itself to a centimetre."""
    path = RoutePath(CIRCUIT)
    position = path.motion(np.arange(0.0, path.flown_s, 0.1)).position
    downwind = (np.abs(position[:, 0]) < 16e3) & (position[:, 1] > 7e3)
    final = (position[:, 0] > -16e3) & (np.abs(position[:, 1]) < 1e3)
    assert np.sum(downwind) > 1000
    assert np.max(np.abs(position[downwind, 1] - 8e3)) < 0.01
    assert np.max(np.abs(position[final, 1])) < 0.01


@pytest.mark.parametrize("angle_deg", [2.0, 20.0, 60.0, 120.0, 165.0, -45.0])
def test_turns_join_the_legs_whatever_their_angle(angle_deg: float) -> None:
    """After a corner of any angle the aircraft is on the outgoing leg, and the bank stays within 25.5 degrees."""
    angle = math.radians(angle_deg)
    away = (60e3 * math.cos(angle), 60e3 * math.sin(angle))
    path = RoutePath(_legs((-60e3, 0.0, 500.0, 90.0), (0.0, 0.0, 500.0, 90.0), (*away, 500.0, 90.0)))
    times = np.arange(0.0, path.flown_s, 0.1)
    beside = path.motion(times).position[-3000:, :2] @ np.array([-math.sin(angle), math.cos(angle)])
    assert np.max(np.abs(beside)) < 0.02
    # the spline over half-second knots overshoots the corners of the bank profile by less than half a degree
    assert np.degrees(np.max(np.abs(fly(path, DEMO_SITE.runway, times).roll_rad))) < 25.5


def test_corners_that_are_too_near_are_refused() -> None:
    """A turn that does not fit between two corners is an error that names them."""
    with pytest.raises(ValueError, match="points 0 and 1 of the route"):
        RoutePath(_legs((0.0, 0.0, 500.0, 100.0), (1e3, 0.0, 500.0, 100.0), (1e3, 30e3, 500.0, 100.0)))
    with pytest.raises(ValueError, match="back on itself"):
        RoutePath(_legs((0.0, 0.0, 500.0, 100.0), (30e3, 0.0, 500.0, 100.0), (0.0, 100.0, 500.0, 100.0)))


def test_a_route_that_stops_stands_there_for_ever() -> None:
    """With a last speed of 0 the aircraft stands at the last point, exactly still, and never leaves."""
    path = RoutePath(_legs((0.0, 0.0, 0.0, 70.0), (1500.0, 0.0, 0.0, 0.0)), start_s=10.0)
    assert path.end_s == math.inf
    assert path.motion(1e4).position == pytest.approx([1500.0, 0.0, 0.0], abs=1e-3)
    assert np.all(path.motion(1e4).velocity == 0.0)
    assert path.flown_s == pytest.approx(2 * 1500.0 / 70.0)  # constant braking


def test_traffic_flies_within_its_limits() -> None:
    """All aircraft of the scene: bank within 25.5 degrees, descents within 8 m/s, never below the runway."""
    scene = build_scene("traffic", start_ns=0, changes=["aircraft=30"])
    for aircraft in scene.aircraft:
        start, end = scene.present(aircraft)
        flown = scene.flown(aircraft, np.arange(start, end, 0.5))
        assert np.degrees(np.max(np.abs(flown.roll_rad))) < 25.5, aircraft
        assert np.min(flown.velocity_mps[:, 2]) > -8.0, aircraft
        assert np.max(flown.velocity_mps[:, 2]) < 10.0, aircraft
        assert np.min(flown.height_m) > 499.99, aircraft


def test_traffic_shows_all_that_it_promises() -> None:
    """Within ten minutes of 30 aircraft there are landings, go-arounds, holdings and crossings to be seen."""
    scene = build_scene("traffic", start_ns=0, changes=["aircraft=30"])
    seen = set()
    for aircraft in scene.aircraft:
        start, end = scene.present(aircraft)
        flown = scene.flown(aircraft, np.arange(start, end, 1.0))
        low, last = np.min(flown.height_m), flown.height_m[-1]
        turned = np.sum(np.abs(flown.turn_radps[flown.height_m > 1000.0]))
        if low < 500.1 and aircraft.kind != "crossing":
            seen.add("landing")
        if aircraft.kind == "go-around" and 570.0 < low < 600.0 and last > 900.0:
            seen.add("go-around")
        if aircraft.kind == "holding" and turned > 2 * math.pi:
            seen.add("holding")
        if aircraft.kind == "crossing" and low > 2000.0:
            seen.add("crossing")
    assert seen == {"landing", "go-around", "holding", "crossing"}
