"""Whether sources scatter as much as the settings say, and what the program says where they do not."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.fuse.consistency import PLOT, SOURCES_AT_MOST, Consistency, Sums
from gateway.fuse.events import Residual
from gateway.settings import Options, PositionSource, Site

SIGMA_M = 15.0


def _after(innovations: list[float], scatter_m: float = 18.0) -> Sums:
    """Sums after innovations of one component in metres, stated to have SIGMA_M and expected to scatter by more."""
    sums, before = Sums(), None
    for innovation in innovations:
        before = Residual.after(before, np.array([innovation]), np.array([innovation / scatter_m]))
        sums = sums.then(before, slice(0, 1), SIGMA_M)
    return sums


@pytest.mark.parametrize("seed", range(5))
def test_noise_as_stated_is_as_stated(seed: int) -> None:
    """Innovations that scatter as they should say nothing, at any time, nor do those of a filter that fears too much."""
    noise = np.random.default_rng(seed).standard_normal(1500)
    for scatter_m in (16.0, 18.0, 30.0):
        sums, before = Sums(), None
        for innovation in noise * min(scatter_m, 18.0):
            before = Residual.after(before, np.array([innovation]), np.array([innovation / scatter_m]))
            sums = sums.then(before, slice(0, 1), SIGMA_M)
            assert sums.factor is None


@pytest.mark.parametrize("factor", [1.5, 1.0 / 1.5])
def test_noise_that_is_not_as_stated_is_found_with_its_factor(factor: float) -> None:
    """600 innovations of 1.5 times as much noise, or as little, give that factor to 15 %."""
    noise = np.random.default_rng(3).standard_normal(600)
    assert _after(list(factor * 18.0 * noise)).factor == pytest.approx(factor, rel=0.15)


def test_a_lag_and_a_turn_are_no_noise() -> None:
    """Innovations that are wrong to one side for long, and now and then a large one, are not taken for noise."""
    noise = 18.0 * np.random.default_rng(4).standard_normal(800)
    lag = 60.0 * np.sin(np.arange(800) / 40.0)
    jump = np.where(np.arange(800) % 100 == 50, 150.0, 0.0)
    assert _after(list(noise + lag + jump)).factor is None


def test_a_component_that_is_never_measured_says_nothing() -> None:
    """NaN adds nothing to any sum."""
    assert _after([math.nan] * 200) == Sums()


def test_sources_are_bounded(world: Any) -> None:
    """Those least lately heard are forgotten."""
    known = {(f"GPS of {name}", "position", True): Sums() for name in range(SOURCES_AT_MOST + 10)}
    kept, _ = Consistency(known).judged(PositionSource(), {})
    assert len(kept.sums) == SOURCES_AT_MOST
    assert ("GPS of 0", "position", True) not in kept.sums


def _said(world: Any, site: Site, seconds: float = 100.0, **options: Any) -> list[str]:
    ran = world.with_site(site).run(world.flight(seconds=seconds, gps_period_s=1.0), options=Options(**options))
    return [event.text for event in ran.events if "scatters" in event.text]


def _stated(world: Any, **sigmas: float) -> Site:
    radar = world.site.radars[0]
    return replace(world.site, radars=(replace(radar, **sigmas),))


@pytest.mark.parametrize("estimator", ["kalman", "rmimm"])
def test_an_honest_session_says_nothing(world: Any, estimator: str) -> None:
    """With noise as stated, and a constant error of 60 m as the site allows, nothing is said of any source."""
    assert _said(world, world.site, estimator=estimator) == []


@pytest.mark.parametrize(("stated_m", "estimator"), [(10.0, "kalman"), (22.5, "kalman"), (10.0, "rmimm")])
def test_a_radars_range_stated_wrongly_is_said_once_with_what_to_set(
    world: Any, estimator: str, stated_m: float
) -> None:
    """15 m stated as 10 or as 22.5 is one sentence that names the radar, the key and about 15 m; others are not named."""
    (text,) = _said(
        world, _stated(world, range_sigma_m=stated_m), seconds=160.0 if stated_m > 15.0 else 80.0, estimator=estimator
    )
    assert text.startswith("radar 1: its range scatters")
    assert "set range_sigma_m = " in text
    assert float(text.split("range_sigma_m = ")[1].split()[0]) == pytest.approx(15.0, rel=0.2)


def test_a_position_source_stated_wrongly_is_said_with_its_aircraft(world: Any) -> None:
    """Reports of 15 m that are stated as 10 m: the sentence names the vehicle and sigma_m."""
    site = replace(world.site, position=replace(world.site.position, sigma_m=10.0))
    (text,) = _said(world, site, seconds=200.0)
    assert text.startswith("GPS of mavlink:1: its position scatters")
    assert "set sigma_m = 1" in text


def test_what_a_stream_says_of_itself_is_never_too_careful(world: Any) -> None:
    """A receiver that says 40 m and scatters by 15 is believed: its error may last; one that says 6 m is not."""
    for said_m, expected in ((40.0, 0), (6.0, 1)):
        ran = world.run(world.flight(seconds=150.0, gps_period_s=1.0, radars=(), horizontal_sigma_m=said_m))
        assert len(ran.said("scatters")) == expected
    assert "its stream says (6 m)" in ran.said("scatters")[0].text


def test_a_receiver_whose_errors_last_is_believed(world: Any) -> None:
    """Reports that are all off by the same few metres change by nothing: that says nothing of 15 m, which they may be off by."""
    reports = [world.report(world.Course(), 0.5 * k, off_m=(6.0, -5.0, 4.0)) for k in range(300)]
    assert world.run(reports).said("scatters") == []


def test_the_parts_of_a_plot_are_keys_of_the_site_file(world: Any) -> None:
    """What is said to be set can be set: each key is one that a radar's table has."""
    assert {part.key for part in PLOT} == {"range_sigma_m", "azimuth_sigma_deg", "elevation_sigma_deg"}


def test_sources_that_are_gone_for_an_hour_are_forgotten() -> None:
    """What is known of a source stays while it is heard, and an hour longer."""
    known = {(f"GPS of {name}", "position", True): Sums(1.0) for name in "ab"}
    hour = 3_600_000_000_000
    kept, _ = Consistency(known, heard={"GPS of a": 0, "GPS of b": hour}).judged(PositionSource(), {}, hour + 1)
    assert list(kept.sums) == [("GPS of b", "position", True)]
    assert list(kept.heard) == ["GPS of b"]
