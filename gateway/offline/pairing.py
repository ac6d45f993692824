"""Pairs of what an aircraft and a radar said of one time, out of the pictures of a session.

A pair is an aircraft's report beside the plots of the radar track that it is associated with, brought to the report's time.
At most one a second of each aircraft and radar counts: what comes more often has the same errors in it.
"""

from __future__ import annotations

import math
from bisect import insort
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from gateway.align import SECOND, Plot, bracket, place_plot, radar_from_status
from gateway.frames import RunwayFrame, turn
from gateway.observation import GpsReport, RadarPlot, RadarStatus
from gateway.picture import Picture
from gateway.settings import RadarSite, Site

WAIT_S = 3.0  # what a radar or an aircraft says later than this of a time is not waited for
_NOTHING = (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Pair:
    """One report beside one radar: geodetic (3,) latitude rad, longitude rad, height m; polar (3,) in the radar's own frame."""

    at: int
    aircraft: str
    radar: int
    geodetic: tuple[float, float, float]
    sigma_m: tuple[float, float, float]  # east, north, up
    velocity_enu_mps: tuple[float, float, float]  # of the runway's ENU; 0 where it is not told
    polar: tuple[float, float, float]
    polar_sigma: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Report:
    at: int
    aircraft: str
    geodetic: tuple[float, float, float]
    sigma_m: tuple[float, float, float]
    velocity_enu_mps: tuple[float, float, float]


@dataclass(slots=True)
class Gathering:
    """Pairs out of the pictures of a session in which nothing is taken off. Memory: the pairs, and seconds of the rest."""

    site: Site
    pairs: list[Pair] = field(default_factory=list)
    radars: dict[int, RadarSite] = field(default_factory=dict)
    _frame: RunwayFrame = field(init=False)
    _plots: dict[str, deque[Plot]] = field(default_factory=dict)  # by radar track, in order of time
    _reports: deque[_Report] = field(default_factory=deque)
    _last: dict[tuple[str, int], int] = field(default_factory=dict)  # the second of the last pair

    def __post_init__(self) -> None:
        self._frame = RunwayFrame(self.site.runway)
        self.radars = {radar.number: radar for radar in self.site.radars}

    def take(self, picture: Picture) -> None:
        """What one picture adds."""
        reports = [one for one in picture.observations if isinstance(one, GpsReport)]
        for place, report in enumerate(reports):
            self._take_report(report, picture, place)
        for one in picture.observations:
            if isinstance(one, RadarStatus) and one.radar not in self.radars:
                self.radars[one.radar] = radar_from_status(one, self._frame)
            elif isinstance(one, RadarPlot) and one.track_number and one.radar in self.radars:
                plot = place_plot(one, 0, self.radars[one.radar], _NOTHING)
                plots = self._plots.setdefault(f"{one.radar}/{one.track_number}", deque())
                insort(plots, plot, key=lambda known: known.at)
        due = picture.now - int(WAIT_S * SECOND)
        while self._reports and self._reports[0].at <= due:
            self._pair(self._reports.popleft(), picture)
        self._forget(picture.now - int(3 * WAIT_S * SECOND))

    def _take_report(self, report: GpsReport, picture: Picture, place: int) -> None:
        """A report whose height was measured; its place is that which align gave it."""
        if not picture.align.report_has_height[place]:
            return
        latitude, longitude, height = self._frame.geodetic_from_runway(picture.align.report_runway_m[place])
        usual = self.site.position.sigma_m
        level = report.horizontal_sigma_m or usual
        upright = report.vertical_sigma_m or report.horizontal_sigma_m or usual
        told = (report.velocity_east_mps, report.velocity_north_mps, report.velocity_up_mps)
        local = np.array([math.nan if one is None else one for one in told])
        axes = self._frame.local_from_enu(latitude, longitude)
        east, north, up = turn(axes.T, local).tolist()
        where = (float(latitude), float(longitude), float(height))
        if math.isnan(east + north + up):
            east = north = up = 0.0  # a report that does not tell how fast it flies tells nothing of times
        made = _Report(report.valid_at, report.aircraft, where, (level, level, upright), (east, north, up))
        insort(self._reports, made, key=lambda one: one.at)

    def _pair(self, report: _Report, picture: Picture) -> None:
        for aircraft, track in picture.associate.pairs:
            radar = int(track.partition("/")[0])
            if aircraft != report.aircraft or self._last.get((aircraft, radar)) == report.at // SECOND:
                continue
            polar, sigma = bracket(list(self._plots.get(track, ())), report.at, WAIT_S / 3, WAIT_S / 3)
            if any(map(math.isnan, polar)):  # a place in space needs all three
                continue
            self._last[aircraft, radar] = report.at // SECOND
            where, velocity = report.geodetic, report.velocity_enu_mps
            self.pairs.append(Pair(report.at, aircraft, radar, where, report.sigma_m, velocity, polar, sigma))

    def _forget(self, before: int) -> None:
        for track in list(self._plots):
            plots = self._plots[track]
            while plots and plots[0].at < before:
                plots.popleft()
            if not plots:
                del self._plots[track]
        if len(self._last) > 10_000:
            self._last = {key: second for key, second in self._last.items() if second * SECOND >= before}
