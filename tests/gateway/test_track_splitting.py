"""Track splitting: the recursion's unit values, gates, sharing, partial plots, and what a bank may not do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators import track_splitting_literal as literal
from gateway.estimators.track_splitting import Bank, Plots, Splitting, scan
from gateway.estimators.track_splitting_bank import distinct
from gateway.estimators.track_splitting_gates import near
from gateway.estimators.track_splitting_plots import Plane, corrected, moved
from gateway.estimators.track_splitting_shares import shared

MODEL = Splitting((1.0, 1.0), (60.0, 60.0))
SECOND, SIGMA_M, CLUTTER = 1_000_000_000, 50.0, 0.5e-6


def plots(value: object, at_s: float, first: int = 1, newborn: float = 1e-8) -> Plots:
    """Plots of one scan at positions (m, 2), NaN = not measured."""
    given = np.array(value, dtype=float).reshape(-1, 2).T
    m = given.shape[1]
    at = np.full(m, round(at_s * SECOND))
    return Plots(
        given,
        np.full(given.shape, SIGMA_M**2),
        np.full(m, CLUTTER),
        np.full(m, newborn),
        at,
        np.arange(first, first + m),
    )


def worked(scans: list[object], period_s: float = 6.0, model: Splitting = MODEL, newborn: float = 1e-8) -> Bank:
    """The bank after scans of plots."""
    bank = Bank.empty(0, 2)
    for place, value in enumerate(scans):
        bank, _ = scan(
            bank,
            plots(value, place * period_s, 1000 * place + 1, newborn),
            round(place * period_s * SECOND),
            Plane(),
            model,
        )
    return bank


def test_the_recursion_has_the_paper_s_unit_values() -> None:
    """With PD 0.9, PR 0.15 and a likelihood of 0.5: 0.105 without a plot, 0.857 with a plot that is certainly the target's."""
    assert literal.unseen(0.5, 0.9, 0.15) == pytest.approx(0.105, abs=5e-4)
    assert literal.seen(0.5, 1.0, 0.9, 0.15) == pytest.approx(0.857, abs=5e-4)
    assert literal.seen(0.5, 0.0, 0.9, 0.15) == pytest.approx(literal.unseen(0.5, 0.9, 0.15))


def test_a_family_s_likelihood_is_bayes_rule() -> None:
    """One family and no plot: P (1 - PD PG) / (1 - P + P (1 - PD PG)); one plot in its gate: by the ratio of densities."""
    model = Splitting((1.0, 1.0), (60.0, 60.0), survival=1.0, drop_below=1e-6)
    alone = worked([[[0, 0]], []], model=model, newborn=CLUTTER)
    missed = 1.0 - 0.9 * 0.999
    assert alone.existence == pytest.approx(0.5 * missed / (0.5 + 0.5 * missed))
    both = worked([[[0, 0]], [[0, 0]]], model=model, newborn=CLUTTER)
    scatter = 2.0 * SIGMA_M**2 + (6.0 * 30.0) ** 2 + 6.0**3 / 3.0
    ratio = 0.9 / (2.0 * np.pi * scatter) / CLUTTER
    assert both.existence[0] == pytest.approx((missed + ratio) / (1.0 + missed + ratio))


def test_a_target_in_every_scan_is_confirmed_and_ends_by_its_likelihood_alone() -> None:
    """Six plots in a row confirm it; without further plots it is gone within ten scans, and the bank is empty."""
    track = [[[180.0 * place, 0.0]] for place in range(8)]
    bank = worked(track)
    assert bank.confirmed.tolist() == [True]
    assert bank.mean[2, bank.best[0]] == pytest.approx(30.0, abs=1.0)
    assert len(worked([*track, *[[] for _ in range(10)]])) == 0


def test_two_families_cannot_both_have_one_plot() -> None:
    """Where two sure tracks reach for one plot, their chances for it add up to at most one; alone each would be sure of it."""
    chance, none, free, _ = shared(
        np.array([0, 1]), np.array([0, 0]), np.array([100.0, 100.0]), np.array([0.1, 0.1]), 1
    )
    assert chance.sum() + free[0] == pytest.approx(1.0, abs=0.02)
    assert chance[0] == pytest.approx(0.5, abs=0.01)
    assert none + chance == pytest.approx([1.0, 1.0])
    alone, _, _, _ = shared(np.array([0]), np.array([0]), np.array([100.0]), np.array([0.1]), 1)
    assert alone[0] == pytest.approx(100.0 / 100.1)


def test_shared_chances_are_those_of_all_joint_associations() -> None:
    """Three tracks and three plots: the marginals are within 0.05 of the sum over every joint association."""
    random = np.random.default_rng(3)
    weight, none = random.exponential(2.0, (3, 3)), np.array([0.5, 1.0, 0.2])
    exact, total = np.zeros((3, 3)), 0.0
    for choice in np.ndindex(4, 4, 4):
        taken = [plot for plot in choice if plot < 3]
        if len(taken) == len(set(taken)):
            product = np.prod([none[t] if plot == 3 else weight[t, plot] for t, plot in enumerate(choice)])
            total += product
            for t, plot in enumerate(choice):
                if plot < 3:
                    exact[t, plot] += product
    track, plot = np.divmod(np.arange(9), 3)
    chance, _, _, _ = shared(track, plot, weight.ravel(), none, 3)
    assert chance == pytest.approx((exact / total).ravel(), abs=0.05)


@pytest.mark.parametrize("partial", [0.0, 0.2])
def test_the_grid_finds_what_all_with_all_finds(partial: float) -> None:
    """Pairs within reach, by the grid and by comparing everything, are the same and in the same order."""
    random = np.random.default_rng(1)
    expected, value = random.uniform(-1e4, 1e4, (3, 300)), random.uniform(-1e4, 1e4, (3, 400))
    reach, spread = random.uniform(10.0, 2000.0, (3, 300)) ** 2, random.uniform(10.0, 300.0, (3, 400)) ** 2
    value[random.random(value.shape) < partial] = np.nan
    row, plot = near(expected, reach, value, spread)
    apart = (expected[:, :, None] - value[:, None, :]) ** 2 > reach[:, :, None] + spread[:, None, :]
    wanted = np.nonzero(~apart.any(axis=0))
    assert (row == wanted[0]).all()
    assert (plot == wanted[1]).all()


def test_an_angle_is_near_from_both_ends() -> None:
    """Plots just beyond half a turn lie near predictions just before it, each pair once."""
    expected, reach = np.full((2, 40), 9e9), np.full((2, 40), 0.05**2)
    expected[:, :2] = [[1000.0, 1000.0], [3.13, 0.0]]
    value = np.array([[1000.0, 1000.0, 1000.0], [-3.14, 3.12, 0.01]])
    row, plot = near(expected, reach, value, np.zeros_like(value), 2.0 * np.pi)
    assert list(zip(row.tolist(), plot.tolist(), strict=True)) == [(0, 0), (0, 1), (1, 2)]


def test_what_lies_near_is_among_the_pairs_of_few_and_of_many() -> None:
    """From one prediction and plot to hundreds, every way of looking finds the pairs that lie within reach."""
    random = np.random.default_rng(8)
    for n, m in ((1, 1), (5, 9), (40, 60), (200, 300), (7, 0), (0, 7), (3000, 2)):
        expected, value = random.uniform(-1e3, 1e3, (2, n)), random.uniform(-1e3, 1e3, (2, m))
        reach, spread = random.uniform(0.0, 4e4, (2, n)), random.uniform(0.0, 4e3, (2, m))
        apart = (expected[:, :, None] - value[:, None, :]) ** 2 > reach[:, :, None] + spread[:, None, :]
        wanted = set(zip(*(one.tolist() for one in np.nonzero(~apart.any(axis=0))), strict=True))
        found = list(zip(*(one.tolist() for one in near(expected, reach, value, spread)), strict=True))
        assert found == sorted(set(found))
        assert wanted <= set(found)


def test_of_families_that_follow_one_thing_one_is_left() -> None:
    """Three in nearly the same state that took a plot in common: the confirmed one stays; one that took another, too."""
    bank = worked([[[0.0, 0.0], [5.0, 5.0], [10.0, 0.0], [6.0, 2.0]]])
    path = bank.path.copy()
    path[0] = [1, 1, 1, 9]
    alike = replace(bank, path=path, confirmed=np.array([False, True, False, False]))
    assert distinct(alike).number.tolist() == [2, 4]


def test_components_one_by_one_are_the_kalman_update() -> None:
    """Worked one component after the other, means, covariances and densities are those of the textbook's matrices."""
    random = np.random.default_rng(2)
    root = random.normal(size=(6, 6))
    mean, covariance, slope = random.normal(size=6), root @ root.T, random.normal(size=(3, 3))
    off, variance = random.normal(size=3), np.array([1.0, 2.0, 0.5])
    h = np.hstack([slope, np.zeros((3, 3))])
    s = h @ covariance @ h.T + np.diag(variance)
    gain = covariance @ h.T @ np.linalg.inv(s)
    m, c, distance, density = corrected(
        mean[:, None], covariance[:, :, None], off[:, None], variance[:, None], slope[:, :, None]
    )
    assert m[:, 0] == pytest.approx(mean + gain @ off)
    assert c[:, :, 0] == pytest.approx(covariance - gain @ h @ covariance)
    assert distance[0] == pytest.approx(off @ np.linalg.solve(s, off))
    assert density[0] == pytest.approx(np.exp(-0.5 * distance[0]) / np.sqrt(np.linalg.det(2.0 * np.pi * s)))


def test_a_missing_component_neither_moves_nor_weighs() -> None:
    """A plot without its second component is the update by the first alone, and its density is of that alone."""
    mean, covariance = np.zeros((4, 1)), 100.0 * np.eye(4)[:, :, None]
    variance, off = np.full((2, 1), 100.0), np.array([[10.0], [np.nan]])
    m, c, distance, density = corrected(mean, covariance, off, variance, None, np.isnan(off))
    assert m[:, 0] == pytest.approx([5.0, 0.0, 0.0, 0.0])
    assert c[1, 1, 0] == 100.0
    assert distance[0] == pytest.approx(0.5)
    assert density[0] == pytest.approx(np.exp(-0.25) / np.sqrt(2.0 * np.pi * 200.0))


def test_partial_plots_keep_a_track_and_begin_none() -> None:
    """A target of which every other plot lacks a component stays one confirmed track; what lacks one begins nothing."""
    scans: list[object] = [[[180.0 * place, 0.0 if place % 2 == 0 or place < 6 else np.nan]] for place in range(20)]
    bank = worked(scans)
    assert bank.confirmed.tolist() == [True]
    assert len(worked([[[np.nan, 0.0]], [[5.0, np.nan]]])) == 0


def test_a_plot_of_another_instant_tells_of_that_instant() -> None:
    """Plots measured half a second before the scan's instant give the same track as the scan at their own instant."""
    early, same = Bank.empty(0, 2), Bank.empty(0, 2)
    for place in range(10):
        value = [[30.0 * 6.0 * place, 0.0]]
        same, _ = scan(same, plots(value, 6.0 * place), round(6.0 * place * SECOND), Plane(), MODEL)
        at = round((6.0 * place + 0.5) * SECOND)
        early, _ = scan(early, plots(value, 6.0 * place), at, Plane(), MODEL)
    carried, _ = moved(same.mean, same.covariance, 0.5, (1.0, 1.0))
    assert early.mean[:, early.best[0]] == pytest.approx(carried[:, same.best[0]], abs=0.5)


def test_the_budget_bounds_a_burst_and_says_what_it_left_out() -> None:
    """10 000 plots in one scan: no more hypotheses than the budget, the rest are counted, a confirmed track lives on."""
    scans: list[object] = [[[180.0 * place, 0.0]] for place in range(8)]
    bank = worked(scans)
    burst = np.random.default_rng(1).uniform(-10_000.0, 10_000.0, (10_000, 2))
    burst[0] = [180.0 * 8, 0.0]
    number = bank.number[bank.confirmed][0]
    bank, found = scan(bank, plots(burst, 48.0), 48 * SECOND, Plane(), MODEL)
    assert len(bank) <= MODEL.budget
    assert found.left_out > 0
    assert bank.confirmed[bank.number == number].all()
    assert number in bank.number


def test_no_number_is_given_twice_and_weights_add_up() -> None:
    """Over 40 scans of clutter and a target: families are told apart by number, and each one's hypotheses weigh 1 in all."""
    random = np.random.default_rng(5)
    bank, known = Bank.empty(0, 2), 0
    for place in range(40):
        value: NDArray[np.float64] = random.uniform(-4000.0, 4000.0, (32, 2))
        value[0] = [180.0 * place - 3500.0, 0.0]
        bank, _ = scan(bank, plots(value, 6.0 * place, 100 * place + 1), 6 * place * SECOND, Plane(), MODEL)
        assert (np.diff(bank.family) >= 0).all()
        assert np.bincount(bank.family, bank.weight) == pytest.approx(np.ones(len(bank.number)))
        assert (np.diff(bank.number) > 0).all()
        assert (bank.number[bank.looks == 1] > known).all()
        known = max(known, int(bank.number.max()))


def test_a_scan_in_pieces_counts_as_one_look() -> None:
    """Each scan in four pieces, the target's plot in one of them: it is confirmed, and what is missed is missed once a scan."""
    bank, looks = Bank.empty(0, 2), []
    for place in range(40):
        at_s = 1.5 * place
        value = [[30.0 * at_s, 0.0]] if place % 4 == 1 and place not in (25, 29) else []
        bank, _ = scan(bank, plots(value, at_s, 10 * place + 1), round(at_s * SECOND), Plane(), MODEL, 6.0)
        looks.append(int(bank.looks[0]) if len(bank) else 0)
    assert bank.confirmed.tolist() == [True]
    assert looks[-1] == 10
    assert bank.path[:4, bank.best[0]].tolist() == [371, 331, 0, 0]


def test_a_scan_that_comes_at_once_and_misses_a_target_counts() -> None:
    """Every third scan has clutter alone: the family was looked at in all of them, and its path tells which had no plot."""
    bank = Bank.empty(0, 2)
    for place in range(17):
        value = [[-9000.0, 5000.0 * (-1) ** place], *([[180.0 * place, 0.0]] if place % 3 != 2 else [])]
        at = round(6.0 * place * SECOND)
        bank, _ = scan(bank, plots(value, 6.0 * place, 10 * place + 1), at, Plane(), MODEL, 6.0)
    family = int(np.flatnonzero(bank.confirmed)[0])
    assert bank.looks[family] == 17
    assert bank.path[:, bank.best[family]].tolist() == [162, 152, 0, 132, 122, 0, 102, 92]


def test_a_scan_that_never_came_is_not_held_against_a_target() -> None:
    """After a silence of ten scans a track goes on as sure as before; one that was seen by, and missed in, is not."""
    bank = worked([[[180.0 * place, 0.0]] for place in range(8)])
    here = plots([[180.0 * 18, 0.0]], 108.0, 100)
    silent, _ = scan(replace(bank, at=42 * SECOND), here, 108 * SECOND, Plane(), MODEL, 6.0)
    seen = replace(bank, at=102 * SECOND, mean=moved(bank.mean, bank.covariance, 60.0, (1.0, 1.0))[0])
    missed, _ = scan(seen, here, 108 * SECOND, Plane(), MODEL, 6.0)
    assert silent.existence[0] > 0.999
    assert bank.number[0] not in missed.number
