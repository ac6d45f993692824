"""The multi-radar track: where the radars alone have a target that is also its own position source's (paper 004, figure 1).

It is made of tracklets only, and so knows nothing of the position source: when either fails, the other shows it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.associate.pairing import ALLOWED, Systematic
from gateway.associate.tracklets import Tracklets
from gateway.frames import RunwayFrame, turn
from gateway.track import Key, name_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _none() -> Ints:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True)
class MultiRadar:
    """What several radars alone have of system tracks, n rows; some seconds old, since each is from the plots about it."""

    time: Ints = field(default_factory=_none)  # (n,) ns
    track: Ints = field(default_factory=_none)  # (n,) the system track that it is part of
    radar_track: tuple[str, ...] = ()  # "1/3 2/7"
    runway_m: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    velocity_mps: Floats = field(default_factory=lambda: np.zeros((0, 3)))  # in the runway frame
    sigma_m: Floats = field(default_factory=lambda: np.zeros((0, 3)))  # east, north, up; systematic errors included

    @classmethod
    def of(cls, some: Sequence[MultiRadar]) -> MultiRadar:
        """Those of several instants together."""
        if len(some) < 2:
            return some[0] if some else cls()
        return cls(
            np.concatenate([one.time for one in some]),
            np.concatenate([one.track for one in some]),
            tuple(name for one in some for name in one.radar_track),
            np.concatenate([one.runway_m for one in some]),
            np.concatenate([one.velocity_mps for one in some]),
            np.concatenate([one.sigma_m for one in some]),
        )


def combined(
    seen: Tracklets,
    groups: Mapping[int, Sequence[Key]],
    systematic: Mapping[int, Systematic],
    frame: RunwayFrame,
) -> MultiRadar:
    """The tracklets of each system track's radar tracks as one, weighted by their covariances."""
    row_of = {key: row for row, key in enumerate(seen.keys)}
    tracks = [track for track, keys in groups.items() if sum(key in row_of for key in keys) > 1]
    if not tracks:
        return MultiRadar()
    members = [[key for key in groups[track] if key in row_of] for track in tracks]
    rows = np.array([row_of[key] for keys in members for key in keys])
    first = np.concatenate([[0], np.cumsum([len(keys) for keys in members])[:-1]])
    sigma = np.array([systematic.get(radar, ALLOWED) for radar in seen.radar[rows].tolist()])
    by_error = seen.by_error[rows] * sigma[:, None, :]
    weight = np.linalg.inv(seen.covariance[rows] + by_error @ by_error.transpose(0, 2, 1))
    spread = np.linalg.inv(np.add.reduceat(weight, first))
    told = np.add.reduceat(weight @ seen.state[rows][:, :, None], first)
    state = (spread @ told)[:, :, 0]
    return MultiRadar(
        np.full(len(tracks), seen.at, np.int64),
        np.array(tracks, np.int64),
        tuple(" ".join(name_of(key) for key in sorted(keys)) for keys in members),
        turn(frame.runway_from_enu, np.ascontiguousarray(state[:, :3])),
        turn(frame.runway_from_enu, np.ascontiguousarray(state[:, 3:])),
        np.sqrt(np.diagonal(spread, axis1=1, axis2=2)[:, :3]),
    )
