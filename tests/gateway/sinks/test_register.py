"""What is drawn of registration: errors with their sigma and what is taken off, residuals by radar, and the verdicts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.picture import Picture
from gateway.register import Registered, Residuals
from gateway.settings import DEMO_SITE
from gateway.sinks.scene.entry import Always, Entry, Rows
from gateway.sinks.scene.register import VERDICT, RegisterScene

SECOND = 1_000_000_000
HALF = math.radians(0.5)


def told(**changes: Any) -> Registered:
    """Radar 1: range and azimuth found and taken off in part, elevation not observable, time not told."""
    error = np.array([[150.0, HALF, 0.01, math.nan]])
    sigma = np.array([[2.0, 0.1 * HALF, 0.2, math.nan]])
    words = (
        ("range: measures 150.0 m too far (+- 2.0): applied", "azimuth: applied", "elevation: not observable", ""),
    )
    correction, applied = np.array([[100.0, HALF, 0.0, 0.0]]), np.array([[True, True, False, False]])
    return replace(Registered((1,), correction, error, sigma, applied, words), **changes)


@pytest.fixture
def drawn(pictures: Callable[..., list[Picture]]) -> Any:
    """Draws what register told, a second after the other; the entries by path."""

    def draw(*some: Registered) -> dict[str, list[Entry]]:
        first = pictures(0.5)[0]
        given = [replace(first, register=one, now=first.now + k * SECOND) for k, one in enumerate(some)]
        found: dict[str, list[Entry]] = {}
        for entry in RegisterScene(DEMO_SITE).entries(given):
            found.setdefault(entry.path, []).append(entry)
        return found

    return draw


def values(entries: Sequence[Entry]) -> Any:
    """The numbers or texts of the rows of one entity."""
    return [
        value for entry in entries if isinstance(entry, Rows) for value in entry.columns[0].as_arrow_array().to_pylist()
    ]


def test_an_error_is_drawn_with_its_sigma_and_with_what_is_taken_off(drawn: Any) -> None:
    """Taken off, found, one sigma below and above, in metres and degrees."""
    found = drawn(told())
    assert values(found["/register/error/range/1"]) == [[100.0, 150.0, 148.0, 152.0]]
    assert values(found["/register/error/azimuth/1"])[0] == pytest.approx([0.5, 0.5, 0.45, 0.55])


def test_what_geometry_does_not_tell_is_not_drawn(drawn: Any) -> None:
    """An elevation known to 11 degrees only, or a time that nothing tells, leaves just what is taken off."""
    found = drawn(told())
    for what in ("elevation", "time"):
        taken_off, *others = values(found[f"/register/error/{what}/1"])[0]
        assert taken_off == 0.0
        assert all(map(math.isnan, others))


def test_residuals_are_points_of_each_radar_before_and_after(drawn: Any) -> None:
    """In the order of time; components that were not measured, and angles far from the others', are left out."""
    before = np.array([[150.0, HALF, math.nan], [160.0, HALF, math.nan], [140.0, 5 * HALF, math.nan], [3.0, 0.0, 0.0]])
    some = Residuals(np.array([30, 10, 20, 40]), np.array([1, 1, 1, 2]), ("a", "b", "c", "a"), before, 0.5 * before)
    found = drawn(told(residuals=some))
    assert values(found["/register/residual/range/1"]) == [[160.0, 80.0], [140.0, 70.0], [150.0, 75.0]]
    assert len(values(found["/register/residual/azimuth/1"])) == 2
    assert "/register/residual/elevation/1" not in found
    assert values(found["/register/residual/elevation/2"]) == [[0.0, 0.0]]


def test_the_verdicts_are_told_in_words_when_they_change(drawn: Any) -> None:
    """Once while they stay as they are; a wrong prior comes first."""
    found = drawn(told(), told(), told(prior_wrong=True))[VERDICT]
    assert len([entry for entry in found if isinstance(entry, Always)]) == 1
    first, second = (value[0] for value in values(found))
    assert "- range: measures 150.0 m too far (± 2.0): applied" in first
    assert "| time, ms | – | – | 0 |" in first
    assert second.startswith("**The position sources are further off than was assumed")


def test_before_the_first_pair_it_says_so(drawn: Any) -> None:
    """Only what the site file has taken off is drawn."""
    found = drawn(Registered.untold((1, 2), np.zeros((2, 4))))
    assert values(found[VERDICT])[0][0].count("No pair has told anything yet.") == 2
    assert values(found["/register/error/range/2"])[0][0] == 0.0
