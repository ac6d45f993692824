"""The dead reckoning of many vehicles: what waits to be worked, and how a crowd is spread over the second."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache

import numpy as np
import pytest

from gateway.observation import Attitude, Heard, ImuSample, Many
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.reckon import reckoners as many
from gateway.reckon.reckoners import TOGETHER, Reckoners
from gateway.reckon.told import Series, before, by_share, portioned
from gateway.settings import Options, Runway, Site
from sim.inertial import aeroplane
from sim.told_rides import Teller, heard

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
SITE = Site("here", Runway(math.radians(47.4), math.radians(8.5), 500.0, 0.0, geoid_separation_m=0.0))
QUIET = Options(horizons_s=(10.0,), prediction_period_s=60.0)  # nothing here is about predictions

CROWD = TOGETHER + 3


@cache
def crowd_told() -> tuple[Heard, ...]:
    """Twelve seconds of more vehicles than a share has; for the last six without positions."""
    tellers = []
    for number in range(CROWD):
        generator = np.random.default_rng([11, number])
        falsified = lambda time_s: None if time_s > 6.0 else (0.0, 0.0, 0.0, 0.0)  # noqa: E731
        tellers.append(Teller.of(f"mavlink:{number + 1}", 1, aeroplane(generator, 12.0), generator, falsified))
    return tuple(heard(tellers, START, 5))


def samples_of(one: Heard) -> list[Many]:
    """The inertial samples of each vehicle."""
    return [each for each in one.observations if isinstance(each, Many)]


def pictures(said: Sequence[Heard], at_once: int) -> Iterator[Picture]:
    """Of arrivals, and a little of the time after them, worked so many at once."""
    state, said = initial(SITE, QUIET), [*said, Heard(said[-1].now // SECOND * SECOND + 2 * SECOND - 1)]
    for place in range(0, len(said), at_once):
        state, picture = step(state, said[place : place + at_once])
        yield picture


def crowd_rows(at_once: int) -> list[tuple[int, str | None, str, bytes]]:
    """What is written of a crowd, in order of time: when, of whom, by what, and the bits of where."""
    found = []
    for picture in pictures(crowd_told(), at_once):
        fuse = picture.fuse
        for row, at in enumerate(fuse.time.tolist()):
            bits = fuse.latitude_rad[row].tobytes() + fuse.velocity_mps[row].tobytes() + fuse.covariance[row].tobytes()
            found.append((at, fuse.aircraft[row], fuse.updated_by[row], bits))
    return sorted(found)


def test_a_crowd_goes_on_in_shares_within_the_second_and_is_where_it_would_be_if_all_did_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    in_shares, at_once = crowd_rows(10), crowd_rows(200)
    assert in_shares == at_once
    led = [row for row in in_shares if row[2] == "dead-reckoning"]
    assert len(led) >= 2 * CROWD
    assert not [row for row in in_shares if row[2] == "coast"]
    monkeypatch.setattr(many, "TOGETHER", CROWD)
    assert [row for row in crowd_rows(200) if row[2] == "dead-reckoning"] == led


def test_a_step_in_a_crowd_is_told_within_two_seconds_and_does_not_reach_its_track(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(many, "TOGETHER", 1)
    tellers = []
    for number, aside_m in enumerate((0.0, 50.0)):
        generator = np.random.default_rng([12, number])
        falsified = lambda time_s, aside_m=aside_m: (aside_m * (time_s > 33.0), 0.0, 0.0, 0.0)  # noqa: E731
        tellers.append(Teller.of(f"mavlink:{number + 1}", 1, aeroplane(generator, 38.0), generator, falsified))
    motion, off_m, said = tellers[1].ride.motion, list[float](), list[tuple[float, str]]()
    for picture in pictures(tuple(heard(tellers, START, 5)), 10):
        said += [((one.at - START) / SECOND, one.text) for one in picture.events if "deny" in one.text]
        for row, at in enumerate(picture.fuse.time.tolist()):
            place = round((at - START) / SECOND * 50.0)
            if picture.fuse.aircraft[row] == "mavlink:2" and 20 * 50 < place < len(motion.height_m):
                off_m.append(abs(picture.fuse.latitude_rad[row] - motion.latitude_rad[place]) * 6.367e6)
    ((at_s, text),) = said
    assert text.startswith("mavlink:2")
    assert 33.5 < at_s <= 35.0
    assert max(off_m) < 15.0


def test_a_crowd_is_planned_in_shares_of_a_few_evenly_over_the_second_and_a_few_vehicles_at_once() -> None:
    samples = samples_of(crowd_told()[0])
    planned = Reckoners().hearing(0, samples).planning(START + SECOND).planned
    assert [at - START - SECOND for at, _ in planned] == [SECOND // 4, 3 * SECOND // 4]
    assert [len(share.names) for _, share in planned] == [TOGETHER, CROWD - TOGETHER]
    assert [len(share.told) for _, share in planned] == [TOGETHER, CROWD - TOGETHER]
    doubted = Reckoners().hearing(0, samples).suspecting("mavlink:8").planning(START + SECOND).planned
    assert [(at - START - SECOND, len(share.names)) for at, share in doubted] == [
        (0, 1),
        (SECOND // 4, TOGETHER),
        (3 * SECOND // 4, CROWD - 1 - TOGETHER),
    ]
    assert doubted[0][1].names == ("mavlink:8",)
    few = Reckoners().hearing(0, samples[:TOGETHER]).planning(START + SECOND).planned
    assert [(at, len(share.names)) for at, share in few] == [(START + SECOND, TOGETHER)]


def test_columns_of_several_vehicles_are_parted_among_their_shares() -> None:
    one, other = samples_of(crowd_told()[0])[:2]
    both = Many(ImuSample, {name: np.concatenate([one.columns[name], other.columns[name]]) for name in one.columns})
    shares = by_share([both], {"mavlink:1": 0, "mavlink:2": 1})
    assert [[len(each) for each in shares[number]] for number in (0, 1)] == [[len(one)], [len(other)]]
    assert portioned(shares[1])["mavlink:2"][0].values.tolist() == portioned([other])["mavlink:2"][0].values.tolist()


def test_series_are_the_same_whatever_came_first() -> None:
    generator = np.random.default_rng(1)
    at, values = generator.integers(0, 30, 40), generator.standard_normal((40, 2))
    once = Series.empty(2).with_more(Series(at, values))
    order = generator.permutation(40)
    parts = Series.empty(2)
    for place in order:
        parts = parts.with_more(Series(at[place : place + 1], values[place : place + 1]))
    assert once.at.tolist() == parts.at.tolist()
    assert once.values.tolist() == parts.values.tolist()


def test_what_was_received_at_an_instant_or_later_waits_for_the_next() -> None:
    samples = [each for one in crowd_told()[:3] for each in samples_of(one)[:1]]
    until = int(samples[1].columns["received_at"][0])
    earlier, later = before(samples, until)
    portion = portioned(earlier)
    assert len(portion["mavlink:1"][0].at) == 5
    assert sum(len(one) for one in later if isinstance(one, Many)) == 10


def test_what_waits_one_by_one_keeps_its_order_and_is_few_parts() -> None:
    """Tens of thousands a second come one by one before the session's time has settled: the parts must not be copied for each."""
    reckoners = Reckoners()
    for number in range(1000):
        reckoners = reckoners.hearing(
            SECOND if number >= 900 else 0, [Attitude("mavlink:1", number, number, 0.0, 0.0, 0.0)]
        )
    assert len(reckoners.waiting) <= 20
    said = [(added, one.received_at) for added, some in reckoners.waiting for one in some]
    assert said == [(SECOND if number >= 900 else 0, number) for number in range(1000)]
