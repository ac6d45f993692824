"""Where tracks should be and where they will be: /approach/{track} and /predict/{track}."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.predict import Predicted
from gateway.predict.approach import deviations
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity
from gateway.sinks.scene.flown import Flock, Flown
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.sheaf import Sheaf

Floats = NDArray[np.float64]

_CIRCLE = np.stack([f(np.linspace(0.0, 2.0 * math.pi, 25)) for f in (np.cos, np.sin)] + [np.zeros(25)], axis=-1)


class ApproachScene:
    """Plots how far each track is off its glide path and the centreline, in lengths and in angles."""

    def __init__(self, site: Site) -> None:
        self._runway, self._units = site.runway, style.units_of(site)
        self._named: Lately[int] = Lately()

    def entries(self, flights: Flock) -> list[Entry]:
        """The rows of those tracks that are on the approach."""
        all_of = flights.columns
        off = deviations(self._runway, all_of.runway_m, all_of.velocity_mps[:, 0])
        known = np.asarray(np.isfinite(off.distance_m))
        for above in (off.vertical_m, off.vertical_rad):
            above[~all_of.has_height] = np.nan
        sheaf = flights.sheaf.where(known)
        entries: list[Entry] = []
        for flown, _, end in sheaf.cuts():
            if self._named.is_new(flown.track, int(sheaf.time[end - 1])):
                entries += self._looks(flown.track)
        length, distance = self._units.lengths, self._units.distances
        for place, values in (
            (("approach",), (off.vertical_m * length, off.lateral_m * length)),
            (("approach", "angle"), (np.degrees(off.vertical_rad), np.degrees(off.lateral_rad))),
            (("approach", "distance"), (off.distance_m * distance,)),
        ):
            plotted = columns.scalars(np.stack(values, axis=-1)[known])
            entries += sheaf.rows(lambda flown, place=place: entity(*place, flown.track), plotted)  # type: ignore[misc]
        return entries

    def _looks(self, track: int) -> list[Entry]:
        colours = [style.VERTICAL, style.HORIZONTAL]
        kinds = ("above glide path", "left of centreline")
        metres = [f"track {track} {kind}, {self._units.length}" for kind in kinds]
        degrees = [f"track {track} {kind}, degrees" for kind in kinds]
        distance = f"track {track} to threshold, {self._units.distance}"
        return [
            Always(entity("approach", track), (rr.SeriesLines(names=metres, colors=colours),)),
            Always(entity("approach", "angle", track), (rr.SeriesLines(names=degrees, colors=colours),)),
            Always(entity("approach", "distance", track), (rr.SeriesLines(names=distance),)),
        ]


class PredictScene:
    """Draws the newest prediction of each track: its path, its corridor of one sigma, and a ring at each point."""

    def __init__(self, site: Site) -> None:
        self._frame = RunwayFrame(site.runway)
        self._newest: Lately[int] = Lately()
        self._here: dict[int, Floats] = {}  # the last position of each track: where its prediction starts
        self._looked: Lately[int] = Lately()

    def entries(self, pictures: Sequence[Picture], flights: Sequence[Flown]) -> list[Entry]:
        """The predictions that these pictures add; each stands until the next one is made."""
        known = {flown.track: flown for flown in flights}
        found: dict[int, list[tuple[int, int, list[Floats]]]] = {}
        for picture in pictures:
            for track, made, strips in self._made(picture.predict, known):
                found.setdefault(track, []).append((made, picture.step, strips))
        for flown in flights:
            self._here[flown.track] = flown.runway_m[-1]
        return self._rows(found) if found else []

    def end(self, track: int, at: int) -> None:
        """A track ended: what was predicted for it until then is not drawn any more."""
        self._newest.is_new(track, at)
        self._looked.drop(track)
        self._here.pop(track, None)

    def _made(self, predicted: Predicted, known: dict[int, Flown]) -> list[tuple[int, int, list[Floats]]]:
        """The strips of each prediction in one picture: (track, made, strips)."""
        if not len(predicted.made):
            return []
        found = []
        keys = np.stack([predicted.track, predicted.made], axis=-1)
        for track, made in dict.fromkeys(map(tuple, keys.tolist())):
            if made < self._newest.at(track):
                continue
            self._newest.is_new(track, made)
            index = np.flatnonzero((predicted.track == track) & (predicted.made == made))
            methods = dict.fromkeys(predicted.method[row] for row in index)
            strips: list[Floats] = []
            for method in methods:
                mine = index[[predicted.method[row] == method for row in index]]
                mine = mine[np.argsort(predicted.horizon_s[mine], kind="stable")]
                start = self._start(track, made, known)
                strips += corridor(start, predicted.runway_m[mine], predicted.sigma_m[mine])
            found.append((track, made, strips))
        return found

    def _start(self, track: int, made: int, known: dict[int, Flown]) -> Floats | None:
        flown = known.get(track)
        if flown is not None:
            row = int(np.searchsorted(flown.time, made, side="right")) - 1
            if row >= 0:
                return np.asarray(flown.runway_m[row])
        return self._here.get(track)

    def _rows(self, found: dict[int, list[tuple[int, int, list[Floats]]]]) -> list[Entry]:
        told = [one for mine in found.values() for one in mine]
        strips = [strip for _, _, part in told for strip in part]
        counts = [len(part) for _, _, part in told]
        ends = np.cumsum([len(strip) for strip in strips])[:-1]
        latitude, longitude, _ = self._frame.geodetic_from_runway(np.concatenate(strips))
        ground = np.split(np.degrees(np.stack([latitude, longitude], axis=-1)), ends)
        entries: list[Entry] = []
        radius, look = style.points(0.8), style.PREDICTED
        for track, mine in found.items():
            if self._looked.is_new(track, mine[-1][0]):
                line = rr.LineStrips3D.from_fields(colors=look, radii=radius)
                on_map = rr.GeoLineStrings.from_fields(colors=look, radii=radius)
                entries.append(Always(entity("predict", track), (line, on_map)))
        time, step = [made for made, _, _ in told], [number for _, number, _ in told]
        sheaf = Sheaf.of(list(found), [len(mine) for mine in found.values()], time, step)
        drawn = columns.strips_3d(strips, counts), columns.strips_on_map(ground, counts)
        return [*entries, *sheaf.rows(lambda track: entity("predict", track), *drawn)]


def corridor(start: Floats | None, ahead_m: Floats, sigma_m: Floats) -> list[Floats]:
    """A predicted path as lines (k, 3): the path, its edges at one sigma to either side, a ring at each point.

    `ahead_m` (n, 3) in the order of time, `sigma_m` (n,); `start` (3,) is where the track is now, if that is
    known.
    """
    path = ahead_m if start is None else np.concatenate([start[None], ahead_m])
    sigma = sigma_m if start is None else np.concatenate([[0.0], sigma_m])
    rings = [point + radius * _CIRCLE for point, radius in zip(ahead_m, sigma_m, strict=True) if radius > 0.0]
    if len(path) < 2:
        return [np.repeat(path, 2, axis=0), *rings]
    along = np.gradient(path[:, :2], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    aside = np.stack([-along[:, 1], along[:, 0], np.zeros(len(path))], axis=-1) * np.nan_to_num(sigma)[:, None]
    return [path, path + aside, path - aside, *rings]
