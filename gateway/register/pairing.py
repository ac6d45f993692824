"""Pairs: each report beside what a radar measured of the same aircraft about its time, before anything was taken off.

They are made when they leave the history, so that whatever came late is in. All plots within half a second count: the report
is carried to each by its own velocity, and what they are off is averaged.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.associate import Association, Span, Spans
from gateway.estimators.registration_evidence import Pairs
from gateway.frames import RadarFrame, polar_from_xyz, polar_jacobian
from gateway.track import Key, RadarTracks

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WITHIN_NS = SECOND // 2  # of a report: the plots that count
WAIT_NS = SECOND // 2 + SECOND  # after a report: what may count beside it; and a radar's clock may be late or early
FORMER_NS = 20 * SECOND  # a pair that was lost is watched for so long: did it err, or does the radar?
NEAREST_M = 100.0  # nearer than this angles tell little of a radar


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """n pairs; `at`: when each report was valid, ns; `held`: (n,) whether it is a pair, or was one until lately."""

    at: list[int]
    pairs: Pairs
    held: Bools


Met = tuple[Fix, Floats, int, bool, Sequence[Plot]]  # a report, its velocity, the radar, whether held, the plots


def gathered(
    state: Association, spans: Spans, tracks: RadarTracks, radars: Mapping[int, RadarFrame], first: int, last: int
) -> Gathered | None:
    """The pairs of the reports that were checked for a time from `first` to before `last`; None where there are none."""
    met = list(_met(state, spans, tracks, radars, first, last))
    if not met:
        return None
    count = len(met)
    radar = [number for _, _, number, _, _ in met]
    enu = np.array([fix.enu_m for fix, *_ in met])
    velocity = np.array([speed for _, speed, *_ in met])
    variance = np.array([fix.sigma_m for fix, *_ in met]) ** 2
    owner = np.repeat(np.arange(count), [len(plots) for *_, plots in met])
    some = [(plot, fix) for fix, _, _, _, plots in met for plot in plots]
    elapsed_s = np.array([(plot.said_at - fix.at) / SECOND for plot, fix in some])
    said = np.array([plot.said for plot, _ in some])
    weight = np.array([plot.sigma for plot, _ in some]) ** -2.0
    by_enu, expected, level = np.empty((count, 3, 3)), np.empty((len(some), 3)), np.empty(count)
    carried = enu[owner] + velocity[owner] * elapsed_s[:, None]
    numbers = np.array(radar)
    for number in dict.fromkeys(radar):
        frame, mine, plots = radars[number], numbers == number, numbers[owner] == number
        local = frame.from_enu(enu[mine])
        by_enu[mine] = polar_jacobian(local) @ frame.radar_from_enu
        level[mine] = np.hypot(local[:, 0], local[:, 1])
        expected[plots] = polar_from_xyz(frame.from_enu(carried[plots]))
    off = said - expected
    off[:, 1] -= 2.0 * math.pi * np.round(off[:, 1] / (2.0 * math.pi))
    weight = np.where(np.isnan(off), 0.0, weight)
    total, weighed = np.zeros((count, 3)), np.zeros((count, 3))
    np.add.at(total, owner, weight)
    np.add.at(weighed, owner, weight * np.nan_to_num(off))
    known = (total > 0.0) & (level > NEAREST_M)[:, None]
    safe = np.where(known, total, 1.0)
    noise = 1.0 / safe + (by_enu * by_enu * variance[:, None, :]).sum(axis=-1)
    pairs = Pairs(
        [fix.aircraft for fix, *_ in met],
        radar,
        np.where(known, weighed / safe, math.nan),
        np.where(known, np.sqrt(noise), math.nan),
        by_enu,
        (by_enu @ velocity[:, :, None])[:, :, 0],
    )
    return Gathered([fix.at for fix, *_ in met], pairs, np.array([held for _, _, _, held, _ in met]))


def _met(
    state: Association, spans: Spans, tracks: RadarTracks, radars: Mapping[int, RadarFrame], first: int, last: int
) -> Iterator[Met]:
    """Each report with a height and a velocity, and the plots about its time of each radar track that is its aircraft."""
    checks = state.checks
    for place in range(bisect_left(checks, (first, ""), key=lambda check: check.order), len(checks)):
        fix = checks[place].fix
        if fix.at >= last:
            return
        mine = spans.by_aircraft.get(fix.aircraft, ())
        if not mine or not fix.has_height or (velocity := _velocity(fix, state)) is None:
            continue
        for key, held in _tracks_of(mine, spans, fix.at):
            plots = _about(tracks.plots.get(key, ()), fix.at)
            if plots and key[0] in radars:
                yield fix, velocity, key[0], held, plots


def _tracks_of(mine: Sequence[Span], spans: Spans, at: int) -> Iterator[tuple[Key, bool]]:
    """The radar tracks that an aircraft was at an instant; and those that it was until lately, if neither has another since."""
    held = {span.key for span in mine if span.since <= at and (span.until is None or at < span.until)}
    yield from ((key, True) for key in sorted(held))
    radars = {key[0] for key in held}
    for span in mine:
        if span.until is None or not span.until <= at < span.until + FORMER_NS or span.key[0] in radars:
            continue
        others = spans.by_key.get(span.key, ())
        if all(other.since <= span.since or other.since > at for other in others):
            yield span.key, False


def _about(plots: Sequence[Plot], at: int) -> list[Plot]:
    """Those that the radar stamped within half a second of an instant; by its stamp, what was taken off plays no part."""
    begin = bisect_left(plots, at - 2 * WITHIN_NS, key=lambda plot: plot.at)
    found = []
    for place in range(begin, len(plots)):
        plot = plots[place]
        if plot.at > at + 2 * WITHIN_NS:
            break
        if abs(plot.said_at - at) <= WITHIN_NS:
            found.append(plot)
    return found


def _velocity(fix: Fix, state: Association) -> Floats | None:
    """What the report says of it; else from this report to the next one of the aircraft, or from the one before."""
    if not np.isnan(fix.velocity_mps).any():
        return fix.velocity_mps
    known = state.chosen.get(fix.aircraft, ())
    place = bisect_left(known, fix.at, key=lambda other: other.at)
    beside = [known[near] for near in (place + 1, place - 1) if 0 <= near < len(known)]
    for other in beside:
        if other.at != fix.at and other.has_height:
            return np.asarray((other.enu_m - fix.enu_m) * (SECOND / (other.at - fix.at)))
    return None
