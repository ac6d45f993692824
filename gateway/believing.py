"""What dead reckoning hears within a step, and which positions it lets pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gateway.align import SECOND, Fix, ReckonedFix
from gateway.making import Making
from gateway.observation import GpsReport, Heard, Many, Observation, VehicleStatus
from gateway.picture import Event
from gateway.reckon import USED, Easing, LastPlace, Reckoned, Reckoner, reads

SURE_SIGMA = 6.0
TURNED_MPS2 = 10.0  # the acceleration may have changed by so much since dead reckoning came so far
EASES_MPS, EASES_AT_LEAST_S, EASES_AT_MOST_S = 20.0, 2.0, 5.0


class Believing(Making):
    """A step that hears how vehicles move, and does not believe every position."""

    def _hear_motion(self, arrival: Heard) -> None:
        """What vehicles tell of their own motion waits for the next second."""
        told: list[Observation] = []
        for observation in arrival.observations:
            if isinstance(observation, VehicleStatus):
                self.reckoners = self.reckoners.of_type(observation.aircraft, observation.vehicle_type)
            if reads(observation):
                told.append(observation)
        if told:
            # Many arrivals told together come at the last one's time, within its second: offsets are whole seconds.
            added = (arrival.now - _received_at(told)) // SECOND * SECOND
            self.reckoners = self.reckoners.hearing(added, told)

    def _believed(self, fix: Fix, report: GpsReport) -> Fix | None:
        """A position as fuse takes it: as it is, eased where it comes back, or None where inertial data deny it."""
        if not self.reckoners.denies(fix.aircraft, fix.at) and self._is_frozen(report, fix.at):
            return None
        expected = None
        if fix.aircraft in self.consistency.contradicted - self.reckoners.doubted:
            self._begin_motion_anew(fix.aircraft)
        elif fix.aircraft in self.reckoners.by_aircraft:
            self.reckoners = self.reckoners.placed(fix.aircraft, fix.at, self._place_of(fix, report))
            expected = self.reckoners.of(fix.aircraft, fix.at)
        if expected is None:
            return fix
        is_denied = expected.denied not in USED
        if self.site.dead_reckoning.refuses and (is_denied or self._is_denied(fix, expected)):
            if not is_denied:
                self.reckoners = self.reckoners.suspecting(fix.aircraft)
            self.count("GPS reports that inertial data deny")
            return None
        return self._eased(fix, expected)

    def _begin_motion_anew(self, aircraft: str) -> None:
        """Dead reckoning has learnt from velocities that are known to be wrong: it begins again when they are right."""
        if aircraft in self.reckoners.by_aircraft:
            # It keeps its place: a share that is due later in the second names it.
            vehicles = {**self.reckoners.by_aircraft, aircraft: Reckoner()}
            self.reckoners = replace(self.reckoners, by_aircraft=vehicles)

    def _is_frozen(self, report: GpsReport, at: int) -> bool:
        """Whether a vehicle, of which nothing else tells how it moves, tells one place while its velocity says that it moves."""
        name, here = report.aircraft, (report.latitude_rad, report.longitude_rad)
        if name not in self.reckoners.types or not self.site.dead_reckoning.refuses:
            return False
        east, north = report.velocity_east_mps, report.velocity_north_mps
        speed = None if east is None or north is None else math.hypot(east, north)
        known = self.told_last.get(name) or self.reckoners.told_last.get(name)
        last = LastPlace(*here, at, at) if known is None else known.followed_by(at, *here, speed)
        self.told_last[name] = last
        if last.is_frozen:
            self.count("GPS reports that are frozen")
            if known is not None and not known.is_frozen:
                text = (
                    "its position stays the same while its velocity says that it moves: it is not used until it changes"
                )
                self.events.append(Event(at, "warning", f"{name}: {text}"))
        elif known is not None and known.is_frozen:
            self.events.append(Event(at, "info", f"{name}: its position changes again, and is used"))
        return last.is_frozen

    def _place_of(self, fix: Fix, report: GpsReport) -> tuple[float, ...]:
        """As dead reckoning reads a position (told.PLACE)."""
        height_m = self.geoid.height_m(report) if fix.has_height else math.nan
        north, east, up = report.velocity_north_mps, report.velocity_east_mps, report.velocity_up_mps
        level = (math.nan, math.nan) if north is None or east is None else (north, east)
        down = math.nan if up is None else -up
        sigmas = float(fix.sigma_m[0]), float(fix.sigma_m[2]), fix.velocity_sigma_mps
        return (report.latitude_rad, report.longitude_rad, height_m, *level, down, *sigmas)

    def _is_denied(self, fix: Fix, expected: Reckoned) -> bool:
        """Whether a position is too far from where dead reckoning, which knows of the last second only, expects it."""
        if not expected.trusted:
            return False
        off = fix.enu_m - self._enu_of(expected)
        ahead_s = abs(expected.ahead_s)
        sigma_m = math.hypot(expected.level_sigma_m, expected.scatter_m)
        allowed_m = SURE_SIGMA * sigma_m + 0.5 * TURNED_MPS2 * ahead_s * ahead_s
        return math.hypot(float(off[0]), float(off[1])) > allowed_m

    def _eased(self, fix: Fix, expected: Reckoned) -> Fix:
        """A position that comes back after dead reckoning has led the track: approached at a walk, not jumped to."""
        lane = self.lanes.lanes.get(self.lanes.by_aircraft.get(fix.aircraft, 0))
        easing = self.reckoners.easings.get(fix.aircraft)
        if lane is not None and lane.events and isinstance(lane.last.measure, ReckonedFix) and fix.at > lane.last.at:
            off = self._enu_of(expected) - fix.enu_m
            off[2] = off[2] if fix.has_height else 0.0
            lasts_s = min(max(float(np.linalg.norm(off)) / EASES_MPS, EASES_AT_LEAST_S), EASES_AT_MOST_S)
            easing = Easing(fix.at, fix.at + int(lasts_s * SECOND), off)
            self.reckoners = self.reckoners.easing(fix.aircraft, easing)
        if easing is None or not easing.since <= fix.at < easing.until:
            return fix
        left = easing.off_m * ((easing.until - fix.at) / (easing.until - easing.since))
        return replace(fix, enu_m=fix.enu_m + left, sigma_m=np.hypot(fix.sigma_m, np.abs(left)))

    def _enu_of(self, expected: Reckoned) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        return self.frame.enu_from_geodetic(expected.latitude_rad, expected.longitude_rad, expected.height_m)


def _received_at(told: Sequence[Observation]) -> int:
    return max(int(one.columns["received_at"].max()) if isinstance(one, Many) else one.received_at for one in told)
