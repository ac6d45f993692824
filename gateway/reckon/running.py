"""Dead reckoning of many vehicles side by side, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.dead_reckoning import Reckoning, Unit
from gateway.estimators.inertial import Motion, between, displaced
from gateway.reckon.cells import BLOCK, CELL_NS, CELL_S, SECOND_CELLS, Cells
from gateway.reckon.judging import FAR, judged
from gateway.reckon.tip import (
    HYPOTHESES,
    NOTHING,
    SEEDED_EVERY,
    Tip,
    hypothesis,
    joined,
    spread,
    with_each,
    with_hypothesis,
)
from gateway.reckon.told import true_airspeed_mps
from gateway.settings import DeadReckoning

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LASTS_S = 30.0  # the errors of an autopilot's attitude, of an airspeed and of an altitude: what is told is that old
ATTITUDE_EVERY = 10  # cells
SLOWEST_AIR_MPS = 8.0  # below it an airspeed tells nothing
UNSEEN_SHARE = 0.6  # of the scatter of samples, that the motion between them may have been another
STARTING_VELOCITY_MPS = 0.5
_LOOSE_M = 1e6


@dataclass(frozen=True, slots=True)
class Kinds:
    """What n vehicles are (n,): with wheels, with a keel, with wings."""

    wheels: Bools
    hull: Bools
    wings: Bools

    @classmethod
    def of(cls, types: Sequence[int | None]) -> Kinds:
        """By MAV_TYPE."""
        return cls(
            np.array([one in _WHEELS for one in types], np.bool_),
            np.array([one in _HULLS for one in types], np.bool_),
            np.array([one in _WINGS for one in types], np.bool_),
        )

    def taken(self, rows: Ints) -> Kinds:
        """Some of the vehicles."""
        return Kinds(self.wheels[rows], self.hull[rows], self.wings[rows])


_WHEELS = frozenset((10,))  # ground rover
_HULLS = frozenset((11,))  # surface boat
_WINGS = frozenset((1, 19, 20, 21, 22, 23, 24, 25, 28))  # fixed wing, VTOL, parafoil


def unit_of(settings: DeadReckoning) -> Unit:
    """The inertial unit as the settings have it."""
    return Unit(
        settings.gyro_noise,
        settings.accelerometer_noise,
        settings.gyro_bias_radps,
        settings.accelerometer_bias_mps2,
        settings.gyro_bias_wanders,
        settings.accelerometer_bias_wanders,
        settings.wind_mps,
        settings.wind_wanders,
    )


def begun(at: int, place: Floats, attitude: Floats, settings: DeadReckoning) -> Tip:
    """One vehicle that dead reckoning begins with: a position as `told.PLACE` at an instant, and an attitude (4,)."""
    cell = at // CELL_NS // BLOCK * BLOCK
    height = place[2] if math.isfinite(place[2]) else 0.0
    latitude, longitude, above = (np.array([one]) for one in (place[0], place[1], height))
    velocity = np.nan_to_num(place[3:6])[None]
    latitude, longitude, above = displaced(latitude, longitude, above, velocity * ((cell * CELL_NS - at) / 1e9))
    upright = place[7] if math.isfinite(place[2]) else 1e4
    sigma = np.array([place[6], place[6], upright])
    speed = np.full(3, max(float(place[8]), STARTING_VELOCITY_MPS))
    lean = 2.0 * settings.attitude_sigma_rad * np.array([1.0, 1.0, 2.0])
    state = dr.started(
        Motion(latitude, longitude, above, velocity, attitude[None]), sigma, speed, lean, unit_of(settings)
    )
    one = np.array([cell])
    return Tip(
        spread(state),
        one,
        one,
        np.full((1, HYPOTHESES), cell),
        one,
        np.array([place[6] ** 2]),
        np.array([place[8] ** 2]),
        np.array([math.nan]),
        np.zeros(1, np.int64),
        np.zeros(1, np.int64),
        np.zeros((1, 3)),
    )


def run(tips: Sequence[Tip], inputs: Sequence[Cells], kinds: Kinds, settings: DeadReckoning) -> list[list[Tip]]:
    """Vehicles through their cells; of each the tips at whole seconds on the way, and at the end. Those of one do not
    touch those of another: any batching gives the same bits.
    """
    left: list[list[Tip]] = [[] for _ in tips]
    whole, unit = joined(tips), unit_of(settings)
    ends = [one.end for one in inputs]
    for cell in range(int(whole.cell.min()), max(ends), BLOCK):
        rows = np.flatnonzero([one.first <= cell < one.end for one in inputs])
        all_of_them = len(rows) == len(tips)
        some = whole if all_of_them else whole.taken(rows)
        mine = kinds if all_of_them else kinds.taken(rows)
        after = _through(some, _Slice.of([inputs[int(row)] for row in rows], cell), mine, cell, unit, settings)
        whole = after if all_of_them else whole.put(rows, after)
        for place, row in enumerate(rows):
            if (cell + BLOCK) % SECOND_CELLS == 0 or cell + BLOCK == ends[row]:
                left[row].append(after.taken(np.array([place])))
    return left


@dataclass(frozen=True, slots=True, eq=False)
class _Slice:
    """One block of n vehicles: m cells of each (n, m, ...), and what was told in them last, or first, at the block's end."""

    rate: Floats
    force: Floats
    unseen: Floats
    turned: Floats
    attitude: Floats
    airspeed: Floats
    altitude: Floats
    place: Floats
    place_late: Floats
    pictured: Floats
    pictured_late: Floats

    @classmethod
    def of(cls, inputs: Sequence[Cells], cell: int) -> _Slice:
        rows = [slice(cell - one.first, cell - one.first + BLOCK) for one in inputs]

        def column(name: str) -> NDArray[Any]:
            return np.array([getattr(one, name)[row] for one, row in zip(inputs, rows, strict=True)])

        place, late = _told_first(column("place"), column("place_late_s"))
        pictured, pictured_late = _told_first(column("pictured"), column("pictured_late_s"))
        return cls(
            column("rate_radps"),
            column("force_mps2"),
            column("unseen")[:, -1],
            column("turned_radps"),
            column("attitude")[:, -1],
            _told_last(column("airspeed_mps")),
            _told_last(column("altitude_m")),
            place,
            late,
            pictured,
            pictured_late,
        )


def _told_last(values: Floats) -> Floats:
    """The last of each row's values (n, m) that is a number."""
    known = ~np.isnan(values)
    last = values.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    return np.asarray(values[np.arange(len(values)), last])


def _told_first(values: Floats, late_s: Floats) -> tuple[Floats, Floats]:
    """The first of each row's values (n, m, k) that is told, and how long before the block's end that was, s (n,)."""
    rows, first = np.arange(len(values)), np.argmax(~np.isnan(late_s), axis=1)
    return values[rows, first], late_s[rows, first] + (BLOCK - 1 - first) * CELL_S


def _through(tip: Tip, told: _Slice, kinds: Kinds, cell: int, unit: Unit, settings: DeadReckoning) -> Tip:
    """One block further."""
    before = tip.state.motion.velocity_mps[:, 0]
    rate, noise = _rates(told, settings)
    more = noise[:, None], UNSEEN_SHARE * told.unseen[:, None, :3]
    state = dr.carried_through(tip.state, rate[:, None], told.force[:, None], CELL_S, unit, more)
    accelerated = (state.motion.velocity_mps[:, 0] - before) / (BLOCK * CELL_S)
    end = cell + BLOCK
    state = _tied(state, told, kinds, end, settings)
    tip = replace(tip, state=state, cell=tip.cell + BLOCK, accelerated_mps2=accelerated)
    tip = _with_altitude(tip, told, end, settings)
    has_place = np.flatnonzero(~np.isnan(told.place[:, 0]))
    if len(has_place):
        some = judged(tip.taken(has_place), told.place[has_place], told.place_late[has_place], settings)
        tip = tip.put(has_place, some)
    is_pictured = np.flatnonzero(~np.isnan(told.pictured[:, 0]))
    if len(is_pictured):
        tip = tip.put(is_pictured, _with_picture(tip.taken(is_pictured), told, is_pictured))
    if end % SEEDED_EVERY == 0:
        which = 1 + end // SEEDED_EVERY % (HYPOTHESES - 1)
        seeded = tip.seeded.copy()
        seeded[:, which] = end
        tip = replace(tip, state=with_hypothesis(tip.state, which, hypothesis(tip.state, 0)), seeded=seeded)
    return tip


def _rates(told: _Slice, settings: DeadReckoning) -> tuple[Floats, Floats]:
    """The rates that vehicles turned by (n, m, 3), and their noise in a root Hz (n, 3): their gyros', or their autopilots' if
    these have seen more of them than has been told.
    """
    unseen = UNSEEN_SHARE * told.unseen[:, 3:]
    is_told = ~np.isnan(told.turned).any(axis=(1, 2))
    better = is_told & (np.sqrt(np.mean(unseen**2, axis=1)) > settings.attitude_wanders)
    rate = np.where(better[:, None, None], told.turned, told.rate)
    return rate, np.where(better[:, None], settings.attitude_wanders, unseen)


def _tied(state: Reckoning, told: _Slice, kinds: Kinds, cell: int, settings: DeadReckoning) -> Reckoning:
    """With what a vehicle's kind and the autopilot's attitude tell, of those of which they tell something."""
    if cell % ATTITUDE_EVERY == 0:
        rows = np.flatnonzero(~np.isnan(told.attitude[:, 0]))
        # an error that lasts for so many samples tells as much as one sample of it in that time
        lasting = math.sqrt(2.0 * LASTS_S / (ATTITUDE_EVERY * CELL_S))
        sigma = settings.attitude_sigma_rad * np.array([1.0, 1.0, 2.0]) * lasting
        state = _of_some(state, rows, lambda some: dr.with_attitude(some, told.attitude[rows][:, None], sigma)[0])
    rows = np.flatnonzero(kinds.wheels)
    slip = settings.slip_mps
    state = _of_some(state, rows, lambda some: dr.with_wheels(some, np.array([slip, slip]))[0])
    rows = np.flatnonzero(kinds.hull)
    state = _of_some(state, rows, lambda some: dr.with_wheels(some, np.array([5.0 * slip, 5.0 * slip]))[0])
    rows = np.flatnonzero(kinds.wings & (told.airspeed > SLOWEST_AIR_MPS))
    if len(rows):
        height = state.motion.height_m[rows]
        fast = true_airspeed_mps(told.airspeed[rows][:, None], height)
        sigma_mps = settings.airspeed_sigma_mps * math.sqrt(2.0 * 2.0 / (BLOCK * CELL_S))
        state = _of_some(
            state, rows, lambda some: dr.with_airspeed(some, fast, sigma_mps, settings.sideslip_sigma_mps)[0]
        )
    return state


def _of_some(state: Reckoning, rows: Ints, tie: Callable[[Reckoning], Reckoning]) -> Reckoning:
    """States of which some are tied to something."""
    if not len(rows):
        return state
    if len(rows) == len(state.covariance):
        return tie(state)
    return with_each(_put_rows(rows), state, tie(with_each(lambda one: one[rows], state)))


def _put_rows(rows: Ints) -> Callable[..., NDArray[Any]]:
    def changed(whole: NDArray[Any], part: NDArray[Any]) -> NDArray[Any]:
        whole = whole.copy()
        whole[rows] = part
        return whole

    return changed


def _with_altitude(tip: Tip, told: _Slice, cell: int, settings: DeadReckoning) -> Tip:
    """With an altitude that is told beside positions, which while these come shows by how much it is another."""
    rows = np.flatnonzero(~np.isnan(told.altitude))
    if not len(rows):
        return tip
    known, altitude = tip.above_m[rows], told.altitude[rows]
    off = tip.state.motion.height_m[rows, 0] - altitude
    learns = (cell - tip.heard[rows] <= 2 * SECOND_CELLS) & (tip.denied[rows] == NOTHING)
    share = BLOCK * CELL_S / LASTS_S
    above = tip.above_m.copy()
    above[rows] = np.where(np.isnan(known), np.where(learns, off, np.nan), known + learns * share * (off - known))
    tip = replace(tip, above_m=above)
    ties = np.flatnonzero(~np.isnan(known) & ~learns)
    if not len(ties):
        return tip
    mine = rows[ties]
    sigma = settings.altitude_sigma_m * math.sqrt(2.0 * LASTS_S / (BLOCK * CELL_S))
    height = (altitude + above[rows])[ties][:, None]

    def tie(state: Reckoning) -> Reckoning:
        motion = state.motion
        return dr.with_place(state, motion.latitude_rad, motion.longitude_rad, height, (_LOOSE_M, _LOOSE_M, sigma))[0]

    return replace(tip, state=_of_some(tip.state, mine, tie))


def _with_picture(tip: Tip, told: _Slice, rows: Ints) -> Tip:
    """With where radars have the vehicles: of all hypotheses, unless it is far from where they are."""
    place, late = told.pictured[rows], told.pictured_late[rows][:, None]
    motion = tip.state.motion
    there = (place[:, None, column] for column in range(3))
    latitude, longitude, height = displaced(
        next(there), next(there), next(there), motion.velocity_mps * late[..., None]
    )
    off = between(latitude, longitude, height, motion)[..., :2]
    variance = tip.state.covariance[..., (0, 1), (0, 1)] + place[:, None, 6:7] ** 2
    near = (np.sum(off**2 / variance, axis=-1) < FAR).all(axis=1)
    chosen = np.flatnonzero(near)
    sigma = np.stack([place[chosen, 6], place[chosen, 6], place[chosen, 7]], axis=-1)[:, None]

    def tie(state: Reckoning) -> Reckoning:
        return dr.with_place(state, latitude[chosen], longitude[chosen], height[chosen], sigma)[0]

    return replace(tip, state=_of_some(tip.state, chosen, tie))
