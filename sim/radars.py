"""What a simulated landing radar says: a datagram of plots a scan (more where there are many), and its status."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adapters.landing_radar import MAXIMUM_PLOTS, Header, Plot, Status, encode
from gateway.frames import RadarFrame, RunwayFrame, turn
from gateway.settings import RadarSite, Site
from sim.earth import Flown
from sim.faulty_sensors import RadarFaults, places
from sim.moving_clutter import draw_birds, draw_rain
from sim.scene import Scene, SceneRadar
from sim.sensors import PlotsMeasured, RadarParameters, draw_clutter, during, measure_radar, scan_times, stream

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


class RadarSight:
    """A radar's view of the world: the truth about an aircraft in the radar's frame."""

    def __init__(self, site: Site, radar: RadarSite) -> None:
        self._runway = RunwayFrame(site.runway)
        self._radar = RadarFrame.of(radar, self._runway)

    def see(self, flown: Flown) -> tuple[Floats, Floats]:
        """Positions m and velocities m/s (..., 3) in the radar's frame."""
        return self.see_at(flown.latitude_rad, flown.longitude_rad, flown.height_m, flown.velocity_mps)

    def see_at(
        self, latitude_rad: ArrayLike, longitude_rad: ArrayLike, height_m: ArrayLike, velocity_mps: Floats
    ) -> tuple[Floats, Floats]:
        """The same for geodetic positions (...) and velocities east, north, up there (..., 3)."""
        enu = self._runway.enu_from_geodetic(latitude_rad, longitude_rad, height_m)
        local_from_enu = self._runway.local_from_enu(latitude_rad, longitude_rad)
        velocity = np.sum(local_from_enu * velocity_mps[..., :, None], axis=-2)  # by the transpose
        return self._radar.from_enu(enu), turn(self._radar.radar_from_enu, velocity)

    def status(self, radar: RadarSite, period_s: float) -> Status:
        """What the radar says of itself."""
        latitude, longitude, height = self._runway.geodetic_from_enu(self._radar.antenna_enu_m)
        return Status(
            "operating",
            "precision approach",
            period_s,
            math.degrees(latitude.item()),
            math.degrees(longitude.item()),
            height.item(),
            math.degrees(radar.compass_boresight_rad) % 360.0,
        )


class RadarVoice:
    """Datagrams of one radar, with its running sequence number."""

    def __init__(self, number: int, key: bytes | None = None) -> None:
        self._number, self._key, self._sequence = number, key, 0

    def plots(self, time_ns: int, plots: Sequence[Plot]) -> list[bytes]:
        """One scan: at least one datagram, so that an empty sky is told from a silent radar."""
        parts = [plots[at : at + MAXIMUM_PLOTS] for at in range(0, max(len(plots), 1), MAXIMUM_PLOTS)]
        return [encode(self._header("plots", time_ns), part, key=self._key) for part in parts]

    def status(self, time_ns: int, status: Status) -> bytes:
        """One status datagram."""
        return encode(self._header("status", time_ns), [status], key=self._key)

    def _header(self, kind: str, time_ns: int) -> Header:
        sequence, self._sequence = self._sequence, (self._sequence + 1) & 0xFFFFFFFF
        return Header("plots" if kind == "plots" else "status", self._number, sequence, time_ns, simulated=True)


def plot_record(number: int, time_ns: int, polar: Floats, radial_mps: float, parameters: RadarParameters) -> Plot:
    """A plot as the wire has it, of range m, azimuth rad, elevation rad (3,) and radial velocity; NaN: not measured."""
    distance, azimuth, elevation = (None if math.isnan(part) else float(part) for part in polar)
    given = parameters.sigma_given
    return Plot(
        number,
        time_ns,
        distance,
        None if azimuth is None else math.degrees(azimuth),
        None if elevation is None else math.degrees(elevation),
        None if math.isnan(radial_mps) else radial_mps,
        range_sigma_m=parameters.range_sigma_m if given else None,
        azimuth_sigma_rad=parameters.azimuth_sigma_rad if given else None,
        elevation_sigma_rad=parameters.elevation_sigma_rad if given else None,
    )


def sightings(scene: Scene, radar: SceneRadar) -> list[tuple[int, NDArray[np.int64], PlotsMeasured]]:
    """For each aircraft in the scene: its track number, the scans (n,) it is there in, and what was measured."""
    scans = scan_times(radar.parameters, 0.0, scene.duration_s)
    befalls = scene.faults_of(radar.name)
    faults = RadarFaults.of(befalls, scans)
    sights = [(RadarSight(scene.site, site), at) for site, at in places(radar.site, befalls, scans)]
    found = []
    for index, aircraft in enumerate(scene.aircraft):
        start, end = scene.present(aircraft)
        there = np.flatnonzero((scans >= start) & (scans < end))
        position, velocity = _seen(sights, there, scene.flown(aircraft, scans[there]))
        generator = stream(scene.seed, radar.name, aircraft.system)
        wrong = faults.among(there)
        measured = measure_radar(radar.parameters, scans[there], position, velocity, generator, error=wrong.error)
        number = radar.parameters.first_number + index if radar.parameters.numbered else 0
        found.append((number, there, wrong.leaves(measured)))
    return found


def _seen(sights: Sequence[tuple[RadarSight, Bools]], scans: NDArray[np.int64], flown: Flown) -> tuple[Floats, Floats]:
    """Positions and velocities (n, 3) in the frame of a radar that stands elsewhere in some of the scans (n,)."""
    position, velocity = np.zeros((2, len(scans), 3))
    for sight, at in sights:
        here = at[scans, None]
        there = sight.see(flown)
        position, velocity = np.where(here, there[0], position), np.where(here, there[1], velocity)
    return position, velocity


def datagrams(scene: Scene, radar: SceneRadar) -> Iterator[tuple[float, bytes]]:
    """Arrival times (s of the scene, never falling) and datagrams of one radar."""
    parameters, voice = radar.parameters, RadarVoice(radar.site.number, radar.key)
    scans = scan_times(parameters, 0.0, scene.duration_s)
    plots = _plots_of_scans(scene, radar, scans)
    faults = scene.faults_of(radar.name)
    told = [
        (RadarSight(scene.site, site).status(site, parameters.period_s), at)
        for site, at in places(radar.site, faults, scans, as_told=True)
    ]
    silent = during(parameters.dropouts, scans) | RadarFaults.of(faults, scans).off
    next_status_s = 0.0
    for scan, time_s in enumerate(scans.tolist()):
        arrives = time_s + parameters.latency_s
        if silent[scan] or arrives >= scene.duration_s:
            continue
        stamp_ns = scene.told_ns(radar.name, time_s + parameters.time_error_s)
        if time_s >= next_status_s:
            next_status_s = time_s + parameters.status_period_s
            yield arrives, voice.status(stamp_ns, next(status for status, at in told if at[scan]))
        records = [plot_record(number, stamp_ns, polar, radial, parameters) for number, polar, radial in plots[scan]]
        for datagram in voice.plots(stamp_ns, records):
            yield arrives, datagram


def _plots_of_scans(scene: Scene, radar: SceneRadar, scans: Floats) -> list[list[tuple[int, Floats, float]]]:
    """Track number, polar (3,), radial velocity of the plots of each scan, in order of azimuth as an antenna turns."""
    plots: list[list[tuple[int, Floats, float]]] = [[] for _ in scans]
    for number, there, measured in sightings(scene, radar):
        for place in np.flatnonzero(measured.seen):
            plots[there[place]].append((number, measured.polar[place], float(measured.radial_mps[place])))
    clutter, birds, rain = (stream(scene.seed, radar.name, name) for name in ("clutter", "birds", "rain"))
    strewn = [draw_clutter(radar.parameters, scans, clutter)]
    strewn += [draw_birds(radar.parameters, scans, birds), draw_rain(radar.parameters, scans, rain)]
    lost = RadarFaults.of(scene.faults_of(radar.name), scans).lost
    for which, drawn in strewn:
        polar = np.where(lost[which], np.nan, drawn)
        for scan, false_plot in zip(which.tolist(), polar, strict=True):
            if not np.isnan(false_plot).all():
                plots[scan].append((0, false_plot, math.nan))
    for one in plots:
        one.sort(key=lambda plot: (math.isnan(plot[1][1]), plot[1][1], plot[0]))
    return plots
