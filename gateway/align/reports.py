"""GPS reports as fixes: metres in the runway's ENU, with what is guessed of a height and of an accuracy that nobody told."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame, turn
from gateway.frozen import made_swiftly
from gateway.geodesy import geodetic_to_ecef
from gateway.observation import GpsReport, Timing
from gateway.settings import Site

Floats = NDArray[np.float64]

LEAST_POSITION_SIGMA_M = 0.3  # a receiver that claims less is describing its noise, not its error
LEAST_VELOCITY_SIGMA_MPS = 0.1
# Traffic that others pass on (its times are coarse) says its velocity as ADS-B does, whose lowest category is 10 m/s; MAVLink
# does not pass the category on. SITL's traffic moves up to 24 m/s otherwise than it says.
TRAFFIC_VELOCITY_SIGMA_MPS = 10.0
UNKNOWN_SPEED_MPS = 100.0  # what a coarse time is worth in metres when the stream does not say how fast it flies
# How far a height guessed from a pressure altitude may be off: 1013 for the day's pressure (30 hPa are 250 m), and warm
# or cold air. Without one the guess is the runway's height, and an airliner may be as high as airliners are.
PRESSURE_SIGMA_M, PRESSURE_SIGMA_SHARE = 300.0, 0.05
NO_HEIGHT_SIGMA_M = 5000.0


@dataclass(frozen=True, slots=True, eq=False)
class Local:
    """Of a report that lacks a component: the axes at the reported point, along which the others are measured."""

    from_enu: Floats  # (3, 3) east, north, up there, of the runway's ENU
    velocity_mps: Floats  # (3,) along these, NaN = not measured
    has_height: bool


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """A GPS report in the runway's ENU. Ordered by (at, aircraft, serial).

    Without a height it stands at a guessed one, whose sigma is the last of `sigma_m`; nothing may take it for measured.
    """

    at: int
    serial: int
    received_at: int
    aircraft: str
    enu_m: Floats  # (3,)
    sigma_m: Floats  # (3,) east, north, up
    velocity_mps: Floats  # (3,) in the runway's ENU, NaN = not measured
    velocity_sigma_mps: float
    comparable: bool  # its clock allows to compare it with other sources
    local: Local | None = None  # None: nothing, or all of the velocity, is missing
    pressure_altitude_m: float = math.nan  # carried along, never measured against
    callsign: str | None = None

    @property
    def has_height(self) -> bool:
        """Whether its height is measured."""
        return self.local is None or self.local.has_height


@dataclass(frozen=True, slots=True, eq=False)
class ReckonedFix(Fix):
    """Where dead reckoning has an aircraft: the track's state is this, whatever it was before."""

    is_forced: bool = False  # because what came before was false, not because nothing came


@dataclass(frozen=True, slots=True)
class Geoid:
    """The geoid's height above the ellipsoid here: the site's word, else the median of what the streams gave, else 0."""

    site_m: float | None
    seen_m: tuple[float, ...] = ()

    KEEP = 101  # odd, and enough that one wrong report does not move the median

    @property
    def separation_m(self) -> float:
        """What is added to an altitude above mean sea level to give a height above the ellipsoid."""
        if self.site_m is not None:
            return self.site_m
        return median(self.seen_m) if self.seen_m else 0.0

    @property
    def contradiction_m(self) -> float:
        """How far the streams' separation is from the site's, 0 where either is not given."""
        return median(self.seen_m) - self.site_m if self.site_m is not None and self.seen_m else 0.0

    def learn(self, report: GpsReport) -> Geoid:
        """The same with a report's own separation noted, if it gives both heights."""
        if report.height_m is None or report.altitude_msl_m is None or len(self.seen_m) >= self.KEEP:
            return self
        return Geoid(self.site_m, (*self.seen_m, report.height_m - report.altitude_msl_m))

    def height_m(self, report: GpsReport) -> float:
        """Height above the ellipsoid of a report, NaN where it gives none; the site's separation wins over the stream's."""
        if report.altitude_msl_m is not None and (self.site_m is not None or report.height_m is None):
            return report.altitude_msl_m + self.separation_m
        return report.height_m if report.height_m is not None else math.nan


def place_reports(
    reports: Sequence[GpsReport], serials: Sequence[int], heights_m: Sequence[float], site: Site, frame: RunwayFrame
) -> list[Fix]:
    """GPS reports as fixes; all of a step in one call: arrays of one cost as much as arrays of a hundred.

    Source: 003 2.2 eq 1, 2.
    """
    if not reports:
        return []
    latitude = np.array([report.latitude_rad for report in reports])
    longitude = np.array([report.longitude_rad for report in reports])
    height = np.array(heights_m)
    has_height = ~np.isnan(height)
    guesses = {row: _guessed(report, site) for row, report in enumerate(reports) if not has_height[row]}
    for row, (guessed_m, _) in guesses.items():
        height[row] = guessed_m
    ecef = geodetic_to_ecef(latitude, longitude, height)
    enu = turn(frame.enu_from_ecef, ecef - frame.origin_ecef_m)
    local = _velocities_mps(reports)
    # A component alone cannot be turned into the runway's axes: then what there is stays in the local ones.
    axes = frame.local_from_enu(latitude, longitude)
    velocity = (axes.transpose(0, 2, 1) @ local[:, :, None])[:, :, 0]
    missing = np.isnan(local).sum(axis=1)
    in_part = ~has_height | ((missing > 0) & (missing < 3))
    fixes = []
    for row, report in enumerate(reports):
        guess = guesses.get(row)
        usual = TRAFFIC_VELOCITY_SIGMA_MPS if report.timing_sigma_s else site.position.velocity_sigma_mps
        fixes.append(
            Fix(
                report.valid_at,
                serials[row],
                report.received_at,
                report.aircraft,
                enu[row],
                _position_sigmas_m(report, site, None if guess is None else guess[1]),
                velocity[row],
                max(report.velocity_sigma_mps or usual, LEAST_VELOCITY_SIGMA_MPS),
                report.timing in (Timing.UTC, Timing.ENVELOPE),
                Local(axes[row], local[row], bool(has_height[row])) if in_part[row] else None,
                math.nan if report.pressure_altitude_m is None else report.pressure_altitude_m,
                report.callsign,
            )
        )
    return fixes


def _velocities_mps(reports: Sequence[GpsReport]) -> Floats:
    """East, north, up at each report's place, (n, 3); NaN = not measured."""
    told = [(report.velocity_east_mps, report.velocity_north_mps, report.velocity_up_mps) for report in reports]
    return np.array([[math.nan if part is None else part for part in one] for one in told])


def _position_sigmas_m(report: GpsReport, site: Site, guessed_m: float | None) -> Floats:
    """East, north, up, (3,): what the report says, else the site; `guessed_m`: of a height that it does not tell."""
    level = report.horizontal_sigma_m or site.position.sigma_m
    upright = report.vertical_sigma_m or report.horizontal_sigma_m or site.position.sigma_m
    if report.timing_sigma_s:
        level = math.hypot(level, _speed_mps(report) * report.timing_sigma_s)
        upright = math.hypot(upright, (report.velocity_up_mps or 0.0) * report.timing_sigma_s)
    sigma: Floats = np.array([level, level, upright if guessed_m is None else guessed_m])
    return np.maximum(sigma, LEAST_POSITION_SIGMA_M, out=sigma)


def _guessed(report: GpsReport, site: Site) -> tuple[float, float]:
    """Where to put a report without a height, m above the ellipsoid, and the sigma of that guess."""
    if report.pressure_altitude_m is None:
        return site.runway.height_m, NO_HEIGHT_SIGMA_M
    height_m = report.pressure_altitude_m + (site.runway.geoid_separation_m or 0.0)
    return height_m, PRESSURE_SIGMA_M + PRESSURE_SIGMA_SHARE * abs(report.pressure_altitude_m)


def _speed_mps(report: GpsReport) -> float:
    """Over ground; a usual one where it is not measured."""
    if report.velocity_east_mps is None or report.velocity_north_mps is None:
        return UNKNOWN_SPEED_MPS
    return math.hypot(report.velocity_east_mps, report.velocity_north_mps)
