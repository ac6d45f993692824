"""What a session is started with: everything in here is decided before the first byte arrives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gateway.predict import ArrivalFlow
from gateway.register import Remembered
from gateway.runtime.urls import Url
from gateway.settings import Options, Site


class RunFailure(RuntimeError):
    """A session that could not go on; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class Place:
    """A site and where it is known from. `text` is the site file that gives exactly this site again."""

    site: Site
    text: str
    origin: str


@dataclass(frozen=True, slots=True)
class Serve:
    """Where the viewers' server listens; port 0 takes a free one."""

    host: str = "127.0.0.1"
    port: int = 0


@dataclass(frozen=True, slots=True)
class Setup:
    """How to run. Without a place the stream must tell one; without an archive (sessions' folder) nothing is kept."""

    place: Place | None = None
    options: Options = field(default_factory=Options)
    archive: Path | None = None
    serve: Serve | None = None  # None: no viewer can come
    publish: Url | None = None  # where tracks are told as MAVLink; None: they are not
    publish_system: int = 1  # the system, 1 to 255, whose ADS-B component we are there
    publish_leave_out: frozenset[str] = frozenset()  # aircraft ("mavlink:1") that are not told of
    keys: Mapping[int, bytes] = field(default_factory=dict)  # a radar's number -> its key
    signing_key: bytes | None = field(default=None, repr=False)  # of MAVLink; None: frames are believed unchecked
    live: bool = False
    remembered: Remembered | None = None  # what was known of the radars' errors when the session began
    takes_up: bool = False  # what the last live session of this site, in the archive, has learnt of its radars
    flows: tuple[ArrivalFlow, ...] | None = (
        None  # ways that arrivals come; None: those that lie in the archive, if live
    )
    is_watched: bool = True  # False: drawn in large batches, for a replay as fast as it goes that nobody looks at
    smooth: bool = False  # make smoothed tracks when it is over
    name: str = ""  # of the session's folder, after when it began; without one the site's
    folder_name: str = ""  # the whole name of the session's folder, where it is decided
    command: tuple[str, ...] = ()
