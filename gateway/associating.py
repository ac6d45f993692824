"""Associate, within a step: checks when they are due, what changed pairs mean for the tracks, and radars with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gateway import associate, fuse
from gateway.align import Fix
from gateway.associate import Association
from gateway.picture import Event
from gateway.reckoning import Reckoning
from gateway.register import remaining
from gateway.tracking import Tracked


class Associating(Reckoning):
    """A step that knows which radar tracks are which aircraft, and which are one target."""

    _nearby: associate.Nearby | None = None  # the radar tracks as columns, while no plot comes

    def associate(self, fixes: Sequence[Fix], tracked: Tracked) -> None:
        """Reports wait for the plots about them; plots that came late repeat the checks they touch; what is due is checked."""
        for fix in fixes:
            self.association = associate.await_plots(self.association, fix)
        for plot, key in tracked:
            self._move(associate.check_again(self.association, plot, key, self.tracks, self.setting))
        self._check_due()

    def _next_check(self) -> int:
        due, scan = self.association.due, self.unnumbered.due
        return min(1 << 63 if due is None else due.at + self.wait, 1 << 63 if scan is None else scan)

    def _track_due(self) -> None:
        """The unnumbered plots whose wait is over: those of confirmed tracks go on as numbered ones do."""
        if self.unnumbered.due is None or self.unnumbered.due > (self.now or 0):
            return
        told, back = self.due_tracks()
        for plot, key in back:
            self._settle()
            self._move(associate.check_again(self.association, plot, key, self.tracks, self.setting))
            self._work_in(*fuse.give_back(self.lanes, plot, key, self._scene()))
            self._settle()
        self.associate((), told)
        self.fuse((), told)

    def _check_due(self) -> None:
        """The checks whose wait is over."""
        until = (self.now or 0) - self.wait
        while (fix := self.association.due) is not None and fix.at <= until:
            if self._nearby is None or self._nearby.tracks is not self.tracks:
                self._nearby = associate.Nearby(self.tracks)
            after, made = associate.check_due(self.association, until, self._nearby, self.setting)
            self.checks += made
            self._move(after)

    def _move(self, after: Association) -> None:
        """A new state of association: the plots of pairs made, lost or moved in time change their system tracks."""
        old, known = self.association, self._spans
        if after is old:
            return
        if after.ledger.spans != old.ledger.spans:
            self._settle()  # what waits is written under the pairs that were known when it was heard
        self.association = after
        if after.ledger.spans == old.ledger.spans:
            return
        self._reroute(known, self.now or 0)
        for change in (change for check in after.checks for change in check.changes if change not in self.reported):
            self.reported |= {change}
            self.changes.append(change)
            verb = "is" if change.kind == "associated" else "is no longer"
            self.events.append(Event(change.at, "info", f"{change.aircraft} {verb} radar track {change.radar_track}"))

    def _look_at_radars(self, at: int) -> None:
        """Where the radar tracks of several radars are."""
        if len(self.radars) > 1:
            state = associate.looked(self.association.together, at, self.tracks, self.radar_frames)
            self.association = replace(self.association, together=state)

    def _compare_radars(self, at: int) -> None:
        """Which of them are one target."""
        allowed = remaining(self.registration, self.radars, at)
        state = associate.compared(self.association.together, self.tracks, allowed)
        self.association = replace(self.association, together=state)

    def _join_radars(self, at: int) -> None:
        """Those that were found to be one target, brought into one system track; and others out of it."""
        state, seen = self.association.together, self.association.together.seen
        if seen is None:
            return
        self.association = replace(self.association, together=replace(state, seen=None))
        known, found = self._spans, self.association.ledger.spans
        found = fuse.spans_with(found, self.lanes.adopted) if self.lanes.adopted else found
        groups, alive = associate.together(seen.keys, state.one), frozenset(seen.keys)
        done = fuse.regrouped(self.lanes, groups, alive, found, known, self.tracks, at)
        if done.lanes is not self.lanes:
            self.events += [Event(at, "info", text) for text in done.told]
            self.lanes = done.lanes
            self._reroute(known, at)
        theirs = fuse.radar_tracks_of_aircraft(self.lanes, self._spans, seen.keys)
        allowed = remaining(self.registration, self.radars, at)
        self.of_radars.append(associate.combined(seen, theirs, allowed, self.frame))
