"""Batches of tracks whose filter may be compiled: the same numbers as the gateway's own, whatever is measured.

Without numba the loops are run as they stand, number by number; with it, as machine code.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators.batch import layout, packed, tracks
from gateway.estimators.batch.lanes import Lanes
from gateway.estimators.batch.layout import Layout
from gateway.estimators.batch.stacked import Stacked
from gateway.estimators.kalman import Estimate, Motion, start
from gateway.estimators.modes import Mode, Modes
from gateway.fuse.flying import modes_of
from gateway.settings import Estimation, Options
from sim.studies import rmimm

Floats = NDArray[np.float64]

AGREE = 1e-9  # of each state's own sigma, and of weights
N = 3
WHOLE = np.concatenate([np.eye(6, 9)[None], np.zeros((1, 0, 9))], axis=1)
WHOLE[0, :3, 6:] = np.eye(3)  # position with the source's error, and velocity


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two blocks of two tracks, the last one filled up."""
    monkeypatch.setattr(layout, "STEP", 1)
    monkeypatch.setattr(layout, "WIDEST", 2)
    assert Layout.of(N) == Layout(N, 2, 2)


def gateways(estimator: str = "rmimm") -> Modes:
    """The gateway's five modes of eleven states."""
    modes = modes_of(Options(estimator=estimator), Motion((1.0,) * 3, 20.0), Estimation())
    assert modes is not None
    return modes


@dataclass
class Both:
    """The same tracks in both ways, and what was told of them last."""

    stacked: tracks.Tracks
    lanes: tracks.Tracks

    @classmethod
    def begin(cls, modes: Modes, far_m: float = 3e4) -> Both:
        """Three aircraft of 15 to 130 m/s, and one that stands."""
        random = np.random.default_rng(5)
        velocity = np.array([[15.0, 3.0, 0.5], [-90.0, 93.0, -3.0], [0.0, 0.0, 0.0]])
        spread = np.tile(400.0 * np.eye(3), (N, 1, 1))
        first = start(random.normal(0.0, far_m, (N, 3)), spread, velocity, np.full(N, 4.0), 20.0)
        return cls(Stacked.begin(first, modes), Lanes.begin(first, modes))

    def step(
        self,
        elapsed_s: Floats,
        off: Floats,
        h: Floats,
        variance: float,
        transition: Floats | None = None,
        robust: float | None = None,
    ) -> float:
        """A time on, and a measurement that lies `off` (n, k) from where the first track's modes have it; how far they part."""
        m = self.lanes.weights.shape[1]
        after = []
        for way in (self.stacked, self.lanes):
            ahead = way.predict(elapsed_s, transition)
            means = self.stacked.predict(elapsed_s, transition).means if way is self.stacked else ahead.means
            seen = (h @ means[:, :9, None])[:, :, 0].reshape(N, m, -1)
            innovation = (seen[:, :1] + off[:, None] - seen).reshape(N * m, -1)
            after.append(ahead.update(innovation, h, np.full(innovation.shape, variance), robust))
        (self.stacked, *told), (self.lanes, *again) = after
        of_told = max(np.abs(other - one).max() / np.abs(one).max() for one, other in zip(told, again, strict=True))
        return max(of_told, self.apart())

    def apart(self) -> float:
        """By weights, by the modes' means, by what is combined and what is stated: the most, in sigmas."""
        sigma = np.sqrt(np.diagonal(self.stacked.combine().covariance, axis1=1, axis2=2))
        by_mode = np.repeat(sigma, self.lanes.weights.shape[1], axis=0)
        found = [
            np.abs(self.lanes.weights / self.stacked.weights - 1.0).max(),
            np.abs((self.lanes.means - self.stacked.means)[:, :9] / by_mode).max(),
        ]
        for one, other in (
            (self.stacked.combine(), self.lanes.combine()),
            (self.stacked.stated(), self.lanes.stated()),
        ):
            found.append(np.abs((other.mean - one.mean) / sigma).max())
            found.append(np.abs((other.covariance - one.covariance) / (sigma[:, :, None] * sigma[:, None])).max())
        return float(max(found))


def offs(seed: int, k: int = 6, size: float = 10.0) -> Floats:
    """Where measurements lie beside what is expected."""
    return np.random.default_rng(seed).normal(0.0, size, (N, k))


@pytest.mark.parametrize("estimator", ["imm", "rmimm"])
def test_position_and_velocity_some_of_it_missing(estimator: str) -> None:
    """After unequal times, a height or a velocity that nobody measured."""
    both = Both.begin(gateways(estimator))
    assert both.step(np.array([0.4, 1.0, 7.0]), offs(1), WHOLE, 25.0) < AGREE
    off = offs(2)
    off[0, 2], off[1, 3:] = math.nan, math.nan
    assert both.step(np.ones(N), off, WHOLE, 25.0, robust=3.0) < AGREE


def test_the_paper_s_three_modes_measured_by_each_mode_s_own_derivative() -> None:
    """Nine states; sensitivities that differ from mode to mode, as a radar's do; transitions that are told."""
    modes = rmimm.modes("rmimm")
    both = Both.begin(modes)
    towards = np.tile(rmimm.ALIGNED, (N, 1, 1))
    own = np.random.default_rng(3).normal(0.0, 1.0, (N * 3, 3, 9))
    assert both.step(np.ones(N), offs(4, 3), own, 100.0, transition=towards) < AGREE
    assert both.step(np.ones(N), offs(5, 3), own, 100.0) < AGREE


def test_what_lies_too_far_out_pulls_no_more() -> None:
    """One outlier among three tracks."""
    both = Both.begin(gateways())
    off = offs(6)
    off[1, 0] = 900.0
    assert both.step(np.ones(N), off, WHOLE, 25.0, robust=3.0) < AGREE


def test_a_sure_measurement_keeps_its_digits() -> None:
    """Ten orders of magnitude surer than the prediction; of a source without an error, whose position it is then."""
    both = Both.begin(rmimm.modes("imm"), far_m=1.0)  # a tenth of a millimetre is rounding far away
    assert both.step(np.ones(N), offs(7, size=1e-4), np.eye(6, 9)[None], 1e-8) < AGREE
    assert np.sqrt(both.lanes.stated().covariance[:, 0, 0]) == pytest.approx(1e-4, rel=1e-3)


def test_an_error_that_is_told_far_too_large_is_taken_from_the_filter() -> None:
    """Ten times what it reckons with, before an update of one component."""
    both = Both.begin(gateways())
    assert isinstance(both.stacked, Stacked)
    assert isinstance(both.lanes, Lanes)
    mixture = both.stacked.mixture
    both.stacked = replace(both.stacked, mixture=replace(mixture, error=10.0 * mixture.error))
    both.lanes = replace(both.lanes, error=10.0 * both.lanes.error)
    assert both.step(np.ones(N), offs(9, 1), WHOLE[:, 2:3], 25.0) < AGREE


def test_tracks_that_lag_behind_say_so() -> None:
    """Innovations to one side, of one track: what lags add is in what is stated, and in what the next may scatter by."""
    both = Both.begin(replace(gateways(), modes=gateways().modes[:2]))
    off = np.zeros((N, 3))
    off[1], off[2] = [45.0, 30.0, 0.0], [3.0, 1.0, 0.0]
    alone = np.array([1.0, 0.0, 0.0])
    for _ in range(3):
        assert both.step(np.ones(N), off, WHOLE[:, :3], 25.0) < AGREE
    stated, own = both.lanes.stated().covariance, both.lanes.combine().covariance
    assert alone @ stated[1, :3, :3] @ alone > 1.5 * alone @ stated[0, :3, :3] @ alone
    assert own.shape == stated.shape == (N, 9, 9)


def test_one_mode_is_a_kalman_filter() -> None:
    """A set of a single mode, of a single track."""
    one = Modes((Mode(0.0, Motion((1.0, 1.0, 0.5), 20.0)),), "imm")
    both = Both.begin(one)
    assert both.step(np.ones(N), offs(8), WHOLE, 25.0) < AGREE
    assert both.lanes.weights == pytest.approx(1.0)
    assert tracks.is_prepared()  # whatever had to be compiled has been, and is kept


def test_literal_is_never_compiled_the_others_are_where_numba_is() -> None:
    """Which way a batch goes."""
    state = Estimate(np.zeros((2, 9)), np.tile(np.eye(9), (2, 1, 1)))
    assert isinstance(tracks.begin(state, rmimm.modes("literal")), Stacked)
    assert isinstance(tracks.begin(state, rmimm.modes("rmimm")), Lanes if packed.INSTALLED else Stacked)


def test_blocks_hold_every_track_once_in_its_order() -> None:
    """Whatever number of tracks, laid out and taken back."""
    for n in (1, 2, 3, 7):
        array = np.arange(n * 6.0).reshape(n, 2, 3)
        plan = Layout.of(n)
        assert (plan.rows(plan.laid(array)) == array).all()
        assert plan.laid(array).shape == (plan.blocks, 2, 3, plan.width)
