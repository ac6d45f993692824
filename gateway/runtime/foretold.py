"""A session's predictions, tracks and truth as `gateway.offline.score` wants them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gateway.offline.score import Errors, Foretold, Way, errors
from gateway.runtime.archived import read_table

if TYPE_CHECKING:
    import pyarrow as pa


def errors_of(session: Path) -> tuple[list[Errors], dict[str, str]]:
    """The errors of each track's predictions, and which were held against what.

    Raises FolderError where the session has no predictions, OSError where the files cannot be read.
    """
    predictions, tracks, truth = (read_table(session, name) for name in ("predictions", "tracks", "truth"))
    true = _ways(truth, "aircraft")
    flown = _ways(tracks, "track")
    aircraft = dict(zip(tracks["track"].to_pylist(), tracks["aircraft"].to_pylist(), strict=True))
    number = predictions["track"].to_numpy()
    parts: list[Errors] = []
    against_truth: list[str] = []
    against_track: list[str] = []
    for track in np.unique(number).tolist():
        if track not in flown:
            continue
        name = aircraft.get(track)
        came = true.get(name) if name is not None else None
        (against_track if came is None else against_truth).append(f"{track} ({name or 'radar'})")
        told = _foretold(predictions.filter(number == track))
        parts.append(errors(told, flown[track] if came is None else came, flown[track]))
    against = {"held against the truth": against_truth, "against the track itself": against_track}
    return parts, {what: ", ".join(who) for what, who in against.items() if who}


def _ways(table: pa.Table, by: str) -> dict[Any, Way]:
    """The ways in a table: the last row of each time counts, and what was only carried on is not counted."""
    names = np.array(table[by].to_pylist(), dtype=object)
    seen = np.ones(len(table), dtype=np.bool_)
    if "updated_by" in table.column_names:
        seen = np.array([how != "coast" for how in table["updated_by"].to_pylist()], dtype=np.bool_)
    time = table["time"].cast("int64").to_numpy()
    latitude, longitude, height = (_real(table, column) for column in ("latitude_deg", "longitude_deg", "height_m"))
    ways = {}
    for name in dict.fromkeys(names[seen].tolist()):
        rows = np.flatnonzero(seen & (names == name) & ~np.isnan(latitude))
        order = rows[np.argsort(time[rows], kind="stable")]
        last = np.append(time[order][1:] != time[order][:-1], True)
        order = order[last[: len(order)]]
        ways[name] = Way(time[order], np.radians(latitude[order]), np.radians(longitude[order]), height[order])
    return ways


def _foretold(table: pa.Table) -> Foretold:
    sigma = _real(table, "sigma_m")
    along, across = (_real(table, f"sigma_{axis}_m") for axis in ("along", "across"))
    return Foretold(
        table["made"].cast("int64").to_numpy(),
        table["valid"].cast("int64").to_numpy(),
        _real(table, "horizon_s"),
        np.radians(_real(table, "latitude_deg")),
        np.radians(_real(table, "longitude_deg")),
        _real(table, "height_m"),
        np.where(np.isnan(along), sigma, along),
        np.where(np.isnan(across), sigma, across),
        np.radians(np.nan_to_num(_real(table, "course_deg"))),
        _words(table, "method"),
        _words(table, "intent_kind"),
    )


def _real(table: pa.Table, name: str) -> NDArray[np.float64]:
    """A column; NaN throughout where an older release did not write it."""
    if name not in table.column_names:
        return np.full(len(table), math.nan)
    return np.asarray(table[name].to_numpy(zero_copy_only=False), dtype=np.float64)


def _words(table: pa.Table, name: str) -> NDArray[np.str_]:
    return np.array([word or "" for word in table[name].to_pylist()], dtype="U16")
