"""A recording of any length: one aircraft that flies circles before the runway, in view of the radar.

python -m bench.circles FOLDER SECONDS
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gateway.settings import DEMO_SITE
from sim.paths import Motion
from sim.recording import write_session
from sim.scene import Aircraft, SayParameters, Scene, SceneRadar
from sim.sensors import GpsParameters, RadarParameters

_START_NS = 1_780_000_000 * 10**9
_SAY = SayParameters(attitude_period_s=1.0, truth_period_s=1.0)
_GPS = GpsParameters(period_s=1.0, sigma_m=8.0, error_sigma_m=0.0, latency_low_s=0.1, latency_high_s=0.4)
_RADAR = RadarParameters(period_s=2.0)


@dataclass(frozen=True, slots=True)
class Circle:
    """Left turns at one height and speed, for ever."""

    end_s: float
    start_s: float = 0.0
    centre_x_m: float = -20_000.0
    radius_m: float = 8_000.0
    height_m: float = 1_200.0
    speed_mps: float = 80.0

    def motion(self, time_s: ArrayLike) -> Motion:
        """Position, velocity and acceleration at times (...), s."""
        time = np.asarray(time_s, dtype=np.float64)
        rate = self.speed_mps / self.radius_m
        cosine, sine = np.cos(rate * time), np.sin(rate * time)
        zero = np.zeros_like(time)
        out = np.stack([cosine, sine, zero], axis=-1)
        along = np.stack([-sine, cosine, zero], axis=-1)
        centre = np.array([self.centre_x_m, 0.0, self.height_m])
        return Motion(centre + self.radius_m * out, self.speed_mps * along, -(self.speed_mps**2) / self.radius_m * out)


def circles(duration_s: float) -> Scene:
    """The scene: GPS once a second, radar every two, attitude and truth once a second."""
    radar = SceneRadar(DEMO_SITE.radars[0], _RADAR)
    aircraft = Aircraft(1, Circle(duration_s), "circles")
    return Scene("circles", DEMO_SITE, 0, _START_NS, duration_s, (aircraft,), _GPS, (radar,), _SAY)


def main() -> None:
    """Write the session into a folder inside the folder that is named."""
    folder, seconds = Path(sys.argv[1]), float(sys.argv[2])
    if not math.isfinite(seconds):
        raise SystemExit("so many seconds cannot be flown")
    folder.mkdir(parents=True, exist_ok=True)
    write_session(circles(seconds), folder)


if __name__ == "__main__":
    main()
