"""One session at work: arrivals and a watermark in, a picture out to the sinks, everything recorded on the way.

The loop, live or replayed, calls `work` again and again; how it cuts the arrivals into calls cannot change a number.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from adapters import Arrival, Source
from adapters.arrivals import Arrivals
from adapters.reasons import reason_of
from gateway import __version__
from gateway.observation import Heard
from gateway.picture import Picture
from gateway.pipeline import State, initial, step
from gateway.predict import ArrivalFlow
from gateway.predict.told import known_points
from gateway.runtime.flow_ways import FlowsError, flows_near
from gateway.runtime.folder import Record, make_folder, remembered_for, session_name
from gateway.runtime.hearing import Hearing
from gateway.runtime.opening import Opening
from gateway.runtime.outputs import Outputs
from gateway.runtime.places import PlaceFinder
from gateway.runtime.recorder import Recorder
from gateway.runtime.setup import Place, RunFailure, Setup
from gateway.runtime.summary import Summary, Tally
from gateway.settings import Site
from gateway.sinks.aside import Aside, AtOnce

_FLUSH_NS = 500_000_000  # of wall time: half of the second that a kill may cost


class Run:
    """From the first arrival to the summary. Raises RunFailure when the disk refuses; what was written stays whole."""

    def __init__(self, setup: Setup, started_at: int) -> None:
        self.setup = setup
        self.started_at = started_at
        self.place: Place | None = None
        self.folder: Path | None = None
        self.outputs: Outputs | None = None
        self._wall_began = self._flushed = time.monotonic_ns()
        self._watermark = started_at
        self._first_at: int | None = None
        self._state: State | None = None
        self._tally: Tally | None = None
        self._held: list[Heard] = []
        self._finder = PlaceFinder()
        self._untold: tuple[tuple[str, str], ...] = ()  # notes for the next step
        begins_at = setup.options.begins_at
        self._opening = None if begins_at is None else Opening(begins_at)
        # What waits for the disk must not hold up what comes in; a replay has nothing that could wait for it.
        self._aside = Aside("archive") if setup.live and setup.archive is not None else AtOnce()
        self._recorder: Recorder | None = None
        self._link_counters: dict[str, int] = {}
        if setup.archive is not None:
            name = setup.name or (setup.place.site.name if setup.place else "")
            self.folder = make_folder(setup.archive, setup.folder_name or session_name(started_at, name))
            self._recorder = self._record_into(self.folder)
        self._hearing = Hearing(setup, self._recorder)
        if setup.place is not None:
            self._settle(setup.place)

    @property
    def heard_for_s(self) -> float:
        """How long ago the first arrival was, in s of the session; 0 before it."""
        return 0.0 if self._first_at is None else (self._watermark - self._first_at) / 1e9

    @property
    def watermark(self) -> int:
        """How far the session has come, a stamp, ns since 1970 UTC."""
        return self._watermark

    def known_aircraft(self) -> tuple[str, ...]:
        """Those that have a track."""
        return () if self._state is None else tuple(sorted(self._state.lanes.by_aircraft))

    def known_points(self, aircraft: str) -> tuple[str, ...]:
        """Where an aircraft can be declared to go, by name; the items of its plan by number."""
        if self._state is None:
            return ()
        return known_points(self._state.predicting.tellings.by_aircraft.get(aircraft), self._state.site)

    def _record_into(self, folder: Path) -> Recorder:
        record = Record(__version__, self.setup.command, self.setup.options, self.started_at)
        try:
            return Recorder(folder, record, self._aside)
        except OSError as error:
            raise self._failure(error) from error

    def _settle(self, place: Place) -> None:
        """From now on the place is known: the pipeline and the sinks can begin."""
        self.place = place
        remembered = remembered_for(self.setup, place.site)
        flows = self._flows(place.site)
        self._state = initial(place.site, self.setup.options, remembered, self.started_at, flows)
        self._tally = Tally(place.site.runway)
        if self._recorder is not None:
            self._recorder.describe(site=place.text, site_origin=place.origin, registration=remembered, flows=flows)
        try:
            self.outputs = Outputs(place.site, self.folder, self.setup, self._aside)
        except OSError as error:
            raise self._failure(error) from error

    def _flows(self, site: Site) -> tuple[ArrivalFlow, ...]:
        """Ways that arrivals come here; where none are given, those that lie in the archive of a live session."""
        if self.setup.flows is not None or not self.setup.live or self.setup.archive is None:
            return self.setup.flows or ()
        try:
            flows = flows_near(self.setup.archive, site)
        except FlowsError as error:
            self._untold = (*self._untold, ("warning", str(error)))
            return ()
        if flows:
            said = f"{len(flows)} arrival flows of {self.setup.archive} tell where aircraft without a plan may go."
            self._untold = (*self._untold, ("info", said))
        return flows

    def add(self, source: Source) -> None:
        """A source that is new."""
        try:
            self._hearing.add(source)
        except OSError as error:
            raise self._failure(error) from error

    def work(
        self, arrivals: Sequence[Arrival], watermark: int, notes: tuple[tuple[str, str], ...] = ()
    ) -> Picture | None:
        """Take in arrivals and the watermark after them; the picture, or None while the place is not known.

        `notes` are (level, text) of the links, to be told once.
        """
        heard = self._hear(Arrivals.of(arrivals))
        self._watermark = max(self._watermark, watermark)
        mark = self._hearing.decoder.watermark(self._watermark)
        heard.append(mark if not notes else replace(mark, notes=(*mark.notes, *notes)))
        if self._opening is not None:
            heard = self._before(heard, self._opening)
        if self._state is None:
            self._held += heard
            self._look(heard)
            heard, self._held = ([], self._held) if self._state is None else (self._held, [])
        if not heard:
            self._flush_when_due()
            return None
        if self._untold:
            heard[-1] = replace(heard[-1], notes=(*heard[-1].notes, *self._untold))
            self._untold = ()
        return self._step(heard)

    def _hear(self, arrivals: Arrivals) -> list[Heard]:
        """Record and decode; what holds something for the picture."""
        if self._first_at is None and len(arrivals):
            self._first_at = arrivals[0].received_at
        if (opening := self._opening) is not None:
            begins = np.flatnonzero(arrivals.received_at >= opening.begins_at).tolist()
            if begins:
                return [*self._open(self._decode(arrivals[: begins[0]]), opening), *self._decode(arrivals[begins[0] :])]
        return self._decode(arrivals)

    def _decode(self, arrivals: Arrivals) -> list[Heard]:
        return self._hearing.hear(arrivals, self.outputs)

    def _before(self, heard: list[Heard], opening: Opening) -> list[Heard]:
        """Nothing has come yet from the session's beginning on: keep what will hold then, unless time has come to it."""
        if self._watermark >= opening.begins_at:
            return [*self._open(heard[:-1], opening), heard[-1]]
        for item in heard:
            opening.keep(item)
        if self._state is None:
            self._look(heard)
        return []

    def _open(self, before: list[Heard], opening: Opening) -> list[Heard]:
        """The session begins: what was said before and still holds."""
        for item in before:
            opening.keep(item)
        if self._state is None:
            self._look(before)
        self._opening = None
        return [opening.deliver(self._hearing.decoder.session_time(opening.begins_at))]

    def _look(self, heard: list[Heard]) -> None:
        """See whether what was heard tells where we are."""
        place = self._finder.look(heard)
        if place is not None:
            self._settle(place)
            self._untold = (*self._untold, ("info", f"Site: {place.origin}."))

    def _step(self, heard: Sequence[Heard]) -> Picture:
        assert self._state is not None
        assert self._tally is not None
        assert self.outputs is not None
        health = self._hearing.decoder.health(self._watermark)
        self._state, picture = step(self._state, heard, health)
        if self.setup.options.mutes:
            picture = self._hearing.muting.muted.add(picture)
        self._tally.add(picture)
        try:
            if self._recorder is not None:
                self._recorder.flush_inputs()
            self.outputs.write(picture)
        except OSError as error:
            raise self._failure(error) from error
        self._flush_when_due()
        return picture

    def _flush_when_due(self) -> None:
        if time.monotonic_ns() - self._flushed >= _FLUSH_NS:
            self._flushed = time.monotonic_ns()
            self.flush()

    def flush(self) -> None:
        """Hand what was recorded to the operating system, with session.json beside it."""
        if self._recorder is None:
            return
        try:
            registered = None if self._state is None else self._state.to_remember(self._watermark)
            self._recorder.describe(epoch_offset_s=self._hearing.decoder.epoch_offset_s, registered=registered)
            self._recorder.flush(self._watermark, self._counters())
        except OSError as error:
            raise self._failure(error) from error

    def count(self, counters: dict[str, int]) -> None:
        """What the links have lost so far, totals by reason."""
        self._link_counters = counters

    def _counters(self) -> dict[str, int]:
        gateway = self._tally.gateway_counters() if self._tally else {}
        outputs = self.outputs.counters() if self.outputs else {}
        return {**self._link_counters, **self._hearing.counters(), **gateway, **outputs}

    def _failure(self, error: OSError) -> RunFailure:
        where = self.folder or error.filename or "the archive"
        told = f"{where} could not be written ({reason_of(error)}); the session ends here, what was written is whole."
        return RunFailure(told)

    def finish(self, ended: str, tell: Callable[[float], None] = lambda share: None) -> Summary:
        """Smooth, where that was asked for; close everything, make the Parquet files, complete session.json; the summary.

        `tell` hears how much has been smoothed, from 0 to 1.
        """
        self.flush()
        try:
            if self.outputs is not None and self._state is not None:
                self.outputs.smooth(self._state.lanes, tell)
            if self.outputs is not None:
                self.outputs.close()
            summary = self._summary(ended)
            if self._recorder is not None:
                self._recorder.describe(ended=ended, summary=summary.document())
                self._recorder.flush(self._watermark, self._counters())
                self._recorder.close()
            self._aside.close()
        except OSError as error:
            raise self._failure(error) from error
        return summary

    def abandon(self, ended: str) -> None:
        """Close what can still be closed after a failure. The next command that touches the session completes it."""
        if self.outputs is not None:
            with contextlib.suppress(OSError):  # the failure that brought us here is the one that is told
                self.outputs.abandon()
        if self._recorder is not None:
            self._recorder.describe(watermark=self._watermark)
            self._recorder.abandon(ended)
        with contextlib.suppress(OSError):
            self._aside.close()

    def _summary(self, ended: str) -> Summary:
        tally = self._tally
        began = max(self.started_at if self._first_at is None else self._first_at, self.setup.options.begins_at or 0)
        return Summary(
            ended=ended,
            duration_s=max(self._watermark - began, 0) / 1e9,
            wall_s=(time.monotonic_ns() - self._wall_began) / 1e9,
            site=self.place.site.name if self.place else "",
            site_origin=self.place.origin if self.place else "",
            epoch_offset_s=self._hearing.decoder.epoch_offset_s or 0,
            sources=self._hearing.sources(),
            observations=tally.named_observations() if tally else {},
            tracks=tally.tracks if tally else 0,
            aircraft=tuple(sorted(tally.aircraft)) if tally else (),
            track_rows=tally.track_rows if tally else 0,
            predictions=tally.predictions if tally else 0,
            associations=tally.changes["associated"] if tally else 0,
            associations_lost=tally.changes["lost"] if tally else 0,
            counters=self._counters(),
            accuracy=tally.accuracy.scores() if tally else {},
            muted=self._hearing.muting.muted.scores(),
            smoothed=self.outputs.smoothed() if self.outputs else None,
            archive=self.folder,
        )
