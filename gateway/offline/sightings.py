"""What landing radars saw during a recording, as columns, each radar's in its own frame with its known errors taken off."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Correction, radar_from_status
from gateway.estimators.flight_path import EARTH_M
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, xyz_from_polar
from gateway.observation import Observation, RadarPlot, RadarStatus
from gateway.offline.carrying import Muted, Place, frame_at, on_plane
from gateway.offline.parameters import Series, Times
from gateway.register import Remembered
from gateway.register.corrections import stated
from gateway.settings import RadarSite, Site
from gateway.track import name_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(slots=True)
class Sightings:
    """Plots as they come, by radar: number of the radar's track, range, azimuth, elevation, and their sigmas."""

    plots: dict[int, Series] = field(default_factory=dict)
    statuses: dict[int, RadarStatus] = field(default_factory=dict)

    def take(self, said: Observation) -> None:
        """Keep what a radar said; of the words on where it stands the last."""
        if isinstance(said, RadarPlot):
            values = (said.range_m, said.azimuth_rad, said.elevation_rad)
            sigmas = (said.range_sigma_m, said.azimuth_sigma_rad, said.elevation_sigma_rad)
            self.plots.setdefault(said.radar, Series(7)).add(said.valid_at, said.track_number, *values, *sigmas)
        elif isinstance(said, RadarStatus):
            self.statuses[said.radar] = said


@dataclass(frozen=True, slots=True)
class View:
    """What one radar saw, n plots in order of time: polar (n, 3) with errors taken off, sigma (n, 3), NaN = not measured.

    `number` (n,) is the radar's own track's, 0 where it tracks nothing.
    """

    radar: int
    runway: RunwayFrame
    frame: RadarFrame
    time: Times
    number: Ints
    polar: Floats
    sigma: Floats

    def within(self, first: int, last: int) -> View:
        """The plots of a time, ns, both ends included."""
        return self._of((self.time >= first) & (self.time <= last))

    def without(self, muted: Muted) -> View:
        """All but the plots of some times."""
        kept = np.ones(len(self.time), dtype=np.bool_)
        for since, until in muted:
            kept &= ~((self.time >= since) & (self.time < until))
        return self._of(kept)

    def _of(self, rows: NDArray[np.bool_]) -> View:
        return replace(
            self, time=self.time[rows], number=self.number[rows], polar=self.polar[rows], sigma=self.sigma[rows]
        )

    def polar_of(self, lift_off: Place, place_m: Floats, height_m: Floats) -> Floats:
        """Range, azimuth, elevation (m, 3) of places (m, 2) m from lift-off, at heights (m,) above the ellipsoid."""
        latitude, longitude, _ = frame_at(lift_off).geodetic_from_enu(on_plane(place_m))
        return polar_from_xyz(self.frame.from_enu(self.runway.enu_from_geodetic(latitude, longitude, height_m)))

    def located(self, lift_off: Place, height_m: Floats) -> Floats:
        """East and north (n, 2) m of lift-off; NaN where range or azimuth is missing. Heights (n,) tell missing elevations."""
        above = height_m - self.runway.runway.height_m - self.frame.antenna_enu_m[2]
        above = above - self.polar[:, 0] ** 2 / (2.0 * EARTH_M)
        guessed = np.arcsin(np.clip(above / self.polar[:, 0], -1.0, 1.0))
        polar = self.polar.copy()
        polar[:, 2] = np.where(np.isnan(polar[:, 2]), guessed, polar[:, 2])
        latitude, longitude, _ = self.runway.geodetic_from_enu(self.frame.to_enu(xyz_from_polar(polar)))
        return frame_at(lift_off).enu_from_geodetic(latitude, longitude, np.zeros_like(latitude))[..., :2]


def views(sightings: Sightings, site: Site, remembered: Remembered | None) -> list[View]:
    """What each radar saw whose place is known: by the site, else by its own word.

    `remembered`: what a session learnt that its radars measure too much, which is taken off; else what the site states.
    """
    frame = RunwayFrame(site.runway)
    radars = {number: radar_from_status(status, frame) for number, status in sightings.statuses.items()}
    radars |= {radar.number: radar for radar in site.radars}
    return [
        _view(series, radars[number], frame, remembered)
        for number, series in sorted(sightings.plots.items())
        if number in radars
    ]


def _view(series: Series, radar: RadarSite, frame: RunwayFrame, remembered: Remembered | None) -> View:
    time, told = series.rows()
    *errors, late_s = _too_much(radar, remembered)
    usual = np.array([radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad])
    number = np.zeros(len(time), dtype=np.int64) if radar.numbers == "ignored" else told[:, 0].astype(np.int64)
    sigma = np.where(np.isnan(told[:, 4:]) | (told[:, 4:] <= 0.0), usual, told[:, 4:])
    at = time - round(late_s * SECOND)
    return View(radar.number, frame, RadarFrame.of(radar, frame), at, number, told[:, 1:4] - np.array(errors), sigma)


def _too_much(radar: RadarSite, remembered: Remembered | None) -> Correction:
    """Range m, azimuth rad, elevation rad, time s."""
    by_site = stated(radar)
    known = None if remembered is None else remembered.of(radar, 0.0)
    if known is None:
        return by_site
    range_m, azimuth, elevation, late = (
        own if math.isnan(learnt) else float(learnt) for own, learnt in zip(by_site, known[0], strict=True)
    )
    return range_m, azimuth, elevation, late


def names_of(views: Sequence[View], row_view: Ints, row_number: Ints) -> list[str]:
    """What each plot's track is called, "1/3"."""
    rows = zip(row_view.tolist(), row_number.tolist(), strict=True)
    return [name_of((views[view].radar, number, 0)) for view, number in rows]


def seen_within(views: Sequence[View], first: int, last: int, muted: Collection[tuple[int, Muted]]) -> list[View]:
    """The views of a sortie's time, without what is muted of each radar (0: of all)."""
    found = []
    for view in views:
        part = view.within(first, last)
        for radar, times in muted:
            part = part.without(times) if radar in (0, view.radar) else part
        found.append(part)
    return found
