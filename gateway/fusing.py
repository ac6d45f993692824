"""Fuse, within a step: every report and plot into the system track that it belongs to, and from one into another."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from gateway import fuse
from gateway.align import Fix
from gateway.associate import Spans
from gateway.fuse import Lanes, LifeChange
from gateway.fuse.filtering import Job
from gateway.picture import Event
from gateway.track import Key
from gateway.tracking import Tracked, Tracking


class Fusing(Tracking):
    """A step whose reports and plots are worked into system tracks."""

    def fuse(self, fixes: Sequence[Fix], tracked: Tracked) -> None:
        """Every report and plot into the system track that it belongs to."""
        scene = self._scene()
        for fix in fixes:
            self._settle(self.lanes.by_aircraft.get(fix.aircraft))
            self._work_in(*fuse.take_fix(self.lanes, fix, scene))
        for plot, key in tracked:
            lane = fuse.lane_of(self.lanes, plot, key, scene)
            if lane is None and (goes_on := self._goes_on(key, plot.at)):
                if goes_on == "not yet":
                    continue
                scene = self._scene()
                lane = fuse.lane_of(self.lanes, plot, key, scene)
            self._settle(lane)
            if not fuse.contains(self.lanes, lane, plot):  # a pair that changed just now may have taken it along
                self._work_in(*fuse.take_plot(self.lanes, plot, key, scene))

    def _goes_on(self, key: Key, at: int) -> bool | Literal["not yet"]:
        """Whether a new radar track goes on where another one fell silent; if so it is that one's track from now on."""
        self._settle()
        known, scene = self._spans, self._scene()
        if (lanes := fuse.adopted_earlier(self.lanes, key, at)) is not None:
            self.lanes = lanes  # so that what it took on is in the scene
            self._work_now(*fuse.reroute(lanes, known, self._scene()))
            return True
        found = fuse.continued(self.lanes, key, scene, self.model)
        if found is None:
            return False
        if isinstance(found, str):
            return found
        self.lanes, job = fuse.taken_on(self.lanes, found, scene)
        if job is None:
            self._work_now(*fuse.reroute(self.lanes, known, self._scene()))
        else:
            self._work_now(self.lanes, [job])
        if found.former is not None:
            self.tracks = self.tracks.closing(found.former, found.since)
        self.lived.append(LifeChange(found.since, found.lane.number, "confirmed", found.reason()))
        self.events.append(Event(found.since, "info", f"track {found.lane.number} goes on as {found.reason()}"))
        return True

    def _reroute(self, known: Spans, at: int) -> None:
        """After pairs changed from what was known: plots move between system tracks, and radars' tracks join others."""
        self.lanes, jobs = fuse.reroute(self.lanes, known, self._scene())
        # Before the rows are written, which may be under the number of a track that joined.
        self.lanes, ended = fuse.joined(self.lanes, self._spans, self.tracks, at)
        self.ended += ended
        self._work_now(self.lanes, jobs)

    def _work_now(self, lanes: Lanes, jobs: Sequence[Job]) -> None:
        self.lanes, self.jobs = lanes, {job.track: job for job in jobs}
        self._settle()
