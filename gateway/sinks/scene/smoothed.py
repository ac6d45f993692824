"""Smoothed tracks: /fuse/smoothed/{track}, a line beside the filter's own, and how sure they are among the sigmas.

A smoothed row stands at the time when its state holds, though it was only known when the session was over.
"""

from __future__ import annotations

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.fuse import Fused
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, once, rows
from gateway.sinks.scene.trail import Trail, grown

Ints = NDArray[np.int64]


class SmoothedScene:
    """Draws the rows of smoothed tracks; remembers the trail of the one that is being drawn."""

    def __init__(self, site: Site) -> None:
        self._units = style.units_of(site)
        self._track = 0
        self._trail: Trail | None = None

    def entries(self, fused: Fused, step: Ints) -> list[Entry]:
        """What some rows of one track, in the order of time and after those that were drawn of it before, add."""
        track, path = int(fused.track[0]), entity("fuse", "smoothed", int(fused.track[0]))
        entries: list[Entry] = []
        if self._trail is None or track != self._track:
            self._track, self._trail = track, Trail(path, "line", style.SMOOTHED, 1.5)
            entries += self._looks(track, path)
        lat_lon = np.degrees(np.stack([fused.latitude_rad, fused.longitude_rad], axis=-1))
        place = (rr.Points3D.columns(positions=fused.runway_m), rr.GeoPoints.columns(positions=lat_lon))
        variance = fused.covariance.reshape(-1, 6, 6)[:, [0, 1, 2], [0, 1, 2]]
        upright = np.where(np.isfinite(fused.height_m), variance[:, 2], np.nan)
        sigma = np.sqrt(np.stack([0.5 * (variance[:, 0] + variance[:, 1]), upright], axis=-1)) * self._units.lengths
        entries.append(rows(path, fused.time, step, *place))
        entries.append(rows(self._sigma(track), fused.time, step, rr.Scalars.columns(scalars=sigma)))
        return entries + grown([(self._trail, fused.time, step, fused.runway_m, lat_lon)])

    def end(self, track: int, at: int, step: int) -> list[Entry]:
        """A track that ended leaves the scene."""
        return [once(entity("fuse", "smoothed", track), at, step, rr.Clear.columns(is_recursive=[True]))]

    def _sigma(self, track: int) -> str:
        return entity("fuse", "sigma", "smoothed", track)

    def _looks(self, track: int, path: str) -> list[Entry]:
        """Colours, sizes and names: what is the same in every row."""
        names = [f"track {track} smoothed, {axis} sigma, {self._units.length}" for axis in ("horizontal", "vertical")]
        return [
            Always(
                path,
                (
                    rr.Points3D.from_fields(colors=style.SMOOTHED, radii=style.points(2.5)),
                    rr.GeoPoints.from_fields(colors=style.SMOOTHED, radii=style.points(4.0)),
                ),
            ),
            Always(self._sigma(track), (rr.SeriesLines(names=names, colors=[style.SMOOTHED] * 2),)),
        ]
