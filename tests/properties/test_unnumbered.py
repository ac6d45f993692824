"""Unnumbered plots, whatever is in them: nothing raises, everything is counted, and what is known stays a distribution."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway import pipeline
from gateway.observation import Heard, RadarPlot
from gateway.settings import DEMO_SITE, with_radar
from gateway.track.sight import RadarSight

START, SECOND = 1_790_000_000_000_000_000, 1_000_000_000
SITE = with_radar(DEMO_SITE, replace(DEMO_SITE.radars[0], period_s=0.4))

RANGES = st.none() | st.floats(0.0, 4.3e7) | st.sampled_from([0.0, 1.0, 20_000.0])
AZIMUTHS = st.none() | st.floats(-math.pi, math.pi) | st.sampled_from([-math.pi, 0.1, math.pi])
ELEVATIONS = st.none() | st.floats(-0.5 * math.pi, 0.5 * math.pi) | st.sampled_from([0.05, 0.5 * math.pi])
SIGMAS = st.none() | st.floats(1e-6, 655.0)
PLOTS = st.tuples(st.floats(-3.0, 3.0), RANGES, AZIMUTHS, ELEVATIONS, SIGMAS)


@settings(max_examples=25)
@given(st.lists(st.lists(PLOTS, max_size=6), min_size=2, max_size=12))
def test_whatever_plots_say_nothing_raises(
    scans: list[list[tuple[float, float | None, float | None, float | None, float | None]]],
) -> None:
    """Any ranges, angles, sigmas and times within the history: covariances stay positive and weights add up to 1."""
    state = pipeline.initial(SITE)
    for place, scan in enumerate(scans):
        now = START + place * 2 * SECOND // 5
        plots = []
        for late_s, distance, azimuth, elevation, sigma_m in scan:
            at = now - round(late_s * SECOND)
            plots.append(RadarPlot(1, 0, at, now, distance, azimuth, elevation, range_sigma_m=sigma_m))
        state, _ = pipeline.step(state, [Heard(now, tuple(plots)), Heard(now + SECOND // 5)])
    for watch in state.unnumbered.watches.values():
        bank, density = watch.newest
        assert np.isfinite(bank.mean).all()
        diagonal = np.arange(6)
        assert (bank.covariance[diagonal, diagonal] > 0.0).all()
        assert ((bank.existence >= 0.0) & (bank.existence <= 1.0 + 1e-9)).all()
        assert np.allclose(np.bincount(bank.family, bank.weight, minlength=len(bank.number)), 1.0)
        assert (density.counts > 0.0).all()


@settings(max_examples=100)
@given(
    st.floats(500.0, 60_000.0), st.floats(-3.1, 3.1), st.floats(-0.3, 1.2), st.floats(1.0, 100.0), st.floats(1e-4, 5e-3)
)
def test_a_placed_plot_is_measured_where_it_was(
    distance: float, azimuth: float, elevation: float, range_sigma: float, angle_sigma: float
) -> None:
    """The place of a plot, measured again, gives the plot; its covariance, measured again, the plot's variances."""
    sight, value = RadarSight(), np.array([[distance], [azimuth], [elevation]])
    variance = np.array([[range_sigma**2], [angle_sigma**2], [angle_sigma**2]])
    whole, place, covariance = sight.placed(value, variance)
    again, slope = sight.measured(place)
    assert whole.all()
    assert np.allclose(sight.off(again, value), 0.0, atol=1e-6)
    scatter = np.einsum("kan,abn,lbn->kln", slope, covariance, slope)[:, :, 0]
    assert np.allclose(np.diag(scatter), variance[:, 0], rtol=0.02, atol=0.0)
