"""What is inside a recording: who speaks, how often, what is lost, how good the clocks are, and what can be made of it.

Read once, in flat memory: a count, two stamps and the longest silence for each kind of message of each component. The
decoder of a live session tells what it makes of the same arrivals, so that `check` cannot promise what `replay` does not
keep.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import Frame, fields, message_name, parse
from adapters.roles import by_heartbeat, by_number
from adapters.sequences import SequenceCheck, Siblings
from gateway.observation import (
    FlightPlan,
    GpsReport,
    Many,
    Observation,
    RadarPlot,
    RadarStatus,
    Timing,
    WeatherArea,
)
from gateway.picture import Health, VehicleHealth
from gateway.runtime.places import PlaceFinder
from gateway.runtime.playback import Playback
from gateway.runtime.setup import Place

SECOND = 10**9
HEARTBEAT, _read_heartbeat = fields("HEARTBEAT", "type", "autopilot")
_SAMPLE_NS = 10 * SECOND  # health is asked this often: delays and clocks of the whole file, not of its last minute


@dataclass(slots=True)
class Stream:
    """One kind of message, or one radar's plots: how many, from when to when (stamps), and the longest silence."""

    name: str
    count: int = 0
    first: int = 0
    last: int = 0
    longest_gap_ns: int = 0
    gap_at: int = 0  # when the longest silence began

    def hear(self, received_at: int) -> None:
        """Count one more."""
        if self.count:
            gap = received_at - self.last
            if gap > self.longest_gap_ns:
                self.longest_gap_ns, self.gap_at = gap, self.last
        else:
            self.first = received_at
        self.last = received_at
        self.count += 1

    @property
    def rate_hz(self) -> float:
        """Between the first and the last; 0 for a single one."""
        return (self.count - 1) / ((self.last - self.first) / 1e9) if self.last > self.first else 0.0


@dataclass(slots=True)
class Component:
    """One (source, system, component) and what it sent. `counters` are of its own frames."""

    source: Source
    system: int
    component: int
    what: str = ""  # in words, by its heartbeat or its number
    frames: Stream = field(default_factory=lambda: Stream("all"))
    streams: dict[int, Stream] = field(default_factory=dict)
    versions: Counter[int] = field(default_factory=Counter)
    signed: int = 0
    counters: Counter[str] = field(default_factory=Counter)
    sequence: SequenceCheck = field(default_factory=SequenceCheck)

    @property
    def name(self) -> str:
        """As people write it: system/component."""
        return f"{self.system}/{self.component}"

    def hear(self, frame: Frame, received_at: int) -> None:
        """Count a frame."""
        self.frames.hear(received_at)
        self.versions[frame.version] += 1
        self.signed += frame.signed
        self.sequence.hear(frame.sequence, frame.message, self.counters)
        if frame.verdict != "good":
            self.counters[f"{frame.verdict}: message {message_name(frame.message)}"] += 1
        if frame.message == HEARTBEAT and frame.verdict == "good":
            kind, autopilot = _read_heartbeat(frame.payload)
            self.what = by_heartbeat(kind, autopilot, self.component)
        stream = self.streams.get(frame.message)
        if stream is None:
            stream = self.streams[frame.message] = Stream(message_name(frame.message))
        stream.hear(received_at)

    @property
    def lost_share(self) -> float:
        """Of what it sent, by its sequence numbers."""
        lost = max(self.counters["lost"], 0)
        return lost / (lost + self.frames.count)


@dataclass(slots=True)
class AircraftSeen:
    """What the decoder made of one aircraft."""

    name: str
    reports: Stream
    timings: Counter[Timing] = field(default_factory=Counter)
    kinds: Counter[str] = field(default_factory=Counter)  # all its observations
    with_accuracy: int = 0
    with_height: int = 0  # of any kind but pressure altitude
    with_ellipsoid_height: int = 0
    with_velocity: int = 0
    plan_points: int = 0


@dataclass(slots=True)
class RadarSeen:
    """What one radar said."""

    number: int
    plots: Stream
    numbered: int = 0
    tracks: set[int] = field(default_factory=set)
    partial: int = 0  # plots without range, azimuth or elevation
    states: Counter[str] = field(default_factory=Counter)


@dataclass(slots=True)
class Survey:
    """Everything that was found. Stamps are ns since 1970 UTC."""

    began: int = 0
    ended: int = 0
    epoch_offset_s: int | None = None
    components: dict[tuple[int, int, int], Component] = field(default_factory=dict)
    aircraft: dict[str, AircraftSeen] = field(default_factory=dict)
    radars: dict[int, RadarSeen] = field(default_factory=dict)
    observations: Counter[str] = field(default_factory=Counter)
    counters: dict[str, int] = field(default_factory=dict)
    vehicles: dict[str, VehicleHealth] = field(default_factory=dict)  # each at its worst median delay
    place: Place | None = None
    used: frozenset[int] = frozenset()  # the MAVLink messages that say something to the gateway

    @property
    def duration_s(self) -> float:
        """From the first arrival to the last."""
        return (self.ended - self.began) / 1e9


def survey(playback: Playback, tell: Callable[[float], None] = lambda fraction: None) -> Survey:
    """Read all of it; `tell` hears how far it is, from 0 to 1. Raises FileError as `Playback.arrivals` does."""
    found = Survey()
    sources = {source.number: source for source in playback.sources}
    decoder, finder = Decoder(playback.sources), PlaceFinder()
    found.used = decoder.wanted
    due = 0
    for index, arrival in enumerate(playback.arrivals()):
        _count(found, sources[arrival.source], arrival)
        heard = decoder.hear(arrival)
        if heard is not None:
            for observation in heard.observations:
                finder.gather(observation)
                _see(found, observation)
        if arrival.received_at >= due:
            due = arrival.received_at + _SAMPLE_NS
            _remember(found, decoder.health(arrival.received_at))
        if index % 4096 == 0:
            tell(playback.fraction())
    _remember(found, decoder.health(found.ended))
    found.counters = {**playback.counters(), **decoder.counters()}
    found.epoch_offset_s = decoder.epoch_offset_s
    found.place = playback.place or finder.place(complete=True)
    return found


def _count(found: Survey, source: Source, arrival: Arrival) -> None:
    at = arrival.received_at
    if not found.began:
        found.began = at
    found.ended = at
    if source.kind != "mavlink":
        return
    frame = parse(arrival.data)
    if frame is None:
        return
    key = (source.number, frame.system, frame.component)
    component = found.components.get(key)
    if component is None:
        beside = [one for place, one in found.components.items() if place[:2] == key[:2]]
        siblings = beside[0].sequence.siblings if beside else Siblings()
        name, check = by_number(frame.component), SequenceCheck(siblings)
        component = found.components[key] = Component(source, frame.system, frame.component, name, sequence=check)
    component.hear(frame, at)


def _see(found: Survey, observation: Observation) -> None:
    if isinstance(observation, Many):
        for one in observation:
            _see(found, one)
        return
    kind = type(observation).__name__
    found.observations[kind] += 1
    if isinstance(observation, RadarPlot | RadarStatus):
        _see_radar(found, observation)
        return
    if isinstance(observation, WeatherArea):
        return
    seen = found.aircraft.get(observation.aircraft)
    if seen is None:
        seen = found.aircraft[observation.aircraft] = AircraftSeen(observation.aircraft, Stream("positions"))
    seen.kinds[kind] += 1
    if isinstance(observation, GpsReport):
        seen.reports.hear(observation.received_at)
        seen.timings[observation.timing] += 1
        seen.with_accuracy += observation.horizontal_sigma_m is not None
        seen.with_height += observation.height_m is not None or observation.altitude_msl_m is not None
        seen.with_ellipsoid_height += observation.height_m is not None
        seen.with_velocity += observation.velocity_east_mps is not None
    elif isinstance(observation, FlightPlan):
        seen.plan_points = max(seen.plan_points, len(observation.points))


def _see_radar(found: Survey, observation: RadarPlot | RadarStatus) -> None:
    radar = found.radars.get(observation.radar)
    if radar is None:
        radar = found.radars[observation.radar] = RadarSeen(observation.radar, Stream("plots"))
    if isinstance(observation, RadarStatus):
        radar.states[observation.state] += 1
        return
    radar.plots.hear(observation.received_at)
    radar.partial += None in (observation.range_m, observation.azimuth_rad, observation.elevation_rad)
    if observation.track_number:
        radar.numbered += 1
        radar.tracks.add(observation.track_number)


def _remember(found: Survey, health: Health) -> None:
    for vehicle in health.vehicles:
        known = found.vehicles.get(vehicle.aircraft)
        if known is None or known.clock_sigma_s != known.clock_sigma_s or not vehicle.delay_s < known.delay_s:
            found.vehicles[vehicle.aircraft] = vehicle
