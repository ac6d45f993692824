"""Conflicts that are foretold: /predict/conflicts, a line between the places where both aircraft will be nearest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.predict import Conflicts
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, once
from gateway.sinks.scene.mapped import circle, label_look, lat_lon_deg, line_look

Floats = NDArray[np.float64]

PATH = "/predict/conflicts"
_CIRCLE = circle(48)


class ConflictScene:
    """Draws all conflicts of a round as one row of one entity, and takes them away when there is none any more.

    About each of both places a circle of half the separation: where they overlap, it is lost.
    """

    def __init__(self, site: Site) -> None:
        self._frame, self._units = RunwayFrame(site.runway), style.units_of(site)
        self._half_m = 0.5 * site.separation.horizontal_m
        self._looked = self._shown = False

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        entries: list[Entry] = []
        for picture in pictures:
            found = picture.predict.conflicts
            for at in found.rounds:
                rows = [row for row in np.flatnonzero(found.time == at).tolist() if found.state[row] != "over"]
                if rows:
                    entries += [*self._looks(), *self._drawn(found, rows, at, picture.step)]
                elif self._shown:
                    entries.append(once(PATH, at, picture.step, rr.Clear.columns(is_recursive=[False])))
                self._shown = bool(rows)
        return entries

    def _looks(self) -> list[Entry]:
        if self._looked:
            return []
        self._looked = True
        return [Always(PATH, (*line_look(style.CONFLICT, 1.5), *label_look(style.CONFLICT, 4.0)))]

    def _drawn(self, found: Conflicts, rows: list[int], at: int, step: int) -> list[Entry]:
        strips: list[Floats] = []
        for row in rows:
            places = found.places_m[row]
            strips += [places, *(place + self._half_m * _CIRCLE for place in places)]
        middle = found.places_m[rows].mean(axis=1)
        dots = rr.Points3D.columns(positions=middle, labels=[self._label(found, row, at) for row in rows])
        return [
            once(
                PATH,
                at,
                step,
                columns.strips_3d(strips, [len(strips)]),
                columns.strips_on_map([lat_lon_deg(self._frame, strip) for strip in strips], [len(strips)]),
                dots.partition([len(rows)]),
                rr.GeoPoints.columns(positions=lat_lon_deg(self._frame, middle)).partition([len(rows)]),
            )
        ]

    def _label(self, found: Conflicts, row: int, at: int) -> str:
        first, second = found.pair[row]
        left_s = max((int(found.loses_at[row]) - at) / 1e9, 0.0)
        near = f"{found.horizontal_m[row] * self._units.lengths:.0f} {self._units.length}"
        return f"{first} and {second}: conflict in {left_s:.0f} s, {near}, {100.0 * found.probability[row]:.0f} %"
