"""Arrival flows: cleaning, outliers, order, files, the command."""

from __future__ import annotations

import csv
import gzip
import json
import math
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from gateway.cli.app import run
from gateway.estimators.fuzzy import feature_points, fuzzy_means
from gateway.offline.flows import OUTLIER, Track, by_distance, cleaned, found
from sim.arrivals import arrivals

DATA = Path(__file__).parents[4] / "shared" / "data" / "arrivals-lfpg.csv.gz"
LABELS = Path(__file__).parents[2] / "data" / "arrivals_lfpg_flows.csv"


def test_points_that_nothing_could_have_flown_to_go() -> None:
    """A point 50 km aside for a second, and one that is 10 km up; the rest stays as it was."""
    time = np.arange(-100.0, 1.0)
    place = np.stack([100.0 * time, 0.0 * time, -5.0 * time], axis=-1)
    damaged = place.copy()
    damaged[40, 1] = 50_000.0
    damaged[70, 2] = 10_000.0
    found_track = cleaned(Track("one", time, damaged))
    np.testing.assert_array_equal(found_track.place_m, np.delete(place, [40, 70], axis=0))


def test_who_comes_another_way_than_all_others_is_alone() -> None:
    """A flight that circles, and one from nowhere: named as outliers, the flows stay."""
    of = arrivals(5)
    angle = np.linspace(0.0, 6.0 * np.pi, 900)
    holding = np.stack(
        [-60_000.0 + 9_000.0 * np.cos(angle), 50_000.0 + 9_000.0 * np.sin(angle), 0.0 * angle + 3000.0], axis=-1
    )
    stranger = Track("holding", np.arange(-899.0, 1.0), holding)
    tracks = [cleaned(one) for one in (*of.tracks, stranger)]
    flows = found(tracks)
    assert flows.labels[-1] == OUTLIER
    assert flows.membership[-1] == 0.0
    assert len(flows.flows) == 4
    assert [len(flow.flights) for flow in flows.flows] == sorted(
        (len(flow.flights) for flow in flows.flows), reverse=True
    )


def test_the_order_of_flights_does_not_matter() -> None:
    """The same flights in another order are in the same flows."""
    of = arrivals(7)
    tracks = [cleaned(one) for one in of.tracks]
    order = np.random.default_rng(1).permutation(len(tracks))
    straight, shuffled = found(tracks), found([tracks[place] for place in order])
    assert (straight.labels[order] == shuffled.labels).all()


def test_a_track_at_distances_to_go_ends_at_its_end() -> None:
    """What begins nearer than asked for stays where it began."""
    track = Track(
        "one", np.arange(-10.0, 1.0), np.stack([np.arange(0.0, 11.0) * 100.0, np.zeros(11), np.zeros(11)], axis=-1)
    )
    places = by_distance(track, 2000.0)
    np.testing.assert_allclose(places[-1], [1000.0, 0.0, 0.0])
    np.testing.assert_allclose(places[0], [0.0, 0.0, 0.0])


def test_fuzzy_means_finds_separate_heaps() -> None:
    """Three heaps, three centres; memberships sum to 1; the same again."""
    generator = np.random.default_rng(2)
    heaps = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    points = np.concatenate([heap + 0.02 * generator.standard_normal((40, 2)) for heap in heaps])
    centres, membership = fuzzy_means(points, 3)
    assert np.abs(np.sort(centres.sum(axis=1)) - [0.0, 1.0, 1.0]).max() < 0.05
    np.testing.assert_allclose(membership.sum(axis=1), 1.0)
    assert (fuzzy_means(points, 3)[0] == centres).all()
    assert len(feature_points(points, 0.3)) == 3


def _csv(path: Path, seed: int) -> Path:
    """Two flows of six flights, a row each ten seconds."""
    of = arrivals(seed, (6, 6), (300.0, 60.0), (5000.0, 4000.0), (900.0, 800.0))
    rows = ["fid,timestamp,icao24,callsign,latitude,longitude,altitude"]
    for number, track in enumerate(of.tracks):
        begun = 1.6e9 + 3600.0 * number
        for second, (east, north, up) in zip(track.time_s[::10], track.place_m[::10], strict=True):
            place = f"{49.0 + north / 111_200.0:.6f},{2.5 + east / 72_950.0:.6f},{up / 0.3048 + 400.0:.0f}"
            rows.append(f"f{number},{begun + second},abc,CALL{number},{place}")
    with gzip.open(path, "wt") as file:
        file.write("\n".join(rows) + "\n")
    return path


def test_recorded_adsb_becomes_flows_tables_and_a_drawing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two flows of six, read from a gzipped CSV; who belongs to which is archived."""
    path = _csv(tmp_path / "arrivals.csv.gz", 3)
    assert run(["flows", str(path), "--least", "5", "--archive", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert [len(flow["flights"]) for flow in told["flows"]] == [6, 6]
    assert told["alone"] == []
    assert np.abs(np.array(told["airport_deg"]) - [49.0, 2.5]).max() < 0.02
    members = pq.read_table(tmp_path / "out" / "memberships.parquet")
    assert members["flow"].to_pylist().count(1) == 6
    made = {"memberships.parquet", "flows.parquet", "flows.json", "flows.rrd"}
    assert {one.name for one in (tmp_path / "out").iterdir()} == made


def test_a_table_that_lacks_a_column_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One sentence, exit code 2."""
    (tmp_path / "x.csv").write_text("time,lat\n1,2\n")
    assert run(["flows", str(tmp_path / "x.csv")]) == 2
    assert "lacks the column timestamp, latitude, longitude, altitude" in capsys.readouterr().err


def test_who_lands_the_other_way_or_is_far_aside_is_of_no_flow() -> None:
    """Ten flights on each of two ways, one that leaves its way by 12 km, one that lands against all others: both named."""
    generator = np.random.default_rng(4)
    along = np.linspace(-80_000.0, 0.0, 800)

    def flown(name: str, bulge_m: float = 0.0, turned: bool = False, begins_m: float = 0.0) -> Track:
        aside = begins_m * (along / -80_000.0) + generator.normal(0.0, 300.0) * (along / -80_000.0)
        aside = aside + bulge_m * np.exp(-(((along + 45_000.0) / 15_000.0) ** 2))
        place = np.stack([along, aside, -0.05 * along], axis=-1)
        if turned:  # the last 8 km flown back, past the field and round
            place = np.concatenate([place, place[-1] - np.linspace(0.0, 1.0, 80)[:, None] * [8_000.0, 0.0, 0.0]])
        return Track(name, np.arange(1.0 - len(place), 1.0), place)

    tracks = [flown(f"south {number}") for number in range(10)]
    tracks += [flown(f"north {number}", begins_m=60_000.0) for number in range(10)]
    tracks += [flown("far", 12e3), flown("against", turned=True)]
    flows = found(tracks)
    assert [len(flow.flights) for flow in flows.flows] == [10, 10]
    assert [tracks[row].name for row in np.flatnonzero(flows.labels == OUTLIER)] == ["far", "against"]


def test_where_all_come_one_way_there_is_one_flow_and_where_each_comes_its_own_none() -> None:
    """Nine flights along one line, and a tenth 20 km aside, which is alone; ten from all over the sky are no flow."""
    generator = np.random.default_rng(6)
    to_go = np.linspace(70_000.0, 0.0, 300)[:, None]

    def flown(number: int, bearing: float) -> Track:
        along = np.array([math.sin(bearing), math.cos(bearing), 0.05])
        return Track(f"f{number}", np.arange(-299.0, 1.0), to_go * along)

    one_way = [flown(number, 1.0 + generator.normal(0.0, 0.005)) for number in range(9)] + [flown(9, 1.4)]
    assert found(one_way).labels.tolist() == [0] * 9 + [OUTLIER]
    each = [flown(number, 0.6 * number) for number in range(10)]
    assert found(each).labels.tolist() == [OUTLIER] * 10


@pytest.mark.skipif(not DATA.exists(), reason="the recordings are not beside the project")
def test_the_arrivals_to_paris_are_the_flows_that_were_seen_by_eye(capsys: pytest.CaptureFixture[str]) -> None:
    """53 flights, labelled by eye before any clustering: adjusted Rand index at least 0.9; outliers are named."""
    from sim.studies.flows import agreement

    with LABELS.open() as file:
        seen = {row["fid"]: row["flow"] for row in csv.DictReader(file)}
    assert run(["flows", str(DATA), "--airport", "49.01,2.55", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    labels = {flight: number for number, flow in enumerate(told["flows"]) for flight in flow["flights"]}
    labels |= {one["flight"]: OUTLIER for one in told["alone"]}
    assert sorted(labels) == sorted(seen)
    names = sorted(set(seen.values()))
    index = agreement(
        np.array([names.index(seen[flight]) for flight in sorted(seen)]),
        np.array([labels[one] for one in sorted(seen)]),
    )
    assert index >= 0.9
    assert any(seen[one["flight"]] == "alone" for one in told["alone"])
