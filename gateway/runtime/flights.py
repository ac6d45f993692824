"""Flights rebuilt from recordings: the parameters read, and what was rebuilt written as Parquet and JSON."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from adapters.decode import Decoder
from gateway.observation import (
    AirData,
    Attitude,
    GpsReport,
    ImuSample,
    Many,
    Observation,
    RadarPlot,
    RadarStatus,
    VehicleStatus,
)
from gateway.offline.parameters import Parameters
from gateway.offline.reconstruction import Sortie
from gateway.offline.sightings import Sightings, View, views
from gateway.runtime.archived import read_table
from gateway.runtime.folder import FolderError, read_record
from gateway.runtime.playback import Playback
from gateway.runtime.remembering import is_of
from gateway.runtime.setup import Place

_TOGETHER = 1000  # arrivals that are decoded at once
_TIME = pa.timestamp("ns", tz="UTC")
_NUMBERS = (
    *("latitude_deg", "longitude_deg", "east_m", "north_m", "height_m", "sigma_m", "open_east_m", "open_north_m"),
    *("true_airspeed_mps", "wind_east_mps", "wind_north_mps", "roll_deg", "pitch_deg", "heading_deg"),
)
SCHEMA = pa.schema(
    [("time", _TIME), ("aircraft", pa.string()), ("sortie", pa.int64()), *((name, pa.float64()) for name in _NUMBERS)]
)


@dataclass(frozen=True, slots=True)
class Recorded:
    """What a recording tells of flights: each aircraft's parameters, by name, and what radars saw."""

    aircraft: dict[str, Parameters]
    sightings: Sightings

    @classmethod
    def none(cls) -> Recorded:
        """Nothing yet."""
        return cls({}, Sightings())


def read_recorded(playback: Playback, tell: Callable[[float], None]) -> Recorded:
    """The flight parameters of every aircraft of a recording, and its radars' plots. Raises FileError."""
    decoder = Decoder(playback.sources)
    recorded = Recorded.none()
    left = iter(playback.arrivals())
    while some := list(islice(left, _TOGETHER)):
        for _, heard in decoder.hear_many(some)[0]:
            for observation in heard.observations:
                _take(observation, recorded)
        tell(playback.fraction())
    return recorded


def _take(observation: Observation, recorded: Recorded) -> None:
    """Keep what paths can be made of with whom it is of."""
    if isinstance(observation, Many) and observation.kind is ImuSample:
        _feel(observation, recorded.aircraft)
        return
    for one in observation if isinstance(observation, Many) else (observation,):
        if isinstance(one, RadarPlot | RadarStatus):
            recorded.sightings.take(one)
        elif isinstance(one, AirData | Attitude | GpsReport | ImuSample | VehicleStatus):
            recorded.aircraft.setdefault(one.aircraft, Parameters()).take(one)


def radar_views(recorded: Recorded, playback: Playback, place: Place | None, session: Path | None) -> list[View]:
    """What the radars of a recording saw, at its place or another; of a session with what it learnt of them taken off.

    Empty where nothing tells where the radars stand. Raises FileError, FolderError.
    """
    if not recorded.sightings.plots:
        return []
    place = place or playback.place or playback.find_place()
    if place is None:
        return []
    record = None if session is None else read_record(session)
    learnt = None if record is None else record.registered or record.registration
    if learnt is not None and not is_of(learnt, place.site):
        learnt = None
    return views(recorded.sightings, place.site, learnt)


def radar_tracks(session: Path) -> dict[str, set[str]]:
    """Of each aircraft of a session's tracks which tracks of radars ("1/3") were taken for it; none without such a table."""
    try:
        table = read_table(session, "tracks", ("aircraft", "radar_track"))
    except FolderError:
        return {}
    pairs = Counter(zip(table["aircraft"].to_pylist(), table["radar_track"].to_pylist(), strict=True))
    most: dict[str, tuple[int, str]] = {}
    for (aircraft, names), count in pairs.items():
        for name in (names or "").split() if aircraft else ():
            most[name] = max(most.get(name, (0, "")), (count, aircraft))
    found: dict[str, set[str]] = {}
    for name, (_, aircraft) in most.items():
        found.setdefault(aircraft, set()).add(name)
    return found


def _feel(samples: Many, found: dict[str, Parameters]) -> None:
    """Inertial samples in columns: too many to be taken one by one."""
    columns = samples.columns
    if "acceleration_mps2" not in columns:
        return
    whose = np.array([f"{one} {sensor}" for one, sensor in zip(columns["aircraft"], columns["sensor"], strict=True)])
    for one in np.unique(whose):
        rows = np.flatnonzero(whose == one)
        aircraft, sensor = str(columns["aircraft"][rows[0]]), int(columns["sensor"][rows[0]])
        taken = found.setdefault(aircraft, Parameters())
        taken.feel(sensor, columns["valid_at"][rows], columns["acceleration_mps2"][rows])


def write_flights(flights: Mapping[str, Sequence[Sortie]], folder: Path) -> tuple[Path, Path]:
    """flights.parquet, a row a sample, and sorties.json, in an existing folder. Raises OSError."""
    table, summary = folder / "flights.parquet", folder / "sorties.json"
    with pq.ParquetWriter(table, SCHEMA) as writer:
        for aircraft, sorties in flights.items():
            for number, sortie in enumerate(sorties, 1):
                writer.write_table(_table(aircraft, number, sortie))
    summary.write_text(json.dumps(document(flights), indent=1) + "\n")
    return table, summary


def document(flights: Mapping[str, Sequence[Sortie]]) -> dict[str, Any]:
    """What is told of each sortie, as JSON has it; null for what is not known."""
    return {aircraft: [_told(sortie) for sortie in sorties] for aircraft, sorties in flights.items()}


def _told(sortie: Sortie) -> dict[str, Any]:
    wind = sortie.wind_mps.mean(axis=0)
    told: dict[str, Any] = {
        "lift_off": int(sortie.time[0]),
        "ended": int(sortie.time[-1]),
        "took_off": sortie.took_off,
        "landed": sortie.landed,
        "duration_s": sortie.duration_s,
        "length_m": sortie.length_m,
        "lift_off_deg": None if sortie.lift_off is None else [math.degrees(angle) for angle in sortie.lift_off],
        "closed_on": sortie.closed_on,
        "end_error_m": sortie.end_error_m,
        "wind_east_mps": float(wind[0]),
        "wind_north_mps": float(wind[1]),
        "heading_bias_deg": math.degrees(sortie.heading_bias_rad),
        "heading_bias_sigma_deg": math.degrees(sortie.heading_bias_sigma_rad),
        "height_by": sortie.height_by,
        "fixes": sortie.fixes,
        "by_accelerations": sortie.by_accelerations,
        "doubts": list(sortie.doubts),
    }
    if (radar := sortie.radar) is not None:
        told["radar"] = {
            "plots_used": radar.used,
            "plots_refused": radar.of - radar.used,
            "radar_tracks": list(radar.tracks),
            "doubt": radar.doubt,
        }
    if (beside := sortie.compared) is not None:
        told["beside_positions"] = {
            "positions": len(beside.time),
            "rmse_m": beside.rmse_m,
            "greatest_m": float(beside.off_m.max()),
            "end_m": float(beside.off_m[-1]),
            "length_m": beside.length_m,
            "share_of_length": beside.rmse_m / beside.length_m if beside.length_m > 0.0 else math.nan,
            "open_rmse_m": beside.open_rmse_m,
            "height_rmse_m": beside.height_rmse_m,
        }
    return _plain(told)


def _plain(told: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _plain(one) if isinstance(one, dict) else None if isinstance(one, float) and math.isnan(one) else one
        for key, one in told.items()
    }


def _table(aircraft: str, number: int, sortie: Sortie) -> pa.Table:
    count, place = len(sortie.time), sortie.geodetic_deg
    columns = (
        *np.broadcast_to(np.nan if place is None else place, (count, 2)).T,
        *sortie.path_m.T,
        sortie.height_m,
        sortie.sigma_m,
        *sortie.open_m[:, :2].T,
        sortie.true_airspeed_mps,
        *sortie.wind_mps.T,
        np.degrees(sortie.roll_rad),
        np.degrees(sortie.pitch_rad),
        np.degrees(sortie.compass_rad) % 360.0,
    )
    values = [pa.array(np.ascontiguousarray(column), from_pandas=True) for column in columns]  # NaN is null
    time = pa.array(sortie.time).cast(pa.timestamp("ns")).cast(_TIME)
    head = [time, pa.array([aircraft] * count), pa.array([number] * count, pa.int64())]
    return pa.Table.from_arrays([*head, *values], schema=SCHEMA)
