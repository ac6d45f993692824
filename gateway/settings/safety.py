"""What two aircraft and an approach have to keep to: the separation that is probed for, and the gates of a final."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Separation:
    """Two aircraft that are foretold to be nearer than both of these are a conflict.

    By default those of "well clear" in RTCA DO-365, 4000 ft and 450 ft, which suit drones as well as airliners; a
    controlled approach has 5556 m and 300 m.
    """

    horizontal_m: float = 1220.0
    vertical_m: float = 140.0
    look_ahead_s: float = 120.0
    least_probability: float = 0.2  # less likely ones are not told
    least_height_m: float = 30.0  # above the runway: who is lower stands, lands or has just taken off


@dataclass(frozen=True, slots=True)
class Stabilised:
    """A stabilised approach: how far off the glide path, the centreline and its speed an aircraft may be below two gates.

    Heights are above the runway. Where none are given, the gates are those heights from which the vehicle has as long to go
    as an airliner has from 1000 ft and 500 ft: 83 and 41.5 s at its approach speed, but no more than these.
    """

    upper_gate_m: float | None = None
    lower_gate_m: float | None = None
    approach_speed_mps: float | None = None  # None: the least that the vehicle has flown on this final
    glide_path_rad: float = math.radians(0.5)  # above or below, seen from where it meets the runway
    centreline_rad: float = math.radians(1.25)  # to either side, likewise
    least_vertical_m: float = 10.0  # nearer to the runway than where the angles are so much, these hold
    least_lateral_m: float = 20.0
    speed_share: float = 0.15  # faster than the approach speed by this share of it
    slow_share: float = 0.05  # or slower
    least_fast_mps: float = 3.0  # or by this, where the share is less: gusts
