"""Flights rebuilt from flight parameters: sorties found, integrated, closed or tied, and compared with what positions said.

Source: 002-2. Positions are used only for what is asked: where lift-off was, and as fixes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators import flight_path as paths
from gateway.estimators.inertial_wind import Felt
from gateway.estimators.tied_path import Tied
from gateway.offline.carrying import (
    GAP_S,
    Muted,
    Place,
    carried,
    ending,
    evidence_of,
    fixes_of,
    frame_at,
    on_plane,
    together,
    tying,
)
from gateway.offline.compared import Compared, compared_with
from gateway.offline.ends import Closing, closing, roll_along
from gateway.offline.parameters import Flown, Parameters, Times
from gateway.offline.radar_fixes import Seen, Way, seen
from gateway.offline.sightings import View, seen_within
from gateway.settings import Runway

Floats = NDArray[np.float64]

# Of the cruising speed: what most fixed-wing aircraft lift off and touch down at.
TAKE_OFF_SHARE, LANDING_SHARE = 0.6, 0.45


@dataclass(frozen=True, slots=True)
class How:
    """How a flight is rebuilt. Speeds None: a share of the cruising speed."""

    take_off_mps: float | None = None
    landing_mps: float | None = None
    lift_off: Place | None = None  # where; None: the position that was told nearest to it
    close_on: Place | str | None = (
        None  # "lift-off", "nothing", a place; None: lift-off, or the touchdown that was told elsewhere
    )
    runway: Runway | float | None = (
        None  # or its direction, rad: the heading's constant error is found on the take-off roll
    )
    fixes: bool = False  # whether positions tie the path
    inertial: bool = True  # whether accelerations tell how the wind changed, where they are told
    muted: Muted = ()  # positions of these times tie nothing
    radars_muted: tuple[tuple[int, Muted], ...] = ()  # and plots of these, of a radar by number, or, 0, of all


@dataclass(frozen=True, slots=True)
class Sortie:
    """One flight. Paths are east and north of lift-off, m; heights above lift-off, m."""

    time: Times  # (n,)
    open_m: Floats  # (n, 3) integrated alone; its height is that of the pitch
    path_m: Floats  # (n, 2) closed or tied
    sigma_m: Floats  # (n,) 1 sigma an axis, by how much wind usually changes; NaN for an open path
    height_m: Floats  # (n,) by pressure
    wind_mps: Floats  # (n, 2) where the air moves to, east and north
    roll_rad: Floats
    pitch_rad: Floats
    compass_rad: Floats  # with its constant error taken off
    true_airspeed_mps: Floats
    closed_on: str  # "lift-off", "touchdown" (as positions told it), "place", "nothing"
    end_error_m: float  # of the open path, from where it should have ended; NaN where nothing tells
    heading_bias_rad: float
    heading_bias_sigma_rad: float
    lift_off: Place | None
    height_by: str  # "pressure", "altitude", "pitch"
    took_off: bool  # it began above the take-off speed, not with the recording
    landed: bool  # it ended below the landing speed, not with the recording
    compared: Compared | None
    fixes: int
    by_accelerations: bool  # whether they told how the wind changed
    radar: Seen | None  # which plots tie the path; None: no radar saw anything, or it was not asked
    doubts: tuple[str, ...]  # sentences: what speaks against the runway and the end that were taken

    @property
    def geodetic_deg(self) -> Floats | None:
        """Latitude and longitude (n, 2) of the path, degrees; None where nothing tells where it began."""
        if self.lift_off is None:
            return None
        latitude, longitude, _ = frame_at(self.lift_off).geodetic_from_enu(on_plane(self.path_m))
        return np.degrees(np.stack([latitude, longitude], axis=-1))

    @property
    def duration_s(self) -> float:
        """From lift-off to touchdown."""
        return float(self.time[-1] - self.time[0]) / SECOND

    @property
    def length_m(self) -> float:
        """Of the rebuilt way over the ground."""
        return float(np.linalg.norm(np.diff(self.path_m, axis=0), axis=1).sum())


def speeds(airspeed_mps: Floats) -> tuple[float, float]:
    """Take-off and landing speed of an aircraft that cruises as this one does, m/s."""
    fast = airspeed_mps[airspeed_mps > 0.5 * np.percentile(airspeed_mps, 99.0)]
    cruise = float(np.median(fast)) if len(fast) else 0.0
    return TAKE_OFF_SHARE * cruise, LANDING_SHARE * cruise


@dataclass(frozen=True, slots=True)
class _Beside:
    """What was told beside flight parameters: positions, accelerations, and what radars saw."""

    places: tuple[Times, Floats]
    felt: Felt | None
    views: Sequence[View]
    radar_tracks: Collection[str]

    def since(self, seconds: float) -> _Beside:
        """The same with seconds of accelerations counted from a later instant."""
        return self if self.felt is None else replace(self, felt=replace(self.felt, time_s=self.felt.time_s - seconds))


def reconstructed(
    parameters: Parameters, how: How = How(), views: Sequence[View] = (), radar_tracks: Collection[str] = ()
) -> list[Sortie]:
    """Every sortie of one aircraft, of which `parameters.lacks()` nothing; none where airspeed never rises. Raises Unplaced.

    `views`: what radars saw, which ties the paths; `radar_tracks` ("1/3"): which of their tracks are this aircraft, where that is
    known.
    """
    flown = Flown.of(parameters)
    if not len(flown.time):
        return []
    usual = speeds(flown.airspeed_mps)
    take_off = usual[0] if how.take_off_mps is None else how.take_off_mps
    landing = min(usual[1], 0.75 * take_off) if how.landing_mps is None else how.landing_mps
    if not 0.0 < landing < take_off:
        return []
    felt = parameters.felt(int(flown.time[0])) if how.inertial and parameters.flies_by_its_nose else None
    beside = _Beside(parameters.places.columns(), felt, views, radar_tracks)
    sorties: list[Sortie] = []
    for piece in flown.pieces(GAP_S):
        time_s = (piece.time - piece.time[0]) * 1e-9
        for first, end in paths.sorties(time_s, piece.airspeed_mps, take_off, landing):
            since = (int(piece.time[first]) - int(flown.time[0])) * 1e-9
            sorties.append(_sortie(piece, first, end, take_off, beside.since(since), how))
    return sorties


def _sortie(flown: Flown, first: int, end: int, take_off_mps: float, beside: _Beside, how: How) -> Sortie:
    places = beside.places
    part, took_off, landed = slice(first, end + 1), first > 0, end < len(flown.time) - 1
    time, time_s = flown.time[part], (flown.time[part] - flown.time[first]) * 1e-9
    lift_off = how.lift_off or _nearest_place(places, int(time[0]))
    rolled = roll_along(flown, first, take_off_mps, how.runway, lift_off)
    compass = flown.compass_rad[part] - (0.0 if math.isnan(rolled.bias_rad) else rolled.bias_rad)
    pressure, height, height_by = _heights(flown, part)
    speed = paths.true_airspeed(flown.airspeed_mps[part], pressure, flown.temperature_k[part])
    pitch, roll = flown.pitch_rad[part], flown.roll_rad[part]
    velocity = _air_velocity(time_s, height, speed, compass, pitch, roll)
    through_air = (
        paths.integrated(time_s, velocity) if lift_off is None else paths.on_earth(time_s, velocity, lift_off[0])
    )
    if height is None:
        height = through_air[:, 2]
    end_is = Closing("nothing", None)
    if landed and (took_off or how.close_on not in (None, "lift-off")):
        touchdown = _nearest_place(places, int(time[-1]))
        end_is = closing(how.close_on, through_air[:, :2], float(time_s[-1]), lift_off, touchdown)
    target = end_is.target_m
    fixes = fixes_of(places, time, lift_off, how.muted) if how.fixes and lift_off is not None else None
    positions = 0 if fixes is None else len(fixes.time_s) // 2
    evidence = None if beside.felt is None else evidence_of(beside.felt, time_s, velocity[:, :2], lift_off)
    usual_end = how.close_on is None or isinstance(how.close_on, str)
    radar = None
    if beside.views and lift_off is not None:
        sure = together(fixes, None if usual_end or target is None else ending(time_s, target))
        way = Way(int(time[0]), time_s, through_air[:, :2], height, lift_off)
        plots = seen_within(beside.views, int(time[0]), int(time[-1]), how.radars_muted)
        radar = seen(way, plots, beside.radar_tracks, tying(time_s, through_air[:, :2], sure, evidence))
        fixes = together(fixes, radar.known if radar.used else None)
    if usual_end and fixes is not None:
        end_is = Closing("nothing", None)
    found = carried(time_s, through_air[:, :2], target, fixes, evidence, usual_end)
    return Sortie(
        time=time,
        open_m=through_air,
        path_m=found.path_m,
        sigma_m=found.sigma_m,
        height_m=height,
        wind_mps=found.wind_mps,
        roll_rad=roll,
        pitch_rad=pitch,
        compass_rad=compass,
        true_airspeed_mps=speed,
        closed_on=end_is.on,
        end_error_m=math.nan if target is None else float(np.linalg.norm(through_air[-1, :2] - target)),
        heading_bias_rad=rolled.bias_rad,
        heading_bias_sigma_rad=rolled.sigma_rad,
        lift_off=lift_off,
        height_by=height_by,
        took_off=took_off,
        landed=landed,
        compared=None if lift_off is None else compared_with(places, time, through_air, found.path_m, height, lift_off),
        fixes=positions,
        by_accelerations=evidence is not None and isinstance(found, Tied),
        radar=radar,
        doubts=tuple(one for one in (rolled.doubt, end_is.doubt) if one is not None),
    )


def _air_velocity(
    time_s: Floats, height_m: Floats | None, speed_mps: Floats, compass_rad: Floats, pitch_rad: Floats, roll_rad: Floats
) -> Floats:
    """Through the air (n, 3), m/s; level, with the angle of attack taken off where heights tell it."""
    velocity = paths.air_velocity(speed_mps, compass_rad, pitch_rad)
    if height_m is not None:
        attack = paths.attack_by_height(time_s, height_m, speed_mps, pitch_rad, roll_rad)
        velocity[:, :2] = paths.air_velocity(speed_mps, compass_rad, pitch_rad, roll_rad, attack)[:, :2]
    return velocity


def _heights(flown: Flown, part: slice) -> tuple[Floats, Floats | None, str]:
    """Pressure, height above lift-off, and what the height is of; None: pitch must do."""
    pressure, altitude = flown.pressure_pa[part], flown.altitude_m[part]
    if not np.isnan(pressure).any():
        return pressure, paths.pressure_height(pressure, float(pressure[0])), "pressure"
    if not np.isnan(altitude).any():
        return paths.standard_pressure(altitude), altitude - altitude[0], "altitude"
    return np.full(len(altitude), paths.SEA_LEVEL_PA), None, "pitch"


def _nearest_place(places: tuple[Times, Floats], at: int) -> Place | None:
    """The position told nearest to an instant, if within 5 s."""
    time, values = places
    if not len(time):
        return None
    nearest = int(np.argmin(np.abs(time - at)))
    if abs(int(time[nearest]) - at) > 5 * SECOND:
        return None
    return float(values[nearest, 0]), float(values[nearest, 1])
