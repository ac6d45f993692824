"""Areas of weather that people told while the session ran: /predict/weather/{name}, until they are gone."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.observation import WeatherArea
from gateway.picture import Picture
from gateway.settings import Site, Weather
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity, once

Floats = NDArray[np.float64]

_ANGLES = np.linspace(0.0, 2.0 * math.pi, 73)


class WeatherScene:
    """Draws an area when it is told, and takes it away when it is gone; those of the site file are drawn with the site."""

    def __init__(self, site: Site) -> None:
        self._frame, self._ground_m = RunwayFrame(site.runway), site.runway.height_m

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        entries: list[Entry] = []
        for picture in pictures:
            for told in picture.observations:
                if isinstance(told, WeatherArea):
                    entries += self._drawn(told, picture.now, picture.step)
        return entries

    def _drawn(self, told: WeatherArea, now: int, step: int) -> list[Entry]:
        path = entity("predict", "weather", told.name)
        if told.area is None:
            return [once(path, now, step, rr.Clear.columns(is_recursive=[False]))]
        ring = self._ring(told.area)
        latitude, longitude, _ = self._frame.geodetic_from_runway(ring)
        ground = np.degrees(np.stack([latitude, longitude], axis=-1))
        thin = style.points(1.0)
        look = (
            rr.LineStrips3D.from_fields(colors=style.JOINED, radii=thin),
            rr.GeoLineStrings.from_fields(colors=style.JOINED, radii=thin),
        )
        row = once(path, now, step, columns.strips_3d([ring], [1]), columns.strips_on_map([ground], [1]))
        return [Always(path, look), row]

    def _ring(self, area: Weather) -> Floats:
        """Its edge (k, 3) on the runway's plane."""
        if area.latitude_rad is not None and area.longitude_rad is not None:
            centre = self._frame.runway_from_geodetic([area.latitude_rad], [area.longitude_rad], [self._ground_m])[0]
            circle = np.stack([np.cos(_ANGLES), np.sin(_ANGLES), np.zeros(len(_ANGLES))], axis=-1)
            return np.asarray(centre * [1.0, 1.0, 0.0] + (area.radius_m or 0.0) * circle)
        latitude, longitude = np.array([*area.polygon_rad, area.polygon_rad[0]]).T
        ring = self._frame.runway_from_geodetic(latitude, longitude, np.full(len(latitude), self._ground_m))
        ring[:, 2] = 0.0
        return np.asarray(ring)
