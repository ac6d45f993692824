"""Where tracks should be and where they will be: /approach/{track} and /predict/{track}."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.geodesy import wrap_rad
from gateway.picture import Picture
from gateway.predict import Predicted
from gateway.predict.approach import deviations
from gateway.predict.ways import path_on
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity
from gateway.sinks.scene.flown import Flock, Flown
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.mapped import circle, lat_lon_deg, line_look
from gateway.sinks.scene.sheaf import Sheaf

Floats = NDArray[np.float64]

DRAWN_EVERY_S = 5.0
SHOWN, LEAST_SHOWN_M = 0.5, 50.0  # sigmas up to this share of the way, or so much, are drawn
_CIRCLE = circle(24)


class ApproachScene:
    """Plots how far each track is off its glide path and the centreline, in lengths and in angles."""

    def __init__(self, site: Site) -> None:
        self._runway, self._units = site.runway, style.units_of(site)
        self._named: Lately[int] = Lately()

    def entries(self, flights: Flock) -> list[Entry]:
        """The rows of those tracks that are on the approach."""
        all_of = flights.columns
        off = deviations(self._runway, all_of.runway_m, all_of.along_mps)
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
    """Draws the newest prediction of each track: its path, its corridor of one sigma, an ellipse of one sigma at each point."""

    def __init__(self, site: Site) -> None:
        self._frame, self._landing_rad = RunwayFrame(site.runway), site.runway.landing_compass_rad
        self._newest: Lately[int] = Lately()
        self._here: dict[int, Start] = {}  # the last state of each track: where its prediction starts
        self._looked: Lately[int] = Lately()

    def entries(self, pictures: Sequence[Picture], flights: Sequence[Flown]) -> list[Entry]:
        """The predictions that these pictures add; each stands until the next one is made."""
        known = {flown.track: flown for flown in flights}
        found: dict[int, list[tuple[int, int, list[Floats]]]] = {}
        for picture in pictures:
            for track, made, strips in self._made(picture.predict, known):
                found.setdefault(track, []).append((made, picture.step, strips))
        for flown in flights:
            self._here[flown.track] = flown.standing_m[-1], _direction(flown.velocity_mps[-1])
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
        found: list[tuple[int, int, list[Floats]]] = []
        other = (predicted.track[1:] != predicted.track[:-1]) | (predicted.made[1:] != predicted.made[:-1])
        for rows in np.split(np.arange(len(predicted.made)), np.flatnonzero(other) + 1):
            track, made = int(predicted.track[rows[0]]), int(predicted.made[rows[0]])
            if made < self._newest.at(track):
                continue
            self._newest.is_new(track, made)
            mine = rows[np.argsort(predicted.horizon_s[rows], kind="stable")]
            ahead = Ahead(
                predicted.horizon_s[mine],
                predicted.runway_m[mine],
                self._landing_rad - predicted.course_rad[mine],
                predicted.sigma_along_m[mine],
                predicted.sigma_across_m[mine],
            )
            found.append((track, made, corridor(self._start(track, made, known), ahead)))
        return found

    def _start(self, track: int, made: int, known: dict[int, Flown]) -> Start | None:
        flown = known.get(track)
        if flown is not None:
            row = int(np.searchsorted(flown.time, made, side="right")) - 1
            if row >= 0:
                return np.asarray(flown.standing_m[row]), _direction(flown.velocity_mps[row])
        return self._here.get(track)

    def _rows(self, found: dict[int, list[tuple[int, int, list[Floats]]]]) -> list[Entry]:
        told = [one for mine in found.values() for one in mine]
        strips = [strip for _, _, part in told for strip in part]
        counts = [len(part) for _, _, part in told]
        ends = np.cumsum([len(strip) for strip in strips])[:-1]
        ground = np.split(lat_lon_deg(self._frame, np.concatenate(strips)), ends)
        entries: list[Entry] = []
        for track, mine in found.items():
            if self._looked.is_new(track, mine[-1][0]):
                entries.append(Always(entity("predict", track), line_look(style.PREDICTED, 0.8)))
        time, step = [made for made, _, _ in told], [number for _, number, _ in told]
        sheaf = Sheaf.of(list(found), [len(mine) for mine in found.values()], time, step)
        drawn = columns.strips_3d(strips, counts), columns.strips_on_map(ground, counts)
        return [*entries, *sheaf.rows(lambda track: entity("predict", track), *drawn)]


Start = tuple[Floats, float]
"""Where (3,) in the runway frame a track is, and its course, from x to the left."""


@dataclass(frozen=True, slots=True, eq=False)
class Ahead:
    """A prediction of one track: n points in the order of time, in the runway frame, with courses from x to the left."""

    horizon_s: Floats
    place: Floats  # (n, 3)
    course: Floats
    along: Floats  # sigmas
    across: Floats


def corridor(start: Start | None, ahead: Ahead) -> list[Floats]:
    """A predicted path as lines (k, 3): the path, its edges at one sigma to either side, an ellipse at each point.

    `start` is where the track is now, if that is known. Edges and ellipses end where sigma is more than half of the way there:
    from there on they would say no more than that nobody knows.
    """
    if start is None:
        times, known, place, course = ahead.horizon_s, ahead.horizon_s, ahead.place, ahead.course
        across = ahead.across
    else:
        known = np.concatenate([[0.0], ahead.horizon_s])
        place, course = np.concatenate([start[0][None], ahead.place]), np.concatenate([[start[1]], ahead.course])
        across = np.concatenate([[0.0], ahead.across])
        times = np.unique(np.concatenate([known, np.arange(0.0, known[-1], DRAWN_EVERY_S)]))
    if len(times) < 2:
        return [np.repeat(place, 2, axis=0), *_ellipses(ahead)]
    course = course[0] + np.concatenate([[0.0], np.cumsum(wrap_rad(np.diff(course)))])
    level, heading = (part[0] for part in path_on(times, known[None], place[None, :, :2], course[None]))
    path = np.concatenate([level, np.interp(times, known, place[:, 2])[:, None]], axis=1)
    sigma = np.interp(times, known, across)
    flown = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(level, axis=0) ** 2).sum(axis=1)))])
    shown = sigma <= np.maximum(SHOWN * flown, LEAST_SHOWN_M)
    last = len(times) if shown.all() else max(int(shown.argmin()), 2)
    aside = sigma[:, None] * np.stack([-np.sin(heading), np.cos(heading), np.zeros(len(times))], axis=-1)
    edges = [(path + side * aside)[:last] for side in (1.0, -1.0)]
    return [path, *edges, *_ellipses(ahead, times[last - 1])]


def _ellipses(ahead: Ahead, until_s: float = math.inf) -> list[Floats]:
    drawn = []
    for row in np.flatnonzero((ahead.horizon_s <= until_s) & (ahead.along > 0.0)).tolist():
        sine, cosine = math.sin(ahead.course[row]), math.cos(ahead.course[row])
        along, across = ahead.along[row] * _CIRCLE[:, :1], ahead.across[row] * _CIRCLE[:, 1:2]
        drawn.append(ahead.place[row] + along * [cosine, sine, 0.0] + across * [-sine, cosine, 0.0])
    return drawn


def _direction(velocity_mps: Floats) -> float:
    return math.atan2(velocity_mps[1], velocity_mps[0])
