"""Flights rebuilt from recordings: the parameters read, and what was rebuilt written as Parquet and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from adapters.decode import Decoder
from gateway.observation import AirData, Attitude, GpsReport, ImuSample, Many, Observation, VehicleStatus
from gateway.offline.parameters import Parameters
from gateway.offline.reconstruction import Sortie
from gateway.runtime.playback import Playback

_TOGETHER = 1000  # arrivals that are decoded at once
_TIME = pa.timestamp("ns", tz="UTC")
_NUMBERS = (
    *("latitude_deg", "longitude_deg", "east_m", "north_m", "height_m", "sigma_m", "open_east_m", "open_north_m"),
    *("true_airspeed_mps", "wind_east_mps", "wind_north_mps", "roll_deg", "pitch_deg", "heading_deg"),
)
SCHEMA = pa.schema(
    [("time", _TIME), ("aircraft", pa.string()), ("sortie", pa.int64()), *((name, pa.float64()) for name in _NUMBERS)]
)


def read_parameters(playback: Playback, tell: Callable[[float], None]) -> dict[str, Parameters]:
    """The flight parameters of every aircraft of a recording, by name. Raises FileError."""
    decoder = Decoder(playback.sources)
    found: dict[str, Parameters] = {}
    left = iter(playback.arrivals())
    while some := list(islice(left, _TOGETHER)):
        for _, heard in decoder.hear_many(some)[0]:
            for observation in heard.observations:
                _take(observation, found)
        tell(playback.fraction())
    return found


def _take(observation: Observation, found: dict[str, Parameters]) -> None:
    """Keep what paths can be made of with whom it is of."""
    if isinstance(observation, Many) and observation.kind is ImuSample:
        _feel(observation, found)
        return
    for one in observation if isinstance(observation, Many) else (observation,):
        if isinstance(one, AirData | Attitude | GpsReport | ImuSample | VehicleStatus):
            found.setdefault(one.aircraft, Parameters()).take(one)


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
        "end_error_m": sortie.end_error_m,
        "wind_east_mps": float(wind[0]),
        "wind_north_mps": float(wind[1]),
        "heading_bias_deg": math.degrees(sortie.heading_bias_rad),
        "heading_bias_sigma_deg": math.degrees(sortie.heading_bias_sigma_rad),
        "height_by": sortie.height_by,
        "fixes": sortie.fixes,
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
