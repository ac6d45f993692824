"""The picture in the Rerun viewer: drawn into a session's .rrd file, and served to viewers that come and go."""

from __future__ import annotations

import uuid
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.fuse import Fused
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.blueprint import blueprint
from gateway.sinks.feed import FileFeed, Identity, ServedFeed
from gateway.sinks.hold import Hold
from gateway.sinks.recording import optimise
from gateway.sinks.scene.believed import BelievedScene
from gateway.sinks.scene.clutter import ClutterScene
from gateway.sinks.scene.conflicts import ConflictScene
from gateway.sinks.scene.deck import DeckScene
from gateway.sinks.scene.entry import Entry, made
from gateway.sinks.scene.flown import Flights
from gateway.sinks.scene.health import HealthScene
from gateway.sinks.scene.later import Later
from gateway.sinks.scene.paths import ApproachScene, PredictScene
from gateway.sinks.scene.plans import PlanScene
from gateway.sinks.scene.radars import MultiRadarScene
from gateway.sinks.scene.reckoning import ReckoningScene
from gateway.sinks.scene.register import RegisterScene
from gateway.sinks.scene.scope import ScopeScene
from gateway.sinks.scene.site import SiteScene
from gateway.sinks.scene.smoothed import SmoothedScene
from gateway.sinks.scene.sources import SourceScene, raw_positions
from gateway.sinks.scene.stages import StageScene
from gateway.sinks.scene.tracks import TrackScene
from gateway.sinks.scene.weather import WeatherScene

_ENTITY_NS = 1_000_000  # of session time for each that is drawn: so a crowd takes a fifth of a core
_CURVES_REST = 4  # of a crowd, curves are drawn so many times less often than what moves


class RerunSink:
    """Draws pictures of one site, into a file, for viewers, or both.

    Pictures are gathered for `period_s` of session time or until `rows_limit` rows of tracks and raw
    positions wait, then drawn as columns: 0.4 s for people who watch, 10 s where a recording is replayed as
    fast as it goes (an entity costs the same for one row as for a hundred). `serve` is (host, port) to listen
    on, port 0 for a free one. `modes`: the estimator has motion modes, their probabilities get a view.

    The file is written in the caller's thread and never drops; `write`, `flush` and `close` raise OSError
    when the disk does not take it. Viewers are fed from a thread of their own and can slow nothing: what they
    do not take is dropped and counted in `dropped`.
    """

    def __init__(
        self,
        site: Site,
        *,
        path: Path | None = None,
        serve: tuple[str, int] | None = None,
        application: str = "talkdown",
        recording: str | None = None,
        name: str | None = None,
        modes: bool = False,
        memory_limit: str = "256MiB",
        period_s: float = 0.4,
        rows_limit: int = 256,
    ) -> None:
        identity = Identity(application, recording or str(uuid.uuid4()), name or site.name)
        views = blueprint(site, modes=modes)
        self._served = ServedFeed(*serve, identity, views, memory_limit) if serve else None
        try:
            self._file = FileFeed(path, identity, views) if path else None
            self._hold = Hold(path) if path else None
        except OSError:
            if self._served:
                self._served.close()
            raise
        self._deck = deck = DeckScene(site)
        self._flights, self._sources, self._tracks = (
            Flights(site, deck),
            SourceScene(site, deck),
            TrackScene(site, deck),
        )
        self._approach, self._predict, self._stages = ApproachScene(site), PredictScene(site), StageScene(site)
        self._scope, self._health, self._plans = ScopeScene(site, deck), HealthScene(), PlanScene(site)
        self._smoothed, self._register, self._radars = SmoothedScene(site), RegisterScene(site), MultiRadarScene(site)
        self._clutter, self._conflicts = ClutterScene(site), ConflictScene(site)
        self._believed, self._reckoning, self._weather = BelievedScene(site), ReckoningScene(), WeatherScene(site)
        self._period_ns, self._rows_limit = round(period_s * 1e9), rows_limit
        self._rest_ns = self._period_ns
        self._waiting: list[Picture] = []
        self._rows = 0
        self._later, self._draws = Later(), 0
        self._drawn_at: int | None = None
        self._send([*SiteScene(site).entries(), *self._scope.site_entries()])

    @property
    def address(self) -> str | None:
        """What a viewer opens, such as "rerun+http://127.0.0.1:41234/proxy"; None when nothing is served."""
        return self._served.address if self._served else None

    @property
    def dropped(self) -> int:
        """Rows that viewers did not take in time; the file has them."""
        return self._served.dropped if self._served else 0

    def write(self, picture: Picture) -> None:
        """Take one picture; raises OSError when the file could not be written."""
        self._waiting.append(picture)
        self._rows += len(picture.fuse.time) + len(picture.align.report_time) + len(picture.align.plot_time)
        self.flush(picture.now)

    def write_all(self, pictures: Sequence[Picture]) -> None:
        """Take pictures in their order; raises OSError when the file could not be written."""
        for picture in pictures:
            self.write(picture)

    def flush(self, now: int) -> None:
        """Draw what waits if a period has passed until `now` (session time, ns) or many rows wait."""
        if self._drawn_at is None:
            self._drawn_at = now
        if self._rows >= self._rows_limit or now - self._drawn_at >= self._rest_ns:
            self._drawn_at = now
            self._draw()

    def write_smoothed(self, fused: Fused, step: NDArray[np.int64]) -> None:
        """Draw smoothed rows of one track in the order of time, and the numbers of their pictures; raises OSError."""
        self._send([*self._smoothed.entries(fused, step), *self._scope.smoothed_entries(fused, step)])

    def end_smoothed(self, track: int, at: int, step: int) -> None:
        """A track ended then, in that picture, and leaves the scene; raises OSError."""
        self._send(self._smoothed.end(track, at, step))

    def close(self) -> None:
        """Draw what waits, end the file, make it small, end the server; calling it again does nothing."""
        self._end(made_small=True)

    def abandon(self) -> None:
        """The same, but leave the file as large as it is: the next command that touches the session makes it small."""
        self._end(made_small=False)

    def _end(self, *, made_small: bool) -> None:
        try:
            self._draw()
            if self._later:
                self._send(self._later.take())
        finally:
            try:
                if self._file and self._file.close() and made_small:
                    optimise(self._file.path)
            finally:
                if self._hold:
                    self._hold.release()
                if self._served:
                    self._served.close()

    def _draw(self) -> None:
        pictures, self._waiting, self._rows = self._waiting, [], 0
        if not pictures:
            return
        moved = self._deck.entries(pictures)  # first: where the deck was is what the others are drawn from
        heard, flights = raw_positions(pictures), self._flights.gather(pictures)
        entries: list[Entry] = [
            *moved,
            *self._sources.entries(pictures, heard),
            *self._scope.entries(heard, flights),
            *self._radars.entries(pictures),
            *self._clutter.entries(pictures),
            *self._tracks.entries(flights),
            *self._approach.entries(flights),
            *self._predict.entries(pictures, flights),
            *self._conflicts.entries(pictures),
            *self._believed.entries(pictures),
            *self._weather.entries(pictures),
            *self._reckoning.entries(pictures),
            *self._stages.entries(pictures, flights, self._flights.newest),
            *self._register.entries(pictures),
            *self._health.entries(pictures),
            *self._plans.entries(pictures, flights),
        ]
        for picture in pictures:
            for ended in picture.fuse.ended:
                self._flights.end(ended.track, picture.now)
                self._predict.end(ended.track, picture.now)
                self._believed.end(ended.track)
                self._tracks.forget(ended.track)
        entries = self._rested(entries)
        self._send(entries)
        while entries:  # one by one: to free them all at once takes 20 ms, in which nothing else gets a turn
            entries.pop()

    def _rested(self, entries: list[Entry]) -> list[Entry]:
        """What is drawn of a crowd comes in larger batches, curves in the largest; how long to rest after them."""
        urgent = self._later.without(entries)
        entities = len(urgent) + len(self._later) / _CURVES_REST
        self._rest_ns = max(self._period_ns, round(entities * _ENTITY_NS))
        self._draws += 1
        if self._rest_ns > self._period_ns and self._draws < _CURVES_REST:
            return urgent
        self._draws = 0
        return [*urgent, *self._later.take()]

    def _send(self, entries: Sequence[Entry]) -> None:
        ready = made(entries)
        if self._served:
            self._served.send(ready)
        if self._file:
            self._file.send(ready)
