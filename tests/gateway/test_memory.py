"""What is remembered: bounded by construction, and gone when those have gone whom it is about."""

import gc
import sys
from collections.abc import Iterator
from dataclasses import replace
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np
import pytest

from gateway import arriving, pipeline, track, work
from gateway.align import SECOND
from gateway.fuse import lanes, life
from gateway.observation import Heard, Observation, RadarStatus
from gateway.settings import Options
from gateway.state import State

APART = ("site", "options", "frame", "radars")


def held(state: State) -> dict[str, int]:
    """Bytes of what each part of the state holds, all the way down."""
    return {name: _deep_size(getattr(state, name)) for name in State.__dataclass_fields__ if name not in APART}


def _deep_size(root: object) -> int:
    seen: set[int] = set()
    waiting, total = [root], 0
    while waiting:
        one = waiting.pop()
        if id(one) in seen or isinstance(one, type | ModuleType | FunctionType | BuiltinFunctionType):
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        waiting += gc.get_referents(one)
        if isinstance(one, np.ndarray) and one.base is not None:
            waiting.append(one.base)
    return total


def visit(world: Any, number: int, since_s: float) -> list[Observation]:
    """Half a minute of one that nobody saw before: GPS, radar, or both; with a gap, a new radar number, and plots of nothing."""
    course = world.Course(along_m=-20_000.0, left_m=300.0 * (number % 7) - 900.0)
    who, kind = f"icao:{number:06x}", number % 3
    said: list[Observation] = []
    if kind != 0:
        said += [world.report(course, t, aircraft=who, late_s=0.5) for t in (0.1, 2.1, 4.1, 6.1, 20.1, 22.1, 24.1)]
    if kind != 1:
        said += [world.radar_plot(course, 0.4 * k, number=2 * number + 10) for k in range(20)]
        said += [world.radar_plot(course, 10.0 + 0.4 * k, number=2 * number + 11) for k in range(10)]
        said += [world.radar_plot(world.Course(left_m=4000.0), 3.0, number=60_000 + number % 100)]
    shift = round(since_s * SECOND)
    return [replace(one, valid_at=one.valid_at + shift, received_at=one.received_at + shift) for one in said]


def steps(world: Any, visits: range, every_s: float) -> Iterator[list[Heard]]:
    """What is heard of some visits, a step for each."""
    for number in visits:
        yield world.heard(visit(world, number, every_s * number))


def test_after_hours_of_coming_and_going_the_state_is_as_it_was_at_the_beginning(world: Any) -> None:
    """Visitors come and go for an hour and a half; an hour after the last, all parts of the state are as small as at first."""
    options = Options(prediction_period_s=30.0)
    first = pipeline.initial(world.site, options)
    state, _ = pipeline.step(first, [Heard(world.at(0.0))])
    began, busy = held(state), {}
    for heard in steps(world, range(45), 120.0):
        state, _ = pipeline.step(state, heard)
        busy = {name: max(size, busy.get(name, 0)) for name, size in held(state).items()}
    assert state.lanes.next_track > 40
    state, _ = pipeline.step(state, [Heard(world.at(45 * 120.0 + life.REMEMBERED_S + 60.0))])
    ended = held(state)
    for name in ("tracks", "association", "lanes"):
        assert busy[name] > 5 * began[name]
    # What is learnt of a radar is kept, of however many aircraft it was learnt.
    assert ended.pop("registration") < 20_000
    del began["registration"]
    # what is left: numbers that have become larger ints, a few counters, and sentences that are said once
    left = {name: ended[name] - began[name] for name in ended if ended[name] > began[name] + 64}
    assert left.keys() <= {"said", "counters"}
    assert sum(ended.values()) < sum(began.values()) + 1000


def test_aircraft_that_are_gone_are_remembered_in_a_bounded_number(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many that came and went the latest are remembered, and for an hour at most."""
    monkeypatch.setattr(life, "REMEMBERED", 10)
    state = pipeline.initial(world.site, Options(prediction_period_s=30.0))
    for heard in steps(world, range(25), 20.0):
        state, _ = pipeline.step(state, heard)
    assert 5 < len(state.lanes.gone) <= 10
    assert all(one.event is None or one.ended_at > world.at(400.0) for one in state.lanes.gone.values())
    state, _ = pipeline.step(state, [Heard(world.at(500.0 + 3700.0))])
    assert not state.lanes.gone


def test_a_track_keeps_so_many_states_and_no_more(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """A source that says more in 10 s than is kept has a shorter history, in the same way whatever the ticks."""
    said = world.flight(seconds=7.0, gps_period_s=0.1)
    wanted = world.run(said)
    monkeypatch.setattr(lanes, "EVENTS_AT_MOST", 40)
    monkeypatch.setattr(track.numbered, "PLOTS_AT_MOST", 12)
    runs = [world.run(said, ticks=ticks) for ticks in ("one", "20 ms", "all")]
    for ran in runs:
        assert max(len(lane.events) for lane in ran.state.lanes.lanes.values()) == 40
        assert max(len(plots) for plots in ran.state.tracks.plots.values()) == 12
        assert ran.bits() == runs[0].bits()
    assert {row["track"] for row in runs[0].rows()} == {row["track"] for row in wanted.rows()}
    assert len(runs[0].rows()) > 100


def test_more_aircraft_than_are_kept_are_counted(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that were there first stay; the others' reports are counted and that is said once."""
    monkeypatch.setattr(arriving, "AIRCRAFT_AT_MOST", 3)
    course = world.Course()
    said = [world.report(course, t, aircraft=f"icao:{k:06x}") for t in (0.1, 1.1, 2.1) for k in range(5)]
    ran = world.run(said)
    assert {row["aircraft"] for row in ran.rows()} == {f"icao:{k:06x}" for k in range(3)}
    assert ran.state.counters["reports of more aircraft than are kept"] == 6
    assert len(ran.said("more than 3 aircraft at a time")) == 1
    assert set(ran.state.association.chosen) <= {row["aircraft"] for row in ran.rows()}


def test_more_radar_tracks_than_are_kept_are_counted(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Plots of further radar tracks are those of no track."""
    monkeypatch.setattr(track.numbered, "TRACKS_AT_MOST", 2)
    said = [world.radar_plot(world.Course(), 0.4 * k, number=number) for k in range(4) for number in (1, 2, 3)]
    ran = world.run(said)
    assert len(ran.state.tracks.plots) == 2
    assert sum(picture.track.untracked for picture in ran.pictures) == 4


def test_strangers_cannot_make_us_remember_radars_or_sentences_without_end(world: Any) -> None:
    """Of status from 200 radars 64 are believed; of plots from 2000 unknown ones 500 sentences are said."""
    at, place = world.at(1.0), (0.54, 1.81, 500.0, 1.57)
    places = [RadarStatus(number, at, at, "operating", "search", 0.4, *place) for number in range(200)]
    ran = world.run(places)
    assert len(ran.state.radars) == 64
    assert ran.state.counters["status of more radars than are kept"] == 200 - 64
    plots = [world.radar_plot(world.Course(), 0.001 * k) for k in range(2000)]
    strange = world.run([replace(plot, radar=1000 + k) for k, plot in enumerate(plots)])
    assert len(strange.state.said) == 500
    assert strange.state.counters["plots of an unknown radar"] == 2000


def test_numbers_of_radar_tracks_are_forgotten_and_never_mixed_up(world: Any) -> None:
    """A number that was silent for long is forgotten; used again, it is a radar track that never was before."""
    state = pipeline.initial(world.site)
    first = world.heard([world.radar_plot(world.Course(), 0.4 * k, number=5) for k in range(5)])
    state, _ = pipeline.step(state, first)
    (key,) = state.tracks.plots
    state, _ = pipeline.step(state, [Heard(world.at(40.0))])
    assert not state.tracks.episode
    again = world.heard([world.radar_plot(world.Course(), 50.0 + 0.4 * k, number=5) for k in range(5)])
    state, _ = pipeline.step(state, again)
    assert set(state.tracks.plots) & {key} == set()


def test_of_many_aircraft_that_scatter_otherwise_than_stated_the_first_are_named(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of six scatters by 60 m and says 20: two are named, then it is said once that there are more."""
    monkeypatch.setattr(work, "NAMED_AT_MOST", 2)
    random = np.random.default_rng(1)
    said = [
        world.report(
            world.Course(),
            t_s,
            aircraft=f"icao:{k:06x}",
            off_m=random.normal(0.0, 60.0, 3),
            horizontal_sigma_m=20.0,
        )
        for t_s in np.arange(0.1, 60.0, 1.0).tolist()
        for k in range(6)
    ]
    ran = world.run(said)
    assert len(ran.said("its position scatters")) == 2
    assert len(ran.said("more aircraft")) == 1
