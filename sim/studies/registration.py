"""Paper 004's experiment: the errors of a radar and a position source, found in three coordinate systems.

Ten points of a straight track at 10 000 m, measured with the page's errors; without noise, as the paper has it, and many times
with noise, beside the Cramer-Rao bound; and geometries that do not tell everything. Source: 004 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.registration import Errors, Method, Pairs, register
from gateway.estimators.registration_frames import SYSTEMS, System, difference, per_metre
from sim.studies import Progress, Study, Table, silent

Floats = NDArray[np.float64]

RADAR = np.array([[0.5688, 1.72795, 50.0]])  # latitude rad, longitude rad, height m
RADAR_ERROR = np.array([500.0, 0.01, 0.01])  # range m, azimuth rad, elevation rad
SOURCE_ERROR = np.array([1e-4, 1e-4, 100.0])  # longitude rad, latitude rad, height m
SMALL_ERROR_M = np.array([10.0, 10.0, 10.0])  # of a source that is worth its prior: east, north, up
RADAR_SIGMA = np.array([50.0, 1e-3, 1e-3])
SOURCE_SIGMA_M = np.array([10.0, 10.0, 15.0])  # east, north, up
FROM_DEG, TO_DEG, HEIGHT_M = (33.20, 98.10), (32.15, 100.05), 10_000.0
POINTS = (10, 100)
ROUNDS = (1, 2, 3)
ALONE = Method(prior_sigma_m=None, robust=False)
NAMES = ("range m", "azimuth mrad", "elevation mrad", "east m", "north m", "height m")


@dataclass(frozen=True, slots=True)
class Case:
    """A flight: where it was, and what a radar and a position source without errors would have said."""

    geodetic: Floats  # (n, 3) longitude rad, latitude rad, height m
    polar: Floats  # (n, 3) range m, azimuth rad clockwise from north, elevation rad

    def measured(
        self, runs: int, seed: int, source_error: Floats = SOURCE_ERROR, radar_error: Floats = RADAR_ERROR
    ) -> Pairs:
        """The pairs of so many runs, (runs, n); of no runs without noise, (n)."""
        count = len(self.polar)
        polar, geodetic = self.polar - radar_error, self.geodetic - source_error
        if runs:
            generator = np.random.default_rng(seed)
            polar = polar + generator.standard_normal((runs, count, 3)) * RADAR_SIGMA
            noise_m = generator.standard_normal((runs, count, 3)) * SOURCE_SIGMA_M
            geodetic = geodetic + noise_m * per_metre(self.geodetic, each=True)
        sigmas = (np.broadcast_to(one, (count, 3)) for one in (RADAR_SIGMA, SOURCE_SIGMA_M))
        radar_sigma, source_sigma_m = sigmas
        return Pairs(RADAR, np.zeros(count, np.intp), polar, radar_sigma, geodetic, source_sigma_m)

    def remaining_m(self, errors: Errors | None, source_error: Floats = SOURCE_ERROR) -> tuple[Floats, Floats]:
        """How far the corrected tracks of source and radar are from the truth, the mean over the points; None: uncorrected."""
        geodetic, polar = self.geodetic - source_error, self.polar - RADAR_ERROR
        if errors is not None:
            geodetic, polar = geodetic + errors.source[..., None, :], polar + errors.radar
        place = np.repeat(RADAR, len(self.polar), axis=0)
        true = difference("ecef", place, self.polar, self.geodetic)
        source = difference("ecef", place, self.polar, geodetic).off - true.off
        radar = difference("ecef", place, polar, self.geodetic).off - true.off
        return np.linalg.norm(source, axis=-1).mean(axis=-1), np.linalg.norm(radar, axis=-1).mean(axis=-1)


def straight(count: int) -> Case:
    """The paper's track: points evenly between two places."""
    latitude, longitude = (np.radians(np.linspace(a, b, count)) for a, b in zip(FROM_DEG, TO_DEG, strict=True))
    return _seen(np.stack([longitude, latitude, np.full(count, HEIGHT_M)], axis=-1))


def around(name: str, count: int = 100) -> Case:
    """A flight that passes abeam, one that flies straight away from the radar, and one that circles it."""
    part = np.linspace(0.0, 1.0, count)
    still = np.zeros(count)
    east, north = {
        "abeam": (still + 20e3, -100e3 + 200e3 * part),
        "radial": (still, 30e3 + 80e3 * part),
        "circle": (60e3 * np.sin(2.0 * math.pi * part), 60e3 * np.cos(2.0 * math.pi * part)),
    }[name]
    middle = np.array([RADAR[0, 1], RADAR[0, 0], HEIGHT_M])
    level = np.stack([east, north, still], axis=-1) * per_metre(middle[None])
    return _seen(middle + level)


def _seen(geodetic: Floats) -> Case:
    place = np.repeat(RADAR, len(geodetic), axis=0)
    polar = difference("polar", place, np.zeros_like(geodetic), geodetic).off
    polar[:, 1] %= 2.0 * math.pi
    return Case(geodetic, polar)


def run(runs: int = 300, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """004's table 1 and figure 3 without noise, the estimates with noise, and what geometry does not tell.

    `rrd`: where figures 2 and 3 are drawn, or None.
    """
    figures: dict[str, float] = {}
    progress("without noise", 0.0)
    tables = [_table_1(figures), _by_rounds(figures)]
    for place, count in enumerate(POINTS):
        progress(f"{count} points, with noise", 0.1 + 0.3 * place)
        tables.append(_noisy(count, runs, seed, figures))
    progress("geometries", 0.7)
    tables.append(_geometries(runs, seed, figures))
    if rrd is not None:
        from sim.studies.registration_figures import draw

        progress("drawing", 0.9)
        draw(rrd)
    return Study("registration", runs, seed, tuple(tables), figures, str(rrd) if rrd else None)


def _table_1(figures: dict[str, float]) -> Table:
    case, rows = straight(10), []
    left = {}
    for system in SYSTEMS:
        found = register(case.measured(0, 0), Method(system, "none", 1, None, robust=False))
        off = np.concatenate([SOURCE_ERROR - found.source, RADAR_ERROR - found.radar[0]])
        left[system] = np.abs(off)
        source_m, radar_m = case.remaining_m(found)
        figures |= {f"printed {system} source": float(source_m), f"printed {system} radar": float(radar_m)}
        shown = off * np.array([1e6, 1e6, 1.0, 1.0, 1e4, 1e4])
        rows.append((system, *shown.tolist(), float(source_m), float(radar_m)))
    names = ("longitude", "latitude", "height", "range", "azimuth", "elevation")
    best = {name: min(SYSTEMS, key=lambda system: left[system][place]) for place, name in enumerate(names)}
    printed = dict.fromkeys(("longitude", "latitude", "azimuth"), "ecef")
    printed |= dict.fromkeys(("height", "range", "elevation"), "geodetic")
    wrong = [f"{name} (here {best[name]})" for name in names if best[name] != printed[name]]
    note = "the print has ECEF best for longitude, latitude and azimuth, geodetic for height, range and elevation: "
    note += f"not so for {', '.join(wrong)}" if wrong else "so it is"
    columns = (
        *("system", "longitude 1e-6", "latitude 1e-6", "height m", "range m", "azimuth 1e-4", "elevation 1e-4"),
        *("source track m", "radar track m"),
    )
    before = case.remaining_m(None)
    title = f"004 table 1: what is left after one round, unweighted (before: {before[0]:.0f} and {before[1]:.0f} m)"
    return Table(title, columns, tuple(rows), (note,))


def _by_rounds(figures: dict[str, float]) -> Table:
    case, rows = straight(10), []
    for weighting in ("none", "whitened"):
        for system in SYSTEMS:
            row: list[str | float] = [f"{system}, {'unweighted' if weighting == 'none' else weighting}"]
            for rounds in ROUNDS:
                found = register(case.measured(0, 0), Method(system, weighting, rounds, None, robust=False))
                source_m, radar_m = (float(one) for one in case.remaining_m(found))
                row.append(f"{source_m:.2g} / {radar_m:.2g}")
                figures[f"{weighting} {system} {rounds}"] = max(source_m, radar_m)
            rows.append(tuple(row))
    columns = ("system", *(f"{rounds} round{'s'[: rounds > 1]}" for rounds in ROUNDS))
    return Table("004 figure 3: what is left of the tracks of source / radar, m, without noise", columns, tuple(rows))


def _noisy(count: int, runs: int, seed: int, figures: dict[str, float]) -> Table:
    case = straight(count)
    pairs = case.measured(runs, seed)
    units = np.concatenate([[1.0, 1e3, 1e3], 1.0 / per_metre(case.geodetic)])
    bound = register(case.measured(0, 0), ALONE).sigma * units
    rows: list[tuple[str | float, ...]] = [("Cramer-Rao bound", *bound.tolist())]
    for system in SYSTEMS:
        found = register(pairs, Method(system, prior_sigma_m=None, robust=False))
        off = np.concatenate([found.radar[:, 0] - RADAR_ERROR, found.source - SOURCE_ERROR], axis=-1) * units
        rms = np.sqrt((off * off).mean(axis=0))
        figures |= {f"{count} {system} {name}": value for name, value in zip(NAMES, rms.tolist(), strict=True)}
        figures[f"{count} {system} worst of bound"] = float((rms / bound).max())
        rows.append((f"{system}, RMS", *rms.tolist()))
    figures |= {f"{count} bound {name}": value for name, value in zip(NAMES, bound.tolist(), strict=True)}
    return Table(f"004: {count} points with noise, {runs} runs", ("", *NAMES), tuple(rows))


def _geometries(runs: int, seed: int, figures: dict[str, float]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for name in ("abeam", "radial", "circle"):
        case = around(name)
        error = SMALL_ERROR_M * per_metre(case.geodetic)
        pairs = case.measured(runs, seed, error)
        free, held = register(pairs, ALONE), register(pairs, Method(robust=False))
        told = register(case.measured(0, 0, error), ALONE)
        hidden = [one.split()[0] for one, seen in zip(NAMES, told.observable.tolist(), strict=True) if not seen]
        left = [_rms(one) for found in (free, held) for one in case.remaining_m(found, error)]
        figures |= {f"{name} condition": float(told.condition), f"{name} hidden": float(len(hidden))}
        figures |= {f"{name} source with prior": left[2], f"{name} radar with prior": left[3]}
        rows.append((name, float(told.condition), ", ".join(hidden) or "-", *left))
    columns = (
        "100 points",
        "condition",
        "not observable",
        "source track m",
        "radar track m",
        "with prior",
        "with prior",
    )
    note = "source off by 10 m an axis; prior 30 m an axis"
    return Table(f"004: what geometry tells, {runs} runs", columns, tuple(rows), (note,))


def _rms(values: Floats) -> float:
    return float(np.sqrt((values * values).mean()))


def of_system(system: System, rounds: int) -> Errors:
    """What is found without noise, as printed, after so many rounds; for the figures."""
    return register(straight(10).measured(0, 0), Method(system, "none", rounds, None, robust=False))
