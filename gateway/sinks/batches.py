"""The archive's tables: what columns they have, and the rows of many steps as one batch of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from gateway.frames import DeckPose
from gateway.fuse import Fused
from gateway.observation import Truth
from gateway.predict import Conflicts, Predicted

_TIME = pa.timestamp("ns", tz="UTC")
_REAL = pa.float64()
_TEXT = pa.string()
_VELOCITY = [(f"velocity_{axis}_mps", _REAL) for axis in ("east", "north", "up")]
_PLACE = [("latitude_deg", _REAL), ("longitude_deg", _REAL), ("height_m", _REAL)]

TRACKS = pa.schema(
    [
        pa.field("time", _TIME, nullable=False),
        ("received", _TIME),
        pa.field("track", pa.int64(), nullable=False),
        ("aircraft", _TEXT),
        ("radar_track", _TEXT),
        ("updated_by", _TEXT),
        ("state", _TEXT),
        *_PLACE,
        ("altitude_msl_m", _REAL),
        *_VELOCITY,
        ("covariance", pa.list_(_REAL, 36)),
        ("straight", _REAL),
        ("left", _REAL),
        ("right", _REAL),
        ("pressure_altitude_m", _REAL),  # never a height: it stands beside one, or where there is none
        ("callsign", _TEXT),
        ("life", _TEXT),
        ("wind_east_mps", _REAL),  # where the air moves to, as dead reckoning has found it
        ("wind_north_mps", _REAL),
    ]
)

PREDICTIONS = pa.schema(
    [
        pa.field("made", _TIME, nullable=False),
        pa.field("track", pa.int64(), nullable=False),
        pa.field("valid", _TIME, nullable=False),
        ("horizon_s", _REAL),
        *_PLACE,
        ("sigma_m", _REAL),
        ("method", _TEXT),
        ("intent", _TEXT),
        ("intent_kind", _TEXT),
        ("confidence", _REAL),
        ("sigma_along_m", _REAL),
        ("sigma_across_m", _REAL),
        ("course_deg", _REAL),
    ]
)

TRUTH = pa.schema([pa.field("time", _TIME, nullable=False), ("aircraft", _TEXT), *_PLACE, *_VELOCITY, ("mode", _TEXT)])

CONFLICTS = pa.schema(
    [
        pa.field("time", _TIME, nullable=False),
        pa.field("track", pa.int64(), nullable=False),
        pa.field("other_track", pa.int64(), nullable=False),
        ("state", _TEXT),  # "found", "goes on", "over": then the rest is as it was told last
        ("loses_separation", _TIME),
        ("closest", _TIME),
        *_PLACE,  # in the middle between both when they are nearest
        ("horizontal_m", _REAL),  # then
        ("vertical_m", _REAL),
        ("probability", _REAL),
    ]
)

DECK = pa.schema(
    [
        pa.field("time", _TIME, nullable=False),
        *[(f"{axis}_m", _REAL) for axis in ("east", "north", "up")],  # of the place where the site file has the runway
        *_VELOCITY,
        ("landing_direction_deg", _REAL),  # true
        ("turn_degps", _REAL),  # clockwise
    ]
)
"""Where a runway that follows a ship was, a row a second; no table of one that stands still."""

SCHEMAS = {"tracks": TRACKS, "predictions": PREDICTIONS, "conflicts": CONFLICTS, "truth": TRUTH, "deck": DECK}
"""The tables of a session by the stem of their files."""

_TRACK_TEXTS = ("aircraft", "radar_track", "updated_by", "state")


def _real(values: Any) -> pa.Array:
    """NaN is how arrays say "not measured"; a table says it with null."""
    return pa.array(np.ascontiguousarray(values, dtype=np.float64), type=_REAL, from_pandas=True)


def _time(values: Any) -> pa.Array:
    return pa.array(np.ascontiguousarray(values, dtype=np.int64)).cast(_TIME)


def _text(parts: Sequence[Sequence[str | None]]) -> pa.Array:
    return pa.array([text for part in parts for text in part], type=_TEXT)


def tracks_batch(parts: Sequence[Fused]) -> pa.RecordBatch:
    """The rows of many steps as one batch of the TRACKS schema."""
    received = np.concatenate([part.received for part in parts])
    velocity = np.concatenate([part.velocity_mps for part in parts])
    modes = np.concatenate([part.modes for part in parts])
    covariance = np.concatenate([part.covariance for part in parts]).astype(np.float64, copy=False)
    heard = pa.array(received, mask=received < 0).cast(_TIME)
    columns = [
        _time(np.concatenate([part.time for part in parts])),
        heard,
        pa.array(np.concatenate([part.track for part in parts])),
        *(_text([getattr(part, name) for part in parts]) for name in _TRACK_TEXTS),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        _real(np.concatenate([part.height_m for part in parts])),
        _real(np.concatenate([part.altitude_msl_m for part in parts])),
        *(_real(velocity[:, axis]) for axis in range(3)),
        pa.FixedSizeListArray.from_arrays(pa.array(covariance.reshape(-1)), 36),
        *(_real(modes[:, mode]) for mode in range(3)),
        _real(np.concatenate([part.pressure_altitude_m for part in parts])),
        _text([part.callsign for part in parts]),
        _text([part.life for part in parts]),
        *(_real(np.concatenate([part.wind_mps for part in parts])[:, axis]) for axis in range(2)),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=TRACKS)


def predictions_batch(parts: Sequence[Predicted]) -> pa.RecordBatch:
    """The predicted points of many steps as one batch of the PREDICTIONS schema."""
    columns = [
        _time(np.concatenate([part.made for part in parts])),
        pa.array(np.concatenate([part.track for part in parts])),
        _time(np.concatenate([part.valid for part in parts])),
        _real(np.concatenate([part.horizon_s for part in parts])),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        _real(np.concatenate([part.height_m for part in parts])),
        _real(np.concatenate([part.sigma_m for part in parts])),
        *(_text([getattr(part, name) for part in parts]) for name in ("method", "intent", "intent_kind")),
        _real(np.concatenate([part.confidence for part in parts])),
        _real(np.concatenate([part.sigma_along_m for part in parts])),
        _real(np.concatenate([part.sigma_across_m for part in parts])),
        _real(np.degrees(np.concatenate([part.course_rad for part in parts]))),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=PREDICTIONS)


def conflicts_batch(parts: Sequence[Conflicts]) -> pa.RecordBatch:
    """The conflicts of many rounds as one batch of the CONFLICTS schema."""
    pairs = [pair for part in parts for pair in part.pair]
    columns = [
        _time(np.concatenate([part.time for part in parts])),
        *(pa.array([pair[side] for pair in pairs], type=pa.int64()) for side in (0, 1)),
        _text([part.state for part in parts]),
        _time(np.concatenate([part.loses_at for part in parts])),
        _time(np.concatenate([part.closest_at for part in parts])),
        _real(np.degrees(np.concatenate([part.latitude_rad for part in parts]))),
        _real(np.degrees(np.concatenate([part.longitude_rad for part in parts]))),
        *(
            _real(np.concatenate([getattr(part, name) for part in parts]))
            for name in ("height_m", "horizontal_m", "vertical_m", "probability")
        ),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=CONFLICTS)


def deck_batch(poses: Sequence[DeckPose]) -> pa.RecordBatch:
    """Poses of a deck as one batch of the DECK schema."""
    place, velocity = np.array([one.enu_m for one in poses]), np.array([one.velocity_mps for one in poses])
    columns = [
        _time([one.at for one in poses]),
        *(_real(place[:, axis]) for axis in range(3)),
        *(_real(velocity[:, axis]) for axis in range(3)),
        _real(np.degrees([one.compass_rad for one in poses])),
        _real(np.degrees([one.turn_radps for one in poses])),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=DECK)


def truth_batch(rows: Sequence[Truth], geoid_separation_m: float) -> pa.RecordBatch:
    """True states as one batch of the TRUTH schema; an altitude above mean sea level becomes a height."""

    def height_m(row: Truth) -> float | None:
        if row.height_m is not None or row.altitude_msl_m is None:
            return row.height_m
        return row.altitude_msl_m + geoid_separation_m

    columns = [
        _time([row.valid_at for row in rows]),
        pa.array([row.aircraft for row in rows], type=_TEXT),
        _real(np.degrees([row.latitude_rad for row in rows])),
        _real(np.degrees([row.longitude_rad for row in rows])),
        pa.array([height_m(row) for row in rows], type=_REAL),
        *(pa.array([getattr(row, name) for row in rows], type=_REAL) for name, _ in _VELOCITY),
        pa.array([row.mode for row in rows], type=_TEXT),
    ]
    return pa.RecordBatch.from_arrays(columns, schema=TRUTH)
