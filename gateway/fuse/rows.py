"""The rows that the fused tracks write, as columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, ReckonedFix
from gateway.associate import Spans
from gateway.estimators.kalman import ERROR, POSITION, SIZE, VELOCITY
from gateway.frames import RunwayFrame, turn
from gateway.frozen import made_swiftly
from gateway.fuse.agreement import CONFIRMED
from gateway.fuse.filtering import NEVER, Event, Job, carried_on, directions, run
from gateway.fuse.lanes import Ended, Lane, Lanes, radar_names
from gateway.fuse.life import LifeChange
from gateway.fuse.settled import Settled
from gateway.fuse.weighting import Model

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SEEN_WITHIN_S = 10.0  # a source that saw the track this lately is part of its state
TOLD_WITHIN_S = 10.0  # a pressure altitude older than this is not written any more
HEIGHT_WITHIN_S = 30.0  # a height that was measured this lately is known
HEIGHT_SIGMA_M = 150.0  # and an older one as long as it is this sure
CLIMB_SIGMA_MPS = 20.0  # without a height, a climb less sure than this is not known either


@dataclass(frozen=True, slots=True)
class Fused:
    """A step's track updates, n rows in writing order; a row for a (track, time) already written corrects it."""

    time: Ints  # (n,) ns, when the state holds
    received: Ints  # (n,) ns, when the observation behind it was heard; -1 = none
    track: Ints  # (n,)
    aircraft: tuple[str | None, ...]
    radar_track: tuple[str | None, ...]  # "1/3", several with a space between
    updated_by: tuple[str, ...]  # "gps", "radar", "coast", "dead-reckoning"
    state: tuple[str, ...]  # "gps only", "radar only", "fused", "coasting"
    latitude_rad: Floats
    longitude_rad: Floats
    height_m: Floats  # above the ellipsoid; NaN = never measured, or too long ago
    altitude_msl_m: Floats
    velocity_mps: Floats  # (n, 3) east, north, up at that point; up is NaN where neither height nor climb is known
    covariance: Floats  # (n, 36) row-major over east, north, up position and velocity at that point
    modes: Floats  # (n, 3) straight, left, right; NaN = the estimator has none
    runway_m: Floats  # (n, 3) position in the runway frame, at a guessed height where none is known
    bias_m: Floats  # (n, 3) estimated error of the position source, east north up; NaN = none
    pressure_altitude_m: Floats  # as last reported; NaN = not in the last seconds
    callsign: tuple[str | None, ...]
    life: tuple[str, ...]  # "tentative", "confirmed", "coasting"
    wind_mps: Floats  # (n, 2) east, north: where the air moves to, as dead reckoning has found; NaN = it has not
    ended: tuple[Ended, ...] = ()
    lived: tuple[LifeChange, ...] = ()  # which began, were confirmed, or coast, and why
    settled: tuple[Settled, ...] = ()  # states that nothing can change any more


@made_swiftly
@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One row before its numbers are brought into the world's coordinates."""

    time: int
    received: int
    track: int
    aircraft: str | None
    radar_track: str | None
    updated_by: str
    state: str
    mean: Floats  # (9,)
    covariance: Floats  # (9, 9)
    separation_m: float  # of the geoid, as it was known then
    event: Event  # what the row was made of
    modes: Floats  # (3,) straight, left, right; NaN = the estimator has none
    life: str
    wind_mps: tuple[float, float] = (
        math.nan,
        math.nan,
    )  # east, north: where the air moves to, as found by dead reckoning


def row_of(lane: Lane, event: Event, spans: Spans, separation_m: float, model: Model) -> Row:
    """The row that an event of a lane writes."""
    is_reckoned = isinstance(event.measure, ReckonedFix)
    by = "dead-reckoning" if is_reckoned else "gps" if isinstance(event.measure, Fix) else "radar"
    within = int(SEEN_WITHIN_S * SECOND)
    gps, radar = event.at - event.gps_at <= within, event.at - event.radar_at <= within
    state = "coasting" if is_reckoned else "fused" if gps and radar else "gps only" if gps else "radar only"
    names = radar_names(lane, spans, event.at)
    received = event.measure.received_at
    return Row(
        event.at,
        received,
        lane.number_at(event.at),
        lane.aircraft,
        names,
        by,
        state,
        event.mean,
        event.covariance,
        separation_m,
        event,
        directions(event, model),
        "tentative" if event.score != CONFIRMED else "coasting" if is_reckoned else "confirmed",
    )


def work(
    lanes: Lanes, jobs: Sequence[Job], spans: Spans, separation_m: float, model: Model
) -> tuple[Lanes, list[Row], list[tuple[int, Event]]]:
    """The lanes with some jobs done, the rows that they wrote, and each new measurement's event with its track."""
    rows: list[Row] = []
    changed: dict[int, Lane] = {}
    fresh: list[tuple[int, Event]] = []
    for job, events in zip(jobs, run(jobs, model), strict=True):
        lane = lanes.lanes[job.track]
        changed[lane.track] = lane.with_events((*lane.events, *events))
        rows += [row_of(lane, event, spans, separation_m, model) for event in events]
        heard = [event for event in events if event.measure.serial == job.fresh]
        fresh += [(lane.number, event) for event in heard if not isinstance(event.measure, ReckonedFix)]
    return lanes.with_lanes(changed), rows, fresh


def coast(lanes: Sequence[Lane], at: int, spans: Spans, separation_m: float, model: Model) -> list[Row]:
    """A row for each of some silent lanes, carried on to an instant."""
    if not lanes:
        return []
    elapsed_s = np.array([(at - lane.last.at) / SECOND for lane in lanes])
    state, flown = carried_on([lane.last for lane in lanes], elapsed_s, model)
    return [
        Row(
            at,
            -1,
            lane.number,
            lane.aircraft,
            radar_names(lane, spans, at),
            "coast",
            "coasting",
            state.mean[i],
            state.covariance[i],
            separation_m,
            lane.last,
            flown[i],
            "coasting" if lane.last.score == CONFIRMED else "tentative",
        )
        for i, lane in enumerate(lanes)
    ]


def knows_height(events: Sequence[Event], times: Sequence[int], covariance: Floats) -> NDArray[np.bool_]:
    """Whether the height of each state is known at its time, (n,): measured lately, or still sure; (n, 9, 9)."""
    measured = np.array([event.height_at for event in events], dtype=np.int64)
    lately = np.array(times, dtype=np.int64) - measured <= int(HEIGHT_WITHIN_S * SECOND)
    return np.asarray((measured != NEVER) & (lately | (covariance[:, 2, 2] <= HEIGHT_SIGMA_M**2)), dtype=np.bool_)


def _pressure_altitude_m(row: Row) -> float:
    told = row.event.barometric
    if told is None or row.time - told.at > int(TOLD_WITHIN_S * SECOND):
        return math.nan
    return told.pressure_altitude_m


def table(
    rows: Sequence[Row],
    ended: Sequence[Ended],
    lived: Sequence[LifeChange],
    settled: Sequence[Settled],
    frame: RunwayFrame,
    model: Model,
) -> Fused:
    """Rows as columns, in geodetic coordinates and with velocity and covariance along the axes at each point."""
    n = len(rows)
    mean = np.array([row.mean for row in rows]).reshape(n, SIZE)
    full = np.array([row.covariance for row in rows]).reshape(n, SIZE, SIZE)
    latitude, longitude, height, velocity, covariance = in_the_world(mean, full, frame)
    has_height = knows_height([row.event for row in rows], [row.time for row in rows], full)
    height = np.where(has_height, height, math.nan)
    velocity[~has_height & (covariance[:, 5, 5] > CLIMB_SIGMA_MPS**2), 2] = math.nan
    known = np.array([row.aircraft is not None for row in rows], dtype=np.bool_)[:, None]
    has_error = model.motion.error_sigma_m > 0.0
    return Fused(
        time=np.array([row.time for row in rows], dtype=np.int64),
        received=np.array([row.received for row in rows], dtype=np.int64),
        track=np.array([row.track for row in rows], dtype=np.int64),
        aircraft=tuple(row.aircraft for row in rows),
        radar_track=tuple(row.radar_track for row in rows),
        updated_by=tuple(row.updated_by for row in rows),
        state=tuple(row.state for row in rows),
        latitude_rad=latitude,
        longitude_rad=longitude,
        height_m=height,
        altitude_msl_m=height - np.array([row.separation_m for row in rows]).reshape(n),
        velocity_mps=velocity,
        covariance=covariance.reshape(n, 36),
        modes=np.array([row.modes for row in rows]).reshape(n, 3),
        runway_m=turn(frame.runway_from_enu, np.ascontiguousarray(mean[:, POSITION])),
        bias_m=np.where(known & has_error, mean[:, ERROR], math.nan),
        pressure_altitude_m=np.array([_pressure_altitude_m(row) for row in rows]).reshape(n),
        callsign=tuple(row.event.callsign for row in rows),
        life=tuple(row.life for row in rows),
        wind_mps=np.array([row.wind_mps for row in rows]).reshape(n, 2),
        ended=tuple(ended),
        lived=tuple(lived),
        settled=tuple(settled),
    )


def in_the_world(mean: Floats, covariance: Floats, frame: RunwayFrame) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """States (n, 9), (n, 9, 9) as latitude, longitude (rad) and height (m), (n,) each, and along the axes at each point.

    These are the velocity (n, 3), and the covariance (n, 6, 6) of position and velocity.
    """
    latitude, longitude, height = frame.geodetic_from_enu(np.ascontiguousarray(mean[:, POSITION]))
    local = frame.local_from_enu(latitude, longitude)
    both = np.zeros((len(mean), 6, 6))
    both[:, :3, :3] = both[:, 3:, 3:] = local
    along = both @ np.ascontiguousarray(covariance[:, :6, :6]) @ both.transpose(0, 2, 1)
    velocity = (local @ mean[:, VELOCITY][:, :, None])[:, :, 0]
    return latitude, longitude, height, velocity, along
