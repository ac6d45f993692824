"""What faults do to a position source, to a radar and to clocks, over arrays of times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.settings import RadarSite
from sim.earth import offset_geodetic
from sim.faults import (
    ClockJump,
    Fault,
    GpsFrozen,
    GpsLost,
    GpsNoise,
    GpsSpoofed,
    GpsVelocity,
    RadarComponentLost,
    RadarError,
    RadarMoved,
    RadarOff,
)
from sim.sensors import GpsMeasured, PlotsMeasured

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

COMPONENTS = ("range", "azimuth", "elevation")


def clock_error_s(faults: Sequence[Fault], link: str, time_s: ArrayLike) -> Floats:
    """By how much the clock behind a link is ahead at times (...), s."""
    ahead = np.zeros(np.shape(time_s))
    for fault in faults:
        if isinstance(fault, ClockJump) and fault.befalls(link):
            ahead += np.where(fault.lasts(time_s), fault.by_s, 0.0)
    return ahead


def gps_sigma_m(faults: Sequence[Fault], usual_m: float, valid_s: Floats) -> Floats:
    """The noise of positions (n,) an axis, m, of faults that befall the source."""
    sigma = np.full(valid_s.shape, usual_m)
    for fault in faults:
        if isinstance(fault, GpsNoise):
            sigma = np.where(fault.lasts(valid_s), fault.sigma_m, sigma)
    return sigma


def faulty_gps(faults: Sequence[Fault], measured: GpsMeasured) -> GpsMeasured:
    """Reports (n,) as faults that befall the source make them, in the order of the faults."""
    for fault in faults:
        lasts = fault.lasts(measured.valid_s)
        if isinstance(fault, GpsSpoofed):
            measured = _spoofed(fault, lasts, measured)
        elif isinstance(fault, GpsFrozen):
            measured = _frozen(lasts, measured)
        elif isinstance(fault, GpsVelocity):
            told = np.where(lasts[:, None], fault.times * measured.velocity_mps, measured.velocity_mps)
            measured = replace(measured, velocity_mps=told)
        elif isinstance(fault, GpsLost):
            if fault.shows == "silence":
                measured = replace(measured, heard=measured.heard & ~lasts)
            else:  # receivers without a fix tell the last place that they had
                measured = replace(_frozen(lasts, measured), fix=measured.fix & ~lasts)
    return measured


def _spoofed(fault: GpsSpoofed, lasts: Bools, measured: GpsMeasured) -> GpsMeasured:
    since_s = np.where(lasts, measured.valid_s - fault.at_s, 0.0)
    away = np.where(lasts, fault.step_m, 0.0) + fault.walks_mps * since_s
    up = np.where(lasts, fault.step_up_m, 0.0) + fault.climbs_mps * since_s
    east, north = np.sin(fault.compass_rad), np.cos(fault.compass_rad)
    latitude, longitude, height = offset_geodetic(measured, away * east, away * north, up)
    moves = np.array([fault.walks_mps * east, fault.walks_mps * north, fault.climbs_mps])
    velocity = measured.velocity_mps + np.where(lasts[:, None], moves, 0.0)
    return replace(measured, latitude_rad=latitude, longitude_rad=longitude, height_m=height, velocity_mps=velocity)


def _frozen(lasts: Bools, measured: GpsMeasured) -> GpsMeasured:
    """The report before the fault again and again, or its first one where none was before."""
    if not lasts.any():
        return measured
    last = max(int(np.argmax(lasts)) - 1, 0)
    held = {
        name: np.where(lasts, getattr(measured, name)[last], getattr(measured, name))
        for name in ("latitude_rad", "longitude_rad", "height_m")
    }
    velocity = np.where(lasts[:, None], measured.velocity_mps[last], measured.velocity_mps)
    return replace(measured, **held, velocity_mps=velocity)


@dataclass(frozen=True, slots=True)
class RadarFaults:
    """What is wrong with a radar in each of its scans (n,)."""

    off: Bools
    lost: Bools  # (n, 3) range, azimuth, elevation
    error: Floats  # (n, 3) m, rad, rad

    @classmethod
    def of(cls, faults: Sequence[Fault], scans_s: Floats) -> RadarFaults:
        """Of the faults that befall the radar, at the times of its scans."""
        off, lost = np.zeros(len(scans_s), np.bool_), np.zeros((len(scans_s), 3), np.bool_)
        error = np.zeros((len(scans_s), 3))
        for fault in faults:
            lasts = fault.lasts(scans_s)
            if isinstance(fault, RadarOff):
                off |= lasts
            elif isinstance(fault, RadarComponentLost):
                lost |= lasts[:, None] & np.isin(COMPONENTS, fault.components)
            elif isinstance(fault, RadarError):
                wrong = np.array([fault.range_error_m, fault.azimuth_error_rad, fault.elevation_error_rad])
                error += np.where(lasts[:, None], wrong, 0.0)
        return cls(off, lost, error)

    def among(self, scans: NDArray[np.int64]) -> RadarFaults:
        """In some of the scans."""
        return RadarFaults(self.off[scans], self.lost[scans], self.error[scans])

    def leaves(self, measured: PlotsMeasured) -> PlotsMeasured:
        """What is left of plots (n,), one a scan."""
        polar = np.where(self.lost | self.off[:, None], np.nan, measured.polar)
        return PlotsMeasured(polar, np.where(np.isfinite(polar).any(axis=-1), measured.radial_mps, np.nan))


def places(
    radar: RadarSite, faults: Sequence[Fault], time_s: Floats, *, as_told: bool = False
) -> Iterator[tuple[RadarSite, Bools]]:
    """Where a radar stands, in truth or as its status tells, and at which of the times (n,) it stands there."""
    moved = np.zeros((len(time_s), 4))
    for fault in faults:
        if isinstance(fault, RadarMoved) and (fault.status == "new" or not as_told):
            by = np.array([fault.along_m, fault.left_m, fault.up_m, fault.turned_rad])
            moved += np.where(fault.lasts(time_s)[:, None], by, 0.0)
    for offset in np.unique(moved, axis=0):
        along_m, left_m, up_m, turned_rad = offset.tolist()
        there = replace(
            radar,
            along_m=radar.along_m + along_m,
            left_m=radar.left_m + left_m,
            antenna_height_m=radar.antenna_height_m + up_m,
            compass_boresight_rad=radar.compass_boresight_rad + turned_rad,
        )
        yield there, np.all(moved == offset, axis=-1)
