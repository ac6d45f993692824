"""Dead reckoning, within a step: once a second as far as vehicles have told, and on into their tracks where positions fail."""

from __future__ import annotations

import math

import numpy as np

from gateway import fuse
from gateway.align import SECOND, ReckonedFix
from gateway.estimators.kalman import ERROR, POSITION
from gateway.fuse import Lane
from gateway.fusing import Fusing
from gateway.picture import Event
from gateway.reckon import DISAGREES, JUMPED, NOTHING, USED, VELOCITY_JUMPED, VELOCITY_ONLY, Reckoned, Reckoners

SERIAL = -2  # of what was not heard
GPS_GONE_S = 3.0  # without a position for so long a radar shows dead reckoning where the vehicle is
WALK_MPS = 2.0  # what walks off so fast should be told
CORRELATED = 2.0  # a track's errors last for more than the second between two looks at it


class Reckoning(Fusing):
    """A step that knows where vehicles are that tell how they move."""

    def _reckon(self, at: int) -> None:
        """At a whole second: all vehicles go on; many do so in shares, later in the second."""
        self._remember_places()
        if self.options.dead_reckoning == "off" or self.reckoners.is_idle:
            return
        self.reckoners = self.reckoners.planning(at)
        if self.reckoners.crowded:
            self.once("more vehicles tell how they move than are followed by dead reckoning: the others are not")
        if self.reckoners.due == at:
            self._reckon_share(at)

    def _reckon_share(self, now: int) -> None:
        """The vehicles that are due; and where positions are missing or denied, their tracks go on by dead reckoning."""
        self._settle()
        before, share = self.reckoners, self.reckoners.planned[0][1]
        self.reckoners = before.advanced(self.history, self.site.dead_reckoning)
        for aircraft in share.names:
            found = self.reckoners.of(aircraft, share.at)
            self._tell_denied(aircraft, before, share.at, now)
            lane = self.lanes.lanes.get(self.lanes.by_aircraft.get(aircraft, 0))
            if found is None or lane is None or not lane.events or lane.ended_at is not None:
                continue
            self.reckoned.append(found)
            self._tell_walks(found)
            if found.denied not in USED and before.denied(aircraft) in USED:
                # also what has come since the second, and has entered the track, is not believed
                self._go_on(lane, self.reckoners.of(aircraft, now) or found, is_forced=True)
            elif lane.coasting_at(share.at, self.options):
                self._go_on(lane, found, is_forced=False)
            elif share.at - found.heard_at > GPS_GONE_S * SECOND and share.at - lane.last.radar_at <= SECOND * 2:
                self._show(lane, aircraft)
        self._settle()

    def _go_on(self, lane: Lane, found: Reckoned, *, is_forced: bool) -> None:
        """The track goes on from where dead reckoning has it, and with how sure that is."""
        axes = self.frame.local_from_enu(found.latitude_rad, found.longitude_rad)
        north, east, down = found.velocity_mps
        sigma = found.sigma_m[[1, 0, 2]]
        fix = ReckonedFix(
            found.at,
            SERIAL,
            -1,
            found.aircraft,
            self._enu_of(found),
            sigma,
            axes.T @ np.array([east, north, -down]),
            float(np.max(found.velocity_sigma_mps)),
            False,
            is_forced=is_forced,
        )
        self._work_in(*fuse.take_fix(self.lanes, fix, self._scene()))

    def _show(self, lane: Lane, aircraft: str) -> None:
        """Where radars have the vehicle corrects dead reckoning, in the position source's own coordinates."""
        event = lane.last
        place, error = event.mean[POSITION], event.mean[ERROR]
        both = np.hstack([np.eye(3), np.eye(3)])
        some = np.r_[POSITION, ERROR]
        variance = np.diagonal(both @ event.covariance[np.ix_(some, some)] @ both.T)
        latitude, longitude, height = self.frame.geodetic_from_enu(place + error)
        level = CORRELATED * math.sqrt(0.5 * float(variance[0] + variance[1]))
        upright = CORRELATED * math.sqrt(float(variance[2]))
        told = (float(latitude), float(longitude), float(height), math.nan, math.nan, math.nan, level, upright, 1e3)
        self.reckoners = self.reckoners.pictured(aircraft, event.at, told)

    def _tell_walks(self, found: Reckoned) -> None:
        """Say of each vehicle, once, which positions that walk off its inertial data would deny."""
        if math.isnan(found.told_from_mps):
            return
        least, words = f"{found.told_from_mps:.1f} m/s", self.reckoners.by(found.aircraft).words
        if found.told_from_mps <= WALK_MPS:
            text = f"{found.aircraft}: a position that walked off at {least} or more would be denied by {words}"
        else:
            text = (
                f"{found.aircraft}: {words} tell a position that walks off with velocities to match from {least} on only;"
                " one that jumps, begins to walk at once, or leaves its own velocities, is told sooner"
            )
        self.once(text, "info", f"{found.aircraft}: walks")

    def _tell_denied(self, aircraft: str, before: Reckoners, reckoned_at: int, at: int) -> None:
        now = self.reckoners.denied(aircraft)
        if before.denied(aircraft) == now:
            return
        if now == VELOCITY_ONLY:
            text = f"its velocity is not what its position moves by, and {self.reckoners.by(aircraft).words} deny it"
            text = f"{aircraft}: {text}: what it says of its position is used, without its velocity until that fits"
            self.events.append(Event(at, "warning", text))
            return
        if now == NOTHING and before.denied(aircraft) == VELOCITY_ONLY:
            self.events.append(Event(at, "info", f"{aircraft}: its velocity fits its position again, and is used"))
            return
        if now == NOTHING:
            known, sure = before.of(aircraft, reckoned_at), ""
            if known is not None:  # what walked off so slowly agrees some time because little is known by then
                sure = f" with where it is known to be, within {3.0 * known.level_sigma_m:.0f} m"
            text = f"{aircraft}: what it says of its position agrees again{sure}, and is used"
            self.events.append(Event(at, "info", text))
            return
        by = self.reckoners.by(aircraft).words
        how = f"jumped, which {by} deny" if now == JUMPED else f"walks off slowly, which {by} deny"
        if now == DISAGREES:
            how = "is not where its own velocities lead"
        if now == VELOCITY_JUMPED:
            how = f"comes with a velocity that jumped, which {by} deny"
        text = f"{aircraft}: what it says of its position {how}: it is not used until it agrees again"
        self.count("position sources denied")
        self.events.append(Event(at, "warning", text))
