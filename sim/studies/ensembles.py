"""Cases measured many times at the same instants, as arrays: what a filter is held against, run beside run.

An ensemble is one aircraft. All its runs share the instants of their measurements, so that one batch of the gateway's own
filter follows all of them, and means over the runs can be taken second by second.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RadarFrame, RunwayFrame
from gateway.settings import DEMO_SITE, PositionSource, Site
from sim.cases import case_003
from sim.earth import fly
from sim.paths import CasePath
from sim.radars import RadarSight
from sim.scenes import build_scene
from sim.sensors import gps_phases, gps_times, measure_gps, measure_radar, scan_times, stream
from sim.studies.rmimm import flight

Floats = NDArray[np.float64]

ASSOCIATED_S = 10.0  # a radar's plots count from here on: the gateway has joined them to the aircraft by then
DRONE_MPS, DRONE_TURN_RPS, DRONE_SIGMA_M = 15.0, math.radians(15.0), 2.0
DRONE_LEGS_S = (30.0, 6.0)  # straight, turning by 90 degrees, in turn to the left and to the right


@dataclass(frozen=True, slots=True)
class Step:
    """What every run measured at one instant; NaN = not measured. `radar` 0 is a report, else a plot of that radar."""

    at_s: float
    radar: int
    value: Floats  # (runs, 3) east, north, up m, or range m, azimuth rad, elevation rad
    velocity: Floats  # (runs, 3) of reports
    true_enu_m: Floats  # (3,)


@dataclass(frozen=True, slots=True)
class Ensemble:
    """One aircraft measured in many runs. NEES is taken of the first `axes` of the position, from `since_s` on."""

    name: str
    site: Site
    position: PositionSource  # what the position source is worth: as it is simulated, so that settings are right
    steps: tuple[Step, ...]
    axes: int
    since_s: float

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return len(self.steps[0].value)

    @property
    def frames(self) -> dict[int, RadarFrame]:
        """The radars' frames by number."""
        frame = RunwayFrame(self.site.runway)
        return {radar.number: RadarFrame.of(radar, frame) for radar in self.site.radars}


def approach(runs: int, seed: int) -> Ensemble:
    """003's approach, from 20 s on."""
    case = case_003(runs, seed)
    frame, gps = RunwayFrame(case.site.runway), case.gps
    enu = frame.enu_from_geodetic(gps.latitude_rad, gps.longitude_rad, gps.height_m)
    valid = np.broadcast_to(gps.valid_s, gps.received_s.shape)[0]
    flown = fly(CasePath(), case.site.runway, valid)
    true = frame.enu_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
    nothing = np.full((runs, 3), np.nan)
    steps = [Step(float(at), 0, enu[:, i], nothing, true[i]) for i, at in enumerate(valid)]
    for i, at in enumerate(case.plot_s):
        if at >= ASSOCIATED_S:
            steps.append(
                Step(float(at), case.site.radars[0].number, case.plots.polar[:, i], nothing, case.true_enu_m[i])
            )
    return Ensemble("003's approach", case.site, case.site.position, _in_order(steps), 3, 20.0)


def two_turns(runs: int, seed: int, *, velocity: bool = False) -> Ensemble:
    """000's case, in the plane: a turn to each side, with positions alone or with velocity."""
    flown = flight(runs, seed, velocity=velocity)
    steps = []
    for i, measured in enumerate(flown.measured):
        place, speed = np.full((runs, 3), np.nan), np.full((runs, 3), np.nan)
        place[:, :2] = measured[:, :2]
        if velocity:
            speed[:, :2] = measured[:, 2:]
        steps.append(Step(float(i + 1), 0, place, speed, np.append(flown.position[i], 0.0)))
    name = "000's case, velocity measured" if velocity else "000's case"
    return Ensemble(name, DEMO_SITE, PositionSource(float(flown.sigma[0]), 0.0, 1.0), tuple(steps), 2, 10.0)


def drone(runs: int, seed: int) -> Ensemble:
    """A small drone at 15 m/s that turns by 90 degrees in 6 s, each half minute; positions twice a second, 2 m."""
    time_s = 0.5 * np.arange(1, 441)
    phase = time_s % (2.0 * sum(DRONE_LEGS_S))
    left = (phase >= DRONE_LEGS_S[0]) & (phase < sum(DRONE_LEGS_S))
    right = phase >= DRONE_LEGS_S[0] + sum(DRONE_LEGS_S)
    rate = DRONE_TURN_RPS * (left.astype(float) - right.astype(float))
    course = np.concatenate([[0.0], np.cumsum(0.5 * rate)])
    middle, chord = 0.5 * (course[:-1] + course[1:]), 0.5 * DRONE_MPS * np.sinc(0.25 * rate / math.pi)
    true = np.cumsum(np.stack([chord * np.cos(middle), chord * np.sin(middle), np.zeros_like(chord)], axis=1), axis=0)
    true += [500.0, 500.0, 80.0]
    noise = DRONE_SIGMA_M * stream(seed, "drone").standard_normal((len(time_s), runs, 3))
    nothing = np.full((runs, 3), np.nan)
    steps = [Step(float(at), 0, true[i] + noise[i], nothing, true[i]) for i, at in enumerate(time_s)]
    return Ensemble("a drone at 15 m/s", DEMO_SITE, PositionSource(DRONE_SIGMA_M, 0.0, 0.5), tuple(steps), 3, 10.0)


def traffic(runs: int, seed: int) -> list[Ensemble]:
    """Every aircraft of the scene `traffic`, from its first report on; the scene is the same in all runs, the noise is not."""
    scene = build_scene("traffic", start_ns=0, seed=seed)
    frame, gps = RunwayFrame(scene.site.runway), scene.gps
    position = PositionSource(gps.sigma_m, math.sqrt(3.0) * gps.error_sigma_m, gps.velocity_sigma_mps)
    found = []
    for aircraft in scene.aircraft:
        start, end = scene.present(aircraft)
        generator = stream(seed, "ensemble", aircraft.system)
        valid = gps_times(gps, start, end, gps_phases(gps, generator))
        if not len(valid):
            continue
        flown = scene.flown(aircraft, valid)
        measured = measure_gps(gps, np.broadcast_to(valid, (runs, len(valid))), flown, generator)
        enu = frame.enu_from_geodetic(measured.latitude_rad, measured.longitude_rad, measured.height_m)
        true = frame.enu_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
        turned = frame.local_from_enu(flown.latitude_rad, flown.longitude_rad)
        velocity = np.einsum("nji,rnj->rni", turned, measured.velocity_mps)
        steps = [Step(float(at), 0, enu[:, i], velocity[:, i], true[i]) for i, at in enumerate(valid)]
        for radar in scene.radars:
            scans = scan_times(radar.parameters, 0.0, scene.duration_s)
            scans = scans[(scans >= valid[0] + ASSOCIATED_S) & (scans < end)]
            flown = scene.flown(aircraft, scans)
            seen, speed = RadarSight(scene.site, radar.site).see(flown)
            draws = stream(seed, "ensemble", radar.name, aircraft.system)
            plots = measure_radar(radar.parameters, scans, seen, speed, draws, (runs,))
            true = frame.enu_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
            nothing = np.full((runs, 3), np.nan)
            for i in np.flatnonzero(plots.seen.any(axis=0)):
                steps.append(Step(float(scans[i]), radar.site.number, plots.polar[:, i], nothing, true[i]))
        found.append(
            Ensemble(f"traffic: {aircraft.kind} {aircraft.system}", scene.site, position, _in_order(steps), 3, start)
        )
    return found


def _in_order(steps: list[Step]) -> tuple[Step, ...]:
    return tuple(sorted(steps, key=lambda step: (step.at_s, step.radar)))
