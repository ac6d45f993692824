"""How dense a radar's clutter is: given, or learnt from its scans; and how often it sees a target."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.track.density import ELEVATION_RAD, Density

GREATEST_M = 60_000.0


def plots(count: int, low_m: float, high_m: float, seed: int = 1) -> NDArray[np.float64]:
    """Plots (3, count) between two ranges, in azimuths of half a radian, up to 10 degrees."""
    random = np.random.default_rng(seed)
    return random.uniform([low_m, 0.0, 0.0], [high_m, 0.5, ELEVATION_RAD], (count, 3)).T


def learnt(per_scan: int, scans: int) -> Density:
    """After scans of so many plots between 6 and 12 km."""
    density = Density.at_first(GREATEST_M, None, None)
    for scan in range(scans):
        value = plots(per_scan, 6000.0, 12_000.0, scan)
        density = density.after(value, np.ones(per_scan), 1.0)
    return density


def test_a_shower_is_learnt_within_twenty_scans() -> None:
    """The density inside is within a third of what falls there; ten kilometres further it is far less."""
    density = learnt(30, 20)
    volume = 6000.0 * 0.5 * ELEVATION_RAD
    inside, _ = density.of(plots(200, 7500.0, 10_500.0))
    outside, _ = density.of(plots(200, 25_000.0, 30_000.0))
    assert np.median(inside) == pytest.approx(30 / volume, rel=0.33)
    assert np.median(outside) < 0.01 * np.median(inside)


def test_what_tracks_explain_is_no_clutter() -> None:
    """Plots that a track explains leave the density as it is where nothing is."""
    density = Density.at_first(GREATEST_M, None, None)
    value = plots(30, 6000.0, 12_000.0)
    after = density.after(value, np.zeros(30), 1.0)
    assert after.of(value)[0] == pytest.approx(density.of(value)[0])


def test_what_is_given_is_not_learnt() -> None:
    """Clutter and detection of the site file stay, whatever the scans say."""
    density = Density.at_first(GREATEST_M, 40.0, 0.8)
    value = plots(300, 6000.0, 12_000.0)
    after = density.after(value, np.ones(300), 1.0).detecting(0, 50)
    assert after.counts.sum() == pytest.approx(40.0)
    assert after.detection == 0.8


def test_detection_follows_what_confirmed_tracks_show() -> None:
    """Of 2000 looks six in ten had a plot: the probability of detection is near 0.6."""
    density = Density.at_first(GREATEST_M, None, None)
    for _ in range(200):
        density = density.detecting(6, 10)
    assert density.detection == pytest.approx(0.6, abs=0.01)


def test_a_partial_plot_s_density_is_of_what_was_measured() -> None:
    """Without its elevation a plot's clutter is counted by range and azimuth: the cell's plots over the cell's area."""
    density = learnt(30, 5)
    value = plots(1, 8000.0, 8001.0)
    whole, _ = density.of(value)
    value[2] = np.nan
    level, _ = density.of(value)
    assert level == pytest.approx(whole * ELEVATION_RAD)


def test_around_the_back_is_one_place() -> None:
    """Azimuths of half a turn to either side lie in neighbouring cells, and what is in one counts for the other."""
    density = Density.at_first(GREATEST_M, None, None)
    value = np.array([[9000.0], [math.pi - 0.01], [0.1]]).repeat(20, axis=1)
    density = density.after(value, np.ones(20), 1.0)
    here, far = (density.of(np.array([[9000.0], [azimuth], [0.1]]))[0][0] for azimuth in (-math.pi + 0.01, 0.0))
    assert here > 100.0 * far
