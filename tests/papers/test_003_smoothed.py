"""Paper 003's approach smoothed: what later measurements take off the filter's error, and whether it says how sure it is."""

from __future__ import annotations

import numpy as np
import pytest

from gateway.settings import EstimatorName
from sim.cases import case_003
from sim.studies.fusion import COUNTED_FROM_S, accuracy_of
from sim.studies.smoothing import Pair, pair_of, run

SEED = 1
REACH = 0.75  # of the filter's error; 200 runs give 0.4 to 0.5 in every band


@pytest.mark.parametrize("estimator", ["kalman", "rmimm"])
def test_smoothing_takes_a_quarter_off_at_every_distance(estimator: EstimatorName) -> None:
    """On a few draws: at most 0.75 of the filtered error over all and in each band, and no overconfidence."""
    case = case_003(2, SEED)
    pair = pair_of(case, estimator)
    before, after = accuracy_of(case, pair.filtered_m), accuracy_of(case, pair.smoothed_m)
    assert after.overall_m <= REACH * before.overall_m
    assert all(s <= REACH * f for s, f in zip(after.bands_m, before.bands_m, strict=True))
    # The mean of three degrees of freedom over two flights, whose errors last for minutes: sigma is about 0.6.
    assert 1.0 < honesty(case.plot_s, pair) < 4.5


def honesty(plot_s: np.ndarray, pair: Pair) -> float:
    return float(np.nanmean(pair.smoothed_nees[:, plot_s >= COUNTED_FROM_S]))


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2])
def test_the_study_reaches_it_over_200_runs(seed: int) -> None:
    """Every estimator, with and without an error of the position source, over all and in the worst band."""
    figures = run(200, seed).figures
    ratios = {name: value for name, value in figures.items() if "ratio" in name}
    assert len(ratios) == 12
    assert max(ratios.values()) <= REACH
