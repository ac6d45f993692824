"""Trails: where something was in the last minutes, at every instant that a person may scrub to.

A trail is a ring of segments, each an entity of its own that is written again each second while it grows and
stays as it is afterwards. So a row costs the points of its own segment, not of the whole trail, a recording
of ten hours has no more entities than one of ten minutes, and the viewer needs no setting to show the trail.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, Rows
from gateway.sinks.scene.sheaf import Sheaf

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SEGMENT_NS = 60_000_000_000
SEGMENTS = 9  # eight whole minutes and the one that grows: longer than 003's approach
ROW_NS = 1_000_000_000
GAP_NS = 30_000_000_000  # a line does not bridge a longer silence


Kind = Literal["line", "points"]


@dataclass(frozen=True, slots=True)
class Grown:
    """A segment as it is at an instant: k points of it in the runway frame (k, 3) and in degrees (k, 2)."""

    kind: Kind
    path: str
    time: int
    step: int
    runway_m: Floats
    lat_lon_deg: Floats


class Trail:
    """One trail: `kind` "line" for smooth tracks (a point a second), "points" for noisy ones (every position)."""

    def __init__(
        self,
        path: str,
        kind: Kind,
        colour: style.Colour,
        size: float,
        *,
        segments: int = SEGMENTS,
        segment_ns: int = SEGMENT_NS,
    ) -> None:
        self._path, self._kind, self._segments, self._segment_ns = path, kind, segments, segment_ns
        self._colour, self._radius = colour, style.points(size)
        self._ground = style.points(0.4 * size if kind == "points" else size)  # a map is small: lines over dots
        self._segment = -1
        self._started = self._last_row = self._last = 0
        self._runway: list[Floats] = []
        self._lat_lon: list[Floats] = []

    def extend(self, time: Ints, step: Ints, runway_m: Floats, lat_lon_deg: Floats) -> tuple[list[Always], list[Grown]]:
        """Take positions in the order of time: (n,) ns, (n,), (n, 3) m, (n, 2) degrees; new looks, and rows to be drawn."""
        looks: list[Always] = []
        rows: list[Grown] = []
        for index, now in enumerate(time.tolist()):
            if self._segment < 0 or now - self._started >= self._segment_ns or now - self._last > GAP_NS:
                looks += self._begin(now)
            elif self._kind == "line" and now - self._last < ROW_NS:
                continue
            self._last = now
            self._runway.append(runway_m[index])
            self._lat_lon.append(lat_lon_deg[index])
            if now - self._last_row >= ROW_NS and len(self._runway) > (self._kind == "line"):
                self._last_row = now
                shape = np.array(self._runway), np.array(self._lat_lon)
                rows.append(Grown(self._kind, self._place(), now, int(step[index]), *shape))
        return looks, rows

    def _begin(self, now: int) -> list[Always]:
        joined = self._segment >= 0 and self._kind == "line" and now - self._last <= GAP_NS
        self._runway = self._runway[-1:] if joined else []
        self._lat_lon = self._lat_lon[-1:] if joined else []
        self._segment += 1
        self._started = now
        self._last_row = 0
        if self._segment >= self._segments:
            return []
        look: rr.AsComponents
        ground: rr.AsComponents
        if self._kind == "line":
            look = rr.LineStrips3D.from_fields(colors=self._colour, radii=self._radius)
            ground = rr.GeoLineStrings.from_fields(colors=self._colour, radii=self._radius)
        else:
            look = rr.Points3D.from_fields(colors=self._colour, radii=self._radius)
            ground = rr.GeoPoints.from_fields(colors=self._colour, radii=self._ground)
        return [Always(self._place(), (look, ground))]

    def _place(self) -> str:
        return f"{self._path}/trail/{self._segment % self._segments}"


def grown(extended: Iterable[tuple[Trail, Ints, Ints, Floats, Floats]]) -> list[Entry]:
    """What trails add, each with the positions that it is to take: see `Trail.extend`."""
    entries: list[Entry] = []
    shapes: dict[Kind, list[Grown]] = {"line": [], "points": []}
    for trail, time, step, runway_m, lat_lon_deg in extended:
        looks, rows = trail.extend(time, step, runway_m, lat_lon_deg)
        entries += looks
        for row in rows:
            shapes[row.kind].append(row)
    for kind, rows in shapes.items():
        if rows:
            entries += _drawn(kind, rows)
    return entries


def _drawn(kind: Kind, shapes: list[Grown]) -> list[Rows]:
    """Rows of trails of one kind, those of each entity in the order of time."""
    by_path = groupby(sorted(shapes, key=lambda shape: shape.path), key=lambda shape: shape.path)
    mine = [(path, list(group)) for path, group in by_path]
    ordered = [shape for _, group in mine for shape in group]
    time, step = [shape.time for shape in ordered], [shape.step for shape in ordered]
    scene, ground = [shape.runway_m for shape in ordered], [shape.lat_lon_deg for shape in ordered]
    one = np.ones(len(ordered), dtype=np.int64)
    if kind == "line":
        drawn = (columns.strips_3d(scene, one), columns.strips_on_map(ground, one))
    else:
        drawn = (columns.clouds_3d(scene), columns.clouds_on_map(ground))
    sheaf = Sheaf.of([path for path, _ in mine], [len(group) for _, group in mine], time, step)
    return sheaf.rows(str, *drawn)
