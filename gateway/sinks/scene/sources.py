"""What the sources said, and what a simulator says was true: /raw, /align, /truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import GpsReport, RadarPlot, Truth
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.deck import DeckScene
from gateway.sinks.scene.entry import Always, Entry, entity
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.mapped import lat_lon_deg
from gateway.sinks.scene.sheaf import Sheaf
from gateway.sinks.scene.trail import Kind, Trail, grown

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


UNNUMBERED = "/0"  # how the plots are named that their radar does not number
AFTERGLOW_NS = 5_000_000_000  # they are of different things, so that a long trail of them tells nothing


def raw_path(source: str) -> str:
    """The entity of an aircraft's own positions, or of a radar track "1/3"."""
    radar, slash, number = source.partition("/")
    return entity("raw", "radar", radar, number) if slash and radar.isdigit() else entity("raw", "gps", source)


@dataclass(frozen=True, slots=True)
class Positions:
    """What sources said of places: the positions of aircraft, or the plots of radar tracks, n in all."""

    is_plot: bool
    sheaf: Sheaf[str]  # by source: an aircraft, or a radar track "1/3"
    runway_m: Floats  # (n, 3)
    has_height: Bools  # (n,); without one the third coordinate is a guess


def raw_positions(pictures: Sequence[Picture]) -> list[Positions]:
    """The raw positions of pictures, source by source; a plot without range or angle has no place in space."""
    found = []
    for is_plot in (False, True):
        parts = [picture.align for picture in pictures]
        time = np.concatenate([part.plot_time if is_plot else part.report_time for part in parts])
        place = np.concatenate([part.plot_runway_m if is_plot else part.report_runway_m for part in parts])
        named = [part.plot_radar_track if is_plot else part.report_aircraft for part in parts]
        names = [name for part in named for name in part]
        known = np.concatenate([np.ones(0, np.bool_), *(part.report_has_height for part in parts)])
        has_height = np.ones(len(time), dtype=np.bool_) if is_plot else known
        step = np.repeat([picture.step for picture in pictures], [len(part) for part in named])
        sheaf, order = _by_name(names, np.asarray(np.isfinite(place).all(axis=1)), time, step)
        if len(order):
            found.append(Positions(is_plot, sheaf, place[order], has_height[order]))
    return found


class SourceScene:
    """Draws raw positions and truth; remembers the trail of each."""

    def __init__(self, site: Site, deck: DeckScene | None = None) -> None:
        self._frame, self._deck = RunwayFrame(site.runway), deck or DeckScene(site)
        self._geoid_m = site.runway.geoid_separation_m or 0.0
        self._trails: dict[str, Trail] = {}
        self._drawn: Lately[str] = Lately(self._trails.pop)
        self._named: Lately[str] = Lately()

    def entries(self, pictures: Sequence[Picture], heard: Sequence[Positions]) -> list[Entry]:
        """The rows that these pictures add; `heard` are their raw positions."""
        entries: list[Entry] = []
        for one in heard:
            colour = style.RADAR if one.is_plot else style.GPS
            entries += self._positions(raw_path, colour, one.sheaf, one.runway_m, "points")
        return [*entries, *self._lateness(pictures), *self._truth(pictures)]

    def _truth(self, pictures: Sequence[Picture]) -> list[Entry]:
        told = [(truth, picture.step) for picture in pictures for truth in picture.truth]
        if not told:
            return []
        latitude = np.array([truth.latitude_rad for truth, _ in told])
        longitude = np.array([truth.longitude_rad for truth, _ in told])
        place = self._frame.runway_from_geodetic(latitude, longitude, [self._height_m(truth) for truth, _ in told])
        time = np.array([truth.valid_at for truth, _ in told], dtype=np.int64)
        step = np.array([step for _, step in told], dtype=np.int64)
        known = np.asarray(np.isfinite(place).all(axis=1))
        sheaf, order = _by_name([truth.aircraft for truth, _ in told], known, time, step)
        return self._positions(lambda name: entity("truth", name), style.TRUTH, sheaf, place[order], "line")

    def _height_m(self, truth: Truth) -> float:
        if truth.height_m is not None:
            return truth.height_m
        return np.nan if truth.altitude_msl_m is None else truth.altitude_msl_m + self._geoid_m

    def _positions(
        self, path_of: Callable[[str], str], colour: style.Colour, sheaf: Sheaf[str], place: Floats, kind: Kind
    ) -> list[Entry]:
        """The positions of sources, now and where they were; in the scene and on the map."""
        if not len(place):
            return []
        lat_lon = lat_lon_deg(self._frame, place)
        place = self._deck.place(sheaf.time, place)
        line = kind == "line"
        entries: list[Entry] = []
        extended = []
        for name, start, end in sheaf.cuts():
            path, mine = path_of(name), slice(start, end)
            if self._drawn.is_new(path, int(sheaf.time[end - 1])):
                shade = style.UNNUMBERED if name.endswith(UNNUMBERED) else colour
                lasting = partial(Trail, segments=3, segment_ns=AFTERGLOW_NS) if shade is not colour else Trail
                self._trails[path] = lasting(path, kind, shade, 1.0 if line else 0.8)
                look = rr.Points3D.from_fields(colors=shade, radii=style.points(2.0 if line else 3.5))
                ground = rr.GeoPoints.from_fields(colors=shade, radii=style.points(2.0 if line else 3.0))
                entries.append(Always(path, (look, ground)))
            extended.append((self._trails[path], sheaf.time[mine], sheaf.step[mine], place[mine], lat_lon[mine]))
        here = sheaf.rows(path_of, columns.points_3d(place), columns.points_on_map(lat_lon))
        return [*entries, *here, *grown(extended)]

    def _lateness(self, pictures: Sequence[Picture]) -> list[Entry]:
        """How long after its validity each observation was heard: what alignment has to bridge."""
        told = [
            (
                one.aircraft if isinstance(one, GpsReport) else f"radar {one.radar}",
                one.valid_at,
                picture.step,
                one.received_at,
            )
            for picture in pictures
            for one in picture.observations
            if isinstance(one, GpsReport | RadarPlot)
        ]
        if not told:
            return []
        names, *numbers = zip(*told, strict=True)
        time, step, heard = (np.array(column, dtype=np.int64) for column in numbers)
        sheaf, order = _by_name(names, np.ones(len(names), dtype=np.bool_), time, step)
        entries: list[Entry] = []
        for source, _, end in sheaf.cuts():
            if self._named.is_new(source, int(sheaf.time[end - 1])):
                look = rr.SeriesLines(names=f"{source} heard after, s")
                entries.append(Always(entity("align", source), (look,)))
        lateness = columns.scalars(np.asarray(1e-9 * (heard - time)[order], dtype=np.float64))
        return [*entries, *sheaf.rows(lambda source: entity("align", source), lateness)]


def _by_name(names: Sequence[str], wanted: Bools, time: Ints, step: Ints) -> tuple[Sheaf[str], NDArray[np.intp]]:
    """The wanted rows of each name in the order of time, names in the order of their first row; and their indexes."""
    numbers: dict[str, int] = {}
    group = np.array([numbers.setdefault(name, len(numbers)) for name in names], dtype=np.int64)[wanted]
    order = np.flatnonzero(wanted)[np.lexsort((time[wanted], group))]
    counts = np.bincount(group, minlength=len(numbers))
    keys = [name for name, number in numbers.items() if counts[number]]
    return Sheaf.of(keys, counts[counts > 0], time[order], step[order]), order
