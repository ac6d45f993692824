"""What the sources said, and what a simulator says was true: /raw, /align, /truth."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import GpsReport, RadarPlot, Truth
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, in_order, rows
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.trail import Trail

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def raw_path(source: str) -> str:
    """The entity of an aircraft's own positions, or of a radar track "1/3"."""
    radar, slash, number = source.partition("/")
    return entity("raw", "radar", radar, number) if slash and radar.isdigit() else entity("raw", "gps", source)


@dataclass(frozen=True, slots=True)
class Positions:
    """What one source said of places, in the order of time: an aircraft's own, or a radar track's plots."""

    source: str
    is_plot: bool
    time: Ints  # (n,) ns
    step: Ints  # (n,)
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
        for name, index in _by_name(names, np.asarray(np.isfinite(place).all(axis=1))):
            index = index[in_order(time[index])]
            found.append(Positions(name, is_plot, time[index], step[index], place[index], has_height[index]))
    return found


class SourceScene:
    """Draws raw positions and truth; remembers the trail of each."""

    def __init__(self, site: Site) -> None:
        self._frame = RunwayFrame(site.runway)
        self._geoid_m = site.runway.geoid_separation_m or 0.0
        self._trails: dict[str, Trail] = {}
        self._drawn: Lately[str] = Lately(self._trails.pop)
        self._named: Lately[str] = Lately()

    def entries(self, pictures: Sequence[Picture], heard: Sequence[Positions]) -> list[Entry]:
        """The rows that these pictures add; `heard` are their raw positions."""
        entries: list[Entry] = []
        for one in heard:
            colour = style.RADAR if one.is_plot else style.GPS
            entries += self._positions(raw_path(one.source), colour, one.time, one.step, one.runway_m, "points")
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
        entries: list[Entry] = []
        known = np.asarray(np.isfinite(place).all(axis=1))
        for name, index in _by_name([truth.aircraft for truth, _ in told], known):
            path = entity("truth", name)
            entries += self._positions(path, style.TRUTH, time[index], step[index], place[index], "line")
        return entries

    def _height_m(self, truth: Truth) -> float:
        if truth.height_m is not None:
            return truth.height_m
        return np.nan if truth.altitude_msl_m is None else truth.altitude_msl_m + self._geoid_m

    def _positions(
        self, path: str, colour: style.Colour, time: Ints, step: Ints, place: Floats, kind: str
    ) -> list[Entry]:
        """The position of one source, now and where it was; in the scene and on the map."""
        order = in_order(time)
        time, step, place = time[order], step[order], place[order]
        latitude, longitude, _ = self._frame.geodetic_from_runway(place)
        lat_lon = np.degrees(np.stack([latitude, longitude], axis=-1))
        entries: list[Entry] = []
        if self._drawn.is_new(path, int(time[-1])):
            line = kind == "line"
            self._trails[path] = Trail(path, "line" if line else "points", colour, 1.0 if line else 0.8)
            look = rr.Points3D.from_fields(colors=colour, radii=style.points(2.0 if line else 3.5))
            ground = rr.GeoPoints.from_fields(colors=colour, radii=style.points(2.0 if line else 3.0))
            entries.append(Always(path, (look, ground)))
        here = rr.Points3D.columns(positions=place)
        entries.append(rows(path, time, step, here, rr.GeoPoints.columns(positions=lat_lon)))
        return entries + self._trails[path].extend(time, step, place, lat_lon)

    def _lateness(self, pictures: Sequence[Picture]) -> list[Entry]:
        """How long after its validity each observation was heard: what alignment has to bridge."""
        late: dict[str, list[tuple[int, int, float]]] = defaultdict(list)
        for picture in pictures:
            for one in picture.observations:
                if isinstance(one, GpsReport | RadarPlot):
                    source = one.aircraft if isinstance(one, GpsReport) else f"radar {one.radar}"
                    late[source].append((one.valid_at, picture.step, 1e-9 * (one.received_at - one.valid_at)))
        entries: list[Entry] = []
        for source, told in late.items():
            path = entity("align", source)
            if self._named.is_new(source, told[-1][0]):
                entries.append(Always(path, (rr.SeriesLines(names=f"{source} heard after, s"),)))
            time, step, lateness = (np.array(column) for column in zip(*sorted(told), strict=True))
            entries.append(rows(path, time, step, rr.Scalars.columns(scalars=lateness)))
        return entries


def _by_name(names: Sequence[str], wanted: NDArray[np.bool_]) -> list[tuple[str, NDArray[np.intp]]]:
    """The indexes of the wanted rows of each name, names in the order of their first row."""
    found: dict[str, list[int]] = {}
    for index in np.flatnonzero(wanted).tolist():
        found.setdefault(names[index], []).append(index)
    return [(name, np.array(index, dtype=np.intp)) for name, index in found.items()]
