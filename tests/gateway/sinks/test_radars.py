"""What several radars alone have of an aircraft is drawn beside what it says itself, and leaves the scene with its track."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gateway.associate import MultiRadar
from gateway.fuse import Ended
from gateway.picture import Picture
from gateway.settings import DEMO_SITE
from gateway.sinks.scene.entry import Always
from gateway.sinks.scene.radars import MultiRadarScene

SECOND = 1_000_000_000


@pytest.fixture
def seen(pictures: Callable[..., list[Picture]]) -> list[Picture]:
    """Five seconds, in each of which tracks 1 and 12 have a point of the radars'; with the last, track 12 ends."""
    first = pictures(0.5)[0]
    made = []
    for k in range(5):
        at = first.now + k * SECOND
        there = np.array([[-20_000.0 + 80.0 * k, 0.0, 900.0], [-9_000.0, 50.0 * k, 700.0]])
        sigma = np.full((2, 3), 10.0 + k)
        rows = MultiRadar(np.full(2, at), np.array([1, 12]), ("1/3 2/7", "1/4 2/8"), there, 0.0 * there, sigma)
        ended = (Ended(at, 12, "no data for 30 s"),) if k == 4 else ()
        associate, fuse = replace(first.associate, radars=rows), replace(first.fuse, ended=ended)
        made.append(replace(first, step=k, now=at, associate=associate, fuse=fuse))
    return made


def test_each_has_a_line_and_its_sigma_and_leaves_with_its_track(seen: list[Picture]) -> None:
    """A row a second of sigma, a trail that grows; and of the track that ended, a clearing of everything below."""
    entries = [entry for entry in MultiRadarScene(DEMO_SITE).entries(seen) if not isinstance(entry, Always)]
    by_path: dict[str, int] = {}
    for entry in entries:
        by_path[entry.path] = by_path.get(entry.path, 0) + len(entry.time)
    assert by_path["/track/radars/1"] == 5
    assert by_path["/track/radars/1/trail/0"] == by_path["/track/radars/12/trail/0"] == 4
    assert by_path["/track/radars/12"] == 6
    assert entries[-1].path == "/track/radars/12"


def test_without_several_radars_nothing_is_drawn(pictures: Callable[..., list[Picture]]) -> None:
    """Where one radar sees the aircraft its plots are all that there is."""
    assert MultiRadarScene(DEMO_SITE).entries(pictures(5.0)) == []
