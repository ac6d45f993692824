"""The approaches of an archived session: its tables and its site read, and handed to `gateway.offline.report`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.deck import DeckPath
from gateway.frames import RunwayFrame, turn
from gateway.offline.report import Approach, Heard, approaches
from gateway.offline.way import Flown, resampled
from gateway.runtime.archived import read_table
from gateway.runtime.folder import FolderError, Record, read_record
from gateway.settings import Site
from gateway.settings.reading import SiteError, parse_site

if TYPE_CHECKING:
    import pyarrow as pa

Floats = NDArray[np.float64]

_COLUMNS = ("time", "aircraft", "latitude_deg", "longitude_deg", "height_m")
_VELOCITIES = ("velocity_east_mps", "velocity_north_mps", "velocity_up_mps")


@dataclass(frozen=True, slots=True)
class Reported:
    """A session and its approaches, in the order of time."""

    folder: Path
    record: Record
    site: Site
    approaches: tuple[Approach, ...]


def approaches_of(session: Path) -> Reported:
    """Every approach of every aircraft, and of every track that no aircraft is known for.

    Raises FolderError where it is no whole session, OSError where its files cannot be read.
    """
    record = read_record(session)
    if record.site is None:
        raise FolderError(f"{session} holds no tracks: it ended before its place was known.")
    try:
        site = parse_site(record.site)
    except SiteError as error:
        raise FolderError(f"The site in {session} is not understood: {error}") from error
    more = ("received", "track", "updated_by", "state", "radar_track")
    tracks = read_table(session, "tracks", [*_COLUMNS, *_VELOCITIES, *more])
    has_truth = (session / "truth.parquet").is_file()
    true = read_table(session, "truth", [*_COLUMNS, *_VELOCITIES]) if has_truth else tracks.slice(0, 0)
    frame = RunwayFrame(site.runway)
    names = [
        one or f"track {number}"
        for one, number in zip(_words(tracks, "aircraft"), tracks["track"].to_pylist(), strict=True)
    ]
    deck = (
        _deck(session, frame) if site.runway.follows in names else None
    )  # without that ship it is where it is written
    true_deck = None if deck is None else _true_deck(deck, true, frame)
    of_truth = np.array(_words(true, "aircraft"), dtype=object)
    of_track = np.array(names, dtype=object)
    offset_ns = (record.epoch_offset_s or 0) * 1_000_000_000
    found: list[Approach] = []
    for name in dict.fromkeys(names):
        own = _last_of_each_time(tracks.filter(of_track == name))
        told = _last_of_each_time(true.filter(of_truth == name))
        known = _flown(told, frame, true_deck) if len(told) > 1 else None
        found += approaches(site, name, _flown(own, frame, deck), _heard(own, offset_ns), known)
    return Reported(session, record, site, tuple(sorted(found, key=lambda one: int(one.course.time[0]))))


def _last_of_each_time(table: pa.Table) -> pa.Table:
    """In the order of time; the last row written of a time is what holds."""
    time = table["time"].cast("int64").to_numpy()
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(_real(table, "height_m")[order])]
    if not len(order):
        return table.slice(0, 0)
    return table.take(order[np.append(np.diff(time[order]) > 0, True)])


def _flown(table: pa.Table, frame: RunwayFrame, deck: DeckPath | None) -> Flown:
    """A way in the runway's frame, or the deck's as it was at each time."""
    time, place, velocity = _flown_enu(table, frame)
    if deck is not None:
        return Flown(time, deck.place(time, place), deck.velocity(time, velocity))
    return Flown(time, turn(frame.runway_from_enu, place), turn(frame.runway_from_enu, velocity))


def _flown_enu(table: pa.Table, frame: RunwayFrame) -> tuple[NDArray[np.int64], Floats, Floats]:
    latitude, longitude, height = (_real(table, name) for name in _COLUMNS[2:])
    place = frame.enu_from_geodetic(np.radians(latitude), np.radians(longitude), height)
    velocity = np.stack([_real(table, name) for name in _VELOCITIES], axis=-1)
    return table["time"].cast("int64").to_numpy(), place, velocity


def _deck(session: Path, frame: RunwayFrame) -> DeckPath:
    """Where the deck was, as the picture had it."""
    table = read_table(session, "deck")
    place = np.stack([_real(table, f"{axis}_m") for axis in ("east", "north", "up")], axis=-1)
    velocity = np.stack([_real(table, name) for name in _VELOCITIES], axis=-1)
    heading = np.radians(_real(table, "landing_direction_deg")) - frame.runway.landing_compass_rad
    columns = table["time"].cast("int64").to_pylist(), place, velocity, heading.tolist()
    turns = np.radians(_real(table, "turn_degps")).tolist()
    return DeckPath(tuple(map(frame.deck_pose, *columns, turns)))


def _true_deck(deck: DeckPath, true: pa.Table, frame: RunwayFrame) -> DeckPath:
    """The same where the ship truly was, with the heading that she told; the very same where the truth does not know her."""
    ship = _last_of_each_time(true.filter(np.array(_words(true, "aircraft"), dtype=object) == frame.runway.follows))
    if len(ship) < 2:
        return deck
    way = resampled(Flown(*_flown_enu(ship, frame)), np.array([pose.at for pose in deck.poses]))
    return DeckPath(
        tuple(
            frame.deck_pose(
                pose.at, place, velocity, pose.compass_rad - frame.runway.landing_compass_rad, pose.turn_radps
            )
            if np.isfinite(place).all()
            else pose
            for pose, place, velocity in zip(deck.poses, way.place_m, way.velocity_mps, strict=True)
        )
    )


def _heard(table: pa.Table, offset_ns: int) -> Heard:
    """Latencies are by the receiver's clock: a session whose sources have another epoch is brought back to it."""
    received = table["received"].cast("int64").to_pylist()
    measured = (table["time"].cast("int64").to_numpy() - offset_ns).tolist()
    delay = [math.nan if one is None else 1e-9 * (one - was) for one, was in zip(received, measured, strict=True)]
    updated_by, state, radar_track = (
        np.array(_words(table, name), dtype=np.str_) for name in ("updated_by", "state", "radar_track")
    )
    return Heard(updated_by, state, np.array(delay), radar_track)


def _words(table: pa.Table, name: str) -> list[str]:
    return [one or "" for one in table[name].to_pylist()]


def _real(table: pa.Table, name: str) -> Floats:
    return np.asarray(table[name].to_numpy(zero_copy_only=False), dtype=np.float64)


def document(reported: Reported) -> dict[str, Any]:
    """A session's report as plain values for JSON; instants are ns since 1970 UTC."""
    return {
        "session": str(reported.folder),
        "site": reported.site.name,
        "summary": dict(reported.record.summary),
        "approaches": [_plain(one) for one in reported.approaches],
    }


def _plain(value: Any) -> Any:
    """Dataclasses as objects, arrays as lists, what is not known as null."""
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, np.ndarray):
        return [_plain(one) for one in value.tolist()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
