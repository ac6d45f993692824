"""Paper 002-4's experiment: dead reckoning through 199 s without GPS, on the ground and in the air.

A minute with GPS once a second, then none. All runs at once: a run is a leading axis. Source: 002-4 4.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators import inertial as ins
from gateway.estimators import plane_reckoning as plane
from gateway.estimators.inertial import Motion
from sim.inertial import Errors, Ride, aeroplane, car, measured
from sim.studies import Progress, Study, Table, denial, silent

Floats = NDArray[np.float64]

GPS_M, GPS_MPS = 1.5, 0.15
ATTITUDE_RAD = (math.radians(0.5), math.radians(0.5), math.radians(1.0))  # of the autopilot, and it lasts
ATTITUDE_LASTS_S, ATTITUDE_HZ = 30.0, 10.0
AIRSPEED_MPS = 0.5
MARKS_S = (20, 60, 199)
UNIT = dr.Unit(
    rate_noise=math.radians(0.02),
    force_noise=0.01,
    rate_bias_radps=math.radians(0.05),
    force_bias_mps2=0.05,
    wind_wanders=0.12,
)


@dataclass(frozen=True, slots=True)
class Plan:
    """How long GPS tells, how long it does not, whole seconds; how often the unit does, a multiple of `ATTITUDE_HZ`."""

    with_gps_s: int = 60
    without_s: int = 199
    rate_hz: int = 50


@dataclass(frozen=True, slots=True)
class Rides:
    """Many rides beside each other: what truly was (runs, n), and what was told of it."""

    plan: Plan
    time_s: Floats
    truth: Motion
    wind_mps: Floats
    rate_radps: Floats
    force_mps2: Floats
    gps_m: Floats  # errors (runs, seconds, 3)
    gps_mps: Floats
    attitude: Floats  # as the autopilot has it (runs, n, 4)
    airspeed_mps: Floats


def rides(kind: Callable[..., Ride], runs: int, seed: int, plan: Plan = Plan(), errors: Errors = Errors()) -> Rides:
    """Rides of a kind with their measurements."""
    whole = plan.with_gps_s + plan.without_s
    truths: list[Ride] = []
    told: list[tuple[Floats, ...]] = []
    for number in range(runs):
        generator = np.random.default_rng([seed, number])
        one = kind(generator, float(whole), float(plan.rate_hz))
        count = len(one.time_s)
        rate, force = measured(one, errors, generator)
        places, velocities = (sigma * generator.standard_normal((whole + 1, 3)) for sigma in (GPS_M, GPS_MPS))
        attitude = ins.product(ins.turned_by(_lasting(generator, count, plan.rate_hz)), one.motion.attitude)
        truths.append(one)
        told.append((rate, force, places, velocities, attitude, AIRSPEED_MPS * generator.standard_normal(count)))
    names = ("latitude_rad", "longitude_rad", "height_m", "velocity_mps", "attitude")
    truth = Motion(*(np.stack([getattr(one.motion, name) for one in truths]) for name in names))
    wind = np.stack([one.wind_mps for one in truths])
    through = truth.velocity_mps - np.concatenate([wind, np.zeros((*wind.shape[:2], 1))], axis=-1)
    *rest, airspeed = (np.stack(column) for column in zip(*told, strict=True))
    rate, force, places, velocities, attitude = rest
    airspeed = np.linalg.norm(through, axis=-1) + airspeed
    return Rides(plan, truths[0].time_s, truth, wind, rate, force, places, velocities, attitude, airspeed)


def _lasting(generator: np.random.Generator, count: int, rate_hz: int) -> Floats:
    """Errors of an autopilot's attitude (count, 3), about north, east, down: they last."""
    keep = math.exp(-1.0 / (ATTITUDE_LASTS_S * rate_hz))
    shaken = generator.standard_normal((count, 3)) * math.sqrt(1.0 - keep * keep)
    shaken[0] = generator.standard_normal(3)
    errors = np.empty((count, 3))
    level = np.zeros(3)
    for place in range(count):
        level = keep * level + shaken[place] if place else shaken[0]
        errors[place] = level
    return np.asarray(errors * np.array(ATTITUDE_RAD))


def at(motion: Motion, place: int) -> Motion:
    """One instant of all runs."""
    return Motion(
        motion.latitude_rad[:, place],
        motion.longitude_rad[:, place],
        motion.height_m[:, place],
        motion.velocity_mps[:, place],
        motion.attitude[:, place],
    )


@dataclass(frozen=True, slots=True)
class Outcome:
    """Level distance to the truth (runs, samples) from the last position on, once a second, and the claimed 1 sigma an axis."""

    error_m: Floats
    sigma_m: Floats
    inside: Floats  # (runs, samples) whether both axes are within three sigma


def error_state(
    of: Rides, *, attitude: bool = True, airspeed: bool = False, wind: bool = True, wheels: bool = False
) -> Outcome:
    """The error-state filter, with what the vehicle's kind allows."""
    truth, rate_hz = of.truth, of.plan.rate_hz
    first = at(truth, 0)
    start = Motion(first.latitude_rad, first.longitude_rad, first.height_m, first.velocity_mps, of.attitude[:, 0])
    state = dr.started(start, GPS_M, GPS_MPS, np.array(ATTITUDE_RAD), UNIT)
    if not wind:
        covariance = state.covariance.copy()
        covariance[..., dr.WIND, :] = covariance[..., :, dr.WIND] = 0.0
        state = dr.Reckoning(state.motion, state.rate_bias_radps, state.force_bias_mps2, state.wind_mps, covariance)
    unit = UNIT if wind else dr.Unit(**{name: getattr(UNIT, name) for name in _KEPT}, wind_wanders=0.0)
    # an error that lasts for so many samples tells as much as one sample of it in that time
    lasting = np.array(ATTITUDE_RAD) * math.sqrt(2.0 * ATTITUDE_LASTS_S * ATTITUDE_HZ)
    errors, sigmas, inside = [], [], []
    for place in range(1, len(of.time_s)):
        state = dr.carried_on(state, of.rate_radps[:, place - 1], of.force_mps2[:, place - 1], 1.0 / rate_hz, unit)
        if place % round(rate_hz / ATTITUDE_HZ) == 0:
            if attitude:
                state, _ = dr.with_attitude(state, of.attitude[:, place], lasting)
            if airspeed:
                state, _ = dr.with_airspeed(state, of.airspeed_mps[:, place], 2.0 * AIRSPEED_MPS, 1.0)
            if wheels:
                state, _ = dr.with_wheels(state, np.array([0.2, 0.2]))
        if place % rate_hz:
            continue
        second = place // rate_hz
        here = at(truth, place)
        if second <= of.plan.with_gps_s:
            told = ins.displaced(here.latitude_rad, here.longitude_rad, here.height_m, of.gps_m[:, second])
            state, _ = dr.with_place(state, *told, GPS_M)
            state, _ = dr.with_velocity(state, here.velocity_mps + of.gps_mps[:, second], GPS_MPS)
        if second >= of.plan.with_gps_s:
            off = ins.between(here.latitude_rad, here.longitude_rad, here.height_m, state.motion)[:, :2]
            sigma = np.sqrt(np.diagonal(state.covariance, axis1=-2, axis2=-1)[:, :2])
            errors.append(np.linalg.norm(off, axis=-1))
            sigmas.append(np.sqrt(np.mean(sigma**2, axis=-1)))
            inside.append(np.all(np.abs(off) <= 3.0 * sigma, axis=-1))
    return Outcome(*(np.stack(one, axis=-1) for one in (errors, sigmas, inside)))


_KEPT = (
    "rate_noise",
    "force_noise",
    "rate_bias_radps",
    "force_bias_mps2",
    "rate_bias_wanders",
    "force_bias_wanders",
    "wind_mps",
)


def literal(of: Rides, *, corrected: bool) -> Outcome:
    """As printed, six states in the plane: the attitude by the gyro alone in the outage, or, `corrected`, the autopilot's."""
    truth, rate_hz = of.truth, of.plan.rate_hz
    noise = plane.Noise()
    runs = len(of.rate_radps)
    begin = at(truth, 0)
    state = np.zeros((runs, 6))
    state[:, [1, 4]] = begin.velocity_mps[:, :2]
    now = plane.Plane(state, np.broadcast_to(np.diag([9.0, 1.0, 1.0, 9.0, 1.0, 1.0]), (runs, 6, 6)))
    attitude = of.attitude[:, 0]
    errors = []
    for place in range(1, len(of.time_s)):
        here = at(truth, place)
        rate, force = of.rate_radps[:, place - 1], of.force_mps2[:, place - 1]
        level = np.concatenate([now.state[:, [1, 4]], np.zeros((runs, 1))], axis=-1)
        was = Motion(here.latitude_rad, here.longitude_rad, here.height_m, level, attitude)
        if corrected or place <= of.plan.with_gps_s * rate_hz:
            attitude = of.attitude[:, place]
        else:
            attitude = plane.attitude_after(was, rate, 1.0 / rate_hz)
        turned = Motion(here.latitude_rad, here.longitude_rad, here.height_m, level, attitude)
        now = plane.predicted(now, 1.0 / rate_hz, noise)
        about_down = ins.rotate(attitude, rate)[:, 2]
        now = plane.with_inertial(now, about_down, plane.acceleration(turned, force), noise)
        if place % rate_hz:
            continue
        second = place // rate_hz
        true = ins.between(here.latitude_rad, here.longitude_rad, here.height_m, begin)[:, :2]
        if second <= of.plan.with_gps_s:
            now = plane.with_place(now, true + of.gps_m[:, second, :2], noise)
        if second >= of.plan.with_gps_s:
            errors.append(np.linalg.norm(now.state[:, [0, 3]] - true, axis=-1))
    off = np.stack(errors, axis=-1)
    return Outcome(off, np.full(off.shape, math.nan), np.full(off.shape, math.nan))


def constant_velocity(of: Rides) -> Outcome:
    """On with the last velocity that GPS told."""
    second, rate_hz = of.plan.with_gps_s, of.plan.rate_hz
    last = at(of.truth, second * rate_hz)
    errors = []
    for later in range(of.plan.without_s + 1):
        here = at(of.truth, (second + later) * rate_hz)
        true = ins.between(here.latitude_rad, here.longitude_rad, here.height_m, last)[:, :2]
        velocity = last.velocity_mps[:, :2] + of.gps_mps[:, second, :2]
        errors.append(np.linalg.norm(of.gps_m[:, second, :2] + velocity * later - true, axis=-1))
    off = np.stack(errors, axis=-1)
    return Outcome(off, np.full(off.shape, math.nan), np.full(off.shape, math.nan))


GROUND: dict[str, Callable[[Rides], Outcome]] = {
    "constant velocity": constant_velocity,
    "literal, attitude by the gyro": lambda of: literal(of, corrected=False),
    "literal, the autopilot's attitude": lambda of: literal(of, corrected=True),
    "error states, no attitude": lambda of: error_state(of, attitude=False),
    "error states": error_state,
    "error states, wheels": lambda of: error_state(of, wheels=True),
}
AIR: dict[str, Callable[[Rides], Outcome]] = {
    "constant velocity": constant_velocity,
    "error states": error_state,
    "error states, airspeed, no wind": lambda of: error_state(of, airspeed=True, wind=False),
    "error states, airspeed, wind held": lambda of: error_state(of, airspeed=True),
}


def run(runs: int = 20, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """The page's table: a car and an aeroplane. `rrd`: where errors over time are drawn, or None."""
    figures: dict[str, float] = {}
    found: dict[str, dict[str, Outcome]] = {}
    tables = []
    total, done = len(GROUND) + len(AIR), 0
    for name, kind, methods in (("car", car, GROUND), ("aeroplane", aeroplane, AIR)):
        progress(f"{name}: rides", done / total)
        of = rides(kind, runs, seed)
        found[name] = {}
        for method, reckon in methods.items():
            progress(f"{name}: {method}", done / total)
            found[name][method] = reckon(of)
            done += 1
        tables.append(_table(name, found[name], figures))
    tables.append(denial.table(runs, seed, figures, progress))
    if rrd is not None:
        from sim.studies.dead_reckoning_figures import draw

        draw(rrd, found)
    return Study("dead-reckoning", runs, seed, tuple(tables), figures, str(rrd) if rrd else None)


def _table(name: str, found: dict[str, Outcome], figures: dict[str, float]) -> Table:
    rows = []
    for method, outcome in found.items():
        off = outcome.error_m
        twenty = off[:, 1:21].mean(axis=1)
        row: list[str | float] = [method, float(np.mean(twenty)), float(np.max(twenty))]
        row += [float(np.median(off[:, mark])) for mark in MARKS_S]
        row += [float(np.max(off[:, -1])), 100.0 * float(np.mean(outcome.inside))]
        rows.append(tuple(row))
        figures |= {
            f"{name}, {method}, {heading}": float(value)
            for heading, value in zip(
                ("mean 20", "worst 20", "at 20", "at 60", "at 199", "worst 199", "inside"), row[1:], strict=True
            )
        }
    columns = (
        "without GPS",
        "mean of 20 s, m",
        "worst run",
        "at 20 s",
        "at 60 s",
        "at 199 s",
        "worst run",
        "in 3 sigma, %",
    )
    return Table(f"002-4: level distance to the truth, a {name}; medians at their times", columns, tuple(rows))
