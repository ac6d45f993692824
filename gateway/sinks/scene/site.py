"""The airfield: what stands still. Runway, centreline, glide path, decision points, radars, waypoints and weather."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.settings import RadarSite, Runway, Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, entity
from gateway.sinks.scene.mapped import lat_lon_deg, weather_edge

Floats = NDArray[np.float64]


def approach_reach_m(site: Site) -> float:
    """How far out the approach is drawn: as far as the radars see, but at most 50 km.

    Where there is no radar, ten lengths of the runway: a model's strip has short approaches.
    """
    ranges = [radar.maximum_range_m for radar in site.radars]
    return min(max(ranges, default=10.0 * site.runway.length_m), 50_000.0)


def dense(strip: Floats, longest_m: float = 1000.0) -> Floats:
    """The same line (n, 3) in pieces of at most `longest_m`.

    The viewer sets a line's width on the screen at its corners: one of 50 km would be a wall beside the camera.
    """
    pieces = [strip[:1]]
    for start, end in pairwise(strip):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / longest_m)))
        pieces.append(start + (end - start) * (np.arange(1, count + 1) / count)[:, None])
    return np.concatenate(pieces)


class SiteScene:
    """Draws one site; lines go both into the 3D scene and onto the map, so that the map reads without tiles."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.units = style.units_of(site)
        self.frame = RunwayFrame(site.runway)

    def entries(self) -> list[Always]:
        """Everything that is drawn once."""
        runway = self.site.runway
        drawn = [
            Always("/", (rr.ViewCoordinates.RIGHT_HAND_Z_UP,)),
            *self._runway(runway),
            *self._centreline(runway),
            *self._glide_path(runway),
        ]
        for radar in self.site.radars:
            drawn += self._radar(radar)
        drawn += self._decision_points(runway)
        drawn += self._waypoints()
        drawn += self._weather()
        return drawn

    def lines(self, path: str, strips: list[Floats], colour: style.Colour, width: float) -> Always:
        """Lines (runway frame) in the scene and on the map; there not of a runway that moves: its ship's track is there."""
        radius = style.points(width)
        strips = [dense(strip) for strip in strips]
        if self.site.runway.follows is not None:
            return Always(path, (rr.LineStrips3D(strips, colors=colour, radii=radius),))
        return Always(
            path,
            (
                rr.LineStrips3D(strips, colors=colour, radii=radius),
                rr.GeoLineStrings(
                    lat_lon=[lat_lon_deg(self.frame, strip) for strip in strips], colors=colour, radii=radius
                ),
            ),
        )

    def labels(self, path: str, place: Floats, texts: list[str], colour: style.Colour, size: float = 2.0) -> Always:
        """Named points in the scene and (without their names: the map has none) on the map."""
        radius = style.points(size)
        if self.site.runway.follows is not None:
            points = rr.Points3D(place, labels=texts, show_labels=True, colors=colour, radii=radius)
            return Always(path, (points,))
        return Always(
            path,
            (
                rr.Points3D(place, labels=texts, show_labels=True, colors=colour, radii=radius),
                rr.GeoPoints(lat_lon=lat_lon_deg(self.frame, place), colors=colour, radii=radius),
            ),
        )

    def _runway(self, runway: Runway) -> list[Always]:
        half, side = 0.5 * runway.length_m, 0.5 * runway.width_m
        outline = [[-half, -side], [half, -side], [half, side], [-half, side], [-half, -side]]
        corners = np.array([[x, y, 0.0] for x, y in outline])
        surface = rr.Mesh3D(
            vertex_positions=corners[:4],
            triangle_indices=[[0, 1, 2], [0, 2, 3]],
            albedo_factor=(70, 72, 76),
        )
        bar_m, bars = min(60.0, 0.05 * runway.length_m), 8
        across = np.linspace(-0.8 * side, 0.8 * side, bars)
        marks = [np.array([[-half + 6.0, y, 0.2], [-half + 6.0 + bar_m, y, 0.2]]) for y in across]
        marks.append(np.array([[-half + 2.0 * bar_m, 0.0, 0.2], [half - 2.0 * bar_m, 0.0, 0.2]]))
        aim = runway.aiming_point_x_m
        marks += [np.array([[aim, 0.3 * y, 0.2], [aim + bar_m, 0.3 * y, 0.2]]) for y in (-side, side)]
        return [
            Always("/site/runway/surface", (surface,)),
            self.lines("/site/runway", [corners], style.RUNWAY, 1.5),
            Always("/site/runway/marks", (rr.LineStrips3D(marks, colors=style.RUNWAY, radii=style.points(0.8)),)),
        ]

    def _centreline(self, runway: Runway) -> list[Always]:
        threshold, units = runway.threshold_x_m, self.units
        reach = approach_reach_m(self.site)
        tick_m = units.tick_m if reach >= 2.0 * units.tick_m else 0.2 * units.tick_m
        distances = np.arange(1, int(reach / tick_m) + 1) * tick_m
        strips = [np.array([[threshold - reach, 0.0, 0.0], [threshold, 0.0, 0.0]])]
        half_tick = 0.02 * tick_m
        strips += [
            np.array([[threshold - d, -half_tick * (1 + i), 0.0], [threshold - d, half_tick * (1 + i), 0.0]])
            for i, d in enumerate(distances)
        ]
        places = np.stack([threshold - distances, np.zeros_like(distances), np.zeros_like(distances)], axis=-1)
        texts = [f"{distance * units.distances:.0f} {units.distance}" for distance in distances]
        return [
            self.lines("/site/centreline", strips, style.CENTRELINE, 0.8),
            self.labels("/site/centreline/distance", places, texts, style.MARK, 1.0),
        ]

    def _glide_path(self, runway: Runway) -> list[Always]:
        """The path in space, and every few kilometres a pole down to the ground, so that the eye sees its height."""
        aim, slope = runway.aiming_point_x_m, math.tan(runway.glide_path_rad)
        top_m = min(1500.0, approach_reach_m(self.site) * slope)
        poles = np.arange(1, 11) * 0.1 * top_m / slope
        path = np.array([[aim - top_m / slope, 0.0, top_m], [aim, 0.0, 0.0]])
        strips = [np.array([[aim - d, 0.0, 0.0], [aim - d, 0.0, d * slope]]) for d in poles]
        thin = rr.LineStrips3D(strips, colors=style.GLIDE_PATH, radii=style.points(0.4))
        return [
            self.lines("/site/glide_path", [path], style.GLIDE_PATH, 1.2),
            Always("/site/glide_path/poles", (thin,)),
        ]

    def _radar(self, radar: RadarSite) -> list[Always]:
        """The antenna, and the sector of 30 degrees to either side of the boresight out to its range."""
        antenna = np.array([radar.along_m, radar.left_m, radar.antenna_height_m])
        ahead = self.site.runway.landing_compass_rad - radar.compass_boresight_rad
        bearings = ahead + np.radians(np.linspace(-30.0, 30.0, 49))
        arc = np.stack([np.cos(bearings), np.sin(bearings), np.zeros_like(bearings)], axis=-1)
        edge = antenna + radar.maximum_range_m * arc
        edge[:, 2] = 0.0
        strip = np.concatenate([antenna[None], edge, antenna[None]])
        mast = np.array([[antenna[0], antenna[1], 0.0], antenna])
        name = f"radar {radar.number}"
        place = entity("site", "radar", radar.number)
        return [
            self.lines(place, [mast], style.RADAR, 2.0),
            self.labels(f"{place}/antenna", antenna[None], [name], style.ANTENNA, 3.0),
            self.lines(f"{place}/coverage", [strip], style.COVERAGE, 0.6),
        ]

    def _decision_points(self, runway: Runway) -> list[Always]:
        slope = math.tan(runway.glide_path_rad)
        drawn = []
        for point in self.site.decision_points:
            x = runway.threshold_x_m - point.distance_m
            place = np.array([[x, 0.0, (runway.aiming_point_x_m - x) * slope]])
            drawn.append(
                self.labels(entity("site", "decision_point", point.name), place, [point.name], style.DECISION, 3.0)
            )
        return drawn

    def _waypoints(self) -> list[Always]:
        drawn = []
        height = self.site.runway.height_m
        for point in self.site.waypoints:
            place = self.frame.runway_from_geodetic([point.latitude_rad], [point.longitude_rad], [height])
            place[:, 2] = 0.0  # a published point has no height: it is drawn on the runway's plane
            drawn.append(self.labels(entity("site", "waypoint", point.name), place, [point.name], style.TEXT, 2.0))
        return drawn

    def _weather(self) -> list[Always]:
        return [
            self.lines(entity("site", "weather", area.name), [weather_edge(self.frame, area)], style.JOINED, 1.0)
            for area in self.site.weather
        ]
