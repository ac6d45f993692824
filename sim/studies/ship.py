"""Paper 002-5's experiments: four autopilots through a turn, wind and waves, three laws of track control across a current.

The ship is the page's: 160 m, 7.7 m/s, K = 0.072 1/s, T = 41.6 s. All draws of one case are one batch of ships.
Source: 002-5 2, 3.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.ships.autopilots import KINDS, Autopilot, Pid, build_autopilot, place_poles
from sim.ships.hull import Hull, Ship, Weather
from sim.ships.track_control import LAWS, Route, TrackControl
from sim.ships.voyage import STEP_S, Sea, Voyage, make_voyage
from sim.ships.waves import Waves
from sim.studies import Found, Progress, Steps, Study, Table, gather, silent

Floats = NDArray[np.float64]

HULL = Hull()
SEA = Waves()
WIND_RAD = math.radians(2.0)
CURRENT_MPS, LOOKAHEAD_M = 1.0, TrackControl().lookahead_m
TRACK_S, TURN_S, WAVES_S = 1800.0, 600.0, 600.0
ON_TRACK_M = 8.0  # a twentieth of the ship's length
STRAIGHT = Route(np.array([[0.0, 0.0], [0.0, 30_000.0]]), reach_m=320.0)
CHANGES_DEG, SPEEDS_MPS = (20.0, 60.0, 90.0, 120.0), (3.0, 5.0, 7.7, 12.0)


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """The page's figures as tables, each of the newer autopilots against the PID, and plots in an .rrd (None: no plots)."""
    from sim.studies import ship_figures

    steps: Steps = (
        ("a turn in calm", turned),
        ("wind", held),
        ("waves", lambda: filtered(runs, seed)),
        ("a cross current", lambda: tracked(runs, seed)),
        ("adaptive", scheduled),
        ("expert", ruled),
    )
    tables, figures = gather(steps, progress)
    if rrd is not None:
        progress("drawing", len(steps) / (len(steps) + 1))
        ship_figures.draw(rrd, seed)
    return Study("ship", runs, seed, tables, figures, str(rrd) if rrd else None)


def autopilot(name: str, told: Waves | None = None) -> Autopilot:
    """One of the four by its kind, or "pd": the PID without its integral."""
    if name != "pd":
        return build_autopilot(name, HULL, told, STEP_S)
    gains = replace(place_poles(HULL.gain_per_s, HULL.lag_s), integral=0.0)
    return replace(build_autopilot("pid", HULL, told, STEP_S), law=Pid(gains, HULL.rudder_limit_rad))


def turn(name: str, change_deg: float, speed_mps: float = HULL.speed_mps, duration_s: float = TURN_S) -> Voyage:
    """One ship that is told another heading, in calm."""
    ship = Ship.under_way((), speed_mps)
    return make_voyage(HULL, ship, autopilot(name), Sea(), duration_s, heading_rad=math.radians(change_deg))


def hold(
    name: str, runs: int, seed: int, waves: Waves | None, told: Waves | None, duration_s: float = WAVES_S
) -> Voyage:
    """Ships (runs,) that hold their heading in wind, and in waves if there are any; the filter is `told` of a sea."""
    ship = Ship.under_way((runs,), HULL.speed_mps)
    sea = Sea.drawn(Weather(WIND_RAD), waves, duration_s, (runs,), seed)
    return make_voyage(HULL, ship, autopilot(name, told), sea, duration_s, heading_rad=0.0)


def track(law: str, runs: int, seed: int, waves: Waves | None, duration_s: float = TRACK_S) -> Voyage:
    """Ships (runs,) that begin on a leg, along it, and meet a current from its left that nobody told them of."""
    ship = Ship.under_way((runs,), HULL.speed_mps)
    weather = Weather(0.0 if waves is None else WIND_RAD, (CURRENT_MPS, 0.0))
    sea = Sea.drawn(weather, waves, duration_s, (runs,), seed)
    control = TrackControl(law)
    return make_voyage(HULL, ship, autopilot("pid", waves), sea, duration_s, route=STRAIGHT, control=control)


def overshoot(voyage: Voyage, change_deg: float) -> float:
    """How far beyond the new heading, as a share of the change."""
    return float(np.degrees(voyage.heading_rad).max() / change_deg - 1.0)


def settled_s(time_s: Floats, off: Floats, band: float) -> float:
    """From when on all of `off` (t, ...) stays within a band, s; infinity if it never does."""
    beyond = np.flatnonzero((np.abs(off) > band).reshape(len(time_s), -1).any(axis=1))
    if not len(beyond):
        return 0.0
    return float(time_s[beyond[-1] + 1]) if beyond[-1] + 1 < len(time_s) else math.inf


def turned() -> Found:
    """A course change of 20 degrees in calm, by each autopilot."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    for name in KINDS:
        voyage = turn(name, 20.0)
        off = np.degrees(voyage.heading_rad) - 20.0
        cells = (
            100.0 * overshoot(voyage, 20.0),
            settled_s(voyage.time_s, off, 1.0),
            _degrees(voyage.rudder_travel_rad),
            *greatest_rudder(voyage),
        )
        rows.append((name, *cells))
        found |= {f"overshoot {name} %": cells[0], f"settled {name} s": cells[1]}
    columns = (
        "20 degrees in calm",
        "overshoot %",
        "within 1 degree after s",
        "rudder travel deg",
        "greatest deg",
        "deg/s",
    )
    return Table("002-5: a course change", columns, tuple(rows)), found


def greatest_rudder(voyage: Voyage) -> tuple[float, float]:
    """The greatest rudder angle, and the fastest that it moved, degrees and degrees/s."""
    rate = np.abs(np.diff(voyage.rudder_rad, axis=0)).max() / STEP_S
    return _degrees(np.abs(voyage.rudder_rad).max()), _degrees(rate)


def held() -> Found:
    """A steady wind that turns as 2 degrees of rudder do, from calm on, by each autopilot and by the PID without integral."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    for name in ("mechanical", "pd", *KINDS[1:]):
        off = np.degrees(hold(name, 1, 1, None, None).heading_rad[:, 0])
        end = float(abs(off[-1]))
        rows.append((name, float(np.abs(off).max()), end))
        found[f"wind {name} deg"] = end
    columns = ("wind of 2 degrees of rudder", "greatest error deg", "error after 600 s deg")
    return Table("002-5: a steady wind", columns, tuple(rows)), found


def filtered(runs: int, seed: int) -> Found:
    """What the waves do to the rudder without and with the filter, also with the sea's frequency told wrongly."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    told = (
        ("no filter", None),
        ("filter", SEA),
        ("filter told 25 % too slow", replace(SEA, peak_radps=0.75 * SEA.peak_radps)),
        ("filter told 25 % too fast", replace(SEA, peak_radps=1.25 * SEA.peak_radps)),
    )
    for name in ("pid", "adaptive", "expert"):
        for how, sea in told if name == "pid" else told[:2]:
            voyage = hold(name, runs, seed, SEA, sea)
            late = voyage.heading_rad[voyage.time_s > 0.5 * WAVES_S]
            travel = _degrees(voyage.rudder_travel_rad.mean()) / WAVES_S * 60.0
            rows.append((f"{name}, {how}", travel, _degrees(np.sqrt(np.square(late).mean())), *greatest_rudder(voyage)))
            found[f"travel {name} {how}"] = travel
    columns = ("waves of 2 degrees, wind", "rudder travel deg/min", "heading RMS deg", "greatest deg", "deg/s")
    return Table(f"002-5: waves, {runs} runs of 10 minutes", columns, tuple(rows)), found


def tracked(runs: int, seed: int) -> Found:
    """Track control across a current of 1 m/s, in calm and in wind and waves."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    for law in LAWS:
        for where, waves in (("calm", None), ("wind, waves", SEA)):
            voyage = track(law, 1 if waves is None else runs, seed, waves)
            late = voyage.right_m[voyage.time_s >= 300.0]
            cells = (
                float(np.sqrt(np.square(voyage.right_m).mean())),
                float(np.sqrt(np.square(late).mean())),
                float(voyage.right_m[voyage.time_s >= 0.5 * TRACK_S].mean()),
                settled_s(voyage.time_s, voyage.right_m, ON_TRACK_M),
            )
            rows.append((f"{law}, {where}", *cells))
            found |= {f"track {law} {where} m": cells[1], f"bias {law} {where} m": cells[2]}
            found[f"on track {law} {where} s"] = cells[3]
    columns = (
        "cross current 1 m/s",
        "RMS of 1800 s m",
        "RMS from 300 s m",
        "mean at last m",
        f"all within {ON_TRACK_M:.0f} m after s",
    )
    notes = (f"theory for los: {los_bias_m():.1f} m",)
    return Table(f"002-5: along a leg, {runs} runs in waves", columns, tuple(rows), notes), found


def los_bias_m() -> float:
    """Where plain line of sight comes to rest: the heading it asks for there is the one that holds the current."""
    return LOOKAHEAD_M * math.tan(math.asin(CURRENT_MPS / HULL.speed_mps))


def scheduled() -> Found:
    """A course change of 20 degrees at other speeds than the one that the PID was placed for."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    for speed in SPEEDS_MPS:
        row: list[str | float] = [f"{speed:g} m/s"]
        for name in ("pid", "adaptive"):
            voyage = turn(name, 20.0, speed, 1.5 * TURN_S)
            over = 100.0 * overshoot(voyage, 20.0)
            after = settled_s(voyage.time_s, np.degrees(voyage.heading_rad) - 20.0, 1.0)
            row += [over, after]
            found |= {f"overshoot {name} at {speed:g} %": over, f"settled {name} at {speed:g} s": after}
        rows.append(tuple(row))
    columns = ("20 degrees", "pid overshoot %", "settled s", "adaptive overshoot %", "settled s")
    return Table("002-5: where the adaptive one wins", columns, tuple(rows)), found


def ruled() -> Found:
    """Course changes in calm by the PID and by the rules."""
    rows: list[tuple[str | float, ...]] = []
    found: dict[str, float] = {}
    for change in CHANGES_DEG:
        row: list[str | float] = [f"{change:g} degrees"]
        for name in ("pid", "expert"):
            voyage = turn(name, change)
            after = settled_s(voyage.time_s, np.degrees(voyage.heading_rad) - change, 1.0)
            row += [100.0 * overshoot(voyage, change), after, _degrees(voyage.rudder_travel_rad)]
            found[f"settled {name} by {change:g} s"] = after
        rows.append(tuple(row))
    one = ("overshoot %", "within 1 degree after s", "rudder travel deg")
    columns = ("course change", *(f"pid {what}" for what in one), *(f"expert {what}" for what in one))
    return Table("002-5: where the expert wins", columns, tuple(rows)), found


def _degrees(angle_rad: float | Floats) -> float:
    return math.degrees(float(angle_rad))
