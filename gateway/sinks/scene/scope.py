"""The controller's screen: elevation above, azimuth below, over the distance to the point where the glide path ends.

This is a diagram: heights and offsets are drawn ten times as large as distances, which is what lines of constant
deviation need to be seen apart. True proportions are in the 3D scene, true numbers in the plots.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.fuse import Fused
from gateway.settings import Runway, Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.deck import DeckScene
from gateway.sinks.scene.entry import Always, Entry, entity
from gateway.sinks.scene.flown import Flock, Flown
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.sheaf import Sheaf
from gateway.sinks.scene.site import approach_reach_m
from gateway.sinks.scene.sources import UNNUMBERED, Positions, raw_path

Floats = NDArray[np.float64]
Key = TypeVar("Key")

STRETCH = 10.0
ROOT = "/approach/scope"
_ABOVE = {style.UNNUMBERED: 29.0, style.FUSED: 31.0, style.SMOOTHED: 32.0}


class Scope:
    """Where things stand on the screen, for one site: x along the approach, y down, in metres of distance."""

    def __init__(self, site: Site) -> None:
        self._runway: Runway = site.runway
        self.reach_m = approach_reach_m(site)
        self.top_m = 0.03 * self.reach_m  # heights and offsets that are shown; beyond them nothing is drawn
        self.side_m = 0.012 * self.reach_m
        self._ground_y = -STRETCH * 0.25 * self.side_m
        self._middle_y = STRETCH * 1.25 * self.side_m

    @property
    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """What the view shows: ranges of x and y."""
        lowest = self._middle_y + STRETCH * 1.1 * self.side_m
        highest = self._ground_y - STRETCH * 1.05 * self.top_m
        return (-1.04 * self.reach_m, 0.06 * self.reach_m), (highest, lowest)

    def elevation(self, along_m: Floats, height_m: Floats) -> Floats:
        """Screen positions (n, 2) in the upper diagram; NaN for what is too high or low for it."""
        shown = (height_m >= -0.02 * self.top_m) & (height_m <= self.top_m) & (along_m > -self.reach_m)
        y = np.where(shown, self._ground_y - STRETCH * height_m, np.nan)
        return np.stack([along_m, y], axis=-1)

    def azimuth(self, along_m: Floats, left_m: Floats) -> Floats:
        """Screen positions (n, 2) in the lower diagram, left of the centreline up; NaN for what is too far aside."""
        shown = (np.abs(left_m) <= self.side_m) & (along_m > -self.reach_m)
        y = np.where(shown, self._middle_y - STRETCH * left_m, np.nan)
        return np.stack([along_m, y], axis=-1)

    def both(self, runway_m: Floats) -> Floats:
        """Screen positions (n, 2, 2) of runway-frame positions (n, 3): elevation, azimuth."""
        along = runway_m[:, 0] - self._runway.aiming_point_x_m
        return np.stack([self.elevation(along, runway_m[:, 2]), self.azimuth(along, runway_m[:, 1])], axis=1)


class ScopeScene:
    """Draws the screen of one site, and everything that is on the approach."""

    def __init__(self, site: Site, deck: DeckScene | None = None) -> None:
        self._site, self._units, self.scope = site, style.units_of(site), Scope(site)
        self._deck = deck or DeckScene(site)
        self._looked: Lately[str] = Lately()

    def entries(self, heard: Sequence[Positions], flights: Flock) -> list[Entry]:
        """The rows of raw positions and of tracks."""
        entries: list[Entry] = []
        for one in heard:
            colour, size = (style.RADAR, 1.0) if one.is_plot else (style.GPS, 2.0)
            place = self._deck.place(one.sheaf.time, one.runway_m)
            entries += self._dots(raw_at, colour, size, one.sheaf, place, one.has_height)
        all_of = flights.columns
        entries += self._dots(_fused_at, style.FUSED, 1.2, flights.sheaf, all_of.runway_m, all_of.has_height)
        return entries

    def smoothed_entries(self, fused: Fused, step: NDArray[np.int64]) -> list[Entry]:
        """The rows of one smoothed track, in the order of time, on top of the filter's."""
        path = entity("approach", "scope", "smoothed", int(fused.track[0]))
        has_height = np.asarray(np.isfinite(fused.height_m))
        sheaf = Sheaf.of([path], [len(step)], fused.time, step)
        return self._dots(str, style.SMOOTHED, 0.8, sheaf, fused.runway_m, has_height)

    def _dots(
        self,
        path_of: Callable[[Key], str],
        colour: style.Colour,
        size: float,
        sheaf: Sheaf[Key],
        place: Floats,
        has_height: NDArray[np.bool_],
    ) -> list[Entry]:
        spots = self.scope.both(place)
        spots[~has_height, 0] = np.nan
        shown = np.asarray(np.isfinite(spots).all(axis=-1))
        known = np.asarray(shown.any(axis=1))
        seen = sheaf.where(known)
        entries: list[Entry] = []
        for key, _, end in seen.cuts():
            if self._looked.is_new(path_of(key), int(seen.time[end - 1])):
                shade = style.UNNUMBERED if isinstance(key, str) and key.endswith(UNNUMBERED) else colour
                above = _ABOVE.get(shade, 30.0)
                look = rr.Points2D.from_fields(colors=shade, radii=style.points(size), draw_order=above)
                entries.append(Always(path_of(key), (look,)))
        return [*entries, *seen.rows(path_of, columns.points_2d(spots[shown], shown[known].sum(axis=1)))]

    def site_entries(self) -> list[Always]:
        """The lines of the screen: what stands still."""
        scope, runway = self.scope, self._site.runway
        slope, reach = math.tan(runway.glide_path_rad), scope.reach_m
        ground = np.array([[-reach, 0.0], [0.05 * reach, 0.0]])
        half = math.radians(0.5)
        thin: list[Floats] = []
        wide: list[Floats] = []
        for angle in (-half, 0.0, half):
            steep = math.tan(runway.glide_path_rad + angle)
            far = min(reach, scope.top_m / steep)
            line = scope.elevation(np.array([-far, 0.0]), np.array([far * steep * 0.999, 0.0]))
            (wide if angle == 0.0 else thin).append(line)
            aside = math.tan(2.0 * angle)
            out = min(reach, scope.side_m / abs(aside)) if aside else reach
            line = scope.azimuth(np.array([-0.999 * out, 0.0]), np.array([0.999 * out * aside, 0.0]))
            (wide if angle == 0.0 else thin).append(line)
        strip = np.array([runway.threshold_x_m, -runway.threshold_x_m]) - runway.aiming_point_x_m
        zero = np.zeros(2)
        hard = [scope.elevation(strip, zero), scope.azimuth(strip, zero)]
        frame = [scope.elevation(ground[:, 0] * 0.999, zero)]
        texts, places = self._marks(frame)
        decisions = [
            point.distance_m + (runway.aiming_point_x_m - runway.threshold_x_m) for point in self._site.decision_points
        ]
        spots = np.array([[[-d, 0.0, d * slope]] for d in decisions]).reshape(-1, 3)
        spots[:, 0] += runway.aiming_point_x_m
        return [
            Always(f"{ROOT}/lines/frame", (_lines(frame, (60, 66, 74), 0.4),)),
            Always(f"{ROOT}/lines/limits", (_lines(thin, style.CENTRELINE, 0.4),)),
            Always(f"{ROOT}/lines/path", (_lines(wide, style.GLIDE_PATH, 0.8),)),
            Always(f"{ROOT}/lines/runway", (_lines(hard, style.RUNWAY, 2.0),)),
            Always(
                f"{ROOT}/lines/marks",
                (rr.Points2D(places, labels=texts, show_labels=True, colors=style.MARK, radii=style.points(0.1)),),
            ),
            Always(
                f"{ROOT}/lines/decision",
                (rr.Points2D(scope.both(spots).reshape(-1, 2), colors=style.DECISION, radii=style.points(3.0)),),
            ),
        ]

    def _marks(self, frame: list[Floats]) -> tuple[list[str], Floats]:
        """Adds a line at each distance to `frame`; returns the labels and where they stand."""
        scope, units = self.scope, self._units
        tick_m = units.tick_m if scope.reach_m >= 2.0 * units.tick_m else 0.2 * units.tick_m
        texts, places = [], []
        for distance in np.arange(1, int(scope.reach_m / tick_m) + 1) * tick_m * 0.9999:
            along = np.array([-distance, -distance])
            frame.append(scope.elevation(along, np.array([0.0, scope.top_m])))
            frame.append(scope.azimuth(along, np.array([-scope.side_m, scope.side_m])))
            texts.append(f"{distance * units.distances:.0f} {units.distance}")
            places.append(scope.elevation(along[:1], np.zeros(1))[0])
        return texts, np.array(places).reshape(-1, 2)


def raw_at(source: str) -> str:
    """The entity of an aircraft's own positions, or of a radar track "1/3", on the screen."""
    return ROOT + raw_path(source).removeprefix("/raw")


def _fused_at(flown: Flown) -> str:
    return entity("approach", "scope", flown.track)


def _lines(strips: list[Floats], colour: style.Colour, width: float) -> rr.LineStrips2D:
    return rr.LineStrips2D(strips, colors=colour, radii=style.points(width))
