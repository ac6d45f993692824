"""Health as people read it: tables of vehicles and sources, and curves."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rerun.chunk import RrdReader

from gateway.picture import Health, Picture, SourceHealth, VehicleHealth
from gateway.reckon import NOTHING, Reckoned
from gateway.settings import DEMO_SITE
from gateway.sinks.rerun import RerunSink
from gateway.sinks.scene.health import SOURCES, VEHICLES, HealthScene, sources_table, unit_part, vehicles_table

UNKNOWN = (math.nan, math.nan, math.nan)


def drawn(folder: Path, made: list[Picture]) -> dict[str, list[dict[str, Any]]]:
    """The rows below /health of a recording of these pictures, by entity, in order of time."""
    sink = RerunSink(DEMO_SITE, path=folder / "a.rrd")
    for picture in made:
        sink.write(picture)
    sink.close()
    found: dict[str, list[dict[str, Any]]] = {}
    for chunk in RrdReader(folder / "a.rrd").stream():
        if chunk.entity_path.startswith("/health") and not chunk.is_static:
            batch = chunk.to_record_batch()
            columns = {name: batch.column(name) for name in batch.schema.names}
            columns["utc"] = columns["utc"].cast("int64")
            values = {name: column.to_pylist() for name, column in columns.items()}
            rows = [{name: column[row] for name, column in values.items()} for row in range(batch.num_rows)]
            found.setdefault(chunk.entity_path, []).extend(rows)
    return {path: sorted(rows, key=lambda row: row["utc"]) for path, rows in found.items()}


def cells(table: str) -> list[list[str]]:
    """A Markdown table's cells."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line]


def test_health_reaches_the_recording_as_tables_and_curves(tmp_path, pictures):
    entities = drawn(tmp_path, pictures(8.0))
    (table,) = entities[VEHICLES][-1]["TextDocument:text"]
    rows = dict(row for row in cells(table) if len(row) == 2)
    assert rows["clock"] == "UTC"
    assert rows["delay 99 %, ms"] == "300"
    assert rows["landed"] == "in air"
    assert "crc error | 2 |" in entities[SOURCES][-1]["TextDocument:text"][0]
    assert entities["/health/reading/K/mavlink\\:1"][-1]["Scalars:scalars"] == [288.0]
    assert entities["/health/time/mavlink\\:1"][-1]["Scalars:scalars"] == pytest.approx([2.0, 10.0, 300.0])


def test_what_is_not_known_yet_is_neither_drawn_nor_written(tmp_path, pictures):
    """The made-up clock settles after 5 s."""
    made = pictures(8.0)
    entities = drawn(tmp_path, made)
    assert entities["/health/time/mavlink\\:1"][0]["utc"] >= made[0].now + 5_000_000_000
    assert "delay" not in entities[VEHICLES][0]["TextDocument:text"][0]


def test_health_is_drawn_at_most_once_a_second_and_a_table_only_when_it_changes(tmp_path, pictures):
    made = [replace(picture, health=Health((), picture.health.vehicles)) for picture in pictures(20.0)]
    entities = drawn(tmp_path, made)
    assert len(entities["/health/reading/K/mavlink\\:1"]) == 20
    assert len(entities[SOURCES]) == 1
    assert len(entities[VEHICLES]) == len({row["TextDocument:text"][0] for row in entities[VEHICLES]})


def test_a_reading_that_is_told_later_gets_a_series_of_its_own_and_moves_no_other(tmp_path, pictures):
    made = pictures(4.0)
    (vehicle,) = made[0].health.vehicles
    rows = []
    for place, picture in enumerate(made):
        told = (("speed, m/s", 5.0),) if place < len(made) // 2 else (("climb, m/s", 1.0), ("speed, m/s", 6.0))
        rows.append(replace(picture, health=Health((), (replace(vehicle, readings=told),))))
    entities = drawn(tmp_path, rows)
    values = [row["Scalars:scalars"] for row in entities["/health/reading/mps/mavlink\\:1"]]
    assert values[0][0] == 5.0
    assert values[-1] == [6.0, 1.0]


def test_what_dead_reckoning_found_is_among_a_vehicles_readings_until_it_is_old(pictures):
    first, last = pictures(5.0)[0], pictures(5.0)[-1]
    (vehicle,) = first.health.vehicles
    sigma, wind = np.array([3.0, 3.0, 5.0]), np.array([0.0, -4.0])
    place = (vehicle.aircraft, first.now, 0.7, 0.2, 600.0, np.zeros(3), sigma, np.ones(3))
    found = Reckoned(*place, wind, 1.0, NOTHING, first.now, 1.5, True, 0.0)
    scene = HealthScene()
    scene.entries([replace(first, reckoned=(found,))])
    (table,) = scene._tables[VEHICLES].split("\n\n")
    rows = dict(cells(table))
    assert rows["dead reckoning sigma, m"] == "3.00"
    assert (rows["wind found, m/s"], rows["wind found from, degrees"]) == ("4.00", "90.0")
    assert rows["positions"] == "believed"
    scene.entries([last])
    assert "dead reckoning" not in scene._tables[VEHICLES]


def test_when_the_session_goes_back_in_time_health_is_drawn_on(pictures):
    picture = pictures(0.2)[0]
    scene = HealthScene()
    assert scene.entries([picture])
    assert scene.entries([replace(picture, now=picture.now - 3600 * 10**9)])


def test_each_reason_of_a_source_has_a_line_of_its_own():
    source = SourceHealth("mavlink-1", "mavlink", 0.3, 12.0, 1331, (("crc error", 3), ("duplicate", 12_000)))
    silent = SourceHealth("radar-1", "radar", 61.0, 0.0, 0)
    gateway = SourceHealth("gateway", "pipeline", 0.0, 0.0, 0, (("too late", 4),))
    rows = cells(sources_table((source, silent, gateway)))
    assert ["mavlink-1", "0.3 s ago", "12.0/s", "1,331"] in rows
    assert ["radar-1", "**61 s ago**", "0.0/s", "0"] in rows
    assert ["mavlink-1", "crc error", "3"] in rows
    assert ["", "duplicate", "12,000"] in rows
    assert ["gateway", "too late", "4"] in rows


def test_what_a_vehicle_says_cannot_break_the_table():
    said = (("callsign", "A|B\n| c"),)
    table = vehicles_table((VehicleHealth("mavlink:1", "UTC", *UNKNOWN, (), said),))
    assert cells(table)[-1] == ["callsign", "A/B / c"]


def test_many_vehicles_stand_five_abreast_and_the_rest_is_counted():
    vehicles = tuple(VehicleHealth(f"icao:{n:06x}", "UTC", *UNKNOWN) for n in range(1000))
    table = vehicles_table(vehicles)
    assert len(cells(table)[0]) == 6
    assert table.endswith("and 975 more vehicles")


def test_vehicles_that_say_different_things_share_the_rows_that_they_have_in_common():
    one = VehicleHealth("mavlink:1", "UTC", *UNKNOWN, (("airspeed, m/s", 21.34),), (("landed", "in air"),))
    other = VehicleHealth("mavlink:2", "least delay", *UNKNOWN, (("airspeed, m/s", 123.4),))
    assert cells(vehicles_table((one, other)))[2:] == [
        ["clock", "UTC", "least delay"],
        ["landed", "in air", ""],
        ["airspeed, m/s", "21.3", "123"],
    ]


@pytest.mark.parametrize(("unit", "part"), [("m/s", "mps"), ("m", "m"), ("°C", "C"), ("", "1"), ("%", "1")])
def test_units_are_parts_of_paths(unit, part):
    assert unit_part(unit) == part
