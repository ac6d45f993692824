"""What a session came to, in numbers: for people at the end, for programs as JSON, and for session.json."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gateway.observation import Many, how_many
from gateway.picture import Picture, SourceHealth
from gateway.runtime.accuracy import Accuracy, Score, SmoothedScore
from gateway.runtime.muted import MutedScore
from gateway.settings import Runway

_NAMED_AT_MOST = 10_000

KINDS = {
    "GpsReport": "GPS reports",
    "RadarPlot": "radar plots",
    "RadarStatus": "radar status",
    "Attitude": "attitudes",
    "ImuSample": "IMU samples",
    "AirData": "air data",
    "VehicleStatus": "vehicle status",
    "FlightPlan": "flight plans",
    "Intent": "intents",
    "WeatherArea": "areas of weather",
    "Truth": "truths",
}


@dataclass(frozen=True, slots=True)
class SmoothedSummary:
    """What smoothing came to: rows, and by the tracks' state how far they are from the truth before and after it."""

    rows: int
    accuracy: dict[str, SmoothedScore] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Summary:
    """A session's totals. Times in s of the session, distances in m."""

    ended: str
    duration_s: float
    wall_s: float
    site: str
    site_origin: str
    epoch_offset_s: int
    sources: tuple[dict[str, Any], ...]
    observations: dict[str, int]
    tracks: int
    aircraft: tuple[str, ...]
    track_rows: int
    predictions: int
    associations: int
    associations_lost: int
    counters: dict[str, int]
    accuracy: dict[str, Score] = field(default_factory=dict)
    muted: tuple[MutedScore, ...] = ()  # of what went on without the positions that were muted
    smoothed: SmoothedSummary | None = None  # None: nobody asked for it
    archive: Path | None = None

    def document(self) -> dict[str, Any]:
        """The same as plain values for JSON."""
        plain = asdict(self)
        plain["archive"] = None if self.archive is None else str(self.archive)
        return plain


class Tally:
    """Counts what pictures hold."""

    def __init__(self, runway: Runway) -> None:
        self.observations: Counter[str] = Counter()
        self.traffic = 0  # GPS reports of aircraft that others told of
        self.tracks = 0  # they are numbered from 1 on, and each has rows
        self.aircraft: set[str] = set()  # the first of them, at most so many as can be read
        self.changes: Counter[str] = Counter()
        self.track_rows = 0
        self.predictions = 0
        self.sources: tuple[SourceHealth, ...] = ()
        self.accuracy = Accuracy(runway)

    def add(self, picture: Picture) -> None:
        """Count one picture."""
        for observation in picture.observations:
            kind = observation.kind if isinstance(observation, Many) else type(observation)
            self.observations[kind.__name__] += how_many(observation)
        self.traffic += sum(not name.startswith("mavlink:") for name in picture.align.report_aircraft)
        self.tracks = max(self.tracks, int(picture.fuse.track.max(initial=0)))
        if len(self.aircraft) < _NAMED_AT_MOST:
            self.aircraft.update(name for name in picture.fuse.aircraft if name is not None)
        self.changes.update(change.kind for change in picture.associate.changes)
        self.track_rows += len(picture.fuse.time)
        self.predictions += len(picture.predict.made)
        self.sources = picture.health.sources
        self.accuracy.add(picture)

    def gateway_counters(self) -> dict[str, int]:
        """What the pipeline itself counted."""
        return {reason: number for one in self.sources if one.kind == "pipeline" for reason, number in one.counters}

    def named_observations(self) -> dict[str, int]:
        """Counts by what people call them."""
        named = {KINDS.get(kind, kind): number for kind, number in sorted(self.observations.items()) if number}
        return {**named, "GPS reports of traffic": self.traffic} if self.traffic else named
