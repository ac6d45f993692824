"""Where pictures go: the archive's tables, the recording of the viewer, and the viewers that come to it."""

from __future__ import annotations

from pathlib import Path

from gateway.picture import Picture
from gateway.runtime.setup import Serve
from gateway.settings import Site
from gateway.sinks import Sink
from gateway.sinks.arrow import ArrowSink
from gateway.sinks.parquet import finish
from gateway.sinks.rerun import RerunSink

RRD_FILE = "session.rrd"


class Outputs:
    """The sinks of one session. Raises OSError when what must be kept could not be."""

    def __init__(self, site: Site, folder: Path | None, serve: Serve | None) -> None:
        self._folder = folder
        self._sinks: list[Sink] = []
        self.address: str | None = None  # where a viewer finds the session while it runs
        if folder is not None:
            self._sinks.append(ArrowSink(folder, geoid_separation_m=site.runway.geoid_separation_m or 0.0))
        if folder is not None or serve is not None:
            drawn = RerunSink(
                site,
                path=None if folder is None else folder / RRD_FILE,
                serve=None if serve is None else (serve.host, serve.port),
            )
            self._sinks.append(drawn)
            self.address = drawn.address

    def write(self, picture: Picture) -> None:
        """Hand one picture to every sink."""
        for sink in self._sinks:
            sink.write(picture)

    def close(self) -> None:
        """A clean end: everything written out, the tables as Parquet."""
        self.abandon()
        if self._folder is not None:
            finish(self._folder)

    def abandon(self) -> None:
        """Close every sink, whatever one of them says."""
        failure: OSError | None = None
        for sink in self._sinks:
            try:
                sink.close()
            except OSError as error:
                failure = error
        if failure is not None:
            raise failure
