"""The data path, in order: align, track, associate, register, fuse, predict. A newcomer starts here.

`step` works some arrivals into the state and returns the picture of what came of them. The unit of work is the arrival:
how arrivals are grouped into steps changes no number. What happens without an observation (checks that are due, coasting,
ends, predictions) happens at its own instant, after every arrival stamped at or before that instant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from gateway import align, associate, fuse, predict, register, track
from gateway.align import SECOND, Fix, Geoid, Plot
from gateway.associate import Change
from gateway.frames import RadarFrame, RunwayFrame
from gateway.fuse import Ended, Lanes
from gateway.fuse.filtering import Job
from gateway.fuse.rows import Row
from gateway.fuse.weighting import Model
from gateway.observation import GpsReport, Heard, RadarPlot, RadarStatus, Timing, Truth
from gateway.picture import Event, Health, Picture, SourceHealth
from gateway.settings import Options, RadarSite, Site
from gateway.track import RadarTracks

PLOT_MARGIN_S = 4.0  # plots are remembered this much longer than reports: a report's check looks back over them


@dataclass(frozen=True, slots=True)
class State:
    """Everything the picture remembers: one immutable value."""

    site: Site
    options: Options
    frame: RunwayFrame
    radars: Mapping[int, RadarSite]
    geoid: Geoid
    tracks: RadarTracks = RadarTracks()
    association: associate.Association = associate.Association()
    registration: register.Registration = register.Registration()
    lanes: Lanes = Lanes()
    now: int | None = None  # session time of the newest arrival or watermark
    instant: int = 0  # the next whole second
    serial: int = 0  # observations so far
    steps: int = 0
    counters: Mapping[str, int] = field(default_factory=dict)
    said: frozenset[str] = frozenset()  # what is said once
    changes: frozenset[Change] = frozenset()  # lately reported

    @property
    def radar_frames(self) -> Mapping[int, RadarFrame]:
        """The frame of every radar whose place is known."""
        return {number: RadarFrame.of(radar, self.frame) for number, radar in self.radars.items()}


def initial(site: Site, options: Options = Options()) -> State:
    """The state before the first arrival."""
    radars = {radar.number: radar for radar in site.radars}
    return State(site, options, RunwayFrame(site.runway), radars, Geoid(site.runway.geoid_separation_m))


def step(state: State, heard: Sequence[Heard], health: Health = Health()) -> tuple[State, Picture]:
    """What was heard, worked into the state; and the picture of what came of it."""
    work = Work(state)
    fixes = iter(work.place(heard))
    for item in heard:
        work.until(item.now, watermark=not item.observations)
        work.events += [Event(item.now, level, text) for level, text in item.notes]
        for observation in item.observations:
            match observation:
                case GpsReport():
                    fix, geoid = next(fixes)
                    work.take_fix(fix, geoid, observation.timing)
                case RadarPlot():
                    work.take_plot(observation)
                case RadarStatus():
                    work.take_status(observation)
        work.check()
    return work.result(heard, health)


class Work:
    """One step in the making: the state as it stands, and what has come of it so far. Lives only inside `step`."""

    def __init__(self, state: State) -> None:
        self.state = state
        self.radars = state.radar_frames
        self.model = Model.of(state.options, state.site.position, self.radars)
        self.events: list[Event] = []
        self.fixes: list[Fix] = []
        self.plots: list[Plot] = []
        self.checks: list[associate.Check] = []
        self.changes: list[Change] = []
        self.rows: list[Row] = []
        self.ended: list[Ended] = []
        self.forecasts: list[predict.Forecast] = []
        self.jobs: dict[int, Job] = {}
        self.untracked = 0

    # align ------------------------------------------------------------------------------------------------------

    def place(self, heard: Sequence[Heard]) -> list[tuple[Fix, Geoid]]:
        """All GPS reports of the step as fixes in one batch, each with what was known of the geoid at its turn."""
        geoid, reports, heights, geoids = self.state.geoid, [], [], []
        for item in heard:
            for report in item.observations:
                if isinstance(report, GpsReport):
                    geoid = geoid.learn(report)
                    reports.append(report)
                    heights.append(geoid.height_m(report))
                    geoids.append(geoid)
        fixes = align.place_reports(reports, heights, self.state.site, self.state.frame)
        return list(zip(fixes, geoids, strict=True))

    def take_fix(self, fix: Fix, geoid: Geoid, timing: Timing) -> None:
        """One GPS report: to its aircraft's track, and to be checked against the radar tracks."""
        fix = replace(fix, serial=self._next_serial())
        self.fixes.append(fix)
        self.state = replace(self.state, geoid=geoid)
        if abs(geoid.contradiction_m) > 5.0:
            self.once(
                f"the streams give a geoid separation {geoid.contradiction_m:+.0f} m from the site file's; the site's is used"
            )
        if geoid.site_m is None and not geoid.seen_m:
            self.once(
                "no geoid separation from the site or the stream: heights are taken as above mean sea level", "info"
            )
        if timing is Timing.FOREIGN or not self._is_timely(fix.at, fix.aircraft):
            return
        self._settle(self.state.lanes.by_aircraft.get(fix.aircraft))
        lanes, job = fuse.take_fix(self.state.lanes, fix, self._scene())
        self._work_in(lanes, job)
        self.state = replace(self.state, association=associate.await_plots(self.state.association, fix))

    def take_plot(self, observation: RadarPlot) -> None:
        """One plot: to its radar track, and to the system track that this is."""
        radar = self.state.radars.get(observation.radar)
        if radar is None:
            self.count("plots of an unknown radar")
            self.once(
                f"radar {observation.radar} is not in the site file and has not said where it stands: its plots are "
                f"counted, not used; add [[radar]] number = {observation.radar} to the site file"
            )
            return
        correction = self.state.registration.of(observation.radar)
        plot = align.place_plot(observation, self._next_serial(), radar, correction)
        self.plots.append(plot)
        if plot.number == 0:
            self.untracked += 1
            return
        if observation.timing is Timing.FOREIGN or not self._is_timely(plot.at, f"radar {plot.radar}"):
            return
        tracks, key = self.state.tracks.after(plot)
        self.state = replace(self.state, tracks=tracks)
        spans = self.state.association.ledger.spans
        self._move(associate.check_again(self.state.association, plot, tracks, self._setting()))
        if self.state.association.ledger.spans is not spans and fuse.contains(self.state.lanes, plot):
            return  # a pair that changed in hindsight has taken the plot along already
        self._settle(fuse.lane_of(self.state.lanes, plot, key, self._scene()))
        lanes, job = fuse.take_plot(self.state.lanes, plot, key, self._scene())
        self._work_in(lanes, job)

    def take_status(self, status: RadarStatus) -> None:
        """A radar's word of where it stands: used where the site file has none, compared with it otherwise."""
        said = align.radar_from_status(status, self.state.frame)
        known = self.state.radars.get(status.radar)
        if known is None:
            self.state = replace(self.state, radars={**self.state.radars, status.radar: said})
            self.radars = self.state.radar_frames
            self.model = replace(self.model, radars=self.radars)
            self.once(f"radar {status.radar} is not in the site file; it stands where its status says", "info")
        elif text := align.contradiction(known, said):
            self.once(f"radar {status.radar} says that it {text} than the site file says; the site file is used")

    # associate --------------------------------------------------------------------------------------------------

    def check(self) -> None:
        """The checks whose wait is over."""
        while (fix := self.state.association.due) is not None and self._due(fix) <= (self.state.now or 0):
            state = associate.check_due(self.state.association, self.state.tracks, self._setting())
            self.checks += [check for check in state.checks if check.fix is fix]
            self._move(state)

    def _due(self, fix: Fix) -> int:
        return fix.at + int(self.state.options.association_wait_s * SECOND)

    def _move(self, association: associate.Association) -> None:
        """A new state of association: plots of pairs that were made, lost or moved in time change their tracks."""
        old = self.state.association
        self.state = replace(self.state, association=association)
        if association.ledger.spans == old.ledger.spans:
            return
        self._settle()
        lanes, jobs = fuse.reroute(self.state.lanes, old.ledger.spans, self._scene())
        self.state = replace(self.state, lanes=lanes)
        for job in jobs:
            self.jobs[job.track] = job
        self._settle()
        for change in (change for check in association.checks for change in check.changes):
            self._report(change)
        lanes, ended = fuse.joined(self.state.lanes, association.ledger.spans)
        self.state = replace(self.state, lanes=lanes)
        self.ended += ended

    def _report(self, change: Change) -> None:
        if change not in self.state.changes:
            self.state = replace(self.state, changes=self.state.changes | {change})
            self.changes.append(change)
            verb = "is" if change.kind == "associated" else "is no longer"
            self.events.append(Event(change.at, "info", f"{change.aircraft} {verb} radar track {change.radar_track}"))

    # time -------------------------------------------------------------------------------------------------------

    def until(self, now: int, watermark: bool) -> None:
        """Everything that happens by itself before (with a watermark: also at) an instant of session time."""
        state = self.state
        history = int(state.options.history_s * SECOND)
        if state.now is None or now < state.now - history:
            if state.now is not None:
                self._start_again(
                    f"the session's time went back by {(state.now - now) / SECOND:.0f} s: tracks start again"
                )
            self.state = replace(self.state, instant=now // SECOND * SECOND + SECOND)
        while True:
            due = self.state.association.due
            at = self.state.instant if due is None else min(self.state.instant, self._due(due))
            if at > now or (at == now and not watermark):
                break
            self.state = replace(self.state, now=max(at, self.state.now or at))
            self.check()
            if at == self.state.instant:
                self._whole_second(at)
                idle = not self.state.lanes.lanes and self.state.association.due is None
                following = now // SECOND * SECOND if idle else at
                self.state = replace(self.state, instant=max(following, at) + SECOND)
        self.state = replace(
            self.state, now=max(now, self.state.now or now) if not _jumped(self.state.now, now, history) else now
        )

    def _whole_second(self, at: int) -> None:
        """Ends, coasting, predictions, and forgetting what is older than the history."""
        self._settle()
        state, options = self.state, self.state.options
        lanes, ended = fuse.end_silent(state.lanes, at, options)
        self.ended += ended
        self.events += [Event(at, "info", f"track {end.track} ended: {end.reason}") for end in ended]
        alive = [lane for lane in lanes.lanes.values() if lane.ended_at is None and lane.events]
        spans = state.association.ledger.spans
        silent = [lane for lane in alive if lane.coasting_at(at, options)]
        self.rows += fuse.coast(silent, at, spans, state.geoid.separation_m, self.model)
        if alive and at % int(options.prediction_period_s * SECOND) == 0:
            self.forecasts.append(predict.forecast(alive, at, options.horizons_s, self.model))
        before = at - int(options.history_s * SECOND)
        tracks = state.tracks.pruned(before - int(PLOT_MARGIN_S * SECOND))
        gone = associate.missing(state.association, tracks)
        association = associate.pruned(associate.forgotten(state.association, gone), before)
        changes = frozenset(change for change in state.changes if change.at >= before - 60 * SECOND)
        lanes = lanes.pruned(before)
        self.state = replace(state, lanes=lanes, tracks=tracks, association=association, changes=changes)

    def _start_again(self, why: str) -> None:
        """Forget everything that is dated; aircraft keep their track numbers."""
        self._settle()
        self.events.append(Event(self.state.now or 0, "warning", why))
        lanes = fuse.emptied(self.state.lanes)
        self.state = replace(self.state, lanes=lanes, tracks=RadarTracks(), association=associate.Association())

    # fuse -------------------------------------------------------------------------------------------------------

    def _work_in(self, lanes: Lanes, job: Job | None) -> None:
        """A job to be worked with others; a measurement that found no place came too late or starts nothing yet."""
        self.state = replace(self.state, lanes=lanes)
        if job is not None:
            self.jobs[job.track] = job

    def _settle(self, number: int | None = -1) -> None:
        """Work the waiting jobs: all, if this track is among them (-1: in any case). Rows come in order of arrival."""
        if not self.jobs or (number != -1 and number not in self.jobs):
            return
        jobs, self.jobs = list(self.jobs.values()), {}
        lanes, rows, outliers = fuse.work(
            self.state.lanes, jobs, self.state.association.ledger.spans, self.state.geoid.separation_m, self.model
        )
        self.state = replace(self.state, lanes=lanes)
        self.rows += rows
        if outliers:
            self.count("outliers, their pull bounded", outliers)

    def _scene(self) -> fuse.Scene:
        return fuse.Scene(self.state.tracks, self.state.association.ledger.spans, self.state.options)

    def _setting(self) -> associate.Setting:
        return associate.Setting(self.state.site, self.state.options, self.state.frame, self.radars)

    # counting and saying ----------------------------------------------------------------------------------------

    def count(self, reason: str, by: int = 1) -> None:
        """One more for a reason."""
        counters = self.state.counters
        self.state = replace(self.state, counters={**counters, reason: counters.get(reason, 0) + by})

    def once(self, text: str, level: str = "warning") -> None:
        """Say something, the first time only."""
        if text not in self.state.said:
            self.state = replace(self.state, said=self.state.said | {text})
            self.events.append(Event(self.state.now or 0, level, text))

    def _next_serial(self) -> int:
        self.state = replace(self.state, serial=self.state.serial + 1)
        return self.state.serial

    def _is_timely(self, at: int, source: str) -> bool:
        """Whether an observation falls into the history; if not it is counted."""
        history = int(self.state.options.history_s * SECOND)
        now = self.state.now or at
        if at < now - history:
            self.count("too late")
            self.once(
                f"{source} is more than {self.state.options.history_s:.0f} s late: such data are counted, not used"
            )
            return False
        if at > now + history:
            self.count("from the future")
            self.once(
                f"{source} is dated more than {self.state.options.history_s:.0f} s ahead: such data are counted, not used"
            )
            return False
        return True

    def result(self, heard: Sequence[Heard], health: Health) -> tuple[State, Picture]:
        """The new state and its picture."""
        self._settle()
        state = replace(self.state, steps=self.state.steps + 1)
        observations = tuple(observation for item in heard for observation in item.observations)
        own = SourceHealth("gateway", "pipeline", 0.0, 0.0, 0, tuple(sorted(state.counters.items())))
        picture = Picture(
            step=self.state.steps,
            now=state.now or 0,
            observations=observations,
            align=align.draw(self.fixes, self.plots, state.frame, self.radars),
            track=track.table(state.tracks, self.untracked),
            associate=associate.table(self.checks, state.association.ledger, self.changes),
            register=state.registration.table(self.radars),
            fuse=fuse.table(self.rows, self.ended, state.frame, self.model),
            predict=predict.table(self.forecasts, state.frame),
            truth=tuple(observation for observation in observations if isinstance(observation, Truth)),
            health=replace(health, sources=(*health.sources, own)),
            events=tuple(self.events),
        )
        return state, picture


def _jumped(before: int | None, now: int, history: int) -> bool:
    """Whether session time was set back, rather than a stamp a little out of order."""
    return before is not None and now < before - history
