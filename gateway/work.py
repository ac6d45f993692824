"""The stages of one step, and all that happens by itself between its arrivals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from enum import IntEnum

from gateway import associate, fuse, predict, track
from gateway.align import SECOND
from gateway.associating import Associating
from gateway.fuse import Lane
from gateway.fuse.evidence import Finding
from gateway.making import NAMED_AT_MOST
from gateway.observation import Heard
from gateway.picture import Event
from gateway.register import WAIT_NS, gathered, residuals

PLOT_MARGIN_S = 4.0  # plots are remembered this much longer than reports: a report's check looks back over them


class Turn(IntEnum):
    """What is done once a second, in which sixteenth of it; in the middle, or in twentieths, a crowd is predicted."""

    FORGETTING = 1
    JUDGING = 2  # reports and plots in shares, each soon after another turn
    FORGETTING_MORE = 3
    REGISTERING = 5
    LOOKING = 9
    MEETING = 10
    PROBING = 11
    LOOKING_AT_RADARS = 12
    COMPARING = 13
    JOINING = 15


TURN_NS = SECOND // 16
READING_LANES = tuple(
    turn for turn in Turn if turn not in (Turn.REGISTERING, Turn.MEETING, Turn.LOOKING_AT_RADARS, Turn.COMPARING)
)


class Work(Associating):
    """The stages of one step; lives only inside `pipeline.step`, which calls them in order for each arrival."""

    def instants_until(self, arrival: Heard) -> Iterator[int]:
        """The instants before an arrival at which register or predict have their turn, with a watermark also at its very one.

        What else happens by itself is done on the way: checks that are due before them, at each whole second ends and coasting,
        and between them, in turn, one thing after the other. While there is nothing, seconds are passed over, however many
        a step brings: nothing may happen then that would be otherwise for more of them.
        """
        now, watermark = arrival.now, not arrival.observations
        if self.now is None or now < self.now - self.history:
            self._start_again(now)
        due = self._next_check()
        while (at := min(self.instant, due, self._planned_due)) < now or (at == now and watermark):
            self.now = max(at, self.now or at)
            if at == self.reckoners.due:
                self._reckon_share(at)
            if at == self.predicting.due:
                self._foretell(at)
            self._judge(at)
            self._track_due()
            self._check_due()
            if at == self.instant:
                if is_whole := at % SECOND == 0:
                    self._reckon(at)
                    self._live_until(at)
                    self._move_deck(at)
                    yield at
                is_idle = is_whole and not self.lanes.lanes and self.association.due is None and self.reckoners.is_idle
                for turn in Turn if is_idle else (at % SECOND // TURN_NS,):
                    self._in_turn(turn, at)
                if at % SECOND == Turn.REGISTERING * TURN_NS:
                    yield at
                self.instant = max((now - 1) // SECOND * SECOND, at) + SECOND if is_idle else at + TURN_NS
            due = self._next_check()
        self.now = max(now, self.now or now)
        self._hear_heading(arrival)
        self.events += [Event(now, level, text) for level, text in arrival.notes]

    @property
    def _planned_due(self) -> int:
        """When the next share is due of what is spread over the second."""
        return min(self.predicting.due, self.consistency.due, self.reckoners.due)

    def _in_turn(self, turn: int, at: int) -> None:
        """What is done once a second between the whole seconds: of a crowd it would hold up for long what comes, all at once."""
        if turn in READING_LANES:
            self._settle()
            self._forget_states(READING_LANES.index(turn), at)
        if turn == Turn.FORGETTING:
            self.predicting = self.predicting.forgotten(self.lanes.lanes, self.lanes.by_aircraft, at)
        elif turn == Turn.FORGETTING_MORE:
            self._forget_more(at)
        elif turn == Turn.JUDGING:
            self.consistency = self.consistency.planning(at)
        elif turn == Turn.LOOKING:
            self.probing = self.probing.looking(at, list(self._probed()), self.site.separation)
        elif turn == Turn.MEETING:
            self.probing = self.probing.meeting(self.site.separation)
        elif turn == Turn.PROBING:
            self._probe(at)
        elif turn == Turn.LOOKING_AT_RADARS:
            self._look_at_radars(at)
        elif turn == Turn.COMPARING:
            self._compare_radars(at)
        elif turn == Turn.JOINING:
            self._join_radars(at)

    def _judge(self, at: int) -> None:
        """What scatters otherwise than stated: of many sources, each share's at its own instant within the second."""
        self.consistency, findings = self.consistency.judged(self.site.position, self.radars, at)
        for found in findings:
            self._say_scatter(found)

    def _live_until(self, at: int) -> None:
        """Ends and coasting."""
        self._settle()
        lanes, ended = fuse.end_silent(self.lanes, at, self.options)
        self.settled += fuse.settled(self.lanes, lanes)
        self.ended += ended
        self.events += [Event(at, "info", f"track {end.track} ended: {end.reason}") for end in ended if not end.quiet]
        lanes, lived = fuse.told(lanes, at, self.options)
        self.lived += lived
        self.events += [Event(at, "info", text) for one in lived if (text := fuse.sentence(one, lanes)) is not None]
        self.lanes = lanes
        silent = [
            lane
            for lane in self._alive()
            if lane.last.at < at
            and lane.coasting_at(at, self.options)
            and not (lane.aircraft and self.reckoners.follows(lane.aircraft, at))
        ]
        self.rows += self._with_wind(fuse.coast(silent, at, self._spans, self.geoid.separation_m, self.model))

    def _alive(self) -> list[Lane]:
        return [lane for lane in self.lanes.lanes.values() if lane.ended_at is None and lane.events]

    def _forget_states(self, share: int, at: int) -> None:
        """What is older than the history, of a share of the tracks: to free the states of a crowd takes milliseconds."""
        was, self.lanes = self.lanes, self.lanes.pruned(at - self.history, share, len(READING_LANES))
        self.settled += fuse.settled(was, self.lanes)

    def _forget_more(self, at: int) -> None:
        """What is older than the history of radar tracks and of what was found of them."""
        before = at - self.history
        self.tracks = self.tracks.pruned(before - int(PLOT_MARGIN_S * SECOND))
        self.unnumbered = self.unnumbered.pruned(before)
        self.lanes = fuse.remembered(self.lanes, self.tracks, self._spans)
        gone = associate.missing(self.association, self.tracks)
        for key, aircraft in self.association.ledger.pairs.items():
            if key in gone:
                self.events.append(
                    Event(at, "info", f"radar track {track.name_of(key)}, {aircraft}, has fallen silent")
                )
        unlearnt = before - WAIT_NS - SECOND  # register, which takes a second at once, may not have had what came since
        self.association = associate.pruned(associate.forgotten(self.association, gone), unlearnt)
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
            self.once("of more aircraft positions or velocities are not as stated: they are not named")
        else:
            if found.topic not in self.said:
                self.count("noises and velocities that are not as stated")
            self.once(found.text, topic=found.topic)

    def _start_again(self, now: int) -> None:
        """At the first arrival, and when the session's time was set back: forget what is dated, keep track numbers."""
        if self.now is not None:
            self._settle()
            back_s = (self.now - now) / SECOND
            text = f"the session's time went back by {back_s:.0f} s: every track starts again, under its number"
            self.events.append(Event(now, "warning", text))
            self.count("session's time set back")
        was = self.lanes
        self.lanes, ended = fuse.emptied(was, now)
        self.settled += fuse.settled(was, self.lanes)
        self.ended += ended
        self.tracks, self.association = track.RadarTracks(), associate.Association()
        self.unnumbered = self.unnumbered.emptied()
        self.reckoners, self.told_last = self.reckoners.emptied(), {}
        self.registration = self.registration.again(now)
        self.predicting, self.probing = self.predicting.planning((), now), predict.Probing()
        self.consistency = self.consistency.again()
        # An arrival stamped at a whole second comes before what happens at that second.
        self.now, self.instant = now, (now - 1) // SECOND * SECOND + SECOND

    # register -----------------------------------------------------------------------------------------------------

    def register(self, at: int) -> None:
        """What pairs that leave the history tell of the radars' errors; a step further in what align takes off."""
        use = self.options.registration
        if use == "off" or at % SECOND != Turn.REGISTERING * TURN_NS:
            return
        until, known = at - self.history - WAIT_NS, self.registration.learnt_until
        spans = self.association.ledger.spans
        pairs = gathered(self.association, spans, self.tracks, self.radar_frames, known, until) if spans else None
        found = self.registration.second(pairs, self.radars, self.site.position, use, at, self.history)
        self.registration, said = replace(found[0], learnt_until=until), found[1]
        self.events += [Event(at, one.level, one.text) for one in said]
        if pairs is not None:
            self.residuals.append(residuals(pairs, self.registration, self.radars))

    # predict ------------------------------------------------------------------------------------------------------

    def predict(self, at: int) -> None:
        """Where every track will be: of many, each part's at its own instant within the second."""
        alive = self._alive()
        if alive and at % SECOND == 0 and at % int(self.options.prediction_period_s * SECOND) == 0:
            self.predicting = self.predicting.planning([lane.track for lane in alive], at)
            self._foretell(at)
        if self.model.modes is not None and at % SECOND == 0:
            self.predicting = self.predicting.heading(at, at - self.history)

    def _foretell(self, at: int) -> None:
        """The predictions that are due."""
        self._settle()
        self.predicting, tracks = self.predicting.begun(at)
        lanes = (self.lanes.lanes.get(track) for track in tracks)
        alive = [lane for lane in lanes if lane is not None and lane.ended_at is None and lane.events]
        if not alive:
            return
        self.predicting, made = predict.forecast(
            self.predicting,
            alive,
            at,
            self.options.horizons_s,
            self.model,
            self.site,
            self.frame,
            self.geoid.separation_m,
        )
        self.forecasts.append(made)
        if made.judged is not None:
            self.events += [Event(at, level, text) for level, text in made.judged.said]
        self.probing = self.probing.hearing(made.ways, at, self.options.prediction_period_s)

    def _probed(self) -> dict[int, Lane]:
        """The tracks that are surely something that flies, by their numbers."""
        # Not the ship that carries the runway: who lands on her comes near her on purpose.
        some = (lane for lane in self._alive() if self.deck is None or lane.aircraft != self.deck.follows)
        return {lane.number: lane for lane in some if lane.last.score == fuse.CONFIRMED}

    def _probe(self, at: int) -> None:
        """Which tracks will lose their separation."""
        alive = self._probed()
        if len(alive) < 2 and not self.probing.watched:
            return
        self.probing, found = self.probing.watching(at, list(alive), self.site.separation)
        self.rounds.append(found)
        if found.untold:
            self.count("conflicts beyond those that are told", found.untold)
            self.once(
                f"more than {predict.TOLD_AT_MOST} conflicts at once: the soonest are told; where aircraft "
                "fly together on purpose, make [separation] of the site file smaller"
            )
        for row, state in enumerate(found.state):
            if state != "goes on":
                pair = [alive[number] for number in found.told.pair[row].tolist() if number in alive]
                names = {lane.number: f"track {lane.number} ({lane.aircraft})" for lane in pair if lane.aircraft}
                level = "warning" if state == "found" else "info"
                self.events.append(Event(at, level, predict.sentence(found, row, names, self.frame)))
