"""Symbols point where aircraft point, ellipsoids where covariances do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gateway.frames import RunwayFrame
from gateway.settings import DEMO_SITE
from gateway.sinks.scene.attitude import ellipsoid, quaternion_from_attitude, quaternion_from_matrix

NOSE, LEFT_WING, TOP = np.eye(3)


def turned(quaternion: np.ndarray, vector: np.ndarray) -> np.ndarray:
    axis, w = quaternion[:3], quaternion[3]
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def test_an_aircraft_on_the_landing_course_points_along_x():
    quaternion = quaternion_from_attitude(0.0, 0.0, 1.2, landing_rad=1.2)
    assert turned(quaternion, NOSE) == pytest.approx([1.0, 0.0, 0.0])


def test_yaw_turns_the_nose_to_the_right():
    quaternion = quaternion_from_attitude(0.0, 0.0, math.pi / 2, landing_rad=0.0)
    assert turned(quaternion, NOSE) == pytest.approx([0.0, -1.0, 0.0])


def test_positive_pitch_lifts_the_nose():
    quaternion = quaternion_from_attitude(0.0, 0.3, 0.0, landing_rad=0.0)
    assert turned(quaternion, NOSE) == pytest.approx([math.cos(0.3), 0.0, math.sin(0.3)])


def test_positive_roll_lowers_the_right_wing():
    quaternion = quaternion_from_attitude(0.3, 0.0, 0.0, landing_rad=0.0)
    assert turned(quaternion, LEFT_WING) == pytest.approx([0.0, math.cos(0.3), math.sin(0.3)])


def test_roll_pitch_and_yaw_are_taken_in_that_order():
    """A right-wing-down aircraft that pulls up has its top tilted to its right, whatever its course."""
    quaternion = quaternion_from_attitude(0.4, 0.2, 0.0, landing_rad=0.0)
    roll = np.array([[1, 0, 0], [0, math.cos(0.4), -math.sin(0.4)], [0, math.sin(0.4), math.cos(0.4)]])
    pitch = np.array([[math.cos(0.2), 0, -math.sin(0.2)], [0, 1, 0], [math.sin(0.2), 0, math.cos(0.2)]])
    assert turned(quaternion, TOP) == pytest.approx(pitch @ roll @ TOP)


def test_any_rotation_becomes_its_quaternion():
    random = np.random.default_rng(7)
    matrices, _ = np.linalg.qr(random.normal(size=(200, 3, 3)))
    matrices[np.linalg.det(matrices) < 0.0] *= -1.0
    halves = [np.diag(d) for d in ([1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0], [1.0, 1.0, 1.0])]
    swap = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for matrix in [*matrices, *halves, swap]:
        quaternion = quaternion_from_matrix(matrix)
        assert [turned(quaternion, axis) for axis in np.eye(3)] == pytest.approx(matrix.T, abs=1e-12)


def test_an_ellipsoid_lies_in_runway_axes():
    """100 m of doubt to the north lie across a runway that points east, along one that points north."""
    covariance = np.diag([1.0, 10_000.0, 4.0, 1.0, 1.0, 1.0]).reshape(1, 36)
    for landing_rad, along in ((math.pi / 2, 1), (0.0, 0)):
        frame = RunwayFrame(replace(DEMO_SITE.runway, landing_compass_rad=landing_rad))
        half, quaternion = ellipsoid(frame.runway_from_enu, covariance, 3.0)
        longest = int(np.argmax(half[0]))
        assert half[0, longest] == pytest.approx(300.0)
        assert abs(turned(quaternion[0], np.eye(3)[longest])[along]) == pytest.approx(1.0)
