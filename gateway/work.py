"""One step in the making: the stages' parts of the state, and what has come of the arrivals so far."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Literal

from gateway import align, associate, fuse, predict, track
from gateway.align import SECOND, Fix, Geoid, Plot
from gateway.associate import Association, Change, Setting, Spans
from gateway.frames import RadarFrame
from gateway.fuse import Adopted, Ended, Lanes, LifeChange, Scene, Settled
from gateway.fuse.consistency import Finding
from gateway.fuse.filtering import Job
from gateway.fuse.rows import Row
from gateway.fuse.weighting import Model
from gateway.observation import GpsReport, Heard, RadarPlot, RadarStatus, Timing, Truth
from gateway.picture import Event, Health, Picture, SourceHealth
from gateway.state import State
from gateway.track import Key, RadarTracks

PLOT_MARGIN_S = 4.0  # plots are remembered this much longer than reports: a report's check looks back over them
CONTRADICTION_M = 5.0  # between the site's and the streams' geoid: beyond this it is said
NAMED_AT_MOST = 20  # sources whose times are unusable that are told by name
AIRCRAFT_AT_MOST, RADARS_AT_MOST, SAID_AT_MOST = 10_000, 64, 500  # a bound on what strangers can make us remember
STAGED = (GpsReport, RadarPlot, RadarStatus)

Tracked = list[tuple[Plot, Key]]


class Work:
    """The stages of one step; lives only inside `pipeline.step`, which calls them in order for each arrival."""

    def __init__(self, state: State, heard: Sequence[Heard]) -> None:
        self.before, self.heard = state, heard
        self.site, self.options, self.frame = state.site, state.options, state.frame
        self.radars, self.geoid, self.tracks = state.radars, state.geoid, state.tracks
        self.association, self.registration, self.lanes = state.association, state.registration, state.lanes
        self.now, self.instant, self.serial = state.now, state.instant, state.serial
        self.counters, self.said, self.reported = dict(state.counters), state.said, state.reported
        self.consistency = state.consistency
        self.history = int(state.options.history_s * SECOND)
        self.wait = int(state.options.association_wait_s * SECOND)
        self._see_radars()
        self.fixes: list[Fix] = []
        self.plots: list[Plot] = []
        self.checks: list[associate.Check] = []
        self.changes: list[Change] = []
        self.rows: list[Row] = []
        self.ended: list[Ended] = []
        self.lived: list[LifeChange] = []
        self.settled: list[Settled] = []
        self.forecasts: list[predict.Forecast] = []
        self.events: list[Event] = []
        self.jobs: dict[int, Job] = {}
        self._both: tuple[Spans, tuple[Adopted, ...], Spans] = (Spans(), (), Spans())
        self.untracked = 0
        self._placed = self._place(heard)

    # predict, and all else that happens by itself -----------------------------------------------------------------

    def predict_until(self, arrival: Heard) -> None:
        """Everything that happens by itself before an arrival; with a watermark also at its very instant."""
        now, watermark = arrival.now, not arrival.observations
        if self.now is None or now < self.now - self.history:
            self._start_again(now)
        due = self._next_check()
        while (at := min(self.instant, due)) < now or (at == now and watermark):
            self.now = max(at, self.now or at)
            self._check_due()
            if at == self.instant:
                self._whole_second(at)
                idle = not self.lanes.lanes and self.association.due is None
                self.instant = (max((now - 1) // SECOND * SECOND, at) if idle else at) + SECOND
            due = self._next_check()
        self.now = max(now, self.now or now)
        self.events += [Event(now, level, text) for level, text in arrival.notes]

    def _whole_second(self, at: int) -> None:
        """Ends, coasting, predictions, what scatters otherwise than stated, and forgetting what is older than the history."""
        self._settle()
        self.consistency, findings = self.consistency.judged(self.site.position, self.radars, at)
        for found in findings:
            self._say_scatter(found)
        lanes, ended = fuse.end_silent(self.lanes, at, self.options)
        self.ended += ended
        self.events += [Event(at, "info", f"track {end.track} ended: {end.reason}") for end in ended if not end.quiet]
        lanes, lived = fuse.told(lanes, at, self.options)
        self.lived += lived
        self.events += [Event(at, "info", text) for one in lived if (text := fuse.sentence(one, lanes)) is not None]
        alive = [lane for lane in lanes.lanes.values() if lane.ended_at is None and lane.events]
        silent = [lane for lane in alive if lane.coasting_at(at, self.options)]
        self.rows += fuse.coast(silent, at, self._spans, self.geoid.separation_m, self.model)
        if alive and at % int(self.options.prediction_period_s * SECOND) == 0:
            self.forecasts.append(predict.forecast(alive, at, self.options.horizons_s, self.model))
        before = at - self.history
        was, self.lanes = self.lanes, lanes.pruned(before)
        self.settled += fuse.settled(was, self.lanes)
        self.tracks = self.tracks.pruned(before - int(PLOT_MARGIN_S * SECOND))
        gone = associate.missing(self.association, self.tracks)
        for key, aircraft in self.association.ledger.pairs.items():
            if key in gone:
                self.events.append(
                    Event(at, "info", f"radar track {track.name_of(key)}, {aircraft}, has fallen silent")
                )
        self.association = associate.pruned(associate.forgotten(self.association, gone), before)
        self.lanes, doubted = fuse.reviewed(self.lanes, self.association.ledger.spans, self.tracks, at)
        for one in doubted:
            text = f"radar track {track.name_of(one.key)} is {one.aircraft} no more: its reports do not find it there"
            self.events.append(Event(at, "info", text))
        if self.reported:
            self.reported = frozenset(change for change in self.reported if change.at >= before - 60 * SECOND)

    def _say_scatter(self, found: Finding) -> None:
        """A source that scatters otherwise than stated, said once; of aircraft only the first are named."""
        named = sum(", GPS of " in about for about in self.said)
        if ", GPS of " in found.topic and found.topic not in self.said and named >= NAMED_AT_MOST:
            self.once("more aircraft's positions scatter otherwise than is stated of them: they are not named")
        else:
            self.once(found.text, topic=found.topic)

    def _start_again(self, now: int) -> None:
        """At the first arrival, and when the session's time was set back: forget what is dated, keep track numbers."""
        if self.now is not None:
            self._settle()
            back_s = (self.now - now) / SECOND
            text = f"the session's time went back by {back_s:.0f} s: every track starts again, under its number"
            self.events.append(Event(now, "warning", text))
        was = self.lanes
        self.lanes, ended = fuse.emptied(was, now)
        self.settled += fuse.settled(was, self.lanes)
        self.ended += ended
        self.tracks, self.association = RadarTracks(), Association()
        # An arrival stamped at a whole second comes before what happens at that second.
        self.now, self.instant = now, (now - 1) // SECOND * SECOND + SECOND

    # align --------------------------------------------------------------------------------------------------------

    def takes(self, arrival: Heard) -> bool:
        """Whether a stage reads any of it; attitudes, inertial samples, air and intents pass by, for the sinks."""
        for observation in arrival.observations:
            if isinstance(observation, STAGED):
                return True
        self.serial += len(arrival.observations)
        return False

    def align(self, arrival: Heard) -> tuple[list[Fix], list[Plot]]:
        """The arrival's reports and plots in the site's frames; those whose time cannot be used are counted."""
        fixes, plots = [], []
        for observation in arrival.observations:
            self.serial += 1
            if isinstance(observation, GpsReport):
                fix, geoid = next(self._placed)
                if geoid is not self.geoid and geoid.separation_m != self.geoid.separation_m:
                    self._settle()  # what waits is written with the geoid that was known when it was heard
                self.geoid = geoid
                self.fixes.append(fix)
                if fix.has_height:
                    self._judge_heights()
                timely = observation.timing is not Timing.FOREIGN and self._is_timely(fix.at, fix.aircraft)
                if timely and self._has_room(fix.aircraft):
                    fixes.append(fix)
            elif isinstance(observation, RadarPlot):
                plot = self._placed_plot(observation)
                if plot is not None and self._is_timely(plot.at, f"radar {plot.radar}"):
                    plots.append(plot)
            elif isinstance(observation, RadarStatus):
                self._take_status(observation)
        return fixes, plots

    def _place(self, heard: Sequence[Heard]) -> Iterator[tuple[Fix, Geoid]]:
        """All GPS reports of the step as fixes in one batch, each with what was known of the geoid at its turn."""
        reports, heights, geoids, geoid = [], [], [], self.geoid
        serial, serials = self.serial, []
        for arrival in heard:
            for report in arrival.observations:
                serial += 1
                if isinstance(report, GpsReport):
                    geoid = geoid.learn(report)
                    reports.append(report)
                    serials.append(serial)
                    heights.append(geoid.height_m(report))
                    geoids.append(geoid)
        return zip(align.place_reports(reports, serials, heights, self.site, self.frame), geoids, strict=True)

    def _placed_plot(self, observation: RadarPlot) -> Plot | None:
        """A plot with what register learnt taken off, or None where its radar's place or its time is not known."""
        radar = self.radars.get(observation.radar)
        if radar is None:
            self.count("plots of an unknown radar")
            self.once(
                f"radar {observation.radar} is not in the site file and has not said where it stands: its plots are "
                f"counted, not used; add [[radar]] with number = {observation.radar} to the site file"
            )
            return None
        plot = align.place_plot(observation, self.serial, radar, self.registration.of(radar))
        self.plots.append(plot)
        return None if observation.timing is Timing.FOREIGN else plot

    def _take_status(self, status: RadarStatus) -> None:
        """A radar's word of where it stands: used where the site file has none, compared with it otherwise."""
        said, known = align.radar_from_status(status, self.frame), self.radars.get(status.radar)
        if known is None and len(self.radars) >= RADARS_AT_MOST:
            self.count("status of more radars than are kept")
        elif known is None:
            self.radars = {**self.radars, status.radar: said}
            self._settle()
            self._see_radars()
            self.once(
                f"radar {status.radar} is not in the site file: it is taken to stand where its status says", "info"
            )
        elif known is not None and (text := align.contradiction(known, said)):
            told = f"radar {status.radar} says that it {text} than the site file says: the site file is used"
            self.once(told, topic=f"where radar {status.radar} stands")

    def _judge_heights(self) -> None:
        if abs(self.geoid.contradiction_m) > CONTRADICTION_M:
            off_m = self.geoid.contradiction_m
            told = f"the streams' geoid separation is {off_m:+.0f} m from the site file's: the site file's is used"
            self.once(told, topic="the geoid")
        elif self.geoid.site_m is None and not self.geoid.seen_m:
            self.once(
                "neither site nor stream gives the geoid separation: heights are those above mean sea level", "info"
            )

    def _is_timely(self, at: int, source: str) -> bool:
        """Whether an observation falls into the history; if not it is counted, and said once."""
        now = self.now if self.now is not None else at
        if now - self.history <= at <= now + self.history:
            return True
        late = at < now
        self.count("too late" if late else "from the future")
        side = "late" if late else "ahead of the session's time"
        how = f"more than {self.options.history_s:.0f} s {side}"
        named = sum(how in text for text in self.said) < NAMED_AT_MOST
        who = f"{source} is" if named else "more sources are"
        self.once(f"{who} {how}: such data are counted, not used")
        return False

    def _has_room(self, aircraft: str) -> bool:
        """Whether an aircraft is known, or one more can be kept; if not it is counted, and said once."""
        known = self.lanes.by_aircraft
        if len(known) < AIRCRAFT_AT_MOST or aircraft in known:
            return True
        self.count("reports of more aircraft than are kept")
        self.once(f"more than {AIRCRAFT_AT_MOST} aircraft at a time: the reports of the others are counted, not used")
        return False

    # track --------------------------------------------------------------------------------------------------------

    def track(self, plots: Sequence[Plot]) -> Tracked:
        """The plots that the radar numbered, each with its radar track."""
        tracked = []
        for plot in plots:
            if plot.number == 0 or not self.tracks.has_room(plot):
                self.untracked += 1
                continue
            self.tracks, key = self.tracks.after(plot)
            tracked.append((plot, key))
        return tracked

    # associate ----------------------------------------------------------------------------------------------------

    def associate(self, fixes: Sequence[Fix], tracked: Tracked) -> None:
        """Reports wait for the plots about them; plots that came late repeat the checks they touch; what is due is checked."""
        for fix in fixes:
            self.association = associate.await_plots(self.association, fix)
        for plot, key in tracked:
            self._move(associate.check_again(self.association, plot, key, self.tracks, self.setting))
        self._check_due()

    def _next_check(self) -> int:
        due = self.association.due
        return 1 << 63 if due is None else due.at + self.wait

    def _check_due(self) -> None:
        """The checks whose wait is over."""
        until = (self.now or 0) - self.wait
        while (fix := self.association.due) is not None and fix.at <= until:
            after, made = associate.check_due(self.association, until, self.tracks, self.setting)
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
        self.lanes, jobs = fuse.reroute(self.lanes, known, self._scene())
        self.jobs = {job.track: job for job in jobs}
        self._settle()
        for change in (change for check in after.checks for change in check.changes if change not in self.reported):
            self.reported |= {change}
            self.changes.append(change)
            verb = "is" if change.kind == "associated" else "is no longer"
            self.events.append(Event(change.at, "info", f"{change.aircraft} {verb} radar track {change.radar_track}"))
        self.lanes, ended = fuse.joined(self.lanes, self._spans)
        self.ended += ended

    # register -----------------------------------------------------------------------------------------------------

    def register(self) -> None:
        """Nothing is learnt yet: the correction that align takes off stays what it was, none."""

    # fuse ---------------------------------------------------------------------------------------------------------

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
            self.lanes = lanes
            self.lanes, jobs = fuse.reroute(lanes, known, self._scene())
            self.jobs = {job.track: job for job in jobs}
            self._settle()
            return True
        found = fuse.continued(self.lanes, key, scene, self.model)
        if found is None:
            return False
        if isinstance(found, str):
            return found
        self.lanes, job = fuse.taken_on(self.lanes, found, scene)
        jobs = [job] if job is not None else []
        if found.lane.aircraft is not None:
            self.lanes, jobs = fuse.reroute(self.lanes, known, self._scene())
        self.jobs = {job.track: job for job in jobs}
        self._settle()
        if found.former is not None:
            self.tracks = self.tracks.closing(found.former, found.since)
        self.lived.append(LifeChange(found.since, found.lane.track, "confirmed", found.reason()))
        self.events.append(Event(found.since, "info", f"track {found.lane.track} goes on as {found.reason()}"))
        return True

    def _work_in(self, lanes: Lanes, job: Job | None) -> None:
        """A job, to be worked together with those of other tracks."""
        self.lanes = lanes
        if job is not None:
            self.jobs[job.track] = job

    def _settle(self, lane: int | None = -1) -> None:
        """Work the waiting jobs, if this track is among them (-1: in any case); rows come in order of arrival."""
        if not self.jobs or (lane != -1 and lane not in self.jobs):
            return
        jobs, self.jobs = list(self.jobs.values()), {}
        separation_m = self.geoid.separation_m
        self.lanes, rows, fresh = fuse.work(self.lanes, jobs, self._spans, separation_m, self.model)
        self.rows += rows
        self.consistency = self.consistency.hearing(event for _, event in fresh)
        outliers = sum(event.outlying for _, event in fresh)
        if outliers:
            self.count("outliers, their pull bounded", outliers)
        for number, event in fresh:
            if event.restarted is not None:
                self.count("restarted after divergence")
                self.events.append(Event(event.at, "warning", f"track {number} started again: {event.restarted}"))

    def _scene(self) -> Scene:
        return Scene(self.tracks, self._spans, self.options)

    @property
    def _spans(self) -> Spans:
        """Which radar track is which aircraft when: as associated, and where a new number goes on with an old one."""
        found, adopted = self.association.ledger.spans, self.lanes.adopted
        if not adopted:
            return found
        if found is not self._both[0] or adopted is not self._both[1]:
            self._both = found, adopted, fuse.spans_with(found, adopted)
        return self._both[2]

    def _see_radars(self) -> None:
        self.radar_frames = {number: RadarFrame.of(radar, self.frame) for number, radar in self.radars.items()}
        self.model = Model.of(self.options, self.site.position, self.radar_frames, self.site.estimation)
        self.setting = Setting(self.site, self.options, self.frame, self.radar_frames)

    # counting, saying, and the result -----------------------------------------------------------------------------

    def count(self, reason: str, by: int = 1) -> None:
        """One more for a reason."""
        self.counters[reason] = self.counters.get(reason, 0) + by

    def once(self, text: str, level: str = "warning", topic: str = "") -> None:
        """Say something, the first time only; of a topic only the first, whatever numbers are in it."""
        about = topic or text
        if about not in self.said and len(self.said) < SAID_AT_MOST:
            self.said |= {about}
            self.events.append(Event(self.now or 0, level, text))

    def picture(self, health: Health) -> tuple[State, Picture]:
        """The new state and its picture."""
        self._settle()
        state = State(
            self.site,
            self.options,
            self.frame,
            self.radars,
            self.geoid,
            self.tracks,
            self.association,
            self.registration,
            self.lanes,
            self.now,
            self.instant,
            self.serial,
            self.before.steps + 1,
            self.counters,
            self.said,
            self.reported,
            self.consistency,
        )
        observations = tuple(observation for arrival in self.heard for observation in arrival.observations)
        own = SourceHealth("gateway", "pipeline", 0.0, 0.0, 0, tuple(sorted(self.counters.items())))
        table = fuse.table(self.rows, self.ended, self.lived, self.frame, self.model)
        picture = Picture(
            step=self.before.steps,
            now=self.now or 0,
            observations=observations,
            align=align.draw(self.fixes, self.plots, self.frame, self.radar_frames),
            track=track.table(self.tracks, self.untracked),
            associate=associate.table(self.checks, self.association.ledger, self.changes),
            register=self.registration.table(self.radars),
            fuse=replace(table, settled=tuple(self.settled)),
            predict=predict.table(self.forecasts, self.frame),
            truth=tuple(observation for observation in observations if isinstance(observation, Truth)),
            health=replace(health, sources=(*health.sources, own)),
            events=tuple(self.events),
        )
        return state, picture
