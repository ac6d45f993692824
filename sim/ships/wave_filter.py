"""The wave filter: what of a measured heading and rate is the ship's own, and what the waves'.

A steady Kalman filter with five states: the waves' heading and rate (`waves.py`), the ship's heading and rate (Nomoto's model
with the rudder that the autopilot knows it has ordered), and the steady moment of wind as a rudder angle. It costs no lag where
the rudder explains the turn, which is why a notch in the loop is not used.

Source: 002-5 (it asks for a wave filter and prints none); Fossen's observer is the field's form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from gateway.geodesy import wrap_rad
from sim.ships.hull import Hull
from sim.ships.waves import Waves

Floats = NDArray[np.float64]

HEADING_SIGMA_RAD, RATE_SIGMA_RADPS = math.radians(0.1), math.radians(0.05)  # a gyro compass and its rate
_TURN_DENSITY = math.radians(0.001) ** 2  # what else turns a ship, rad2/s3: gusts, and that K and T are not quite these
_WIND_DENSITY = math.radians(0.02) ** 2  # how the wind's moment wanders, as rudder, rad2/s
_SEEN = np.array([[1.0, 0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 0.0, 1.0, 0.0]])


@dataclass(frozen=True, slots=True)
class WaveFilter:
    """The filter of one hull at one speed in one sea: how its states are carried, driven and corrected in a step."""

    carry: Floats  # (5, 5)
    driven: Floats  # (5,), by a rudder angle
    gain: Floats  # (5, 2), of heading and rate

    def start(self, heading_rad: Floats) -> Floats:
        """States (..., 5) of ships that are steady on headings (...)."""
        state = np.zeros((*np.shape(heading_rad), 5))
        state[..., 2] = heading_rad
        return state

    def step(self, state: Floats, rudder_rad: Floats, heading_rad: Floats, rate_radps: Floats) -> Floats:
        """States (..., 5) after a step under rudders (...), with what was measured at its end (...)."""
        ahead = np.einsum("ij,...j->...i", self.carry, state) + self.driven * np.asarray(rudder_rad)[..., None]
        off_heading = wrap_rad(heading_rad - ahead[..., 0] - ahead[..., 2])
        off_rate = rate_radps - ahead[..., 1] - ahead[..., 3]
        return np.asarray(ahead + self.gain[:, 0] * off_heading[..., None] + self.gain[:, 1] * off_rate[..., None])


def wave_filter(hull: Hull, speed_mps: float, waves: Waves, step_s: float) -> WaveFilter:
    """The filter for a hull at a speed, in a sea that it is told."""
    gain, lag = float(hull.gain_at(speed_mps)), float(hull.lag_at(speed_mps))
    fades = math.exp(-step_s / lag)
    turned = lag * (1.0 - fades)
    carry = np.zeros((5, 5))
    carry[:2, :2] = waves.transition(step_s)
    carry[2, 2:] = 1.0, turned, gain * (step_s - turned)
    carry[3, 3:] = fades, gain * (1.0 - fades)
    carry[4, 4] = 1.0
    noise = np.zeros((5, 5))
    noise[:2, :2] = waves.added(step_s)
    noise[3, 3], noise[4, 4] = _TURN_DENSITY * step_s, _WIND_DENSITY * step_s
    measured = np.diag([HEADING_SIGMA_RAD**2, RATE_SIGMA_RADPS**2])
    return WaveFilter(carry, carry[:, 4] - np.eye(5)[4], steady_gain(carry, _SEEN, noise, measured))


def steady_gain(carry: Floats, seen: Floats, noise: Floats, measured: Floats) -> Floats:
    """The gain (n, m) that a Kalman filter ends with: a step's `carry` (n, n) and `noise`, what is `seen` (m, n) and how well."""
    uncertain = solve_discrete_are(carry.T, seen.T, noise, measured)
    scatter = seen @ uncertain @ seen.T + measured
    return np.asarray(np.linalg.solve(scatter, seen @ uncertain).T)
