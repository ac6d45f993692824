"""Paper 002-7: the flows of many arrivals, on synthetic sets of the paper's size."""

from __future__ import annotations

import pytest

from gateway.offline.flows import cleaned, found
from sim.arrivals import arrivals
from sim.studies.flows import agreement, alike, is_apart, times_off

SETS = range(200, 212)


@pytest.mark.parametrize("seed", SETS)
def test_whole_tracks_tell_four_flows_and_their_times(seed: int) -> None:
    """Adjusted Rand index at least 0.98 on 12 of 12; mean times within 3 %."""
    of = arrivals(seed)
    flows = found([cleaned(track) for track in of.tracks])
    assert agreement(of.labels, flows.labels) >= 0.98
    assert times_off(of, flows) <= 0.03


@pytest.mark.study
@pytest.mark.parametrize("seed", SETS)
def test_shared_centres_tell_them_too(seed: int) -> None:
    """`jaccard` likewise; as printed, more than 8 of 30 in common, it sits on a knife's edge."""
    of = arrivals(seed)
    flows = found([cleaned(track) for track in of.tracks], "jaccard")
    assert agreement(of.labels, flows.labels) >= 0.98
    assert times_off(of, flows) <= 0.03


def test_shared_centres_tell_one_of_the_sets() -> None:
    """One of them in the suite; all as a study."""
    of = arrivals(200)
    tracks = [cleaned(track) for track in of.tracks]
    flows = found(tracks, "jaccard")
    assert agreement(of.labels, flows.labels) >= 0.98
    assert (found(tracks, "jaccard").labels == flows.labels).all()  # the same bits again


@pytest.mark.parametrize("seed", range(300, 304))
def test_two_flows_on_one_way_600_metres_apart_in_height_are_two(seed: int) -> None:
    """Heights count ten times as much as ways; no flow has flights of both."""
    assert is_apart(alike(seed), "default")
