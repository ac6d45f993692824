"""What the scene and the map show alike: looks of lines and points, places in degrees, circles, edges of weather."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from gateway.frames import RunwayFrame
from gateway.settings import Weather
from gateway.sinks.scene import style

Floats = NDArray[np.float64]
Look = tuple[rr.AsComponents, ...]


def line_look(colour: style.Colour, width: float) -> Look:
    """Of lines, so many points wide on the screen."""
    radius = style.points(width)
    return (
        rr.LineStrips3D.from_fields(colors=colour, radii=radius),
        rr.GeoLineStrings.from_fields(colors=colour, radii=radius),
    )


def label_look(colour: style.Colour, size: float) -> Look:
    """Of points with labels; on the map they have none."""
    radius = style.points(size)
    return (
        rr.Points3D.from_fields(colors=colour, radii=radius, show_labels=True),
        rr.GeoPoints.from_fields(colors=colour, radii=radius),
    )


def lat_lon_deg(frame: RunwayFrame, runway_m: ArrayLike) -> Floats:
    """Latitudes and longitudes (..., 2) in degrees of places (..., 3) in the runway frame."""
    latitude, longitude, _ = frame.geodetic_from_runway(np.asarray(runway_m, dtype=np.float64))
    return np.degrees(np.stack([latitude, longitude], axis=-1))


def circle(corners: int) -> Floats:
    """A level circle (corners + 1, 3) of radius 1 about 0, closed."""
    angle = np.linspace(0.0, 2.0 * math.pi, corners + 1)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))], axis=-1)


def weather_edge(frame: RunwayFrame, area: Weather) -> Floats:
    """The edge (k, 3) of an area of weather on the runway's plane, closed."""
    height_m = frame.runway.height_m
    if area.latitude_rad is not None and area.longitude_rad is not None:
        centre = frame.runway_from_geodetic([area.latitude_rad], [area.longitude_rad], [height_m])[0]
        return np.asarray(centre * [1.0, 1.0, 0.0] + (area.radius_m or 0.0) * circle(72))
    latitude, longitude = np.array([*area.polygon_rad, area.polygon_rad[0]]).T
    edge = frame.runway_from_geodetic(latitude, longitude, np.full(len(latitude), height_m))
    edge[:, 2] = 0.0
    return np.asarray(edge)
