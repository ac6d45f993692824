"""The doors from bytes, as the fuzzer goes through them, and what has to hold behind each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

import corpus
import numpy as np
from numpy.typing import NDArray

from adapters import Arrival, Source
from adapters.arrivals import Arrivals
from adapters.columns import iter_columns
from adapters.decode import Decoder
from adapters.kinds import FileError, kind_of
from adapters.mission_files import MissionFileError, read_mission
from adapters.signing import SigningGuard
from gateway import pipeline
from gateway.observation import GpsReport, Heard, Observation
from gateway.picture import Picture
from gateway.runtime.findings import findings
from gateway.runtime.folder import FolderError
from gateway.runtime.intake import Intake
from gateway.runtime.links import Chunks
from gateway.runtime.loop import run_replay
from gateway.runtime.manners import Manners
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Place, RunFailure, Setup
from gateway.runtime.stamps import Stamper
from gateway.runtime.survey import survey
from gateway.settings import format_site
from gateway.sinks.batches import predictions_batch, tracks_batch, truth_batch

MAVLINK, RADAR, STREAM = 0, 2, 1  # link numbers


class Unsound(AssertionError):
    """What came through a door is not what may come through it."""


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(one.name for one in fields(kind))


def check_observation(one: Observation) -> None:
    """Every number is one, every time fits its column, every place is on the globe."""
    for name in _names(type(one)):
        value = getattr(one, name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, float) and not math.isfinite(part):
                raise Unsound(f"{name} is {part} in {one}")
    if not -(1 << 63) <= one.valid_at < 1 << 63:
        raise Unsound(f"valid_at fits no column in {one}")
    if isinstance(one, GpsReport) and (abs(one.latitude_rad) > 1.5708 or abs(one.longitude_rad) > 3.1416):
        raise Unsound(f"no place on the globe in {one}")


def check_picture(picture: Picture) -> None:
    """What tables hold is never NaN where the contract says that it is known; the tables can be written."""
    rows = picture.fuse
    for name in ("latitude_rad", "longitude_rad", "covariance", "runway_m"):
        _finite(name, getattr(rows, name))
    _finite("velocity_mps", rows.velocity_mps[:, :2])
    for name in ("height_m", "altitude_msl_m", "velocity_mps", "modes", "pressure_altitude_m"):
        if np.isinf(getattr(rows, name)).any():
            raise Unsound(f"{name} is infinite")
    if len(rows.covariance) and rows.covariance.reshape(-1, 6, 6).diagonal(axis1=1, axis2=2).min() <= 0:
        raise Unsound("a variance is not positive")
    ahead = picture.predict
    for name in ("latitude_rad", "longitude_rad", "sigma_m", "horizon_s"):
        _finite(name, getattr(ahead, name))
    tracks_batch([rows])
    predictions_batch([ahead])
    truth_batch(picture.truth, 0.0)


def _finite(name: str, values: NDArray[Any]) -> None:
    if not np.isfinite(values).all():
        raise Unsound(f"{name} is not finite in a row")


@dataclass
class Live:
    """A live session without sockets: datagrams in, through intake and decoder, and with `pictured` through the pipeline.

    Its clock stands still but for what it is told. `signed`: only frames that are signed with the key are believed.
    """

    signed: bool = False
    pictured: bool = False
    one_by_one: bool = False
    now: int = corpus.BEGIN
    heard: int = 0
    observed: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        stamper = Stamper(lambda: self.now, lambda: self.now - corpus.BEGIN)
        self.intake = Intake(stamper, ["link 0", "link 1"], ["link 2"])
        guard = SigningGuard(corpus.KEY, live=False) if self.signed else None
        self.decoder = Decoder(keys=corpus.RADAR_KEYS, signing=guard)
        key = corpus.KEY if self.signed else None
        self.manners = Manners(heartbeat=True, request_rates=True, fetch_mission=True, key=key)
        self.state = pipeline.initial(corpus.SITE) if self.pictured else None

    def take(self, now: int, link: int, peer: str, data: Sequence[bytes], lines: Sequence[bytes] = ()) -> None:
        """What a peer sends at once; what people tell. Taken in, answered, decoded and worked in."""
        self.hear(now, *self.receive(now, link, peer, data, lines))

    def receive(
        self, now: int, link: int, peer: str, data: Sequence[bytes], lines: Sequence[bytes] = ()
    ) -> tuple[Sequence[Source], Arrivals]:
        """What a peer sends at once, and what people tell, as arrivals, answered; the sources that are new with them."""
        self.now = now
        stream = 0 if link == STREAM else None
        chunks = Chunks.of([peer] * len(data), list(data), [0] * len(data), stream)
        sources, arrivals = self.intake.take([(link, chunks)])
        if lines:
            more, told = self.intake.tell(lines)
            sources, arrivals = sources + more, Arrivals.joined([arrivals, told])
        for source in sources:
            self.manners.add(source)
        self.manners.hear(arrivals)
        self.manners.due(self.now)
        self.manners.notes.clear()
        return sources, arrivals

    def hear(self, now: int, sources: Sequence[Source], arrivals: Arrivals) -> None:
        """Arrivals, these or those that another session has received: decoded and worked in."""
        self.now = now
        for source in sources:
            self.decoder.add(source)
        heard = self._decode(arrivals)
        self.heard += len(arrivals)
        for one in heard:
            for observation in one.observations:
                self.observed[type(observation).__name__] += 1
                check_observation(observation)
        if self.state is not None:
            self._work(heard)

    def _decode(self, arrivals: Sequence[Arrival]) -> list[Heard]:
        """Many at once as a run does it, or with `one_by_one` each by itself."""
        if self.one_by_one:
            return [found for arrival in arrivals if (found := self.decoder.hear(arrival)) is not None]
        return [found for _, found in self.decoder.hear_many(arrivals)[0]]

    def _work(self, heard: list[Heard]) -> None:
        watermark = self.decoder.watermark(self.now)
        health = self.decoder.health(self.now)
        assert self.state is not None
        self.state, picture = pipeline.step(self.state, [*heard, watermark], health)
        check_picture(picture)


def check_file(path: Path, archive: Path | None = None) -> str:
    """Everything that can be done with a file: told what it is, read as columns, looked over, checked and replayed.

    Returns what came of it: "replayed", "mission", or the sentence of why not.
    """
    try:
        kind = kind_of(path)
        if kind in ("plan", "waypoints"):
            read_mission(path)
            return "mission"
        if kind == "tlog":
            for _ in iter_columns(path):
                pass
        playback = open_playback([path])
        findings(survey(playback))
        place = playback.place or playback.find_place() or Place(corpus.SITE, format_site(corpus.SITE), "the fuzzer's")
        setup = Setup(place, playback.options, archive, is_watched=False, keys=corpus.RADAR_KEYS)
        run_replay(playback, setup, watch=lambda run, picture: None if picture is None else check_picture(picture))
    except (FileError, FolderError, MissionFileError, RunFailure) as error:
        sentence = str(error)
        if not sentence.endswith((".", ")")) or "Traceback" in sentence:
            raise Unsound(f"this is no sentence: {sentence}") from error
        return sentence.replace(str(path), "FILE").replace(str(path.parent), "FOLDER")
    return "replayed"
