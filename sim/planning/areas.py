"""Areas to keep out of: circles and polygons, as signed distances over arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Area:
    """A circle about its one corner, or a polygon of corners (n, 2) m in either direction, also a concave one.

    `base_m`, `top_m`: the levels between which it is there, in m above what levels are counted from.
    """

    corners_m: Floats
    radius_m: float | None = None
    base_m: float = -np.inf
    top_m: float = np.inf
    name: str = ""

    def distance(self, place_m: Floats) -> tuple[Floats, Floats]:
        """How far places (..., 2) are outside, negative inside (...), and its derivative by the place (..., 2)."""
        if self.radius_m is not None:
            aside = place_m - self.corners_m[0]
            away = np.maximum(np.hypot(aside[..., 0], aside[..., 1]), 1e-6)
            return away - self.radius_m, aside / away[..., None]
        nearest = self._nearest(place_m)
        aside = place_m - nearest
        away = np.maximum(np.hypot(aside[..., 0], aside[..., 1]), 1e-6)
        side = np.where(self._holds(place_m), -1.0, 1.0)
        return side * away, (side / away)[..., None] * aside

    def outline(self) -> Floats:
        """Its border as a closed line (m, 2)."""
        if self.radius_m is None:
            return np.concatenate([self.corners_m, self.corners_m[:1]])
        angle = np.linspace(0.0, 2.0 * np.pi, 73)
        return np.asarray(self.corners_m[0] + self.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=-1))

    def middle(self) -> Floats:
        """A point (2,) about which ways go round it on one side or the other."""
        return np.asarray(self.corners_m.mean(axis=0))

    def _nearest(self, place_m: Floats) -> Floats:
        """The nearest point (..., 2) of its border."""
        along = np.roll(self.corners_m, -1, axis=0) - self.corners_m
        from_corner = place_m[..., None, :] - self.corners_m
        square = np.maximum((along**2).sum(axis=-1), 1e-12)
        share = np.clip((from_corner * along).sum(axis=-1) / square, 0.0, 1.0)
        points = self.corners_m + share[..., None] * along
        apart = ((place_m[..., None, :] - points) ** 2).sum(axis=-1)
        chosen = apart.argmin(axis=-1)[..., None, None]
        return np.asarray(np.take_along_axis(points, chosen, axis=-2)[..., 0, :])

    def _holds(self, place_m: Floats) -> NDArray[np.bool_]:
        """Whether places (...) are inside: a ray from there crosses the border an odd number of times."""
        x, y = place_m[..., None, 0], place_m[..., None, 1]
        (x1, y1), (x2, y2) = self.corners_m.T, np.roll(self.corners_m, -1, axis=0).T
        between = (y1 > y) != (y2 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            right = x < (x2 - x1) * (y - y1) / (y2 - y1) + x1
        return np.asarray((between & right).sum(axis=-1) % 2 == 1)


def outside(areas: tuple[Area, ...], place_m: Floats) -> Floats:
    """The least distance (...) from places (..., 2) to any of the areas, negative inside; inf where there is none."""
    least = np.full(place_m.shape[:-1], np.inf)
    for area in areas:
        least = np.minimum(least, area.distance(place_m)[0])
    return least
