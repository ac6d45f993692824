"""Arrivals read from recorded ADS-B (CSV, gzipped or not, or Parquet) and from archived sessions, as tracks about an airport."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pyproj import Proj

from gateway.offline.flows import Track, cleaned
from gateway.runtime.archived import read_table
from gateway.runtime.sessions import mend
from gateway.settings.tables import FOOT_M

Floats = NDArray[np.float64]

LEAST_POINTS, LEAST_S = 30, 60.0  # fewer or shorter is no arrival
_NEEDED = ("timestamp", "latitude", "longitude", "altitude")
_NAMES = ("fid", "flight_id", "callsign", "icao24")  # what tells flights apart, the best first
_SILENCE_S = 900.0  # the same callsign after so long is another flight
_LOW_M = 1500.0  # an arrival ends below this above where most end


class ArrivalsError(Exception):
    """A file that holds no arrivals; one plain sentence."""


Flight = tuple[str, Floats]
"""A name and (n, 4): time s, latitude, longitude degrees, height m."""


def flights_of(path: Path) -> list[Flight]:
    """The flights of a file, or of an archived session, that are long enough. Raises ArrivalsError, FolderError, OSError."""
    found = _of_session(path) if path.is_dir() else _of_table(path)
    return [(name, rows) for name, rows in found if len(rows) >= LEAST_POINTS and rows[-1, 0] - rows[0, 0] >= LEAST_S]


def arrivals_among(
    flights: Sequence[Flight], airport_deg: tuple[float, float] | None
) -> tuple[tuple[Track, ...], tuple[float, float], int]:
    """Tracks that end low, the airport (latitude, longitude, degrees), and how many others were left out.

    Without an airport it is the median of where flights end. The projection is Lambert's conformal conic about it (002-7 1.2).
    Raises ArrivalsError where there is no flight.
    """
    if not flights:
        raise ArrivalsError(f"There is no flight of {LEAST_POINTS} points and a minute.")
    ends = np.array([rows[-1] for _, rows in flights])
    if airport_deg is None:
        airport_deg = float(np.median(ends[:, 1])), float(np.median(ends[:, 2]))
    ground_m = float(np.median(ends[:, 3]))
    onto = onto_level(airport_deg)
    tracks = []
    for name, rows in flights:
        east, north = onto(rows[:, 2], rows[:, 1])
        track = cleaned(Track(name, rows[:, 0] - rows[-1, 0], np.stack([east, north, rows[:, 3] - ground_m], axis=-1)))
        if len(track.time_s) >= LEAST_POINTS and track.place_m[-1, 2] < _LOW_M:
            tracks.append(track)
    return tuple(tracks), airport_deg, len(flights) - len(tracks)


def onto_level(airport_deg: tuple[float, float]) -> Proj:
    """Lambert's conformal conic about an airport (latitude, longitude, degrees). Source: 002-7 1.2."""
    latitude, longitude = airport_deg
    return Proj(proj="lcc", lat_1=latitude - 0.5, lat_2=latitude + 0.5, lat_0=latitude, lon_0=longitude)


def _of_table(path: Path) -> list[Flight]:
    """Flights of a CSV or Parquet file; altitudes are feet, as ADS-B has them."""
    try:
        table = pq.read_table(path) if path.suffix == ".parquet" else pyarrow.csv.read_csv(path)
    except FileNotFoundError as error:
        raise ArrivalsError(f"There is no file {path}.") from error
    except (pa.ArrowInvalid, OSError) as error:
        raise ArrivalsError(f"{path} is neither CSV nor Parquet that can be read.") from error
    missing = [name for name in _NEEDED if name not in table.column_names]
    key = next((name for name in _NAMES if name in table.column_names), None)
    if missing or key is None:
        lacking = ", ".join(missing or [" or ".join(_NAMES)])
        raise ArrivalsError(f"{path} lacks the column {lacking}; it has {', '.join(table.column_names)}.")
    columns = [_seconds(table["timestamp"]), *(_numbers(table[name]) for name in _NEEDED[1:])]
    rows = np.stack(columns, axis=-1)
    rows[:, 3] *= FOOT_M
    good = np.isfinite(rows).all(axis=1)
    names = np.array(pc.cast(table[key], pa.string()).to_pylist(), dtype=object)
    return _parted(names[good], rows[good])


def _of_session(folder: Path) -> list[Flight]:
    """The system tracks of an archived session."""
    mend(folder)
    table = read_table(folder, "tracks", ["time", "track", "aircraft", "latitude_deg", "longitude_deg", "height_m"])
    columns = [
        _seconds(table["time"]),
        *(_numbers(table[name]) for name in ("latitude_deg", "longitude_deg", "height_m")),
    ]
    rows = np.stack(columns, axis=-1)
    aircraft, tracks = table["aircraft"].to_pylist(), table["track"].to_pylist()
    names = np.array(
        [f"{folder.name} {one or ''} {track}" for one, track in zip(aircraft, tracks, strict=True)], dtype=object
    )
    good = np.isfinite(rows).all(axis=1)
    return _parted(names[good], rows[good])


def _parted(names: NDArray[np.object_], rows: Floats) -> list[Flight]:
    """The rows of each name in the order of time, once for each time, parted where it was silent for long."""
    known = np.array([name is not None for name in names.tolist()])
    unique, whose = np.unique(names[known].astype(str), return_inverse=True)
    order = np.lexsort((rows[known, 0], whose))
    sorted_rows = rows[known][order]
    flights = []
    for name, own in zip(unique.tolist(), np.split(sorted_rows, np.cumsum(np.bincount(whose))[:-1]), strict=True):
        once = own[np.concatenate([[True], np.diff(own[:, 0]) > 0.0])]
        parts = np.split(once, np.flatnonzero(np.diff(once[:, 0]) > _SILENCE_S) + 1)
        flights += [(name if len(parts) == 1 else f"{name} ({number})", part) for number, part in enumerate(parts, 1)]
    return flights


def _seconds(column: pa.ChunkedArray) -> Floats:
    if pa.types.is_timestamp(column.type):
        nanoseconds = column.cast(pa.timestamp("ns", tz=column.type.tz)).cast(pa.int64())
        return np.asarray(nanoseconds.to_numpy(), dtype=np.float64) * 1e-9
    return _numbers(column)


def _numbers(column: pa.ChunkedArray) -> Floats:
    """As floats; what is no number is NaN."""
    if pa.types.is_string(column.type):
        column = pc.if_else(pc.match_substring_regex(column, r"^-?[0-9.]+(e-?[0-9]+)?$"), column, None)
    return np.asarray(column.cast(pa.float64()).to_numpy(zero_copy_only=False), dtype=np.float64)
