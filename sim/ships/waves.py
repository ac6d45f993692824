"""What waves do to a compass: second-order coloured noise, whose two states are a heading and its rate.

    x'' + 2 d w x' + w^2 x = white noise,    x added to the heading, x' to the rate of turn

w is the frequency at which the ship meets the waves, d how wide the sea's spectrum is about it. The noise is such that x has
the standard deviation that is asked for. A step is exact whatever its length: the matrix exponential carries the state, and what
is added has the covariance that keeps the sea as it is. The hull does not follow a rudder this fast, nor does the
track feel it: it is what the autopilot must not answer.

Source: 002-5; Fossen's linear wave response is the field's form. Deviation: his has no energy at zero frequency, which is
instead w^4 below the peak's; in return heading and rate belong together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Waves:
    """A sea as a ship meets it: peak frequency, relative damping of the spectrum, standard deviation of the heading."""

    peak_radps: float = 0.8
    damping: float = 0.1
    sigma_rad: float = math.radians(2.0)

    @property
    def covariance(self) -> Floats:
        """Of heading and rate (2, 2), steady."""
        return np.diag([1.0, self.peak_radps**2]) * self.sigma_rad**2

    def transition(self, step_s: float) -> Floats:
        """The matrix (2, 2) that carries heading and rate over a step."""
        decay = self.damping * self.peak_radps
        ringing = self.peak_radps * math.sqrt(1.0 - self.damping**2)
        cosine, sine = math.cos(ringing * step_s), math.sin(ringing * step_s) / ringing
        carried = [[cosine + decay * sine, sine], [-(self.peak_radps**2) * sine, cosine - decay * sine]]
        return math.exp(-decay * step_s) * np.array(carried)

    def added(self, step_s: float) -> Floats:
        """The covariance (2, 2) of what a step adds."""
        carry = self.transition(step_s)
        return np.asarray(self.covariance - carry @ self.covariance @ carry.T)


@dataclass(slots=True)
class Rolling:
    """A sea as it goes on, step by step: `now` is heading and rate, (2, ...)."""

    carry: Floats
    root: Floats
    now: Floats

    @classmethod
    def of(cls, waves: Waves, step_s: float, fresh: Floats) -> Rolling:
        """A sea that is steady at once, of standard normal draws (2, ...)."""
        root = np.asarray(np.linalg.cholesky(waves.added(step_s) + 1e-18 * np.eye(2)), dtype=np.float64)
        sigmas = np.sqrt(np.diag(waves.covariance)).reshape(2, *([1] * (fresh.ndim - 1)))
        return cls(waves.transition(step_s), root, np.asarray(fresh * sigmas, dtype=np.float64))

    def step(self, fresh: Floats) -> None:
        """A step further, driven by standard normal draws (2, ...)."""
        (a, b), (c, d) = self.carry
        heading, rate = self.now
        self.now = np.stack(
            [
                a * heading + b * rate + self.root[0, 0] * fresh[0],
                c * heading + d * rate + self.root[1, 0] * fresh[0] + self.root[1, 1] * fresh[1],
            ]
        )


def draw(
    waves: Waves, steps: int, shape: tuple[int, ...], step_s: float, generator: np.random.Generator
) -> tuple[Floats, Floats]:
    """A sea's heading (rad) and rate (rad/s), each (steps, ...), steady from the first step on."""
    noise = generator.standard_normal((steps, 2, *shape))
    told = np.empty_like(noise)
    sea = Rolling.of(waves, step_s, noise[0])
    for step in range(steps):
        told[step] = sea.now
        sea.step(noise[step])
    return told[:, 0], told[:, 1]
