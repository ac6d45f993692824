"""Paper 000's second experiment: to which point a flight goes, and where it will be in 10 to 120 s.

`literal` and `default` on the same draws, beside the filter without intent and with the point known (`intents`).
Source: 000, 2.2, 2.3 and 3, figures 4 to 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from sim.studies import Progress, Study, Table, silent
from sim.studies import rmimm as case
from sim.studies.intents import (
    HORIZONS_S,
    VARIANTS,
    Followed,
    Method,
    Origins,
    Points,
    candidates,
    errors_m,
    right,
    rms_m,
    variant,
)
from sim.studies.prediction_honesty import honesty
from sim.studies.rmimm import Flight

MISSION_EACH, MISSIONS_AT_MOST = 25, 12  # of so many runs; each is flown for ten minutes


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """000's tables of intent, delay and prediction. `rrd`: where figures 4 to 10 are drawn, or None."""
    flown = case.flight(runs, seed)
    points = candidates(flown)
    found: dict[str, Followed] = {}
    for place, (name, *_) in enumerate(VARIANTS):
        progress(name, place / (len(VARIANTS) + 2))
        found[name] = variant(name, flown, points)
    progress("predictions", 0.7)
    figures: dict[str, float] = {}
    tables = (_intents(found, figures), _filters(found, flown, figures), *_predictions(found, flown, points, figures))
    progress("missions", 0.8)
    sigmas, within = honesty(max(min(runs // MISSION_EACH, MISSIONS_AT_MOST), 1), seed)
    figures |= within
    tables = (*tables, sigmas)
    if rrd is not None:
        from sim.studies.prediction_figures import draw

        progress("drawing", 0.9)
        draw(rrd, flown, points, found)
    return Study("prediction", runs, seed, tables, figures, str(rrd) if rrd else None)


def _intents(found: Mapping[str, Followed], figures: dict[str, float]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for name in ("literal", "default"):
        shares = [100.0 * right(found[name], leg) for leg in range(3)]
        figures |= {f"right {name}, leg {leg + 1}": share for leg, share in enumerate(shares)}
        rows.append((name, *shares))
    notes = ("the believed point is the one flown to: share of all seconds of a leg, from its first on",)
    return Table("000: intent, % right", ("rule", "leg 1", "leg 2", "leg 3"), tuple(rows), notes)


def _filters(found: Mapping[str, Followed], flown: Flight, figures: dict[str, float]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for name, one in found.items():
        reached = case.reached(flown, one.tracks)
        figures |= {f"position {name}": reached.position_m, f"velocity {name}": reached.velocity_mps}
        figures |= {
            f"delay {name} {since}": late for (since, _), late in zip(case.LEGS[1:], reached.delay_s, strict=True)
        }
        separation = (min(reached.separation), max(reached.separation))
        rows.append((name, reached.position_m, reached.velocity_mps, *separation, *reached.delay_s))
    columns = ("variant", "position RMSE m", "velocity m/s", "separation, least", "greatest")
    return Table(
        "000: what intent does to the filter", (*columns, "delay s at 100", "200", "300", "350"), tuple(rows), FED
    )


FED = (
    "RMIMM: the default filter without intent; default: with the inferred point fed back; known point: with the true one",
    "literal: the printed filter and the printed inference; literal, known point: with the true one fed back to it",
)
WHERE: dict[Origins, str] = {
    "turns": "from inside the turns, from 10 s on",
    "straights": "on settled straights",
    "all": "from everywhere",
}


def _predictions(
    found: Mapping[str, Followed], flown: Flight, points: Points, figures: dict[str, float]
) -> tuple[Table, ...]:
    kinds: tuple[tuple[str, str, Method], ...] = (
        ("likeliest mode held", "RMIMM", "likeliest mode"),
        ("straight on", "RMIMM", "straight on"),
        ("known point, literal", "RMIMM", "known point, literal"),
        ("known point, default", "RMIMM", "known point"),
        ("inferred, literal", "literal", "inferred, literal"),
        ("inferred, default", "RMIMM", "inferred"),
        ("inferred and fed back", "default", "inferred"),
    )
    off_m = {name: errors_m(found[of], flown, points, method) for name, of, method in kinds}
    tables = []
    for which, where in WHERE.items():
        rows: list[tuple[str | float, ...]] = []
        for name in off_m:
            off = rms_m(off_m[name], which)
            figures |= {f"{which}, {name}, {horizon} s": value for horizon, value in zip(HORIZONS_S, off, strict=True)}
            rows.append((name, *off))
        columns = ("method", *(f"{horizon} s" for horizon in HORIZONS_S))
        tables.append(Table(f"000: prediction {where}, RMS m", columns, tuple(rows)))
    return tuple(tables)
