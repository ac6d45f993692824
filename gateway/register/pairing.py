"""Pairs: each report beside what a radar measured of the same aircraft about its time, before anything was taken off.

They are made when they leave the history, so that whatever came late is in. All plots within half a second count: the report
is carried to each by its own velocity, and what they are off is averaged.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot
from gateway.associate import Association, Span, Spans
from gateway.estimators.registration_evidence import Pairs
from gateway.frames import RadarFrame, polar_from_xyz, polar_jacobian
from gateway.geodesy import wrap_rad
from gateway.track import Key, RadarTracks

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WITHIN_NS = SECOND // 2  # of a report: the plots that count
WAIT_NS = SECOND // 2 + SECOND  # after a report: what may count beside it; and a radar's clock may be late or early
FORMER_NS = 20 * SECOND  # a pair that was lost is watched for so long: did it err, or does the radar?
APART_NS = 4 * SECOND  # of reports that a velocity is made of: the further, the less their errors make of it
NEAREST_M = 100.0  # nearer than this angles tell little of a radar


@dataclass(frozen=True, slots=True, eq=False)
class Gathered:
    """n pairs; `at`: when each report was valid, ns; `held`: (n,) whether it is a pair, or was one until lately."""

    at: list[int]
    pairs: Pairs
    held: Bools


Met = tuple[Fix, int, bool, Sequence[Plot]]  # a report, the radar, whether held, the plots about its time


def gathered(
    state: Association, spans: Spans, tracks: RadarTracks, radars: Mapping[int, RadarFrame], first: int, last: int
) -> Gathered | None:
    """The pairs of the reports that were checked for a time from `first` to before `last`; None where there are none."""
    met = list(_met(state, spans, tracks, radars, first, last))
    if not met:
        return None
    fixes, radar, held, plots = zip(*met, strict=True)
    count = len(fixes)
    enu, velocity = np.array([fix.enu_m for fix in fixes]), _velocities(fixes, state)
    variance = np.array([fix.sigma_m for fix in fixes]) ** 2
    owner = np.repeat(np.arange(count), [len(some) for some in plots])
    said, sigma, elapsed_s = _said([plot for some in plots for plot in some], [fix.at for fix in fixes], owner)
    numbers = np.array(radar)
    by_enu, expected, level = np.empty((count, 3, 3)), np.empty(said.shape), np.empty(count)
    carried = enu[owner] + velocity[owner] * elapsed_s[:, None]
    for number in dict.fromkeys(radar):
        frame, mine, seen = radars[number], numbers == number, numbers[owner] == number
        local = frame.from_enu(enu[mine])
        by_enu[mine] = polar_jacobian(local) @ frame.radar_from_enu
        level[mine] = np.hypot(local[:, 0], local[:, 1])
        expected[seen] = polar_from_xyz(frame.from_enu(carried[seen]))
    off = said - expected
    off[:, 1] = wrap_rad(off[:, 1])
    is_near = np.abs(elapsed_s) <= WITHIN_NS / SECOND
    weight = np.where(np.isnan(off) | ~is_near[:, None], 0.0, sigma**-2.0)
    total, weighed = np.zeros((count, 3)), np.zeros((count, 3))
    np.add.at(total, owner, weight)
    np.add.at(weighed, owner, weight * np.nan_to_num(off))
    known = (total > 0.0) & ((level > NEAREST_M) & ~np.isnan(velocity).any(axis=1))[:, None]
    safe = np.where(known, total, 1.0)
    noise = 1.0 / safe + (by_enu * by_enu * variance[:, None, :]).sum(axis=-1)
    pairs = Pairs(
        [fix.aircraft for fix in fixes],
        list(radar),
        np.where(known, weighed / safe, math.nan),
        np.where(known, np.sqrt(noise), math.nan),
        by_enu,
        (by_enu @ velocity[:, :, None])[:, :, 0],
    )
    some = np.flatnonzero(known.any(axis=1)).tolist()
    if not some:
        return None
    return Gathered([fixes[row].at for row in some], pairs.chosen(some), np.array(held)[some])


def _met(
    state: Association, spans: Spans, tracks: RadarTracks, radars: Mapping[int, RadarFrame], first: int, last: int
) -> Iterator[Met]:
    """Each report with a height, and the plots about its time of each radar track that is its aircraft."""
    checks = state.checks
    for place in range(bisect_left(checks, (first, ""), key=lambda check: check.order), len(checks)):
        fix = checks[place].fix
        if fix.at >= last:
            return
        mine = spans.by_aircraft.get(fix.aircraft)
        if mine is None or not fix.has_height:
            continue
        for key, held in _tracks_of(mine, spans, fix.at):
            plots = _about(tracks.plots.get(key, ()), fix.at)
            if plots and key[0] in radars:
                yield fix, key[0], held, plots


def _tracks_of(mine: Sequence[Span], spans: Spans, at: int) -> list[tuple[Key, bool]]:
    """The radar tracks that an aircraft was at an instant; and those that it was until lately, if neither has another since."""
    found = [(span.key, True) for span in mine if span.since <= at and (span.until is None or at < span.until)]
    if len(found) == len(mine):
        return found
    radars = {key[0] for key, _ in found}
    for span in mine:
        if span.until is None or not span.until <= at < span.until + FORMER_NS or span.key[0] in radars:
            continue
        others = spans.by_key.get(span.key, ())
        if all(other.since <= span.since or other.since > at for other in others):
            found.append((span.key, False))
    return found


def _about(plots: Sequence[Plot], at: int) -> Sequence[Plot]:
    """Those that may have been stamped within half a second of an instant, whatever was taken off their stamps."""
    begin = bisect_left(plots, at - 2 * WITHIN_NS, key=_at)
    return plots[begin : bisect_right(plots, at + 2 * WITHIN_NS, lo=begin, key=_at)]


_at = attrgetter("at")


def _said(plots: Sequence[Plot], at: Sequence[int], owner: NDArray[np.intp]) -> tuple[Floats, Floats, Floats]:
    """What radars measured before anything was taken off (m, 3), its sigmas, and how long after their reports, s, by stamp."""
    taken_off = np.array([plot.taken_off for plot in plots])
    stamps = np.array([plot.at for plot in plots], np.int64) - np.array(at, np.int64)[owner]
    sigma = np.array([plot.sigma for plot in plots])
    said = np.array([plot.polar for plot in plots]) + taken_off[:, :3]
    return said, sigma, stamps / SECOND + taken_off[:, 3]


def _velocities(fixes: Sequence[Fix], state: Association) -> Floats:
    """What reports say of them, (n, 3); else by the aircraft's reports before and after, NaN where there are none.

    Not by the report itself: its own error would stand in what the radar is off and in the velocity, and look like lateness.
    """
    velocity = np.array([fix.velocity_mps for fix in fixes])
    for row in np.flatnonzero(np.isnan(velocity).any(axis=1)).tolist():
        fix, known = fixes[row], state.chosen.get(fixes[row].aircraft, ())
        first, end = bisect_left(known, fix.at, key=_at), bisect_right(known, fix.at, key=_at)
        before = [other for other in known[:first] if other.has_height][::-1]
        after = [other for other in known[end:] if other.has_height]
        if before and after:
            span = min(_reach(fix, before), _reach(fix, after))
            one, other = (min(side, key=lambda near: abs(abs(near.at - fix.at) - span)) for side in (before, after))
            velocity[row] = (other.enu_m - one.enu_m) * (SECOND / (other.at - one.at))
    return velocity


def _reach(fix: Fix, side: Sequence[Fix]) -> int:
    """How far the last of some reports, the nearest first, is that is not too far; the nearest in any case."""
    reached = [abs(other.at - fix.at) for other in side]
    return max((far for far in reached if far <= APART_NS), default=reached[0])
