"""Where pictures go: the archive's tables, the viewer's recording, the viewers that come to it, and who is told of tracks."""

from __future__ import annotations

import errno
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gateway.fuse import Fused, Lanes
from gateway.picture import Picture
from gateway.runtime.publisher import Publisher, open_publisher
from gateway.runtime.setup import Setup
from gateway.runtime.smoothed import Smoothing
from gateway.runtime.summary import SmoothedSummary
from gateway.runtime.urls import LinkError
from gateway.settings import Site
from gateway.sinks import Sink
from gateway.sinks.apart import Apart
from gateway.sinks.arrow import ArrowSink
from gateway.sinks.aside import Aside, AtOnce, SinkAside, size_of
from gateway.sinks.parquet import SmoothedTable, finish
from gateway.sinks.publish import PublishSink

if TYPE_CHECKING:
    from gateway.sinks.rerun import RerunSink

RRD_FILE = "session.rrd"
_WATCHED = (0.4, 256)  # seconds and rows that are drawn at once, for people who look on
_LIVE = (0.4, 16384)  # the same where drawing has a process of its own and holds up nothing
_TABLES_WATCHED_S, _TABLES_ROWS = 1.0, 400  # of rows that a kill may cost; of many, few at once hold nothing up
_UNWATCHED = (30.0, 4096)  # where a recording is replayed as fast as it goes: fewer, larger batches cost less


class Outputs:
    """The sinks of one session, and the smoothing after it where that is asked for.

    Where somebody looks on, or the session must survive a kill, rows go out in small batches. What is written to the disk is
    written `aside`, in the order in which it was given.
    Raises OSError when what must be kept could not be, LinkError when the viewers' port is taken or tracks cannot be
    published where they should be.
    """

    def __init__(self, site: Site, folder: Path | None, setup: Setup, aside: Aside | AtOnce) -> None:
        self._folder = folder
        self._aside = aside
        self._sinks: list[Sink] = []
        self._rerun: RerunSink | Apart | None = None
        self._publisher: Publisher | None = None
        self._published: PublishSink | None = None
        if setup.publish is not None:
            self._publisher = open_publisher(setup.publish)
            self._published = PublishSink(
                self._publisher.send, system=setup.publish_system, leave_out=setup.publish_leave_out
            )
        if folder is not None:
            separation_m = site.runway.geoid_separation_m or 0.0
            often = (_TABLES_WATCHED_S, _TABLES_ROWS) if setup.is_watched else _UNWATCHED
            self._sinks.append(
                ArrowSink(folder, geoid_separation_m=separation_m, period_s=often[0], rows_limit=often[1])
            )
        if folder is not None or setup.serve is not None:
            self._rerun = _rerun(site, folder, setup)
            self._sinks.append(SinkAside(self._rerun) if isinstance(self._rerun, Apart) else self._rerun)
        self._smoothing = Smoothing(site, setup.options, folder) if setup.smooth else None

    @property
    def address(self) -> str | None:
        """Where a viewer finds the session while it runs."""
        return self._rerun.address if self._rerun else None

    @property
    def drawn_by(self) -> int | None:
        """The number of the process that draws, where there is one."""
        return self._rerun.process if isinstance(self._rerun, Apart) else None

    @property
    def dropped(self) -> int:
        """Rows that viewers did not take in time; the archive has them."""
        return self._rerun.dropped if self._rerun else 0

    @property
    def publishes_on(self) -> str | None:
        """The link that tracks are published on."""
        return str(self._publisher.url) if self._publisher else None

    def counters(self) -> dict[str, int]:
        """What was published, totals by reason."""
        if self._publisher is None or self._published is None:
            return {}
        return {**self._published.counters, **self._publisher.counters}

    def is_our_own(self, frame: bytes) -> bool:
        """Whether a frame that came in is one of those that we published, passed on by somebody."""
        return self._published is not None and self._published.is_our_own(frame)

    def write(self, picture: Picture) -> None:
        """Hand one picture to every sink; raises what became of those before."""
        if self._published is not None:
            self._published.write(picture)
        if self._smoothing is not None:
            self._smoothing.add(picture)
        if self._sinks:
            self._aside.do(partial(self._write, picture), size_of(picture))

    def _write(self, picture: Picture) -> None:
        for sink in self._sinks:
            sink.write(picture)

    def smooth(self, lanes: Lanes, tell: Callable[[float], None]) -> None:
        """Smooth every track, if that was asked for, from what was written and what the lanes still hold."""
        if self._smoothing is None:
            return
        self._aside.wait()
        table = SmoothedTable(self._folder) if self._folder is not None else None

        def give(rows: Fused, step: NDArray[np.int64]) -> None:
            if table is not None:
                table.write(rows)
            if self._rerun is not None:
                self._rerun.write_smoothed(rows, step)

        try:
            self._smoothing.finish(lanes, give, tell)
            if self._rerun is not None:
                for track, at, step in self._smoothing.ended:
                    self._rerun.end_smoothed(track, at, step)
            if table is not None:
                table.finish()
        except BaseException:
            if table is not None:
                table.abandon()
            raise

    def smoothed(self) -> SmoothedSummary | None:
        """What smoothing came to, if that was asked for."""
        return SmoothedSummary(self._smoothing.rows, self._smoothing.scores()) if self._smoothing is not None else None

    def close(self) -> None:
        """A clean end: everything written out, the tables as Parquet."""
        self.abandon()
        if self._folder is not None:
            finish(self._folder)

    def abandon(self) -> None:
        """Close every sink, whatever one of them says."""
        failure: OSError | None = None
        if self._smoothing is not None:
            self._smoothing.close()
        for step in (self._aside.wait, *(sink.close for sink in self._sinks)):
            try:
                step()
            except OSError as error:
                failure = error
        if self._published is not None:
            self._published.close()
        if self._publisher is not None:
            self._publisher.close()
        if failure is not None:
            raise failure


def _rerun(site: Site, folder: Path | None, setup: Setup) -> RerunSink | Apart:
    serve = setup.serve
    period_s, rows_limit = _LIVE if setup.live else _WATCHED if setup.is_watched else _UNWATCHED
    sink: type[RerunSink | Apart] = Apart
    if not setup.live:
        from gateway.sinks.rerun import RerunSink  # knows the viewer, which takes half a second to load

        sink = RerunSink
    try:
        return sink(
            site,
            path=None if folder is None else folder / RRD_FILE,
            serve=None if serve is None else (serve.host, serve.port),
            name=site.name if folder is None else folder.name,
            modes=setup.options.estimator in ("imm", "rmimm"),
            period_s=period_s,
            rows_limit=rows_limit,
        )
    except OSError as error:
        if serve is None or error.errno not in (errno.EADDRINUSE, errno.EADDRNOTAVAIL, errno.EACCES):
            raise
        raise LinkError(
            f"Viewers cannot be served on {serve.host}:{serve.port}: the port is taken or not ours to take; "
            "give --serve another one, or leave it out."
        ) from error
