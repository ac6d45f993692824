"""Dead reckoning on a real flight: every 20 s and every 60 s of it without GPS, beside constant velocity.

python -m sim.studies.real_flight fixed-wing-thor75.mat       (AuraUAS/navigation, MIT)

A small fixed wing, 366 s in the air: an inertial unit at 50 Hz, indicated airspeed, GPS once a second, and the attitude of its
autopilot; all of it, without that attitude, or without the unit. The filter runs once through the flight with GPS; from each
tenth second on it goes on without. What is muted is the reference: its own errors, 3 m, are in the figures.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial import Motion, between, displaced, from_angles
from gateway.reckon.cells import CELL_NS, SECOND_CELLS, cells, covered_until
from gateway.reckon.flying import with_unit
from gateway.reckon.kinds import By, Kinds
from gateway.reckon.running import run
from gateway.reckon.tip import Tip
from gateway.reckon.told import PLACE, WIDTHS, Series, Told
from gateway.reckon.vehicle import first_tip
from gateway.reckon.walking import WANDERS_M
from gateway.settings import DeadReckoning

Floats = NDArray[np.float64]

START = 1_349_870_249_000_000_000
BEGINS_S, FLIES_S, LANDS_S = 90.0, 230.0, 565.0
RADIO_EVERY = 12  # of 50 samples a second
STATED = (3.0, 5.0, 0.5)  # sigmas of this receiver's positions and velocities
SETTINGS = DeadReckoning(refuses=False)


@dataclass(frozen=True, slots=True)
class Windows:
    """Level distances to GPS at the ends of windows without it, m, and within them."""

    length_s: float
    reckoned_m: Floats  # (windows, seconds)
    constant_m: Floats
    inside: Floats

    def sentence(self) -> str:
        """What they come to."""
        ends, others = np.median(self.reckoned_m[:, -1]), np.median(self.constant_m[:, -1])
        whole, other = np.median(self.reckoned_m.mean(axis=1)), np.median(self.constant_m.mean(axis=1))
        return (
            f"{len(self.reckoned_m)} windows of {self.length_s:.0f} s: {ends:.1f} m at the end and {whole:.1f} m over the window "
            f"(medians), constant velocity {others:.0f} and {other:.0f} m: {others / ends:.1f} and {other / whole:.1f} times; "
            f"{100.0 * self.inside.mean():.1f} % within three sigma"
        )


def flight(path: Path, *, attitude: bool = True, unit: bool = True) -> Told:
    """What the aircraft told; without `attitude` only that before it began to fly; without `unit` as a telemetry radio brings
    it: attitude and airspeed four times a second, and what an inertial unit would have told.
    """
    from scipy.io import loadmat

    told = loadmat(str(path), squeeze_me=True, struct_as_record=False)["flight_data"]
    at = START + np.round(told.time * 1e9).astype(np.int64)
    fresh = (np.diff(told.GPS_TOW, prepend=told.GPS_TOW[0]) != 0) & (told.satVisible >= 4)
    velocity = np.stack([told.vn, told.ve, told.vd], axis=1)
    place = np.stack([np.radians(told.lat), np.radians(told.lon), told.alt], axis=1)
    sigmas = np.broadcast_to(STATED, (len(at), 3))
    samples = np.stack([told.ax, told.ay, told.az, told.p, told.q, told.r, np.ones(len(at))], axis=1)
    known = (told.navValid == 0) & (attitude | (told.time < BEGINS_S + 5.0))
    lying = from_angles(told.phi, told.theta, told.psi)
    series = (
        Series(at[1:], samples[1:]),
        Series(at[known], lying[known]),
        Series(at, told.ias[:, None]),
        *(Series.empty(width) for width in WIDTHS[3:]),
    )
    told = Told(series, Series(at[fresh], np.hstack([place, velocity, sigmas])[fresh]))
    if unit:
        return told
    seldom = tuple(Series(one.at[::RADIO_EVERY], one.values[::RADIO_EVERY]) for one in series)
    return with_unit(replace(told, series=seldom), By.AIRSPEED)


def windows(told: Told, length_s: float, every_s: float = 10.0) -> Windows:
    """Every so many seconds of the flight."""
    early = told.places.between(0, START + int(BEGINS_S * 1e9))[1]
    places = told.places
    begin = first_tip(replace(told, places=Series(places.at[:early], places.values[:early])), SETTINGS)
    assert begin is not None
    first = int(begin.cell[0])
    kinds = Kinds.of([1], [told.by])
    (passed,) = run([begin], [cells(told, first, covered_until(told, first))], kinds, SETTINGS)
    starts = [
        tip
        for tip in passed
        if FLIES_S <= _second(tip) <= LANDS_S - length_s
        and int(tip.cell[0]) % SECOND_CELLS == 0
        and (_second(tip) - FLIES_S) % every_s < 1.0
    ]
    alone = replace(told, places=Series.empty(PLACE))
    inputs = [cells(alone, int(tip.cell[0]), int(tip.cell[0]) + round(length_s * SECOND_CELLS)) for tip in starts]
    ways = run(starts, inputs, Kinds.of([1] * len(starts), [told.by] * len(starts)), SETTINGS)
    table = np.array([[scored(one, tip, places) for one in way] for tip, way in zip(starts, ways, strict=True)])
    return Windows(length_s, table[..., 0], table[..., 1], table[..., 2])


def _second(tip: Tip) -> float:
    return (int(tip.cell[0]) * CELL_NS - START) / 1e9


def scored(one: Tip, begin: Tip, places: Series) -> tuple[float, float, float]:
    """Distances to where GPS was, of dead reckoning and of constant velocity, and whether the first is within three sigma."""
    at = int(one.cell[0]) * CELL_NS
    true = np.array([np.interp(at, places.at, places.values[:, column]) for column in range(3)])
    motion = one.state.motion
    here = Motion(
        motion.latitude_rad[0, 0], motion.longitude_rad[0, 0], true[2], motion.velocity_mps[0, 0], motion.attitude[0, 0]
    )
    off = between(true[0], true[1], true[2], here)[:2]
    sigma = np.sqrt(one.state.covariance[0, 0, (0, 1), (0, 1)] + WANDERS_M**2)
    last = int(np.searchsorted(places.at, int(begin.cell[0]) * CELL_NS)) - 1
    known = places.values[last]
    elapsed_s = (at - int(places.at[last])) / 1e9
    latitude, longitude, _ = displaced(known[0], known[1], true[2], known[3:6] * elapsed_s)
    straight = between(true[0], true[1], true[2], replace(here, latitude_rad=latitude, longitude_rad=longitude))[:2]
    is_inside = bool((np.abs(off) <= 3.0 * sigma).all())
    return math.hypot(*off), math.hypot(*straight), float(is_inside)


def main() -> None:
    """Print what the windows come to."""
    for what, attitude, unit in (
        ("with the autopilot's attitude", True, True),
        ("by the unit alone", False, True),
        ("by the autopilot's attitude and airspeed, without the unit", True, False),
    ):
        told = flight(Path(sys.argv[1]), attitude=attitude, unit=unit)
        print(what)
        for length_s in (20.0, 60.0):
            print(f"  {windows(told, length_s).sentence()}")


if __name__ == "__main__":
    main()
