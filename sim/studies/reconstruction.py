"""Paper 002-2's experiment: a flight rebuilt from airspeed, heading and pitch, open and closed.

Flights of an hour in a wind, recorded as a flight recorder does: a sample a second, in steps, with noise. The paper has one
flight without its truth; here the truth is known. Source: 002-2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import flight_path as paths
from gateway.estimators.tied_path import Known, tied
from sim.studies import Progress, Study, Table, silent
from sim.studies.reconstruction_wind import table as windy_table

Floats = NDArray[np.float64]

TAKE_OFF_MPS, LANDING_MPS, CRUISE_MPS = 70.0, 55.0, 160.0
RUNWAY_RAD = math.radians(90.0)
ROLL_S, STEP_S, FLIGHT_S = 30.0, 1.0, 3000.0
FINE_S = 0.05  # of the true motion: a recorder's second holds more than its two ends
WIND_MPS = (12.0, -7.0)
SHORT_M = 1300.0  # how far from lift-off it touches down, where it does not come back to it
STEPS = (0.5, math.radians(0.35), math.radians(0.35))  # of the recorder: m/s, rad, rad
NOISE = (1.0, math.radians(0.5), math.radians(0.5), 20.0)  # and of its sensors: m/s, rad, rad, Pa
AIRSPEED_NOISE_MPS = 6.0  # of the recordings in which sorties are counted


@dataclass(frozen=True, slots=True)
class Flight:
    """What truly was, a sample a second from lift-off to touchdown; metres from lift-off."""

    time_s: Floats
    airspeed_mps: Floats  # true
    compass_rad: Floats
    pitch_rad: Floats
    place_m: Floats  # (n, 3)
    wind_mps: Floats  # (n, 2)

    @property
    def length_m(self) -> float:
        """Of the way over the ground."""
        return float(np.linalg.norm(np.diff(self.place_m[:, :2], axis=0), axis=1).sum())


@dataclass(frozen=True, slots=True)
class Recorded:
    """What the recorder has of it."""

    airspeed_mps: Floats
    compass_rad: Floats
    pitch_rad: Floats
    pressure_pa: Floats


def flight(seed: int, wind_mps: tuple[float, float] = WIND_MPS, angle_of_attack_rad: float = 0.0) -> Flight:
    """A flight with twelve turns at random times, a climb, a cruise and a descent; it ends where it ends."""
    generator = np.random.default_rng(seed)
    time = np.linspace(0.0, FLIGHT_S, round(FLIGHT_S / FINE_S) + 1)
    rates = np.zeros(len(time))
    for begin in generator.uniform(60.0, FLIGHT_S - 120.0, 12):
        turning = (time >= begin) & (time < begin + generator.uniform(20.0, 60.0))
        rates[turning] = generator.choice([-1.0, 1.0]) * 0.03
    compass = RUNWAY_RAD + paths.integrated(time, rates[:, None])[:, 0]
    speed = np.interp(
        time, [0.0, 120.0, FLIGHT_S - 300.0, FLIGHT_S], [TAKE_OFF_MPS, CRUISE_MPS, CRUISE_MPS, LANDING_MPS]
    )
    legs = [0.0, 60.0, 500.0, 560.0, FLIGHT_S - 700.0, FLIGHT_S - 640.0, FLIGHT_S]
    climb = np.interp(time, legs, [0.0, 0.1, 0.1, 0.0, 0.0, -0.07, -0.07])
    wind = np.broadcast_to(np.array(wind_mps), (len(time), 2))
    place = paths.integrated(time, paths.air_velocity(speed, compass, climb) + np.pad(wind, ((0, 0), (0, 1))))
    kept = slice(None, None, round(STEP_S / FINE_S))
    return Flight(time[kept], speed[kept], compass[kept], climb[kept] + angle_of_attack_rad, place[kept], wind[kept])


def recorded(flown: Flight, seed: int | None) -> Recorded:
    """With a seed in steps and with noise, without one exactly."""
    pressure = paths.standard_pressure(flown.place_m[:, 2])
    columns = (flown.airspeed_mps, flown.compass_rad, flown.pitch_rad, pressure)
    if seed is None:
        return Recorded(*columns)
    generator = np.random.default_rng(seed)
    noisy = [
        column + sigma * generator.standard_normal(len(column)) for column, sigma in zip(columns, NOISE, strict=True)
    ]
    stepped = [np.round(column / step) * step for column, step in zip(noisy, STEPS, strict=False)]
    return Recorded(stepped[0], stepped[1], stepped[2], noisy[3])


def through_air(flown: Flight, said: Recorded) -> Floats:
    """The open path (n, 3)."""
    return paths.integrated(flown.time_s, paths.air_velocity(said.airspeed_mps, said.compass_rad, said.pitch_rad))


def off_m(flown: Flight, path_m: Floats) -> float:
    """Level RMS distance to the truth."""
    return math.sqrt(float(np.mean(np.sum((path_m[:, :2] - flown.place_m[:, :2]) ** 2, axis=1))))


def airspeeds(seed: int) -> tuple[Floats, Floats, int]:
    """A recording of several sorties with taxiing and lulls: time s, noisy airspeed m/s, and how many sorties there are."""
    generator = np.random.default_rng(seed)
    count = int(generator.integers(1, 6))
    speed = [np.full(120, 8.0)]
    for _ in range(count):
        long = int(generator.integers(300, 900))
        up, down = np.linspace(8.0, 110.0, 40), np.linspace(110.0, 8.0, 60)
        speed += [
            up,
            110.0 + 15.0 * np.sin(np.arange(long) / 40.0),
            down,
            np.full(int(generator.integers(60, 240)), 8.0),
        ]
    clean = np.concatenate(speed)
    noisy = np.maximum(clean + AIRSPEED_NOISE_MPS * generator.standard_normal(len(clean)), 0.0)
    return np.arange(len(clean), dtype=np.float64), noisy, count


def found(seed: int, *, naive: bool) -> tuple[int, int]:
    """How many sorties are found, by one threshold as printed or by ours, and how many there are."""
    time, speed, count = airspeeds(seed)
    if not naive:
        return len(paths.sorties(time, speed, TAKE_OFF_MPS, LANDING_MPS)), count
    above = speed > TAKE_OFF_MPS
    return int(np.count_nonzero(above[1:] & ~above[:-1])), count


def run(runs: int = 50, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """Closing, height, sorties, heading and fixes. `rrd`: where the flights are drawn, or None."""
    figures: dict[str, float] = {}
    progress("closing", 0.0)
    tables = [_closing(runs, seed, figures)]
    progress("heights", 0.4)
    tables.append(heights(seed, figures))
    progress("sorties", 0.5)
    tables.append(_sorties(runs, seed, figures))
    progress("what closing does not see", 0.7)
    tables.append(_unseen(runs, seed, figures))
    progress("accelerations", 0.8)
    tables.append(windy_table(runs, seed, figures))
    if rrd is not None:
        from sim.studies.reconstruction_figures import draw

        progress("drawing", 0.9)
        draw(rrd, seed)
    return Study("reconstruction", runs, seed, tuple(tables), figures, str(rrd) if rrd else None)


def _closing(runs: int, seed: int, figures: dict[str, float]) -> Table:
    rows = []
    for name, noisy in (("perfect sensors", False), ("steps and noise", True)):
        left: dict[str, list[float]] = {"open": [], "lift-off": [], "true end": [], "wind": [], "end": []}
        for number in range(runs):
            flown = flight(seed + number)
            said = recorded(flown, seed + number if noisy else None)
            path = through_air(flown, said)[:, :2]
            end = flown.place_m[-1, :2]
            path_closed, wind = paths.closed(flown.time_s, path, end)
            # it touched down SHORT_M away from the place on which the path is closed
            wrong, _ = paths.closed(flown.time_s, path, end + np.array([SHORT_M, 0.0]))
            share = 100.0 / flown.length_m
            left["open"].append(off_m(flown, path) * share)
            left["lift-off"].append(off_m(flown, wrong))
            left["true end"].append(off_m(flown, path_closed) * share)
            left["wind"].append(float(np.linalg.norm(wind - flown.wind_mps[0])))
            left["end"].append(float(np.linalg.norm(path_closed[-1] - end)))
        row = {key: max(values) for key, values in left.items()}
        figures |= {f"{name}, {key}": value for key, value in row.items()}
        rows.append((name, row["open"], row["true end"], row["lift-off"], row["wind"], row["end"]))
    columns = ("sensors", "open, %", "closed on its end, %", "closed 1.3 km away, m", "wind, m/s", "end, m")
    title = (
        f"002-2: RMS distance of the path, % of its length: the worst of {runs} flights of {FLIGHT_S / 60:.0f} minutes"
    )
    return Table(title, columns, tuple(rows))


def heights(seed: int, figures: dict[str, float]) -> Table:
    """An angle of attack of 2 degrees is taken for climb."""
    flown = flight(seed, angle_of_attack_rad=math.radians(2.0))
    said = recorded(flown, seed)
    true = flown.place_m[:, 2]
    open_m = through_air(flown, said)[:, 2]
    ended, _ = paths.closed(flown.time_s, open_m[:, None], true[-1:])
    by_pressure = paths.pressure_height(said.pressure_pa, float(paths.standard_pressure(0.0)))
    rows = []
    for name, height in (("pitch, open", open_m), ("pitch, closed", ended[:, 0]), ("pressure", by_pressure)):
        rms = math.sqrt(float(np.mean((height - true) ** 2)))
        figures[f"height by {name}"] = rms
        rows.append((name, rms, float(np.abs(height - true).max())))
    return Table("002-2: height, with an angle of attack of 2 degrees", ("by", "RMS, m", "at most, m"), tuple(rows))


def _sorties(runs: int, seed: int, figures: dict[str, float]) -> Table:
    rows = []
    for name, naive in (("one threshold, as printed", True), ("two, smoothed, a minute at least", False)):
        right = sum(one == true for one, true in (found(seed + number, naive=naive) for number in range(runs)))
        figures[f"sorties right, {'printed' if naive else 'ours'}"] = right
        rows.append((name, right, runs))
    title = f"002-2: recordings in which the number of sorties is right; airspeed noise {AIRSPEED_NOISE_MPS:.0f} m/s"
    return Table(title, ("rule", "right", "of"), tuple(rows))


def _unseen(runs: int, seed: int, figures: dict[str, float]) -> Table:
    """A heading that shows 2 degrees too much, and a wind that doubles."""
    bias = math.radians(2.0)
    left: dict[str, list[float]] = {
        "heading, closed": [],
        "heading, runway": [],
        "wind, closed": [],
        "wind, 4 fixes": [],
    }
    for number in range(runs):
        flown = flight(seed + number)
        said = recorded(flown, seed + number)
        turned = replace(said, compass_rad=said.compass_rad + bias)
        end = flown.place_m[-1, :2]
        share = 100.0 / flown.length_m
        path, _ = paths.closed(flown.time_s, through_air(flown, turned)[:, :2], end)
        left["heading, closed"].append(off_m(flown, path) * share)
        noise = NOISE[1] * np.random.default_rng(seed + number).standard_normal(int(ROLL_S))
        roll = np.round((RUNWAY_RAD + bias + noise) / STEPS[1]) * STEPS[1]
        found_bias, _ = paths.heading_bias(roll, np.linspace(25.0, 69.0, len(roll)), TAKE_OFF_MPS, RUNWAY_RAD)
        straight = replace(turned, compass_rad=turned.compass_rad - found_bias)
        path, _ = paths.closed(flown.time_s, through_air(flown, straight)[:, :2], end)
        left["heading, runway"].append(off_m(flown, path) * share)
        windy = _with_wind(flown)
        path = through_air(windy, said)[:, :2]
        end = windy.place_m[-1, :2]
        left["wind, closed"].append(off_m(windy, paths.closed(windy.time_s, path, end)[0]) * 100.0 / windy.length_m)
        known = np.linspace(0, len(windy.time_s) - 1, 5).astype(int)[1:]
        fixes = Known.places(windy.time_s[known], windy.place_m[known, :2], np.full(4, 5.0))
        left["wind, 4 fixes"].append(off_m(windy, tied(windy.time_s, path, fixes).path_m) * 100.0 / windy.length_m)
    rows = [(name, float(np.median(values)), max(values)) for name, values in left.items()]
    figures |= {name: middle for name, middle, _ in rows}
    title = "002-2: what closing does not see: a heading 2 degrees off, a wind that doubles; % of the length"
    return Table(title, ("case", "median", "worst"), tuple(rows))


def _with_wind(flown: Flight) -> Flight:
    """The same through the air, in a wind that grows from one half to three halves."""
    grown = flown.wind_mps * np.linspace(0.5, 1.5, len(flown.time_s))[:, None]
    more = paths.integrated(flown.time_s, grown - flown.wind_mps)
    return replace(flown, place_m=flown.place_m + np.pad(more, ((0, 0), (0, 1))), wind_mps=grown)
