"""One step in the making: what it knows, and what has come of the arrivals so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gateway import align, associate, fuse, predict, register, track
from gateway.align import SECOND, Fix, Plot
from gateway.associate import Change, MultiRadar, Setting, Spans
from gateway.frames import DeckPose, RadarFrame
from gateway.fuse import Adopted, Ended, Joint, Lanes, LifeChange, Scene, Settled
from gateway.fuse.filtering import Job
from gateway.fuse.rows import Row
from gateway.fuse.weighting import Model
from gateway.observation import Heard, Truth
from gateway.picture import Event, Health, Picture, SourceHealth
from gateway.reckon import LastPlace, Reckoned
from gateway.register import Residuals
from gateway.state import State

SAID_AT_MOST = 500  # a bound on what strangers can make us remember
NAMED_AT_MOST = 20  # sources with one trouble that are told by name


class Making:
    """The stages' parts of the state, what waits to be worked, and what is to be drawn of it all."""

    def __init__(self, state: State, heard: Sequence[Heard]) -> None:
        self.before, self.heard = state, heard
        self.site, self.options, self.frame = state.site, state.options, state.frame
        self.radars, self.geoid, self.tracks = state.radars, state.geoid, state.tracks
        self.association, self.registration, self.lanes = state.association, state.registration, state.lanes
        self.now, self.instant, self.serial = state.now, state.instant, state.serial
        self.counters, self.said, self.reported = dict(state.counters), state.said, state.reported
        self.consistency, self.predicting = state.consistency, state.predicting
        self.unnumbered, self.probing, self.reckoners = state.unnumbered, state.probing, state.reckoners
        self.deck, self.poses = state.deck, list[DeckPose]()
        self.history = int(state.options.history_s * SECOND)
        self.wait = int(state.options.association_wait_s * SECOND)
        self.events: list[Event] = []
        self._see_radars()
        self.fixes: list[Fix] = []
        self.plots: list[Plot] = []
        self.checks: list[associate.Check] = []
        self.changes: list[Change] = []
        self.of_radars: list[MultiRadar] = []
        self.rows: list[Row] = []
        self.ended: list[Ended] = []
        self.lived: list[LifeChange] = []
        self.settled: list[Settled] = []
        self.residuals: list[Residuals] = []
        self.forecasts: list[predict.Forecast] = []
        self.rounds: list[predict.Round] = []
        self.jobs: dict[int, Job] = {}
        self._both: tuple[Spans, tuple[Adopted, ...], tuple[Joint, ...], Spans] = (Spans(), (), (), Spans())
        self.untracked = 0
        self.looks: list[track.Look] = []
        self.reckoned: list[Reckoned] = []
        self.told_last: dict[
            str, LastPlace
        ] = {}  # since dead reckoning last heard of it: each would be a copy of them all

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
        self.rows += self._with_wind(rows)
        self.consistency = self.consistency.hearing(fresh)
        outliers = sum(event.outlying for _, event in fresh)
        if outliers:
            self.count("outliers, their pull bounded", outliers)
        for number, event in fresh:
            if event.restarted is not None:
                self.count("restarted after divergence")
                self.events.append(Event(event.at, "warning", f"track {number} started again: {event.restarted}"))

    def _remember_places(self) -> None:
        """Let dead reckoning know where vehicles were last."""
        if self.told_last:
            self.reckoners, self.told_last = self.reckoners.telling(self.told_last), {}

    def _with_wind(self, rows: list[Row]) -> list[Row]:
        """Rows with the winds that dead reckoning has found; what it knows changes only where nothing waits."""
        if not self.reckoners.by_aircraft:
            return rows
        return [replace(row, wind_mps=self.reckoners.wind_mps(row.aircraft)) for row in rows]

    def _scene(self) -> Scene:
        contradicted, doubted = self.consistency.contradicted, self.reckoners.doubted
        return Scene(self.tracks, self._spans, self.options, self.predicting.headings, contradicted, doubted)

    @property
    def _spans(self) -> Spans:
        """Which radar track is in which track when: as associated, as a number goes on, and as another radar's is."""
        found, adopted, joints = self.association.ledger.spans, self.lanes.adopted, self.lanes.joints
        if not adopted and not joints:
            return found
        if found is not self._both[0] or adopted is not self._both[1] or joints is not self._both[2]:
            self._both = found, adopted, joints, fuse.spans_with(found, adopted, joints)
        return self._both[3]

    def _see_radars(self) -> None:
        self.radar_frames = {number: RadarFrame.of(radar, self.frame) for number, radar in self.radars.items()}
        self.model = Model.of(self.options, self.site.position, self.radar_frames, self.site.estimation)
        self.setting = Setting(self.site, self.options, self.frame, self.radar_frames)
        if len(self.registration.met) < len(self.radars):
            self.registration, said = self.registration.meeting(self.radars, self.options.registration)
            at = self.now or (self.heard[0].now if self.heard else 0)
            self.events += [Event(at, one.level, one.text) for one in said]

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
        self._remember_places()
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
            self.predicting,
            self.unnumbered,
            self.probing,
            self.reckoners,
            self.deck,
        )
        observations = tuple(observation for arrival in self.heard for observation in arrival.observations)
        own = SourceHealth("gateway", "pipeline", 0.0, 0.0, 0, tuple(sorted(self.counters.items())))
        table = fuse.table(self.rows, self.ended, self.lived, self.settled, self.frame, self.model)
        picture = Picture(
            step=self.before.steps,
            now=self.now or 0,
            observations=observations,
            align=align.draw(self.fixes, self.plots, self.frame, self.radar_frames),
            track=track.table(self.tracks, self.untracked, self.looks),
            associate=associate.table(self.checks, self.association.ledger, self.changes, self.of_radars),
            register=register.table(self.registration, self.radars, self.now or 0, self.residuals),
            fuse=table,
            predict=predict.table(self.forecasts, self.frame, self.rounds),
            truth=tuple(observation for observation in observations if isinstance(observation, Truth)),
            health=replace(health, sources=(*health.sources, own)),
            events=tuple(self.events),
            reckoned=tuple(self.reckoned),
            deck=tuple(self.poses),
        )
        return state, picture
