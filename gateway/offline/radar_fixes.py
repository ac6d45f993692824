"""Which of a radar's plots are one aircraft's, told by the path that it must have flown, and what they tell of that path.

A path through the air is known but for the wind. So a radar's track is this aircraft's if some wind, of a usual size that
changes as slowly as winds do, carries the path along it; clutter and other aircraft would need another wind at every turn.
Of plots that the radar does not number, each says which constant wind would have brought the aircraft there: those of one
aircraft agree. From such a beginning the path is tied, plots near it are taken up as far as it is known well enough, and so
on until nothing changes. Source: 002-2, known fixes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.tied_path import WANDERS_MPS_PER_SQRT_S, Known, Tied, at_times
from gateway.fuse.weighting import polar_difference
from gateway.offline.carrying import Place
from gateway.offline.sightings import View, names_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Tie = Callable[[Known], Tied]  # the path tied to what is known beside

GATE = 16.0  # squared distance, in sigmas, of a plot that is taken up: one in a thousand is further off
PATH_SIGMA_M = 5.0  # of the path within the half minute over which the wind is taken to be linear
HEIGHT_SIGMA_M = 50.0  # of a height by pressure, above the runway
LEAST_PLOTS, LEAST_S = 5, 10.0
_KNOWN_WELL_M = 500.0  # 1 sigma of the path, up to which plots near it are taken up
_MISFIT = 2.5  # mean square, in sigmas, of residuals and of changes of the wind together: more is another aircraft
_CLEARER = 1.5  # how much worse the next candidate must fit
_MOST_TRACKS, _MOST_VOTES, _ROUNDS = 20, 3, 12
_VOTES_OVER_S, _VOTES_AFTER_S, _VOTE_MPS, _GALE_MPS = 60.0, 60.0, 1.0, 40.0
_UNMEASURED = 1e9
_LASTS_S = 10.0  # the path's error
_EAST, _NORTH = np.eye(2)


@dataclass(frozen=True, slots=True)
class Seen:
    """The plots that tie a path, and of how many; `doubt`: why none of them do, in words."""

    known: Known
    used: int
    of: int
    # (k, 3) those with range and azimuth: east, north, up of lift-off
    place_m: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    tracks: tuple[str, ...] = ()
    doubt: str | None = None


@dataclass(frozen=True, slots=True)
class Way:
    """A sortie before it is tied: through the air (n, 2) and height above lift-off (n,), m, at times (n,) s after `origin` ns."""

    origin: int
    time_s: Floats
    through_air_m: Floats
    height_m: Floats
    lift_off: Place


@dataclass(frozen=True, slots=True)
class _Rows:
    """All plots of a sortie together, m rows."""

    views: Sequence[View]
    view: Ints
    number: Ints
    time_s: Floats
    polar: Floats
    sigma: Floats
    names: list[str]


@dataclass(frozen=True, slots=True)
class _Fit:
    """A candidate grown to its end: which rows it takes, and how well they fit."""

    taken: Bools
    known: Known
    misfit: float


def seen(way: Way, views: Sequence[View], told: Collection[str], tie: Tie) -> Seen:
    """The plots of an aircraft. `told`: the radars' tracks ("1/3") that are known to be this aircraft's; empty: any may be."""
    rows = _together(way, views)
    if not len(rows.time_s):
        return Seen(Known.none(), 0, 0)
    search = _Search(way, rows, tie)
    fits = [fit for start in search.starts(told) if (fit := search.grown(start)) is not None]
    fits = sorted(
        (fit for fit in fits if fit.misfit < _MISFIT), key=lambda fit: fit.misfit / math.sqrt(fit.taken.sum())
    )
    if not fits:
        return Seen(Known.none(), 0, len(rows.time_s), doubt="no wind carries the path along what the radar saw")
    best = fits[0]
    for other in fits[1:]:
        shared = np.count_nonzero(best.taken & other.taken) / min(best.taken.sum(), other.taken.sum())
        if shared < 0.5 and other.misfit < _CLEARER * max(best.misfit, 1.0) and not told:
            names = " and ".join(sorted(rows.names[int(np.argmax(fit.taken))] for fit in (best, other)))
            doubt = f"it may be either of what the radar saw as {names}: close it on where it touched down (--close-on LAT,LON)"
            return Seen(Known.none(), 0, len(rows.time_s), doubt=doubt)
    tracks = sorted({rows.names[row] for row in np.flatnonzero(best.taken & (rows.number > 0)).tolist()})
    return Seen(best.known, int(best.taken.sum()), len(rows.time_s), search.drawn(best.taken), tuple(tracks))


def _together(way: Way, views: Sequence[View]) -> _Rows:
    which = np.repeat(np.arange(len(views)), [len(view.time) for view in views])
    parts = [(view.number, (view.time - way.origin) * 1e-9, view.polar, view.sigma) for view in views]
    if not parts:
        nothing = np.zeros((0, 3))
        return _Rows(views, which, np.zeros(0, np.int64), np.zeros(0), nothing, nothing, [])
    number, time_s, polar, sigma = (np.concatenate(column) for column in zip(*parts, strict=True))
    return _Rows(views, which, number, time_s, polar, sigma, names_of(views, which, number))


class _Search:
    """One sortie's plots held against its path."""

    def __init__(self, way: Way, rows: _Rows, tie: Tie) -> None:
        self._way, self._rows, self._tie = way, rows, tie
        self._air = at_times(rows.time_s, way.time_s, way.through_air_m)
        self._above = np.interp(rows.time_s, way.time_s, way.height_m)
        ground = rows.views[0].runway.runway.height_m
        self._height = self._above + ground
        self._located = np.full((len(rows.time_s), 2), math.nan)
        for place, view in enumerate(rows.views):
            mine = rows.view == place
            self._located[mine] = view.located(way.lift_off, self._height[mine])
        second = np.floor(rows.time_s).astype(np.int64)
        self._looks = np.unique(np.stack([rows.view, second], axis=-1), axis=0, return_inverse=True)[1].reshape(-1)
        self._of = np.unique(np.array(rows.names), return_inverse=True)[1]

    def drawn(self, taken: Bools) -> Floats:
        """Where some plots are, east, north and up of lift-off (k, 3) m, those of them that have a range and an azimuth."""
        places: Floats = np.concatenate([self._located, self._above[:, None]], axis=1)[taken]
        return np.asarray(places[np.isfinite(places).all(axis=1)])

    def starts(self, told: Collection[str]) -> list[Bools]:
        """Rows that may be one aircraft's: of a numbered track, or unnumbered ones that ask for the same wind."""
        rows = self._rows
        fixed = np.isfinite(self._located).all(axis=1)
        names = np.array(rows.names)
        if told:
            mine = np.isin(names, list(told)) & fixed
            if np.count_nonzero(mine) >= LEAST_PLOTS:
                return [mine]
        found = []
        for name in np.unique(names[fixed & (rows.number > 0)]):
            mine = (names == name) & fixed
            if np.count_nonzero(mine) >= LEAST_PLOTS and np.ptp(rows.time_s[mine]) >= LEAST_S:
                found.append(mine)
        found = sorted(found, key=np.count_nonzero, reverse=True)[:_MOST_TRACKS]
        return found + self._voted(fixed & (rows.number == 0) & (rows.time_s > _VOTES_AFTER_S))

    def _voted(self, may: Bools) -> list[Bools]:
        """Of each minute the rows that agree on the wind that brought the aircraft there; the minutes in which most do."""
        time = self._rows.time_s
        with np.errstate(invalid="ignore"):
            wind = (self._located - self._air) / np.maximum(time, 1.0)[:, None]
            may = may & (np.abs(wind) < _GALE_MPS).all(axis=1)
        found: list[tuple[int, Bools]] = []
        for since in np.arange(0.0, float(time.max(initial=0.0)), 0.5 * _VOTES_OVER_S).tolist():
            some = np.flatnonzero(may & (time >= since) & (time < since + _VOTES_OVER_S))
            if len(some) < LEAST_PLOTS:
                continue
            cells, count = np.unique(np.floor(wind[some] / _VOTE_MPS), axis=0, return_counts=True)
            near = np.abs(cells[:, None] - cells).max(axis=-1) <= 1.0
            middle = (cells[int(np.argmax(near @ count))] + 0.5) * _VOTE_MPS
            agree = some[np.linalg.norm(wind[some] - middle, axis=1) < 1.5 * _VOTE_MPS]
            looks = len(np.unique(self._looks[agree]))
            if looks >= LEAST_PLOTS and np.ptp(time[agree]) >= LEAST_S:
                mine = np.zeros(len(time), dtype=np.bool_)
                mine[agree] = True
                found.append((looks, mine))
        return [mine for _, mine in sorted(found, key=lambda one: -one[0])[:_MOST_VOTES]]

    def grown(self, start: Bools) -> _Fit | None:
        """What a start comes to when plots near the path are taken up and others given back, until nothing changes."""
        taken = np.flatnonzero(start)
        known, _ = self._known(taken, self._located[taken])
        tied, before = self._tie(known), [taken]
        for _ in range(_ROUNDS):
            place = self._place(tied)
            taken = self._nearest(self._close(place, tied), place, tied)
            if len(taken) < LEAST_PLOTS:
                return None
            known, _ = self._known(taken, place[taken])
            tied = self._tie(known)
            if any(np.array_equal(taken, one) for one in before):
                break
            before.append(taken)
        mask = np.zeros(len(self._rows.time_s), dtype=np.bool_)
        mask[taken] = True
        return _Fit(mask, known, self._misfit(taken, tied))

    def _place(self, tied: Tied) -> Floats:
        return at_times(self._rows.time_s, self._way.time_s, tied.path_m)

    def _close(self, place_m: Floats, tied: Tied) -> Ints:
        """The rows worth a closer look: where the path is known well enough, and not surely elsewhere."""
        rows = self._rows
        sigma = np.interp(rows.time_s, self._way.time_s, tied.sigma_m)
        apart = np.linalg.norm(self._located - place_m, axis=1)
        blur = np.hypot(rows.sigma[:, 0], rows.polar[:, 0] * rows.sigma[:, 1]) + PATH_SIGMA_M + HEIGHT_SIGMA_M
        tells = np.isfinite(rows.polar[:, :2]).any(axis=1)
        is_far = apart > 2.0 * math.sqrt(GATE) * (sigma + blur)  # never of a row that is not located
        return np.flatnonzero(tells & (sigma < _KNOWN_WELL_M) & ~is_far)

    def _beside(self, at: Ints, place_m: Floats) -> tuple[Floats, Floats, Floats]:
        """Of some rows (k,) and places (k, 2): measured less expected (k, 3), its rates (k, 3, 3) for a metre east, north, up,
        and its sigma (k, 3). What was not measured is 0 off, with a sigma that tells nothing.
        """
        rows, way = self._rows, self._way
        expected, rates = np.empty((len(at), 3)), np.empty((len(at), 3, 3))
        for number, view in enumerate(rows.views):
            mine = rows.view[at] == number
            place, height = place_m[mine], self._height[at[mine]]
            expected[mine] = view.polar_of(way.lift_off, place, height)
            steps = ((place + _EAST, height), (place + _NORTH, height), (place, height + 1.0))
            for axis, (moved, high) in enumerate(steps):
                rates[mine, :, axis] = polar_difference(view.polar_of(way.lift_off, moved, high), expected[mine])
        off = polar_difference(rows.polar[at], expected)
        noise = np.sqrt(rows.sigma[at] ** 2 + (rates[..., 2] * HEIGHT_SIGMA_M) ** 2)
        missing = np.isnan(off)
        return np.where(missing, 0.0, off), rates, np.where(missing, _UNMEASURED, noise)

    def _nearest(self, close: Ints, place_m: Floats, tied: Tied) -> Ints:
        """The rows near the path: of unnumbered ones the nearest of each second, of a numbered track none if most are far."""
        rows = self._rows
        off, rates, noise = self._beside(close, place_m[close])
        level = rates[..., :2]
        spread = tied.spread(rows.time_s[close]) + PATH_SIGMA_M**2 * np.eye(2)
        spread = level @ spread @ level.swapaxes(-1, -2) + noise[..., None] ** 2 * np.eye(3)
        distance = np.einsum("ni,ni->n", off, np.linalg.solve(spread, off[..., None])[..., 0])
        near = close[distance < GATE]
        share = self._counted(near) / np.maximum(self._counted(self._known_well(tied)), 1)
        near = near[(rows.number[near] == 0) | (share[self._of[near]] >= 0.5)]
        least = np.full(len(rows.time_s), np.inf)
        squares = np.full(len(rows.time_s), np.inf)
        squares[close] = distance
        np.minimum.at(least, self._looks[near], squares[near])
        return np.asarray(near[(rows.number[near] > 0) | (squares[near] <= least[self._looks[near]])])

    def _known_well(self, tied: Tied) -> Ints:
        sigma = np.interp(self._rows.time_s, self._way.time_s, tied.sigma_m)
        return np.flatnonzero(sigma < _KNOWN_WELL_M)

    def _counted(self, at: Ints) -> Ints:
        """How many of some rows each track has."""
        return np.bincount(self._of[at], minlength=int(self._of.max()) + 1)

    def _known(self, taken: Ints, place_m: Floats) -> tuple[Known, Floats]:
        """What some plots tell of the path about places (k, 2), and how far off they are there, in sigmas.

        The path's own error lasts, so that plots of the same ten seconds share it: more of them do not make it smaller.
        """
        rows = self._rows
        off, rates, noise = self._beside(taken, place_m)
        tens = (rows.time_s[taken] / _LASTS_S).astype(np.intp)
        shared = np.bincount(tens)[tens][:, None] * (rates[..., :2] ** 2).sum(axis=-1) * PATH_SIGMA_M**2
        measured = noise < _UNMEASURED
        noise = np.sqrt(noise**2 + shared)
        value = off + np.einsum("nij,nj->ni", rates[..., :2], place_m)
        time = np.broadcast_to(rows.time_s[taken][:, None], measured.shape)
        known = Known(time[measured], rates[..., :2][measured], value[measured], noise[measured])
        return known, off[measured] / noise[measured]

    def _misfit(self, taken: Ints, tied: Tied) -> float:
        """Mean square, in sigmas, of what is left or of how the wind changed, whichever is larger."""
        _, left = self._known(taken, self._place(tied)[taken])
        wind = tied.found.reshape(2, -1)
        if np.abs(wind).max() > _GALE_MPS:
            return math.inf
        changes = np.diff(wind, axis=1) / (WANDERS_MPS_PER_SQRT_S * math.sqrt(tied.knots.step_s))
        return max(float(np.mean(left**2)), float(np.mean(changes**2)))
