"""What several radars alone have of an aircraft, apart from what it says itself: /track/radars/{track} (paper 004, figure 1).

A thin blue line beside the orange positions and the red fused track, where two radars or more see an aircraft. With one
radar its plots are just that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.associate import MultiRadar
from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity, once
from gateway.sinks.scene.mapped import lat_lon_deg
from gateway.sinks.scene.sheaf import Sheaf
from gateway.sinks.scene.trail import Trail, grown

Floats = NDArray[np.float64]


class MultiRadarScene:
    """Draws multi-radar tracks, a point a second each."""

    def __init__(self, site: Site) -> None:
        self._units = style.units_of(site)
        self._frame = RunwayFrame(site.runway)
        self._trails: dict[int, Trail] = {}

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        parts = [(picture.associate.radars, picture.step) for picture in pictures if len(picture.associate.radars.time)]
        return [*(self._drawn(parts) if parts else []), *self._ended(pictures)]

    def _drawn(self, parts: Sequence[tuple[MultiRadar, int]]) -> list[Entry]:
        track, time, place, sigma = (
            np.concatenate([getattr(one, name) for one, _ in parts])
            for name in ("track", "time", "runway_m", "sigma_m")
        )
        step = np.repeat([step for _, step in parts], [len(one.time) for one, _ in parts])
        lat_lon = lat_lon_deg(self._frame, place)
        order = np.argsort(track, kind="stable")
        numbers, counts = np.unique(track, return_counts=True)
        sheaf = Sheaf.of(numbers.tolist(), counts, time[order], step[order])
        entries: list[Entry] = []
        extended = []
        for number, start, end in sheaf.cuts():
            path, mine = _path(number), slice(start, end)
            if number not in self._trails:
                self._trails[number] = Trail(path, "line", style.RADAR, 1.2)
                entries.append(Always(path, (self._look(number),)))
            positions = sheaf.time[mine], sheaf.step[mine], place[order][mine], lat_lon[order][mine]
            extended.append((self._trails[number], *positions))
        level = np.hypot(sigma[:, 0], sigma[:, 1]) * np.sqrt(0.5)
        spread = np.stack([level, sigma[:, 2]], axis=-1)[order] * self._units.lengths
        return [*entries, *grown(extended), *sheaf.rows(_path, columns.scalars(spread))]

    def _ended(self, pictures: Sequence[Picture]) -> list[Entry]:
        """Those of system tracks that ended leave the scene."""
        entries: list[Entry] = []
        for picture in pictures:
            for ended in picture.fuse.ended:
                if self._trails.pop(ended.track, None) is not None:
                    gone, clear = max(ended.at, picture.now), rr.Clear.columns(is_recursive=[True])
                    entries.append(once(_path(ended.track), gone, picture.step, clear))
        return entries

    def _look(self, track: int) -> rr.SeriesLines:
        names = [
            f"track {track} radars only, {part} sigma, {self._units.length}" for part in ("horizontal", "vertical")
        ]
        return rr.SeriesLines(names=names, colors=[style.RADAR, style.ANTENNA])


def _path(track: int) -> str:
    return entity("track", "radars", track)
