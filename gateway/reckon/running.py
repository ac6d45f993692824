"""Dead reckoning of many vehicles side by side, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import dead_reckoning as dr
from gateway.estimators.dead_reckoning import Reckoning, Unit
from gateway.estimators.inertial import Motion, displaced, from_angles, heading_rad
from gateway.estimators.medium import dragged, turned_through
from gateway.geodesy import wrap_rad
from gateway.reckon.cells import BLOCK, CELL_NS, CELL_S, SECOND_CELLS, Block, Cells
from gateway.reckon.judging import judged
from gateway.reckon.kinds import HELD, By, Kinds
from gateway.reckon.standing import with_standing
from gateway.reckon.ties import LASTS_S, SLOWEST_AIR_MPS, of_some, tied, with_altitude, with_picture
from gateway.reckon.tip import HYPOTHESES, SEEDED_EVERY, Tip, hypothesis, joined, split_anew, spread, with_hypothesis
from gateway.settings import DeadReckoning

Floats = NDArray[np.float64]

UNSEEN_SHARE = 0.6  # of the scatter of samples, that the motion between them may have been another
STARTING_VELOCITY_MPS = 0.5
CURRENT_MPS, CURRENT_WANDERS = 0.5, 0.02  # of water, m/s, before anything is known of it; m/s in a root second
DRAG_PER_S = (0.2, 0.15)  # of what hangs from rotors, and how different it is from one to another
SPEED_SHARE = 0.1  # of its speed, that what tells none changes it by in a root second


def unit_of(settings: DeadReckoning, by: By = By.UNIT) -> Unit:
    """The inertial unit as the settings have it; or what stands for one."""
    unit = Unit(
        settings.gyro_noise,
        settings.accelerometer_noise,
        settings.gyro_bias_radps,
        settings.accelerometer_bias_mps2,
        settings.gyro_bias_wanders,
        settings.accelerometer_bias_wanders,
        settings.wind_mps,
        settings.wind_wanders,
    )
    if by in (By.UNIT, By.AIRSPEED):
        return unit
    unit = replace(unit, rate_noise=0.0, force_noise=0.0, rate_bias_radps=0.0, rate_bias_wanders=0.0)
    if by == By.TILT:
        return unit
    wind, wanders = (CURRENT_MPS, CURRENT_WANDERS) if by == By.KEEL else (0.0, 0.0)
    return replace(unit, force_bias_mps2=0.0, force_bias_wanders=0.0, wind_mps=wind, wind_wanders=wanders)


def begun(at: int, place: Floats, attitude: Floats, settings: DeadReckoning, by: By = By.UNIT) -> Tip:
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
    lean = lean * [0.0, 0.0, 1.0] if by in HELD else lean
    motion = Motion(latitude, longitude, above, velocity, attitude[None])
    drag = DRAG_PER_S if by == By.TILT else None
    state = dr.started(motion, sigma, speed, lean, unit_of(settings, by), drag)
    here, none, unknown, nothing = np.array([cell]), np.zeros(1, np.int64), np.array([math.nan]), np.zeros(1)
    return Tip(
        spread(state),
        cell=here,
        began=here,
        seeded=np.full((1, HYPOTHESES), cell),
        heard=here,
        scatter_m2=np.array([place[6] ** 2]),
        scatter_mps2=np.array([place[8] ** 2]),
        above_m=unknown,
        denied=none,
        agreed=none,
        accelerated_mps2=np.zeros((1, 3)),
        proved=none,
        times=nothing,
        rough=nothing,
        told_from_mps=unknown,
        last=np.full((1, 5), math.nan),
        placed=here,
        walked_m=np.zeros((1, HYPOTHESES, 2)),
        followed=none,
        strays=nothing,
    )


def run(tips: Sequence[Tip], inputs: Sequence[Cells], kinds: Kinds, settings: DeadReckoning) -> list[list[Tip]]:
    """Vehicles through their cells; of each the tips at whole seconds on the way, and at the end. Those of one do not
    touch those of another: any batching gives the same bits.
    """
    left: list[list[Tip]] = [[] for _ in tips]
    filters = [By.UNIT if by == By.AIRSPEED else By(by) for by in kinds.by.tolist()]
    for by in sorted(set(filters)):
        rows = [row for row, one in enumerate(filters) if one == by]
        some = [tips[row] for row in rows], [inputs[row] for row in rows], kinds.taken(np.array(rows))
        for row, passed in zip(rows, _run_alike(*some, by, settings), strict=True):
            left[row] = passed
    return left


def _run_alike(
    tips: Sequence[Tip], inputs: Sequence[Cells], kinds: Kinds, by: By, settings: DeadReckoning
) -> list[list[Tip]]:
    """Those that are carried on by the same, whose filters have the same states."""
    left: list[list[Tip]] = [[] for _ in tips]
    whole, unit = joined(tips), unit_of(settings, by)
    ends = [one.end for one in inputs]
    for cell in range(int(whole.cell.min()), max(ends), BLOCK):
        rows = np.flatnonzero([one.first <= cell < one.end for one in inputs])
        if not len(rows):  # some end before others begin
            continue
        all_of_them = len(rows) == len(tips)
        some = whole if all_of_them else whole.taken(rows)
        mine = kinds if all_of_them else kinds.taken(rows)
        after = _through(some, Block.of([inputs[int(row)] for row in rows], cell), mine, by, cell, unit, settings)
        whole = after if all_of_them else whole.put(rows, after)
        for place, row in enumerate(rows):
            if (cell + BLOCK) % SECOND_CELLS == 0 or cell + BLOCK == ends[row]:
                left[row].append(after.taken(np.array([place])))
    return left


def _through(tip: Tip, told: Block, kinds: Kinds, by: By, cell: int, unit: Unit, settings: DeadReckoning) -> Tip:
    """One block further."""
    before = tip.state.motion.velocity_mps[:, 0]
    rate, noise, gyro = _rates(told, settings)
    shaken = UNSEEN_SHARE * told.unseen[:, None, :3]
    if by in HELD:
        speed = np.linalg.norm(tip.state.motion.velocity_mps[..., :2], axis=-1)
        shaken = np.maximum(shaken, SPEED_SHARE * speed[..., None] * [1.0, 0.0, 0.0])
    more = noise[:, None], shaken
    state = dr.carried_through(tip.state, rate[:, None], told.force[:, None], CELL_S, unit, more, gyro[:, None])
    state = _through_medium(tip.state, state, by)
    accelerated = (state.motion.velocity_mps[:, 0] - before) / (BLOCK * CELL_S)
    end = cell + BLOCK
    state = _with_bias(state, told, kinds, settings)
    state = tied(state, told, kinds, end, settings)
    tip = replace(tip, state=state, cell=tip.cell + BLOCK, accelerated_mps2=accelerated)
    tip = with_altitude(tip, told, end, settings)
    tip = with_standing(tip, told, kinds, end)
    has_place = np.flatnonzero(~np.isnan(told.place[:, 0]))
    if len(has_place):
        some = judged(
            tip.taken(has_place),
            told.place[has_place],
            told.place_late[has_place],
            (kinds.unit & (kinds.wings | kinds.wheels))[has_place],
            told.unseen[has_place, :3],
            settings,
        )
        tip = tip.put(has_place, some)
    is_pictured = np.flatnonzero(~np.isnan(told.pictured[:, 0]))
    if len(is_pictured):
        tip = tip.put(is_pictured, with_picture(tip.taken(is_pictured), told, is_pictured))
    stands = np.flatnonzero(kinds.wings & (told.airspeed <= SLOWEST_AIR_MPS))
    if len(stands):  # wheels and ground do what wings do not: what went on without GPS knows nothing of that
        tip = tip.put(stands, split_anew(tip.taken(stands), end))
    unseen = stands[~kinds.unit[stands]]
    if len(unseen):  # no unit tells how it takes off, or is thrown: it denies nothing until it has flown for a while
        tip = tip.put(unseen, replace(some := tip.taken(unseen), began=some.cell))
    if not by.denies:
        tip = replace(tip, began=tip.cell)
    if end % SEEDED_EVERY == 0:
        which = 1 + end // SEEDED_EVERY % (HYPOTHESES - 1)
        seeded, walked = tip.seeded.copy(), tip.walked_m.copy()
        seeded[:, which], walked[:, which] = end, walked[:, 0]
        state = with_hypothesis(tip.state, which, hypothesis(tip.state, 0))
        tip = replace(tip, state=state, seeded=seeded, walked_m=walked)
    return tip


def _through_medium(before: Reckoning, state: Reckoning, by: By) -> Reckoning:
    """A block further: what tells no speed keeps its way through the water, or loses that through the air."""
    if by == By.TILT:
        return dragged(state, BLOCK * CELL_S)
    if by in HELD:
        heading = heading_rad(state.motion.attitude)
        turned = wrap_rad(heading - heading_rad(before.motion.attitude))
        level = replace(state.motion, attitude=from_angles(0.0, 0.0, heading))  # the earth turns, and no gyro told
        return turned_through(replace(state, motion=level), turned, BLOCK * CELL_S)
    return state


def _rates(told: Block, settings: DeadReckoning) -> tuple[Floats, Floats, Floats]:
    """The rates that vehicles turned by (n, m, 3), their noise in a root Hz (n, 3), and whether they are gyros' (n,): or else
    their autopilots', if these have seen more of them than has been told. Autopilots' have no bias left.
    """
    unseen = UNSEEN_SHARE * told.unseen[:, 3:]
    is_told = ~np.isnan(told.turned).any(axis=(1, 2))
    better = is_told & (np.sqrt(np.mean(unseen**2, axis=1)) > settings.attitude_wanders)
    rate = np.where(better[:, None, None], told.turned, told.rate)
    return rate, np.where(better[:, None], settings.attitude_wanders, unseen), 1.0 - better


def _with_bias(state: Reckoning, told: Block, kinds: Kinds, settings: DeadReckoning) -> Reckoning:
    """With what gyros tell beyond what the autopilots' attitudes turned by meanwhile: that is their bias."""
    rows = np.flatnonzero(kinds.unit & ~np.isnan(told.turned).any(axis=(1, 2)))
    if not len(rows):
        return state
    bias = np.mean(told.rate[rows] - told.turned[rows], axis=1)
    power = settings.attitude_wanders**2 + (UNSEEN_SHARE * told.unseen[rows, 3:]) ** 2
    # What autopilots turn wrongly lasts as their attitudes' errors do, and these attitudes tie the filter too: each half.
    sigma = np.sqrt(power / (BLOCK * CELL_S)) * math.sqrt(2.0 * 2.0 * LASTS_S / (BLOCK * CELL_S))
    return of_some(state, rows, lambda some: dr.with_gyro_bias(some, bias[:, None], sigma[:, None])[0])
