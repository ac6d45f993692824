"""What a radar's unnumbered plots are thought to be after a scan, for people: places in the runway frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Plot
from gateway.frames import RadarFrame, RunwayFrame, turn, xyz_from_polar
from gateway.track.unnumbered import Watch

Floats = NDArray[np.float64]

SHOWN_AT_MOST = 300  # hypotheses, the likeliest


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A radar's n hypotheses, the likeliest first, and the p plots that confirmed tracks took."""

    radar: int
    at: int  # ns
    runway_m: Floats  # (n, 3)
    likelihood: Floats  # (n,) that there is a target, and that this is where it is
    track: tuple[str, ...]  # (n,) "1/100001" of the likeliest hypothesis of a confirmed track, else ""
    taken_m: Floats  # (p, 3) NaN where a component was not measured


def look_of(watch: Watch, radar: int, told: list[Plot], seen_from: RadarFrame, frame: RunwayFrame) -> Look:
    """What a watch knows now, and which plots were just told."""
    bank, _ = watch.newest
    axes = len(bank.mean) // 2
    likelihood = bank.weight * bank.existence[bank.family]
    order = np.argsort(-likelihood, kind="stable")[:SHOWN_AT_MOST]
    names = np.full(len(bank), "", dtype=object)
    best = bank.best
    for family in np.flatnonzero(bank.confirmed).tolist():
        number = watch.numbers.get(int(bank.number[family]))
        if number is not None:
            names[best[family]] = f"{radar}/{number}"
    place = turn(frame.runway_from_enu, seen_from.to_enu(bank.mean[:axes, order].T.reshape(-1, 3)))
    polar = np.array([plot.polar for plot in told]).reshape(-1, 3)
    taken = turn(frame.runway_from_enu, seen_from.to_enu(xyz_from_polar(polar)))
    return Look(radar, bank.at, place, likelihood[order], tuple(names[order].tolist()), taken)
