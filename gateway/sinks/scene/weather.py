"""Areas of weather that people told while the session ran: /predict/weather/{name}, until they are gone."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr

from gateway.frames import RunwayFrame
from gateway.observation import WeatherArea
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.entry import Always, Entry, entity, once
from gateway.sinks.scene.mapped import lat_lon_deg, line_look, weather_edge


class WeatherScene:
    """Draws an area when it is told, and takes it away when it is gone; those of the site file are drawn with the site."""

    def __init__(self, site: Site) -> None:
        self._frame = RunwayFrame(site.runway)

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
        edge = weather_edge(self._frame, told.area)
        on_map = columns.strips_on_map([lat_lon_deg(self._frame, edge)], [1])
        row = once(path, now, step, columns.strips_3d([edge], [1]), on_map)
        return [Always(path, line_look(style.JOINED, 1.0)), row]
