"""Dead reckoning as the gateway runs it: how soon false positions are denied, that good ones are not, and whether its sigma is
honest. Cars, aeroplanes, and vehicles of which nothing more is known, side by side; and copters and boats.
Source: 002-4, in the gateway.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import between, displaced
from gateway.reckon.cells import CELL_NS, cells, covered_until
from gateway.reckon.kinds import Kinds
from gateway.reckon.running import begun, run
from gateway.reckon.tip import NOTHING, Tip
from gateway.reckon.told import PLACE, WIDTHS, Series, Told
from gateway.reckon.walking import WANDERS_M
from gateway.settings import DeadReckoning
from sim.inertial import Errors, Ride, aeroplane, car
from sim.studies import Progress, Table, silent
from sim.told_rides import TENTH_NS, Falsified, Teller, honest
from sim.unheld_rides import MOTOR, ROTORS, boat, copter

Floats = NDArray[np.float64]
Kinded = Sequence[tuple[int, Callable[[np.random.Generator, float], Ride]]]
"""Of each kind its MAV_TYPE, and what makes a ride of it."""

START = 1_700_000_000_000_000_000
FALSE_FROM_S, FALSE_FOR_S = 100.0, 40.0
OUTAGE_S = 60.0
CLEAN_S = 900.0
KINDS = ((10, car), (1, aeroplane), (2, aeroplane))  # the last tells inertial data only, as a copter does
TELL_WALKS = KINDS[:2]
UNHELD: Kinded = ((2, copter), (11, boat))
SHAKEN: Mapping[object, Errors] = {copter: ROTORS, boat: MOTOR}


def step(time_s: float) -> tuple[float, float, float, float]:
    """50 m to the side."""
    return (30.0, 40.0, 0.0, 0.0) if time_s > FALSE_FROM_S else (0.0, 0.0, 0.0, 0.0)


def walk(time_s: float) -> tuple[float, float, float, float]:
    """2 m/s to the side, and velocities to match."""
    gone_s = max(time_s - FALSE_FROM_S, 0.0)
    return 1.2 * gone_s, 1.6 * gone_s, 1.2 * (gone_s > 0.0), 1.6 * (gone_s > 0.0)


def silent_walk(time_s: float) -> tuple[float, float, float, float]:
    """The same, with velocities that say nothing of it."""
    return (*walk(time_s)[:2], 0.0, 0.0)


def gone(time_s: float) -> tuple[float, float, float, float] | None:
    """Nothing is told any more."""
    return None if time_s > FALSE_FROM_S else (0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Ran:
    """Vehicles, and their dead reckoning at whole seconds."""

    tellers: Sequence[Teller]
    tips: Sequence[Sequence[Tip]]

    def denied_after_s(self) -> list[float]:
        """Of each vehicle, how long after positions are false they are denied first; infinite: not at all."""
        return [
            min((_second(tip) - FALSE_FROM_S for tip in tips if tip.denied[0] != NOTHING), default=math.inf)
            for tips in self.tips
        ]

    def inside(self) -> tuple[float, float]:
        """Of the seconds without positions the share with both axes within three sigma; the median error at their end, m."""
        inside, ends = [], []
        for teller, tips in zip(self.tellers, self.tips, strict=True):
            off = 0.0
            for tip in (one for one in tips if _second(one) > FALSE_FROM_S + 1.0):
                north, east = _off_m(teller, tip)
                sigma = np.sqrt(tip.state.covariance[0, 0, (0, 1), (0, 1)] + WANDERS_M**2)
                inside.append(abs(north) <= 3.0 * sigma[0] and abs(east) <= 3.0 * sigma[1])
                off = math.hypot(north, east)
            ends.append(off)
        return float(np.mean(inside)), float(np.median(ends))


def ran(vehicles: int, seed: int, length_s: float, falsified: Falsified, kinds: Kinded = KINDS) -> Ran:
    """Vehicles of some kinds, each on a ride of its own."""
    tellers = []
    for number in range(vehicles):
        generator = np.random.default_rng([seed, number])
        vehicle_type, kind = kinds[number % len(kinds)]
        ride, errors = kind(generator, length_s), SHAKEN.get(kind, Errors())
        tellers.append(Teller.of(f"mavlink:{number + 1}", vehicle_type, ride, generator, falsified, errors))
    return reckoned(tellers)


def reckoned(tellers: Sequence[Teller]) -> Ran:
    """Their dead reckoning from the first second on."""
    told = [told_of(one) for one in tellers]
    settings = DeadReckoning()
    first = [begun(int(one.places.at[9]), one.places.values[9], one.series[1].values[9], settings) for one in told]
    inputs = [
        cells(one, int(tip.cell[0]), covered_until(one, int(tip.cell[0]))) for one, tip in zip(told, first, strict=True)
    ]
    return Ran(tellers, run(first, inputs, Kinds.of([one.vehicle_type for one in tellers]), settings))


def told_of(one: Teller) -> Told:
    """What a vehicle tells on its whole ride: its unit at 50 Hz, the rest ten times a second."""
    per = round(0.1 / float(one.ride.time_s[1]))
    steps = TENTH_NS // per
    middle = START + steps // 2 + steps * np.arange(len(one.rate_radps))
    unit = np.hstack([one.force_mps2, one.rate_radps, np.ones((len(middle), 1))])
    places = np.arange(1, len(one.off_m))
    at, rows = START + TENTH_NS * places, per * places
    motion = one.ride.motion
    false = [one.falsified(float(place) / 10.0) for place in places]
    known = np.array([each is not None for each in false])
    wrong = np.array([(0.0,) * 4 if each is None else each for each in false])
    level = np.zeros((len(places), 1))
    off = one.off_m[places] + np.hstack([wrong[:, :2], level])
    there = displaced(motion.latitude_rad[rows], motion.longitude_rad[rows], motion.height_m[rows], off)
    velocity = motion.velocity_mps[rows] + one.off_mps[places] + np.hstack([wrong[:, 2:], level])
    sigmas = np.broadcast_to(np.array([1.5, 2.0, 1.0]), (len(places), 3))
    position = np.hstack([np.stack(there, axis=1), velocity, sigmas])
    assert position.shape[1] == PLACE
    air = Series.empty(WIDTHS[2])
    if one.airspeed_mps is not None:
        air = Series(at, one.airspeed_mps[rows][:, None])
    rest = (Series.empty(width) for width in WIDTHS[3:])
    series = (Series(middle, unit), Series(at, one.attitude[rows]), air, *rest)
    return replace(Told(series), places=Series(at[known], position[known]))


def _second(tip: Tip) -> float:
    return (int(tip.cell[0]) * CELL_NS - START) / 1e9


def _off_m(teller: Teller, tip: Tip) -> tuple[float, float]:
    """North and east from where dead reckoning has a vehicle to where it is."""
    place = min(round(_second(tip) * 50.0), len(teller.ride.time_s) - 1)
    motion, state = teller.ride.motion, tip.state.motion
    here = replace(
        state,
        latitude_rad=state.latitude_rad[0, 0],
        longitude_rad=state.longitude_rad[0, 0],
        height_m=state.height_m[0, 0],
    )
    off = between(motion.latitude_rad[place], motion.longitude_rad[place], motion.height_m[place], here)
    return float(off[0]), float(off[1])


def table(vehicles: int, seed: int, figures: dict[str, float], progress: Progress = silent) -> Table:
    """False positions, and as many hours of good ones as vehicles are quarters."""
    rows: list[tuple[str | float, ...]] = []
    length_s = FALSE_FROM_S + FALSE_FOR_S
    for name, falsified, kinds in (
        ("a step of 50 m", step, KINDS),
        ("2 m/s", walk, KINDS),
        ("2 m/s, velocities true", silent_walk, TELL_WALKS),
        ("copters: 2 m/s", walk, UNHELD[:1]),
        ("boats: 2 m/s", walk, UNHELD[1:]),
        ("copters and boats: 2 m/s, velocities true", silent_walk, UNHELD),
    ):
        progress(f"false positions: {name}", 0.9)
        after_s = ran(vehicles, seed, length_s, falsified, kinds).denied_after_s()
        figures |= {f"denied, {name}, median": float(np.median(after_s)), f"denied, {name}, last": max(after_s)}
        never = sum(map(math.isinf, after_s))
        figures[f"denied, {name}, %"] = 100.0 * (1.0 - never / vehicles)
        rows.append((name, vehicles, float(np.median(after_s)), max(after_s), never))
    for name, kinds in (("good", KINDS), ("copters and boats: good", UNHELD)):
        progress(f"positions: {name}", 0.92)
        clean = ran(2 * vehicles, seed + 1, CLEAN_S, honest, kinds)
        denied = sum(not math.isinf(one) for one in clean.denied_after_s())
        hours = 2 * vehicles * CLEAN_S / 3600.0
        figures |= {f"{name}, hours": hours, f"{name}, denied": float(denied)}
        rows.append((f"{name}, {hours:.0f} hours", 2 * vehicles, math.nan, math.nan, 2 * vehicles - denied))
    progress("no positions", 0.97)
    inside, end_m = ran(vehicles, seed, FALSE_FROM_S + OUTAGE_S, gone).inside()
    figures |= {"live, inside": 100.0 * inside, "live, at 60": end_m}
    title = (
        f"as the gateway runs it; without positions for {OUTAGE_S:.0f} s it is {end_m:.0f} m off at their end, "
        f"and {100.0 * inside:.1f} % of the seconds are within three sigma"
    )
    return Table(title, ("positions", "vehicles", "denied after, s", "the last", "never denied"), tuple(rows))
