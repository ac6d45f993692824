"""The search that the defaults of the modes are held against."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gateway.settings import Estimation
from sim.studies import tuning
from sim.studies.ensembles import drone


def test_what_is_found_is_better_than_the_defaults_by_its_own_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    """On half a minute of a drone: less RMSE than the defaults, and the settings that are named give it again."""
    monkeypatch.setattr(tuning, "TRIED", {"turn_acceleration_mps2": (0.3, 1.0), "mode_lasts_s": (9.0, 36.0)})
    whole = drone(4, 1)
    case = replace(whole, steps=whole.steps[:80])
    usual_m = tuning.reached_m(case, Estimation())
    best_m, best = tuning.tuned(case, usual_m, lambda share: None)
    assert best_m < usual_m
    assert tuning.reached_m(case, best) == best_m
