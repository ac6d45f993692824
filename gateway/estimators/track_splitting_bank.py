"""Families of hypotheses as arrays, and what is done with them beside estimation: chosen, merged, told apart, bounded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.track_splitting_gates import near
from gateway.observation import made_swiftly

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

PATH = 8  # plots of a hypothesis that are remembered
ALIKE = 0.25  # hypotheses of a family differ by less than half a sigma in every state: they tell the same
TWINS = 1.0  # families, by less than a sigma, and by a plot that both took lately
LATELY = 4  # looks


@made_swiftly
@dataclass(frozen=True, slots=True)
class Bank:
    """f families and their n hypotheses at an instant: in order of family, the likeliest of each first."""

    at: int  # ns
    mean: Floats  # (2A, n) position, rates
    covariance: Floats  # (2A, 2A, n)
    weight: Floats  # (n,) within the family, they add up to 1
    family: Ints  # (n,) from 0
    path: Ints  # (PATH, n) serials of the last plots, newest first, 0 = none in that look
    existence: Floats  # (f,) the track likelihood
    first: Floats  # (f,) that it began with
    number: Ints  # (f,) the serial of the plot that it began with: nothing else ever has that
    looks: Ints  # (f,) since it began, that look included
    confirmed: Bools  # (f,)
    looked: Ints  # (f,) ns, when the sensor last looked there

    @classmethod
    def empty(cls, at: int, axes: int) -> Bank:
        """Nothing is known."""
        mean, covariance = np.zeros((2 * axes, 0)), np.zeros((2 * axes, 2 * axes, 0))
        none, path = np.zeros(0), np.zeros((PATH, 0), np.int64)
        return cls(at, mean, covariance, none, path[0], path, none, none, path[0], path[0], path[0] > 0, path[0])

    def __len__(self) -> int:
        """How many hypotheses there are."""
        return len(self.weight)

    @property
    def best(self) -> Ints:
        """(f,) the likeliest hypothesis of each family."""
        return np.searchsorted(self.family, np.arange(len(self.number)))


def chosen(bank: Bank, keep: Bools, weight: Floats) -> Bank:
    """Some of the hypotheses, with new weights that are brought to 1; families without one are gone."""
    family = bank.family[keep]
    alive = np.zeros(len(bank.number), np.bool_)
    alive[family] = True
    weight = weight[keep]
    if not alive.all():
        family = (np.cumsum(alive) - 1)[family]
    total = np.bincount(family, weight, minlength=1)
    every = len(weight) == len(keep)
    return Bank(
        bank.at,
        bank.mean if every else bank.mean[:, keep],
        bank.covariance if every else bank.covariance[:, :, keep],
        weight / total[family],
        family,
        bank.path if every else bank.path[:, keep],
        bank.existence[alive],
        bank.first[alive],
        bank.number[alive],
        bank.looks[alive],
        bank.confirmed[alive],
        bank.looked[alive],
    )


def rank(family: Ints) -> Ints:
    """The place (n,) of each within its run of equals, from 0."""
    return np.arange(len(family)) - np.searchsorted(family, family)


def merged(bank: Bank) -> Bank:
    """Hypotheses that tell nearly the same as their family's likeliest become one with it."""
    weight, keep = bank.weight, np.ones(len(bank), np.bool_)
    other = np.flatnonzero(bank.family[1:] == bank.family[:-1]) + 1
    if len(other):
        first = other - rank(bank.family)[other]
        state = np.arange(len(bank.mean))
        off = bank.mean[:, other] - bank.mean[:, first]
        same = (off * off <= ALIKE * bank.covariance[state, state][:, first]).all(axis=0)
        if same.any():
            keep[other[same]] = False
            weight = weight + np.bincount(first[same], weight[other[same]], minlength=len(weight))
    return chosen(bank, keep, weight)


def distinct(bank: Bank) -> Bank:
    """Without families that follow the same thing as another one that is confirmed, or likelier, or older."""
    best = bank.best
    mean, axes = bank.mean[:, best], len(bank.mean) // 2
    state = np.arange(len(mean))
    variance = bank.covariance[state, state][:, best]
    position, reach = mean[:axes], np.sqrt(TWINS * variance[:axes])
    one, other = near(position, reach, position, np.zeros_like(reach))
    apart = one != other
    one, other = one[apart], other[apart]
    path = bank.path[:LATELY, best]
    same = ((path[:, one] == path[:, other]) & (path[:, one] > 0)).any(axis=0)
    off = mean[:, one] - mean[:, other]
    same &= (off * off <= TWINS * variance[:, one]).all(axis=0)
    one, other = one[same], other[same]
    confirmed = bank.confirmed.astype(np.int64)
    order = np.lexsort((bank.number, -bank.existence, -confirmed))
    standing = np.empty(len(order), np.int64)
    standing[order] = np.arange(len(order))
    worse = np.unique(other[standing[one] < standing[other]])
    if not len(worse):
        return bank
    gone = np.zeros(len(best), np.bool_)
    gone[worse] = True
    return chosen(bank, ~gone[bank.family], bank.weight)


def bounded(bank: Bank, budget: int) -> tuple[Bank, int]:
    """The likeliest hypotheses as far as the budget goes, those of confirmed tracks first; and how many were left out."""
    over = len(bank) - budget
    if over <= 0:
        return bank, 0
    standing = bank.existence[bank.family] * bank.weight + bank.confirmed[bank.family]
    keep = np.zeros(len(bank), np.bool_)
    keep[np.argsort(-standing, kind="stable")[:budget]] = True
    return chosen(bank, keep, bank.weight), over


def begun(bank: Bank, mean: Floats, covariance: Floats, serial: Ints, existence: Floats, at: int) -> Bank:
    """The same with b new families of one hypothesis each: states (2A, b), (2A, 2A, b), plots and likelihoods (b,)."""
    count, families = len(serial), len(bank.number)
    if not count:
        return bank
    path = np.zeros((PATH, count), np.int64)
    path[0] = serial
    return Bank(
        at,
        np.concatenate([bank.mean, mean], axis=1),
        np.concatenate([bank.covariance, covariance], axis=2),
        np.concatenate([bank.weight, np.ones(count)]),
        np.concatenate([bank.family, np.arange(families, families + count)]),
        np.concatenate([bank.path, path], axis=1),
        np.concatenate([bank.existence, existence]),
        np.concatenate([bank.first, existence]),
        np.concatenate([bank.number, serial]),
        np.concatenate([bank.looks, np.ones(count, np.int64)]),
        np.concatenate([bank.confirmed, np.zeros(count, np.bool_)]),
        np.concatenate([bank.looked, np.full(count, at)]),
    )
