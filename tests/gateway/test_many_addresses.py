"""Thousands of aircraft over hours: what is remembered is bounded by who is there, not by who ever was."""

from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import pytest

from gateway import pipeline
from gateway.align import SECOND
from gateway.observation import GpsReport, Heard, ImuSample
from gateway.settings import Options
from gateway.state import State

EVERY_S = 0.08  # how soon after each address the next one comes
SHORT = Options(end_after_s=10.0, prediction_period_s=10.0)  # so that few are there at a time


def parade(world: Any, first: int, last: int) -> list[GpsReport]:
    """One address after the other is heard once; times count from address 0's report."""
    template = replace(world.report(world.Course(), 0.0, late_s=0.0), altitude_msl_m=None, pressure_altitude_m=2000.0)
    said = []
    for number in range(first, last):
        at = world.at(number * EVERY_S)
        who = {"aircraft": f"icao:{number:06x}", "callsign": f"T{number}"}
        said.append(replace(template, valid_at=at, received_at=at, **who))
    return said


def run(world: Any, state: State, said: list[GpsReport]) -> State:
    """The state after these, a step for each 20 s of them."""
    heard, edge = [], None
    for one in world.heard(said):
        edge = edge or one.now
        if one.now - edge > 20 * SECOND:
            state, _ = pipeline.step(state, heard)
            heard, edge = [], one.now
        heard.append(one)
    state, _ = pipeline.step(state, heard)
    return state


def test_the_state_after_four_thousand_addresses_is_no_larger_than_after_fifteen_hundred(world: Any) -> None:
    early = run(world, pipeline.initial(world.site, SHORT), parade(world, 0, 1500))
    late = run(world, early, parade(world, 1500, 4000))
    assert late.lanes.next_track > 4000
    assert len(late.association.chosen) < 200  # of the last 12 s
    assert len(pickle.dumps(late)) < 1.2 * len(pickle.dumps(early))


def test_only_so_many_sources_with_unusable_times_are_named(world: Any) -> None:
    said = [replace(one, received_at=one.valid_at + 60 * SECOND) for one in parade(world, 0, 200)]
    ran = world.run(said)
    told = [event for event in ran.events if "late: such data are counted" in event.text]
    assert len(told) == 21
    assert told[-1].text == "more sources are more than 10 s late: such data are counted, not used"
    assert ran.state.counters["too late"] == len(said)


def test_what_no_stage_reads_passes_by(world: Any) -> None:
    """Inertial samples reach the sinks and change no bit of a track."""
    said = world.flight(seconds=20.0)
    samples = [
        ImuSample("mavlink:1", world.at(0.02 * k), world.at(0.02 * k), 1, (0.0, 0.0, -9.81)) for k in range(1000)
    ]
    alone, among = world.run(said), world.run([*said, *samples], until_s=22.0)
    assert world.run(said, until_s=22.0).bits() == among.bits()
    assert len(alone.rows()) > 50
    assert sum(isinstance(one, ImuSample) for picture in among.pictures for one in picture.observations) == 1000


@pytest.mark.parametrize("ticks", ["one", "20 ms"])
def test_a_check_that_falls_due_with_what_no_stage_reads_is_made_all_the_same(world: Any, ticks: str) -> None:
    said = [*world.flight(seconds=15.0, gps_period_s=1.0)]
    due = [one.valid_at + SECOND for one in said if isinstance(one, GpsReport)]
    samples = [ImuSample("mavlink:1", at, at, 1, (0.0, 0.0, -9.81)) for at in due]
    assert world.run([*said, *samples], ticks=ticks).bits() == world.run([*said, *samples]).bits()
    assert isinstance(world.heard(samples)[0], Heard)
