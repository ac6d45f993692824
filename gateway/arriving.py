"""Align, within a step: what was heard, brought into the site's frames, and these to where a runway that moves is.

What cannot be used is counted and said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gateway import align
from gateway.align import SECOND, Fix, Geoid, Plot
from gateway.believing import Believing
from gateway.making import NAMED_AT_MOST
from gateway.observation import (
    AirData,
    Attitude,
    FlightPlan,
    GpsReport,
    Heard,
    Intent,
    RadarPlot,
    RadarStatus,
    Timing,
    VehicleStatus,
    WeatherArea,
)
from gateway.picture import Event
from gateway.state import State

CONTRADICTION_M = 5.0  # between the site's and the streams' geoid: beyond this it is said
AIRCRAFT_AT_MOST, RADARS_AT_MOST = 10_000, 64  # a bound on what strangers can make us remember
STAGED = (GpsReport, RadarPlot, RadarStatus)
# where an aircraft is going, by its mode too; the wind and the weather
FORETELLING = (FlightPlan, Intent, AirData, WeatherArea, VehicleStatus)


class Arriving(Believing):
    """A step whose arrivals are aligned."""

    def __init__(self, state: State, heard: Sequence[Heard]) -> None:
        super().__init__(state, heard)
        self._placed = self._place(heard)

    def takes(self, arrival: Heard) -> bool:
        """Whether a stage before predict reads any of it; attitudes and inertial samples pass by, for the sinks."""
        staged = False
        if self.options.dead_reckoning == "on":
            self._hear_motion(arrival)
        for observation in arrival.observations:
            if isinstance(observation, STAGED):
                staged = True
            elif isinstance(observation, FORETELLING):
                self.predicting = self.predicting.hearing(observation)
        return staged

    def align(self, arrival: Heard) -> tuple[list[Fix], list[Plot]]:
        """The arrival's reports and plots in the site's frames; those whose time cannot be used are counted."""
        fixes, plots = [], []
        for observation in arrival.observations:
            self.serial += isinstance(observation, STAGED)  # how the rest comes together depends on the ticks
            if isinstance(observation, GpsReport):
                fix, geoid = next(self._placed)
                if geoid is not self.geoid and geoid.separation_m != self.geoid.separation_m:
                    self._settle()  # what waits is written with the geoid that was known when it was heard
                self.geoid = geoid
                self.fixes.append(fix)
                if fix.has_height:
                    self._judge_heights()
                timely = observation.timing is not Timing.FOREIGN and self._is_timely(fix.at, fix.aircraft)
                if timely and self._has_room(fix.aircraft) and (taken := self._believed(fix, observation)) is not None:
                    fixes.append(taken)
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
                serial += isinstance(report, STAGED)
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
        plot = align.place_plot(observation, self.serial, radar, self.registration.of(radar, observation.valid_at))
        self.plots.append(plot)
        return None if observation.timing is Timing.FOREIGN else plot

    def _take_status(self, status: RadarStatus) -> None:
        """A radar's word of where it stands: used where the site file has none, compared with it otherwise."""
        said, known = align.radar_from_status(status, self.frame), self.radars.get(status.radar)
        if known is not None or len(self.radars) < RADARS_AT_MOST:
            self.unnumbered = self.unnumbered.scanning(status.radar, status.update_period_s)
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

    # the runway, where it is a ship's deck --------------------------------------------------------------------------

    def _hear_heading(self, arrival: Heard) -> None:
        """What the ship that carries the runway says of her heading."""
        if self.deck is None:
            return
        for one in arrival.observations:
            if isinstance(one, Attitude) and one.aircraft == self.deck.follows:
                self.deck = self.deck.heard(one.valid_at, one.yaw_rad)

    def _move_deck(self, at: int) -> None:
        """The runway to where the ship's track is now; without one it is carried on, and that is said."""
        if self.deck is None:
            return
        before = self.deck.pose
        number = self.lanes.by_aircraft.get(self.deck.follows)
        lane = None if number is None else self.lanes.lanes.get(number)
        if lane is None or lane.ended_at is not None or not lane.events:
            self.deck, said = self.deck.lost()
        else:
            last, silent = lane.last, lane.coasting_at(at, self.options)
            velocity = last.mean[3:6] * [1.0, 1.0, 0.0]
            place = last.mean[:3] + velocity * (max(at - last.at, 0) / SECOND)
            self.deck, said = self.deck.moved(at, place, velocity, silent, self.frame)
        if said is not None:
            self.events.append(Event(at, "warning" if self.deck.is_silent else "info", said))
        if self.deck.pose is not None and self.deck.pose is not before:
            self.frame = self.frame.with_deck(self.deck.pose)
            self.poses.append(self.deck.pose)
