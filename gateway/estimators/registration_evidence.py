"""What pairs tell of the errors of radars and position sources as they come: evidence that adds up and fades.

A pair is an aircraft's report beside a radar's measurement of the same time. What the radar measures more than was reported,

    measured - polar(report) = radar's error - turning rates x lateness - derivatives x the position source's error

is linear in the errors, each counted as what a source says too much. The position source's error is the sum of one that all
aircraft share and one of each aircraft's own, both of which last as long as a flight: a thousand reports of one aircraft do not
make its own error smaller. So the equations are kept apart by aircraft and radar (information matrices and vectors), and own
errors are eliminated when they are solved (`registration_solution`). Aircraft that left are folded into one sum.

Parameters of a radar, in this order: range m, azimuth rad (003's), elevation rad, time s; of a position source east, north, up m.
Source: 004 2. Deviation: own errors, times, fading.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from gateway.estimators.registration_solution import Solution

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

EACH = 4  # parameters of a radar
BLOCK = EACH + 3  # of a radar and a position source
AIRCRAFT_AT_MOST, RADARS_AT_MOST = 2048, 8  # what more there is tells nothing: a bound on memory and time
HUBER = 2.5  # a component further off than this (sigmas) counts less,
WRONG = 6.0  # and a pair with one further off than this not at all: a radar that changed is noticed otherwise

Link = tuple[str, int]  # aircraft, radar


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """n pairs: aircraft, radar, and rows at the radar.

    `off`: (n, 3) the measured range m, azimuth rad, elevation rad less the report's, NaN = not measured. `sigma`: (n, 3) of
    that difference's noise. `by_enu`: (n, 3, 3) derivatives of range, azimuth, elevation by east, north, up. `rates`: (n, 3)
    how fast they change, NaN = not known.
    """

    aircraft: Sequence[str]
    radar: Sequence[int]
    off: Floats
    sigma: Floats
    by_enu: Floats
    rates: Floats

    def rows(self) -> Floats:
        """The derivatives of `off` by the radar's and the position source's error, (n, 3, 7)."""
        rows = np.zeros((len(self.off), 3, BLOCK))
        rows[:, :, :3] = np.eye(3)
        rows[:, :, 3] = -np.nan_to_num(self.rates)
        rows[:, :, EACH:] = -self.by_enu
        return rows

    def chosen(self, places: Sequence[int]) -> Pairs:
        """Only some of them."""
        some = np.array(places, dtype=np.intp)
        return Pairs(
            [self.aircraft[place] for place in places],
            [self.radar[place] for place in places],
            self.off[some],
            self.sigma[some],
            self.by_enu[some],
            self.rates[some],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """What is known: of k links (aircraft and radar) information (k, 7, 7) and vector (k, 7); what aircraft that left told.

    `last`: (k,) when each link's last pair was, ns. `folded`: (p, p) and (p,), of all radars and the common error.
    `pairs` and `seen`: how many pairs there were of each radar, unfaded, and of how many aircraft.
    """

    links: tuple[Link, ...] = ()
    information: Floats = field(default_factory=lambda: np.zeros((0, BLOCK, BLOCK)))
    vector: Floats = field(default_factory=lambda: np.zeros((0, BLOCK)))
    last: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    radars: tuple[int, ...] = ()
    folded: tuple[Floats, Floats] = field(default_factory=lambda: (np.zeros((3, 3)), np.zeros(3)))
    pairs: tuple[int, ...] = ()
    seen: tuple[int, ...] = ()

    def place_of(self, radar: int) -> slice:
        """Where a radar's parameters are among all."""
        first = EACH * self.radars.index(radar)
        return slice(first, first + EACH)


def faded(evidence: Evidence, share: float) -> Evidence:
    """The evidence with this share of its weight left."""
    total, vector = evidence.folded
    return replace(
        evidence,
        information=evidence.information * share,
        vector=evidence.vector * share,
        folded=(total * share, vector * share),
    )


def learnt(evidence: Evidence, pairs: Pairs, at: int, solution: Solution | None) -> Evidence:
    """The evidence with the pairs of an instant. Components far from what the last solution expects count less (Huber)."""
    if not len(pairs.off):
        return evidence
    evidence = with_radars(evidence, pairs.radar)
    evidence = _with_links(evidence, list(zip(pairs.aircraft, pairs.radar, strict=True)))
    place_of = {link: place for place, link in enumerate(evidence.links)}
    rows, weight = pairs.rows(), _weights(pairs, solution)
    weighed = rows * weight[..., None]
    by_pair = weighed.transpose(0, 2, 1) @ rows
    vectors = (weighed * np.nan_to_num(pairs.off)[..., None]).sum(axis=1)
    places = np.array([place_of[link] for link in zip(pairs.aircraft, pairs.radar, strict=True)], dtype=np.intp)
    information, vector, last = evidence.information.copy(), evidence.vector.copy(), evidence.last.copy()
    np.add.at(information, places, by_pair)
    np.add.at(vector, places, vectors)
    last[places] = at
    more = [pairs.radar.count(radar) for radar in evidence.radars]
    counts = tuple(known + new for known, new in zip(evidence.pairs, more, strict=True))
    return replace(evidence, information=information, vector=vector, last=last, pairs=counts)


def remembering(evidence: Evidence, radar: int, error: Floats, sigma: Floats) -> Evidence:
    """The evidence with what was known of a radar before: errors (4,) and their sigmas (4,), NaN = not known."""
    evidence = with_radars(evidence, [radar])
    place, known = evidence.place_of(radar), np.isfinite(error) & np.isfinite(sigma)
    weight = np.where(known, np.where(known, sigma, 1.0) ** -2.0, 0.0)
    total, vector = evidence.folded[0].copy(), evidence.folded[1].copy()
    total[place, place] += np.diag(weight)
    vector[place] += weight * np.where(known, error, 0.0)
    return replace(evidence, folded=(total, vector))


def without(evidence: Evidence, radar: int) -> Evidence:
    """The evidence without all that was ever learnt of a radar's errors: it is another one now."""
    if radar not in evidence.radars:
        return evidence
    stays = [place for place, link in enumerate(evidence.links) if link[1] != radar]
    place, others = evidence.place_of(radar), np.ones(len(evidence.folded[1]), np.bool_)
    others[place] = False
    total, vector = without_past(evidence, radar).folded
    return Evidence(
        tuple(evidence.links[one] for one in stays),
        evidence.information[stays],
        evidence.vector[stays],
        evidence.last[stays],
        tuple(number for number in evidence.radars if number != radar),
        (total[np.ix_(others, others)], vector[others]),
        tuple(n for n, number in zip(evidence.pairs, evidence.radars, strict=True) if number != radar),
        tuple(n for n, number in zip(evidence.seen, evidence.radars, strict=True) if number != radar),
    )


def without_past(evidence: Evidence, radar: int) -> Evidence:
    """The evidence without what aircraft that left, and earlier sessions, told of a radar's errors."""
    total, vector = (part.copy() for part in evidence.folded)
    place, others = evidence.place_of(radar), np.ones(len(vector), np.bool_)
    others[place] = False
    gain = total[others, place] @ np.linalg.pinv(total[place, place], hermitian=True)
    total[np.ix_(others, others)] -= gain @ total[place, others]
    vector[others] -= gain @ vector[place]
    total[place, :] = total[:, place] = 0.0
    vector[place] = 0.0
    return replace(evidence, folded=(total, vector))


def with_radars(evidence: Evidence, numbers: Sequence[int]) -> Evidence:
    """The evidence with room for radars that are new."""
    radars = tuple(sorted({*evidence.radars, *numbers}))
    if radars == evidence.radars:
        return evidence
    size = EACH * len(radars) + 3
    known = [EACH * radars.index(radar) + part for radar in evidence.radars for part in range(EACH)]
    kept = np.array([*known, *range(size - 3, size)])
    total, vector = np.zeros((size, size)), np.zeros(size)
    total[np.ix_(kept, kept)], vector[kept] = evidence.folded
    pairs, seen = (
        tuple(dict(zip(evidence.radars, counts, strict=True)).get(radar, 0) for radar in radars)
        for counts in (evidence.pairs, evidence.seen)
    )
    return replace(evidence, radars=radars, folded=(total, vector), pairs=pairs, seen=seen)


def _with_links(evidence: Evidence, links: Sequence[Link]) -> Evidence:
    known = set(evidence.links)
    new = [link for link in dict.fromkeys(links) if link not in known]
    if not new:
        return evidence
    more = [sum(number == radar for _, number in new) for radar in evidence.radars]
    return replace(
        evidence,
        seen=tuple(known + count for known, count in zip(evidence.seen, more, strict=True)),
        links=(*evidence.links, *new),
        information=np.concatenate([evidence.information, np.zeros((len(new), BLOCK, BLOCK))]),
        vector=np.concatenate([evidence.vector, np.zeros((len(new), BLOCK))]),
        last=np.concatenate([evidence.last, np.zeros(len(new), np.int64)]),
    )


def _weights(pairs: Pairs, solution: Solution | None) -> Floats:
    """Of each component, 1 / variance; less where it is far off; nothing where it was not measured."""
    sigma = np.nan_to_num(pairs.sigma, nan=1.0)
    weight = np.where(np.isnan(pairs.off) | np.isnan(pairs.sigma), 0.0, sigma**-2.0)
    if solution is None:
        return weight
    left, variance = solution.left(pairs)
    distance = np.abs(np.nan_to_num(left)) / np.sqrt(variance)
    less = np.where(distance > HUBER, HUBER / np.maximum(distance, HUBER), 1.0)
    is_right = np.all(distance <= WRONG, axis=1, keepdims=True)
    return np.asarray(weight * less * is_right)
