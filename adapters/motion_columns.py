"""Inertial samples of many frames side by side: the same as motion.py reads from one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.columns import datagram_dtype
from adapters.moments import LEAST_UNIX_USEC
from adapters.motion import (
    AXES,
    CUT_OFF,
    MILLI_G,
    RAW_IMU,
    SCALED_IMU,
    SCALED_IMU2,
    SCALED_IMU3,
)
from adapters.roles import ARDUPILOT
from adapters.rows import Floats, Integers, Rows, Truths
from gateway.observation import ImuSample, Many

_SENSORS = {SCALED_IMU: 1, SCALED_IMU2: 2, SCALED_IMU3: 3}
_FIELDS = ("acceleration_mps2", "angular_rate_radps", "magnetic_field_gauss")


@cache
def _axes_dtype(message: int) -> np.dtype[Any]:
    """A whole frame of a message with its nine axes in one array."""
    whole = datagram_dtype(message)
    fields: Mapping[str, Any] = whole.fields or {}
    first = int(fields[AXES[0]][1])
    assert [int(fields[name][1]) - first for name in AXES] == list(range(0, 18, 2))
    return np.dtype({"names": ["axes"], "formats": [("<i2", (9,))], "offsets": [first], "itemsize": whole.itemsize})


def scaled_imu(rows: Rows, told: Sequence[tuple[int, NDArray[Any]]]) -> Many:
    """RAW_IMU, SCALED_IMU, SCALED_IMU2, SCALED_IMU3: samples in mG, mrad/s and mgauss."""
    axes, usec, sensor, in_milli_g = map(np.concatenate, zip(*(_told(*one) for one in told), strict=True))
    known = in_milli_g | np.array([one == ARDUPILOT for one in rows.autopilots])[rows.vehicle]
    if not known.all():
        rows.count("raw units unknown", ~known)
        rows, axes, usec, sensor = rows.saying(known), axes[known], usec[known], sensor[known]
    values = axes.astype(np.float64)
    values[:, :3] *= MILLI_G
    values[:, 3:] /= 1000
    vectors, has = values.reshape(-1, 3, 3), _has(rows, axes.reshape(-1, 3, 3))
    if not has.all():
        vectors[~has] = np.nan
    _show(rows, sensor, vectors, has)
    columns = {name: vectors[:, place] for place, name in enumerate(_FIELDS)}
    return rows.many(ImuSample, np.logical_or.reduce(has, axis=1), rows.near(usec), sensor=sensor, **columns)


def _has(rows: Rows, axes: NDArray[np.int16]) -> Truths:
    """Which of the three vectors of each row are measured; counts those that are cut off, and rows without any."""
    if axes.size and axes.all() and axes.max() < CUT_OFF and axes.min() > -CUT_OFF:
        return np.ones(axes.shape[:2], np.bool_)
    cut = np.logical_or.reduce((axes >= CUT_OFF) | (axes <= -CUT_OFF), axis=2)
    nothing = np.logical_and.reduce(axes == 0, axis=2)
    nothing[:, 1] &= nothing[:, 0]  # nothing turns beside what is accelerated
    has: Truths = ~cut & ~nothing
    rows.count("inertial out of range", np.logical_or.reduce(cut, axis=1))
    rows.count("inertial unit without data", ~np.logical_or.reduce(has, axis=1))
    return has


def _told(message: int, told: NDArray[Any]) -> tuple[NDArray[np.int16], Integers, Integers, Truths]:
    """Axes, time, sensor of frames of one message, and whether they are surely in mG."""
    axes = told.view(_axes_dtype(message))["axes"]
    if message == RAW_IMU:
        usec = np.minimum(told["time_usec"], LEAST_UNIX_USEC).astype(np.int64)
        return axes, usec, told["id"].astype(np.int64) + 1, np.zeros(len(told), np.bool_)
    sensor = np.full(len(told), _SENSORS[message])
    return axes, told["time_boot_ms"].astype(np.int64) * 1000, sensor, np.ones(len(told), np.bool_)


def _show(rows: Rows, sensor: Integers, vectors: Floats, has: Truths) -> None:
    """Keep for people the last vectors of each vehicle's sensors."""
    order = np.argsort(rows.places)
    keys = (rows.vehicle << 16 | sensor)[order].tolist()
    everywhere = dict(zip(keys, order.tolist(), strict=True))
    for place in range(3):
        last = everywhere
        if not has[:, place].all():
            last = {key: row for key, row in zip(keys, order.tolist(), strict=True) if has[row, place]}
        for key, row in last.items():
            vector = tuple(vectors[row, place].tolist())
            rows.shown.append((int(rows.places[row]), rows.vehicles[key >> 16].inertial, (key & 0xFFFF, place), vector))
