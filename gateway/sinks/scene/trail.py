"""Trails: where something was in the last minutes, at every instant that a person may scrub to.

A trail is a ring of segments, each an entity of its own that is written again each second while it grows and
stays as it is afterwards. So a row costs the points of its own segment, not of the whole trail, a recording
of ten hours has no more entities than one of ten minutes, and the viewer needs no setting to show the trail.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, rows, strips_3d, strips_on_map

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SEGMENT_NS = 60_000_000_000
SEGMENTS = 9  # eight whole minutes and the one that grows: longer than 003's approach
ROW_NS = 1_000_000_000
GAP_NS = 30_000_000_000  # a line does not bridge a longer silence


class Trail:
    """One trail: `kind` "line" for smooth tracks (a point a second), "points" for noisy ones (every position)."""

    def __init__(self, path: str, kind: Literal["line", "points"], colour: style.Colour, size: float) -> None:
        self._path, self._kind = path, kind
        self._colour, self._radius = colour, style.points(size)
        self._ground = style.points(0.4 * size if kind == "points" else size)  # a map is small: lines over dots
        self._segment = -1
        self._started = self._last_row = self._last = 0
        self._runway: list[Floats] = []
        self._lat_lon: list[Floats] = []

    def extend(self, time: Ints, step: Ints, runway_m: Floats, lat_lon_deg: Floats) -> list[Entry]:
        """Take positions in the order of time: (n,) ns, (n,), (n, 3) m, (n, 2) degrees; returns what to send."""
        entries: list[Entry] = []
        grown: list[int] = []  # indexes of rows to be written
        shapes: list[tuple[Floats, Floats]] = []
        for index in range(len(time)):
            now = int(time[index])
            if self._segment < 0 or now - self._started >= SEGMENT_NS or now - self._last > GAP_NS:
                entries += self._written(time, step, grown, shapes)
                grown, shapes = [], []
                entries += self._begin(now)
            elif self._kind == "line" and now - self._last < ROW_NS:
                continue
            self._last = now
            self._runway.append(runway_m[index])
            self._lat_lon.append(lat_lon_deg[index])
            if now - self._last_row >= ROW_NS and len(self._runway) > (self._kind == "line"):
                self._last_row = now
                grown.append(index)
                shapes.append((np.array(self._runway), np.array(self._lat_lon)))
        return entries + self._written(time, step, grown, shapes)

    def _begin(self, now: int) -> list[Entry]:
        joined = self._segment >= 0 and self._kind == "line" and now - self._last <= GAP_NS
        self._runway = self._runway[-1:] if joined else []
        self._lat_lon = self._lat_lon[-1:] if joined else []
        self._segment += 1
        self._started = now
        self._last_row = 0
        if self._segment >= SEGMENTS:
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
        return f"{self._path}/trail/{self._segment % SEGMENTS}"

    def _written(self, time: Ints, step: Ints, grown: list[int], shapes: list[tuple[Floats, Floats]]) -> list[Entry]:
        if not grown:
            return []
        if self._kind == "line":
            scene = strips_3d([runway for runway, _ in shapes])
            ground = strips_on_map([lat_lon for _, lat_lon in shapes])
        else:
            lengths = [len(runway) for runway, _ in shapes]
            scene = rr.Points3D.columns(positions=np.concatenate([runway for runway, _ in shapes]))
            scene = scene.partition(lengths)
            ground = rr.GeoPoints.columns(positions=np.concatenate([lat_lon for _, lat_lon in shapes]))
            ground = ground.partition(lengths)
        return [rows(self._place(), time[grown], step[grown], scene, ground)]
