"""Track, within a step: numbered plots go on at once, unnumbered ones when what they are a piece of has come."""

from __future__ import annotations

from collections.abc import Sequence

from gateway.align import SECOND, Plot
from gateway.arriving import Arriving
from gateway.track import Key, look_of

PERIOD_TOLD_WITHIN_S = 20.0  # radars say it every few seconds

Tracked = list[tuple[Plot, Key]]


class Tracking(Arriving):
    """A step whose plots belong to radar tracks."""

    def track(self, plots: Sequence[Plot]) -> Tracked:
        """The plots that the radar numbered, each with its radar track; those without a number wait."""
        tracked, unnumbered = [], []
        for plot in plots:
            if plot.number == 0:
                unnumbered.append(plot)
            elif not self.tracks.has_room(plot):
                self.untracked += 1
            else:
                self.tracks, key = self.tracks.after(plot)
                tracked.append((plot, key))
        if unnumbered:
            self._await_scan(unnumbered)
        return tracked

    def _await_scan(self, plots: Sequence[Plot]) -> None:
        self.unnumbered, unused = self.unnumbered.hearing(plots, self.radars, self.now or 0)
        self.untracked += len(unused)
        for radar in sorted({plot.radar for plot in unused}):
            if radar in self.unnumbered.watches:
                self.count("plots without a number, more than can wait")
                self._say_crowded(radar)
            else:
                self.count("plots without a number, of a radar that does not say how often it scans")
                if (self.now or 0) - self.unnumbered.unknown_since[radar] < PERIOD_TOLD_WITHIN_S * SECOND:
                    continue
                self.once(
                    f"radar {radar} does not say how long a scan takes: its plots without a number become no tracks; add "
                    f"period_s to its [[radar]] in the site file"
                )

    def _say_crowded(self, radar: int) -> None:
        self.once(
            f"radar {radar} sends more plots without a number at once than can all be followed: the likeliest are, and "
            f"confirmed tracks before all others; hypotheses_at_most = {self.radars[radar].hypotheses_at_most} in its "
            f"[[radar]] bounds their number, and the time that a scan takes"
        )

    def due_tracks(self) -> tuple[Tracked, Tracked]:
        """What was due of the unnumbered plots: those that are told of a radar track, and those that are taken back."""
        before = self.unnumbered.watches
        self.unnumbered, taken = self.unnumbered.worked(self.now or 0, self.radars, self.options)
        for radar, watch in self.unnumbered.watches.items():
            if watch is not before[radar]:
                told = [plot for plot in taken.told if plot.radar == radar]
                self.looks.append(look_of(watch, radar, told, self.radar_frames[radar], self.frame))
        for radar in taken.crowded:
            self.count("scans of which not every plot could be followed")
            self._say_crowded(radar)
        self.untracked += taken.untold
        back: Tracked = []
        for plot in taken.back:
            self.tracks, key = self.tracks.without(plot)
            if key is not None:
                back.append((plot, key))
        given: Tracked = []
        for plot in taken.told:
            if self.tracks.has_room(plot):
                self.tracks, key = self.tracks.after(plot)
                given.append((plot, key))
            else:
                self.untracked += 1
        return given, back
