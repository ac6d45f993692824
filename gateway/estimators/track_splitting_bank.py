"""Families of hypotheses as arrays, and what is done with them beside estimation: chosen, merged, told apart, bounded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.track_splitting_plots import moved
from gateway.frozen import made_swiftly

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECOND = 1e9
PATH = 8  # plots of a hypothesis that are remembered
ALIKE = 0.25  # hypotheses of a family differ by less than half a sigma in every state: they tell the same
TWINS = 1.0  # families, by less than a sigma, and a plot that both took lately
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

    @property
    def position(self) -> Floats:
        """(A, f) where each family is, the mean of its hypotheses."""
        position = self.mean[: len(self.mean) // 2]
        if len(self) == len(self.number):
            return position
        return np.stack([np.bincount(self.family, self.weight * axis, minlength=len(self.number)) for axis in position])


def carried(bank: Bank, at: int, density: tuple[float, ...], silent: int = 0) -> Bank:
    """The same at another instant, ns: see `moved`. For some of that time, ns, the sensor looked nowhere."""
    mean, covariance = moved(bank.mean, bank.covariance, (at - bank.at) / SECOND, density)
    return Bank(
        at,
        mean,
        covariance,
        bank.weight,
        bank.family,
        bank.path,
        bank.existence,
        bank.first,
        bank.number,
        bank.looks,
        bank.confirmed,
        bank.looked + silent if silent else bank.looked,
    )


def chosen(bank: Bank, weight: Floats, keep: Ints | None = None) -> Bank:
    """Some of the hypotheses, None = all, with new weights that are brought to 1; families without one are gone."""
    family, mean, covariance, path = bank.family, bank.mean, bank.covariance, bank.path
    if keep is not None:
        family, weight, path = family.take(keep), weight.take(keep), path.take(keep, axis=1)
        mean, covariance = mean.take(keep, axis=1), covariance.take(keep, axis=2)
    begins = np.ones(len(family), np.bool_)
    np.not_equal(family[1:], family[:-1], out=begins[1:])
    alive = family[begins]
    family = begins.cumsum() - 1
    total = np.bincount(family, weight, minlength=1)
    return Bank(
        bank.at,
        mean,
        covariance,
        weight / total.take(family),
        family,
        path,
        bank.existence.take(alive),
        bank.first.take(alive),
        bank.number.take(alive),
        bank.looks.take(alive),
        bank.confirmed.take(alive),
        bank.looked.take(alive),
    )


def likeliest(weight: Floats, family: Ints, keep: Bools, most: int) -> Ints:
    """Of what may be kept (n,) the places of each family's likeliest, so many at most, in order of family and of weight."""
    some = keep.nonzero()[0]
    family = family.take(some)
    order = np.lexsort((-weight.take(some), family))
    some, family = some.take(order), family.take(order)
    if (family[most:] == family[:-most]).any():
        some = some[rank(family) < most]
    return some


def without_plots(path: Ints, looks: Ints) -> Ints:
    """Paths (PATH, n) where so many looks (n,) before the newest had no plot."""
    place = np.arange(len(path))[:, None]
    earlier = np.maximum(place - looks, 0)
    shifted = np.take_along_axis(path, earlier, axis=0)
    return np.where(place == 0, path, np.where(place <= looks, 0, shifted))


def rank(family: Ints) -> Ints:
    """The place (n,) of each within its run of equals, from 0."""
    return np.arange(len(family)) - np.searchsorted(family, family)


def merged(bank: Bank) -> Bank:
    """Hypotheses that tell nearly the same as their family's likeliest become one with it."""
    other = (bank.family[1:] == bank.family[:-1]).nonzero()[0] + 1
    if not len(other):
        return chosen(bank, bank.weight)
    first = other - rank(bank.family).take(other)
    state = np.arange(len(bank.mean))
    off = bank.mean.take(other, axis=1) - bank.mean.take(first, axis=1)
    same = (off * off <= ALIKE * bank.covariance[state, state].take(first, axis=1)).all(axis=0)
    if not same.any():
        return chosen(bank, bank.weight)
    keep = np.ones(len(bank), np.bool_)
    keep[other[same]] = False
    weight = bank.weight + np.bincount(first[same], bank.weight[other[same]], minlength=len(bank))
    return chosen(bank, weight, keep.nonzero()[0])


def distinct(bank: Bank) -> Bank:
    """Without families that follow the same thing as another one that is confirmed, or likelier, or older."""
    best = bank.best
    one, other = _sharing(bank.path[:LATELY].take(best, axis=1))
    state = np.arange(len(bank.mean))
    variance = bank.covariance[state, state].take(best.take(one), axis=1)
    off = bank.mean.take(best.take(one), axis=1) - bank.mean.take(best.take(other), axis=1)
    same = (off * off <= TWINS * variance).all(axis=0)
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
    return chosen(bank, bank.weight, np.logical_not(gone.take(bank.family)).nonzero()[0])


def _sharing(path: Ints) -> tuple[Ints, Ints]:
    """Pairs of families, both ways, that have a plot in common; path (p, f), 0 = none."""
    serial = path.ravel()
    held = (serial > 0).nonzero()[0]
    held = held.take(serial.take(held).argsort(kind="stable"))
    serial, family = serial.take(held), held % path.shape[1]
    one, other = [family[:0]], [family[:0]]
    for apart in range(1, len(serial)):
        same = (serial[apart:] == serial[:-apart]).nonzero()[0]
        if not len(same):
            break
        one.append(family.take(same))
        other.append(family.take(same + apart))
    return np.concatenate(one + other), np.concatenate(other + one)


def bounded(bank: Bank, budget: int) -> tuple[Bank, int]:
    """The likeliest hypotheses as far as the budget goes, those of confirmed tracks first; and how many were left out."""
    over = len(bank) - budget
    if over <= 0:
        return bank, 0
    standing = bank.existence[bank.family] * bank.weight + bank.confirmed[bank.family]
    keep = np.sort(np.argsort(-standing, kind="stable")[:budget])
    return chosen(bank, bank.weight, keep), over


def begun(bank: Bank, mean: Floats, covariance: Floats, serial: Ints, existence: Floats) -> Bank:
    """The same with b new families of one hypothesis each: states (2A, b), (2A, 2A, b), plots and likelihoods (b,)."""
    count, families = len(serial), len(bank.number)
    if not count:
        return bank
    path = np.zeros((PATH, count), np.int64)
    path[0] = serial
    return Bank(
        bank.at,
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
        np.concatenate([bank.looked, np.full(count, bank.at)]),
    )
