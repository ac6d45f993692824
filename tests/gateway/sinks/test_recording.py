"""The session's recording: what is drawn, when, where, and that the file keeps it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from gateway.frames import RunwayFrame
from gateway.fuse import Ended, Fused
from gateway.observation import RadarPlot
from gateway.settings import DEMO_SITE
from gateway.sinks.recording import optimise
from gateway.sinks.rerun import RerunSink
from gateway.sinks.scene.lately import Lately

Entities = dict[str, list[dict[str, Any]]]
START = 1_772_366_400_000_000_000


@pytest.fixture(autouse=True)
def _bad_input_raises() -> Iterator[None]:
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def record(path: Path, pictures: list, **options: Any) -> None:
    sink = RerunSink(options.pop("site", DEMO_SITE), path=path, **options)
    for picture in pictures:
        sink.write(picture)
    sink.close()


def times(entities: Entities, path: str) -> list[int]:
    return [row["utc"] for row in entities[path] if "utc" in row]


def texts(entities: Entities) -> list[str]:
    return [row["TextLog:text"][0] for row in entities["/log"]]


@pytest.fixture
def drawn(tmp_path, pictures, read) -> Entities:
    record(tmp_path / "a.rrd", pictures(30.0))
    return read(tmp_path / "a.rrd")


def test_every_root_of_the_data_path_is_drawn(drawn):
    roots = {path.split("/")[1] for path in drawn}
    assert roots >= {"site", "raw", "align", "track", "associate", "register", "fuse", "predict"}
    assert roots >= {"approach", "truth", "health", "log"}


def test_identities_with_colons_and_slashes_stay_one_part_of_a_path(drawn):
    assert r"/raw/gps/mavlink\:1" in drawn
    assert "/raw/radar/1/3" in drawn


def test_fused_rows_stand_in_the_runway_frame_and_on_the_map(tmp_path, pictures, read):
    made = pictures(10.0)
    record(tmp_path / "a.rrd", made)
    row = next(row for row in read(tmp_path / "a.rrd")["/fuse/1"] if "utc" in row)
    fused = next(one.fuse for one in made if row["utc"] in one.fuse.time)
    index = fused.time.tolist().index(row["utc"])
    assert row["Points3D:positions"][0] == pytest.approx(fused.runway_m[index].tolist(), rel=1e-6)
    degrees = [np.degrees(fused.latitude_rad[index]), np.degrees(fused.longitude_rad[index])]
    assert row["GeoPoints:positions"][0] == pytest.approx(degrees, abs=1e-12)
    east, north, up = fused.velocity_mps[index]
    assert row["Scalars:scalars"] == pytest.approx([np.hypot(east, north), -up])


def test_a_row_of_the_past_is_not_drawn_over_a_newer_one(tmp_path, pictures, read):
    made = pictures(40.0)
    record(tmp_path / "a.rrd", made)
    written = np.concatenate([one.fuse.time for one in made])
    assert (np.diff(written) < 0).any()
    drawn_at = times(read(tmp_path / "a.rrd"), "/fuse/1")
    expected = written[written >= np.maximum.accumulate(written)]
    assert drawn_at == expected.tolist()


def test_how_pictures_fall_into_batches_changes_no_row(tmp_path, pictures, read):
    made = pictures(25.0)
    record(tmp_path / "a.rrd", made, period_s=0.4)
    record(tmp_path / "b.rrd", made, period_s=10.0, rows_limit=10_000)
    small, large = read(tmp_path / "a.rrd"), read(tmp_path / "b.rrd")
    assert small.keys() == large.keys()
    for path in ("/fuse/1", "/fuse/1/trail/0", "/fuse/1/label", "/predict/1", "/log", "/raw/radar/1/3/trail/0"):
        assert times(small, path) == times(large, path), path
    assert small["/fuse/1/trail/0"][-1]["LineStrips3D:strips"] == large["/fuse/1/trail/0"][-1]["LineStrips3D:strips"]


def test_the_trail_at_any_instant_ends_where_the_track_was(tmp_path, pictures, read):
    record(tmp_path / "a.rrd", pictures(150.0), period_s=10.0, rows_limit=10_000)
    entities = read(tmp_path / "a.rrd")
    for segment in ("0", "1"):
        rows = [row for row in entities[f"/fuse/1/trail/{segment}"] if "utc" in row]
        here = {row["utc"]: row["Points3D:positions"][0] for row in entities["/fuse/1"] if "utc" in row}
        assert len(rows) > 5
        for row in rows:
            assert row["LineStrips3D:strips"][0][-1] == here[row["utc"]]
    ended, begun = (entities[f"/fuse/1/trail/{segment}"] for segment in ("0", "1"))
    first = next(row for row in begun if "utc" in row)
    assert first["LineStrips3D:strips"][0][0] == ended[-1]["LineStrips3D:strips"][0][-1]  # without a gap


def test_the_point_of_association_is_marked_and_said(drawn):
    (mark,) = [row for row in drawn[r"/associate/point/mavlink\:1"] if "utc" in row]
    assert mark["Points3D:labels"] == ["mavlink:1 is radar track 1/3"]
    assert sum("mavlink:1 is radar track 1/3" in text for text in texts(drawn)) == 1


def test_a_track_that_ends_is_said_and_leaves_the_scene(tmp_path, pictures, read):
    record(tmp_path / "a.rrd", pictures(20.0, end=True))
    entities = read(tmp_path / "a.rrd")
    assert any("track 1 ended: no data for 30 s" in text for text in texts(entities))
    for path in ("/fuse/1", "/predict/1", "/approach/1", r"/raw/gps/mavlink\:1", "/raw/radar/1/3"):
        assert entities[path][-1].get("Clear:is_recursive") == [True], path
    assert entities["/fuse/state/1"][-1]["StateChange:state"] == ["ended"]


def test_a_track_that_ended_in_the_past_leaves_the_scene_after_its_last_row(tmp_path, pictures, read):
    """An association found late ends a track at an instant that is older than rows already drawn."""
    made = pictures(20.0)
    ended = replace(made[-1].fuse, ended=(Ended(START + 16_000_000_000, 1, "joined track 2"),))
    record(tmp_path / "a.rrd", [*made[:-1], replace(made[-1], fuse=ended)])
    entities = read(tmp_path / "a.rrd")
    for path in ("/fuse/1", "/predict/1"):
        assert entities[path][-1].get("Clear:is_recursive") == [True]
        assert entities[path][-1]["utc"] >= max(times(entities, path))


def test_an_estimator_without_modes_draws_none(tmp_path, pictures, read):
    record(tmp_path / "a.rrd", pictures(10.0, modes=False))
    assert not any(path.startswith("/fuse/modes") for path in read(tmp_path / "a.rrd"))


def test_aviation_units_are_feet_and_knots(tmp_path, pictures, read):
    site = replace(DEMO_SITE, units="aviation")
    record(tmp_path / "a.rrd", pictures(20.0), site=site)
    entities = read(tmp_path / "a.rrd")
    static = next(row for row in entities["/fuse/1"] if "SeriesLines:names" in row)
    assert static["SeriesLines:names"] == ["track 1 speed, kn", "track 1 sink rate, ft/min"]
    speed = next(row["Scalars:scalars"][0] for row in entities["/fuse/1"] if "utc" in row)
    assert speed == pytest.approx(130.0 * 3600.0 / 1852.0, rel=0.1)
    label = next(row["Points3D:labels"][0] for row in entities["/fuse/1/label"] if "utc" in row)
    assert " ft " in label
    assert " kn " in label


def test_a_position_without_a_full_place_is_left_out(tmp_path, pictures, read):
    made = pictures(10.0)
    missing = sum(int(np.isnan(one.align.plot_runway_m).any(axis=1).sum()) for one in made)
    plots = sum(len(one.align.plot_time) for one in made)
    assert missing > 0
    record(tmp_path / "a.rrd", made)
    assert len(times(read(tmp_path / "a.rrd"), "/raw/radar/1/3")) == plots - missing


def test_a_step_without_anything_is_drawn_without_complaint(tmp_path, pictures, read):
    picture = pictures(0.2)[0]
    nothing = replace(picture, observations=(), truth=(), events=(), fuse=empty(picture.fuse))
    record(tmp_path / "a.rrd", [nothing])
    assert "/fuse/1" not in read(tmp_path / "a.rrd")


def empty(fused: Fused) -> Fused:
    """The same without a row."""
    columns = {name: getattr(fused, name)[:0] for name in Fused.__dataclass_fields__}
    return Fused(**columns)


def test_the_glide_path_of_the_scene_meets_the_runway_at_the_aiming_point(drawn):
    (row,) = [row for row in drawn["/site/glide_path"] if "LineStrips3D:strips" in row]
    top, *_, foot = row["LineStrips3D:strips"][0]
    aim = DEMO_SITE.runway.aiming_point_x_m
    assert foot == pytest.approx([aim, 0.0, 0.0])
    assert np.arctan2(top[2], aim - top[0]) == pytest.approx(DEMO_SITE.runway.glide_path_rad)
    latitude, longitude = row["GeoLineStrings:line_strings"][0][-1]
    expected = RunwayFrame(DEMO_SITE.runway).geodetic_from_runway(np.array([[aim, 0.0, 0.0]]))
    assert np.radians([latitude, longitude]) == pytest.approx([expected[0][0], expected[1][0]], abs=1e-12)


def test_a_session_that_was_killed_opens_and_lacks_at_most_the_last_second(tmp_path, read):
    script = (
        "import os, sys, runpy; from pathlib import Path; from gateway.sinks.rerun import RerunSink\n"
        "from gateway.settings import DEMO_SITE\n"
        "make = runpy.run_path(sys.argv[1])['make_pictures']\n"
        "sink = RerunSink(DEMO_SITE, path=Path(sys.argv[2]))\n"
        "for picture in make(10.0): sink.write(picture)\n"
        "os.kill(os.getpid(), 9)"
    )
    path = tmp_path / "session.rrd"
    made = Path(__file__).with_name("conftest.py")
    subprocess.run([sys.executable, "-c", script, str(made), str(path)], check=False)
    assert max(times(read(path), "/health/mavlink\\:1")) >= START + 8_800_000_000
    assert optimise(path)
    assert max(times(read(path), "/health/mavlink\\:1")) >= START + 8_800_000_000


def test_the_end_of_a_session_keeps_every_row_and_makes_the_file_smaller(tmp_path, pictures, read):
    path, before = tmp_path / "a.rrd", tmp_path / "before.rrd"
    sink = RerunSink(DEMO_SITE, path=path, period_s=0.4)
    for picture in pictures(30.2):
        sink.write(picture)
    shutil.copy(path, before)
    sink.close()
    assert path.stat().st_size < 0.5 * before.stat().st_size
    running, ended = read(before), read(path)
    for name in ("/fuse/1", "/raw/radar/1/3", "/log", "/predict/1"):
        assert times(ended, name)[: len(times(running, name))] == times(running, name), name
        assert len(times(running, name)) > 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.rrd", "before.rrd"]


def test_what_is_no_recording_stays_as_it_is(tmp_path):
    path = tmp_path / "a.rrd"
    path.write_bytes(b"not a recording")
    assert not optimise(path)
    assert path.read_bytes() == b"not a recording"
    assert [file.name for file in tmp_path.iterdir()] == ["a.rrd"]


def test_without_a_height_the_label_says_so_and_no_vertical_is_drawn(tmp_path, pictures, read):
    """The track is drawn flat at the guess; its elevation, its vertical deviation and its sigma are not drawn at all."""
    made = []
    for picture in pictures(20.0, first_s=300.0):
        rows = len(picture.fuse.time)
        unknown = replace(
            picture.fuse,
            height_m=np.full(rows, np.nan),
            altitude_msl_m=np.full(rows, np.nan),
            velocity_mps=picture.fuse.velocity_mps * [1.0, 1.0, np.nan],
            pressure_altitude_m=np.full(rows, 1234.0),
            callsign=("TDN12",) * rows,
        )
        guessed = replace(picture.align, report_has_height=picture.align.report_has_height & False)
        made.append(replace(picture, fuse=unknown, align=guessed))
    record(tmp_path / "a.rrd", made)
    entities = read(tmp_path / "a.rrd")
    labels = [row["Points3D:labels"][0] for row in entities["/fuse/1/label"] if "utc" in row]
    assert labels[0].startswith("TDN12 mavlink:1 fused\npressure altitude 1234 m ")
    for path, place in (("/approach/1", 0), ("/approach/angle/1", 0), ("/fuse/sigma/1", 1)):
        values = [row["Scalars:scalars"] for row in entities[path] if "utc" in row]
        assert values, path
        assert all(np.isnan(value[place]) and np.isfinite(value[1 - place]) for value in values), path
    half = [row["Ellipsoids3D:half_sizes"][0] for row in entities["/fuse/1/ellipsoid"] if "utc" in row]
    assert all(min(axes) == 0.0 < max(axes) for axes in half)
    shown = [len(row["Points2D:positions"]) for row in entities["/approach/scope/1"] if "utc" in row]
    assert set(shown) == {1}  # of elevation and azimuth, the latter


def test_a_track_looks_as_sure_as_it_is(tmp_path, pictures, read):
    """Tentative: dim, and said so. Confirmed: red. Coasting: pale, with how far off it may be in the label."""
    told = {}
    for life, state in (("tentative", "gps only"), ("confirmed", "fused"), ("coasting", "coasting")):
        made = []
        for picture in pictures(20.0, first_s=300.0):
            rows = len(picture.fuse.time)
            made.append(replace(picture, fuse=replace(picture.fuse, life=(life,) * rows, state=(state,) * rows)))
        record(tmp_path / f"{life}.rrd", made)
        entities = read(tmp_path / f"{life}.rrd")
        colours = {
            int(row[column][0])
            for path, column in (("/fuse/1", "Points3D:colors"), ("/fuse/1/ellipsoid", "Ellipsoids3D:colors"))
            for row in entities[path]
            if "utc" in row
        }
        label = next(row["Points3D:labels"][0] for row in entities["/fuse/1/label"] if "utc" in row)
        told[life] = colours, label.splitlines()[0]
    assert len({frozenset(colours) for colours, _ in told.values()}) == 3
    assert all(len(colours) == 1 for colours, _ in told.values())
    assert [label for _, label in told.values()] == [
        *("mavlink:1 gps only, tentative", "mavlink:1 fused"),
        "mavlink:1 coasting ± 32 m",  # 3 sigma of 9 m and 12 m
    ]


def test_memory_is_bounded_by_who_was_there_lately(pictures):
    """Forty minutes in which a new aircraft appears every ten seconds: what is drawn is not remembered beyond ten minutes."""
    (picture,) = pictures(0.2)
    template = next(one for one in pictures(6.0) if len(one.fuse.time) and len(one.align.report_time))
    sink = RerunSink(DEMO_SITE)
    held = []
    for number in range(240):
        shift, name = number * 10_000_000_000, f"icao:{number:06x}"
        fused = template.fuse
        rows = len(fused.time)
        new = replace(
            template,
            now=template.now + shift,
            step=number,
            fuse=replace(
                fused,
                time=fused.time + shift,
                track=np.full(rows, number),
                aircraft=(name,) * rows,
                ended=(Ended(template.now + shift, number - 1, "no data for 30 s"),) if number else (),
            ),
            align=replace(template.align, report_aircraft=(name,), report_time=template.align.report_time + shift),
            observations=tuple(
                replace(one, aircraft=name, valid_at=one.valid_at + shift, received_at=one.received_at + shift)
                for one in template.observations
                if not isinstance(one, RadarPlot)
            ),
            health=picture.health,
        )
        sink.write(new)
        if number in (80, 239):
            held.append(remembered(sink))
    sink.close()
    assert held[1] <= 1.2 * held[0], held


def remembered(sink: RerunSink) -> int:
    """How many things the parts of a sink hold in all their tables."""
    parts = [part for part in vars(sink).values() if type(part).__module__.startswith("gateway.sinks.scene")]
    held = [value for part in parts for value in vars(part).values()]
    return sum(len(value) for value in held if isinstance(value, dict | set | Lately))
