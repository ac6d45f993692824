"""What is believed is drawn while it is believed: candidates, alerts of the gates, conflicts; and archived."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from gateway.observation import WeatherArea
from gateway.picture import Picture
from gateway.predict import Candidates, Conflicts
from gateway.predict.finals import GateAlerts
from gateway.settings import DEMO_SITE, Waypoint, Weather
from gateway.sinks.arrow import ArrowSink
from gateway.sinks.parquet import finish
from gateway.sinks.scene.believed import BelievedScene
from gateway.sinks.scene.conflicts import PATH, ConflictScene
from gateway.sinks.scene.entry import Entry, Rows
from gateway.sinks.scene.weather import WeatherScene

PLACE = np.array([[-9000.0, 100.0, 500.0]])


def conflict(at: int, state: str) -> Conflicts:
    """Tracks 1 and 4 a minute before they lose their separation; `state` "": there is no conflict."""
    n = 1 if state else 0
    one = np.ones(n)
    return Conflicts(
        np.full(n, at),
        ((1, 4),) * n,
        (state,) * n,
        np.full(n, at + 70_000_000_000),
        np.full(n, at + 60_000_000_000),
        300.0 * one,
        np.full(n, np.nan),
        0.4 * one,
        0.54 * one,
        1.8 * one,
        np.full(n, np.nan),
        np.array([[PLACE[0], PLACE[0] + [300.0, 0.0, 0.0]]] * n).reshape(-1, 2, 3),
        (at,),
    )


def rows(entries: list[Entry], path: str) -> list[tuple[int, str]]:
    """When the entity has a row, and what is in it, the names of its components."""
    mine = [entry for entry in entries if isinstance(entry, Rows) and entry.path == path]
    return [
        (int(entry.time[0]), " ".join(str(column.component_descriptor()) for column in entry.columns)) for entry in mine
    ]


def with_conflicts(pictures: list[Picture], states: list[str]) -> list[Picture]:
    return [
        replace(one, predict=replace(one.predict, conflicts=conflict(one.now, state)))
        for one, state in zip(pictures, states, strict=True)
    ]


def test_a_conflict_is_drawn_until_it_is_over(pictures) -> None:
    """A row each round while it stands, one that clears when it is over, and none after that."""
    seen = with_conflicts(pictures(1.0)[:5], ["", "found", "goes on", "over", ""])
    drawn = rows(ConflictScene(DEMO_SITE).entries(seen), PATH)
    assert [at for at, _ in drawn] == [one.now for one in seen[1:4]]
    assert ["Clear" in what for _, what in drawn] == [False, False, True]
    assert "labels" in drawn[0][1]


def test_conflicts_are_archived(tmp_path: Path, pictures) -> None:
    """conflicts.parquet has a row a round, with null for a height that is not known."""
    with ArrowSink(tmp_path) as sink:
        for one in with_conflicts(pictures(1.0)[:4], ["", "found", "goes on", "over"]):
            sink.write(one)
    finish(tmp_path)
    table = pq.read_table(tmp_path / "conflicts.parquet")
    assert table["state"].to_pylist() == ["found", "goes on", "over"]
    assert table["other_track"].to_pylist() == [4] * 3
    assert table["vertical_m"].null_count == 3
    assert (
        table["loses_separation"].cast("int64").to_pylist()[0] - table["time"].cast("int64").to_pylist()[0]
        == 60 * 10**9
    )


def test_candidates_and_alerts_are_drawn_while_they_are_believed(pictures) -> None:
    """A track's candidates and what is wrong on its final have a row each round, and are taken away with the last of them."""
    site = replace(DEMO_SITE, waypoints=(Waypoint("IAF", 0.5, 1.8),))
    scene, entries, seen = BelievedScene(site), list[Entry](), pictures(1.0)[:3]
    for one, count in zip(seen, (1, 1, 0), strict=True):
        time, track = np.full(count, one.now), np.full(count, 7)
        told = Candidates(time, track, ("IAF",) * count, 0.6 * np.ones(count), PLACE[:count], ((one.now, (7,)),))
        wrong = GateAlerts(time, track, ("too high",) * count, 40.0 * np.ones(count), PLACE[:count], ((one.now, (7,)),))
        entries += scene.entries([replace(one, predict=replace(one.predict, candidates=told, gates=wrong))])
    for path in ("/predict/7/candidates", "/predict/7/gates"):
        drawn = rows(entries, path)
        assert ["Clear" in what for _, what in drawn] == [False, False, True]


def test_weather_that_is_told_is_drawn_until_it_is_gone(pictures) -> None:
    """A circle or a polygon as it is told, and a row that clears when it is gone."""
    circle, polygon = (
        Weather("CB", 0.54, 1.8, 3000.0),
        Weather("CB", polygon_rad=((0.5, 1.8), (0.51, 1.8), (0.5, 1.81))),
    )
    seen = [
        replace(one, observations=(WeatherArea("CB", one.now, one.now, area),))
        for one, area in zip(pictures(1.0)[:3], (circle, polygon, None), strict=True)
    ]
    drawn = rows(WeatherScene(DEMO_SITE).entries(seen), "/predict/weather/CB")
    assert ["Clear" in what for _, what in drawn] == [False, False, True]
