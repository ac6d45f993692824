"""The site: where the runway and the radars stand, and what the sources are worth; SI and radians."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

from gateway.settings.safety import Separation, Stabilised

Units = Literal["si", "aviation"]
PlotNumbers = Literal["used", "ignored"]

HYPOTHESES_AT_MOST = 2000
SLOWEST_MPS = 25.0  # an aircraft that lands; birds and rain, with the wind, are slower


@dataclass(frozen=True, slots=True)
class Runway:
    """The runway: its centre is the origin of the ENU and runway frames. One that `follows` a ship stands where it is written
    until she is heard, and its frames stay there: `gateway.frames.RunwayFrame.deck` is where it is then.

    `threshold_x_m` (negative) and `glide_path_origin_x_m` follow from the length, the glide path and the crossing height.
    """

    latitude_rad: float
    longitude_rad: float
    height_m: float
    landing_compass_rad: float
    geoid_separation_m: float | None = None
    length_m: float = 3000.0
    width_m: float = 45.0
    glide_path_rad: float = math.radians(3.0)
    threshold_crossing_height_m: float = 15.0
    follows: str | None = (
        None  # the ship that carries it, such as "mavlink:7"; the landing direction counts from her bow
    )

    @property
    def threshold_x_m(self) -> float:
        """Runway-frame x of the landing threshold."""
        return -0.5 * self.length_m

    @property
    def aiming_point_x_m(self) -> float:
        """Runway-frame x where the glide path meets the runway."""
        return self.threshold_x_m + self.threshold_crossing_height_m / math.tan(self.glide_path_rad)


@dataclass(frozen=True, slots=True)
class PositionSource:
    """What a position source is worth when its stream does not say: noise an axis, and allowed constant error."""

    sigma_m: float = 15.0
    systematic_m: float = 60.0
    velocity_sigma_mps: float = 1.0


@dataclass(frozen=True, slots=True)
class RadarSite:
    """One radar's place in the runway frame, the noise of its measurements, and by how much it is known to measure too much.

    The azimuth error is positive to the left, as the radar's azimuths are; its stamps are late by the time error.
    """

    number: int
    along_m: float
    left_m: float
    antenna_height_m: float
    compass_boresight_rad: float
    range_sigma_m: float = 15.0
    azimuth_sigma_rad: float = math.radians(0.0573)
    elevation_sigma_rad: float = math.radians(0.0573)
    maximum_range_m: float = 60000.0
    key_file: str | None = None
    range_error_m: float = 0.0
    azimuth_error_rad: float = 0.0
    elevation_error_rad: float = 0.0
    time_error_s: float = 0.0
    numbers: PlotNumbers = "used"  # "ignored": it numbers its plots badly, they are tracked as if it did not
    period_s: float | None = None  # of a scan; None: as its status says
    clutter_per_scan: float | None = None  # plots; None: learnt from its scans
    detection_probability: float | None = None  # of a target in a scan; None: learnt from its scans
    slowest_mps: float = SLOWEST_MPS  # no track of unnumbered plots is told before it surely flies faster
    hypotheses_at_most: int = HYPOTHESES_AT_MOST  # of unnumbered plots: what bounds the time of a scan


@dataclass(frozen=True, slots=True)
class Estimation:
    """How aircraft fly, for the estimators of several modes; nobody has to tune it between drones and jets.

    Accelerations are white over a second, but for the one that lasts. Shares are of an aircraft's time, against each other.
    """

    calm_acceleration_mps2: float = 0.15  # along the course and upright
    calm_across_acceleration_mps2: float = 3.0  # courses wander more than speeds
    lasting_acceleration_mps2: float = 0.15  # along the course: braking
    lasting_drag_mps2: float = 0.25  # braking at 100 m/s: by the square of speed, never more than across
    lasting_across_acceleration_mps2: float = 1.0  # swinging onto a course
    lasting_for_s: float = 40.0
    manoeuvre_acceleration_mps2: float = 3.0  # straight, with changes of speed or course that are no full turn
    manoeuvre_vertical_acceleration_mps2: float = 3.0
    turn_acceleration_mps2: float = 1.0
    turn_rate_rps: float = math.radians(3.0)
    bank_rad: float = math.radians(25.0)  # slow aircraft turn faster: as a level turn at this bank
    calm_share: float = 50.0
    lasting_share: float = 80.0
    manoeuvre_share: float = 6.0
    turn_share: float = 20.0  # both sides together
    mode_lasts_s: float = 9.0  # mean time until the mode is drawn anew, by the shares


@dataclass(frozen=True, slots=True)
class DeadReckoning:
    """How good vehicles' inertial units are, and what else ties dead reckoning; noises in a root Hz, wandering in a root s.

    The defaults are those of a small autopilot in the air, vibration included.
    """

    gyro_noise: float = math.radians(0.03)  # rad/s
    gyro_bias_radps: float = math.radians(1.0)
    gyro_bias_wanders: float = 1e-4  # rad/s
    accelerometer_noise: float = 0.05  # m/s2
    accelerometer_bias_mps2: float = 0.2
    accelerometer_bias_wanders: float = 1e-3  # m/s2
    attitude_sigma_rad: float = math.radians(1.0)  # of an autopilot's roll and pitch; its heading is twice as bad
    attitude_wanders: float = math.radians(0.1)  # rad: what these errors change by
    airspeed_sigma_mps: float = 1.5
    sideslip_sigma_mps: float = 2.0
    wind_mps: float = 10.0  # before anything is known of it
    wind_wanders: float = 0.3  # m/s
    slip_mps: float = 0.2  # of wheels to the side
    altitude_sigma_m: float = 5.0  # of altitudes that are told beside positions
    ends_at_sigma_m: float = 300.0  # less sure than this it tells nothing
    refuses: bool = True  # positions that it denies


@dataclass(frozen=True, slots=True)
class DecisionPoint:
    """A named point on the approach, before the threshold."""

    name: str
    distance_m: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A published point, a candidate of intent."""

    name: str
    latitude_rad: float
    longitude_rad: float


LEAST_AREA_RAD2 = 1e-13  # some four square metres


def encloses(corners: Sequence[tuple[float, float]]) -> bool:
    """Whether corners, latitude and longitude in rad, enclose an area: not all of them at one place, or on one line."""
    (y, x), *others = corners
    return any(
        abs((one[1] - x) * (two[0] - y) - (one[0] - y) * (two[1] - x)) > LEAST_AREA_RAD2
        for one, two in pairwise(others)
    )


@dataclass(frozen=True, slots=True)
class Weather:
    """An area to avoid: a circle about a point, or a polygon; between two times where they are given (ISO 8601, UTC),
    and between two heights above mean sea level.
    """

    name: str
    latitude_rad: float | None = None
    longitude_rad: float | None = None
    radius_m: float | None = None
    polygon_rad: tuple[tuple[float, float], ...] = ()
    valid_from: str | None = None
    valid_until: str | None = None
    base_msl_m: float | None = None
    top_msl_m: float | None = None


@dataclass(frozen=True, slots=True)
class Site:
    """Everything that is known of the place before the first byte arrives."""

    name: str
    runway: Runway
    position: PositionSource = PositionSource()
    estimation: Estimation = Estimation()
    separation: Separation = Separation()
    stabilised: Stabilised = Stabilised()
    dead_reckoning: DeadReckoning = DeadReckoning()
    radars: tuple[RadarSite, ...] = ()
    decision_points: tuple[DecisionPoint, ...] = ()
    waypoints: tuple[Waypoint, ...] = ()
    weather: tuple[Weather, ...] = ()
    units: Units = "si"

    def radar(self, number: int) -> RadarSite | None:
        """The radar of this number, or None."""
        return next((radar for radar in self.radars if radar.number == number), None)


def with_radar(site: Site, radar: RadarSite) -> Site:
    """The same site with this radar added, or in place of the one of its number."""
    others = tuple(known for known in site.radars if known.number != radar.number)
    return replace(site, radars=(*others, radar))


DEMO_SITE = Site(
    name="Demo field",
    runway=Runway(
        latitude_rad=math.radians(31.0),
        longitude_rad=math.radians(104.0),
        height_m=500.0,
        landing_compass_rad=math.radians(90.0),
        geoid_separation_m=-35.0,
    ),
    radars=(
        RadarSite(
            number=1, along_m=300.0, left_m=150.0, antenna_height_m=3.0, compass_boresight_rad=math.radians(270.0)
        ),
    ),
    decision_points=(DecisionPoint("DA", 1500.0),),
)
