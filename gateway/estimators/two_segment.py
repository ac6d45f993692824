"""Two-segment prediction: on in the present turn until the course points at the next point, then straight to it.

Arrays are over n aircraft; a route is p points (n, p, 2), NaN where there is none, and a path is made of legs, each a turn
and a straight. Two rules:

`literal`   as printed: one turn, in the mode that it is in, and one straight, on past the point at the present ground speed
`default`   then on to the route's further points, which are flown by, not over; who does not turn yet begins to, the short
            way; with a wind that is known, ground speed follows the course

Source: 000 2.3, figure 3. Deviation: the print has no formula of P; it is where the circle's tangent goes through the point.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import intent
from gateway.estimators.circling import Circles, entered, go_round
from gateway.estimators.turns_and_straights import OnPath, Path, angle_to_go, or_zero
from gateway.geodesy import wrap_rad

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rule = Literal["literal", "default"]

STRAIGHT_RPS = 1e-9  # slower turns are none
ALIGNED_RAD = math.radians(0.05)  # a turn by less is a straight
ROLL_OUT_RAD = math.radians(45.0)  # who is no more than this beyond its point turns back to it
MOST_LEAD = 2.0  # radii: no turn begins earlier before its point
FASTER = 4.0  # than usual who begins a turn late turns where the corner asks for it
LEAST_SPEED_MPS = 0.1


@dataclass(frozen=True, slots=True)
class Moving:
    """n aircraft as they move now: position (n, 2), velocity (n, 2), turn rate (n,) rad/s, positive to the left."""

    position: Floats
    velocity: Floats
    turn_rate: Floats


@dataclass(frozen=True, slots=True)
class Ahead:
    """Where n aircraft are at h horizons: position (n, h, 2), course (n, h) from x towards y, not wrapped."""

    position: Floats
    course: Floats
    turned: Floats  # (n, h) radians turned by until then, whichever way
    passed: Floats  # (n, h) how many points of the route were passed by then
    over_s: Floats  # (n, h) seconds past the route's last point
    slower_s: Floats  # (n, h) seconds since it was to fly slower
    follows: Bools  # (n,) whether there is a path to the first point at all

    def first(self, count: int) -> Ahead:
        """The same for the first horizons only."""
        one = slice(0, count)
        return Ahead(
            self.position[:, one],
            self.course[:, one],
            self.turned[:, one],
            self.passed[:, one],
            self.over_s[:, one],
            self.slower_s[:, one],
            self.follows,
        )


def ground_speed(course: Floats, air_speed: Floats, wind: Floats) -> Floats:
    """Ground speed (n,) on a course, at a speed through the air (n,), in a wind (n, 2)."""
    along = wind[:, 0] * np.cos(course) + wind[:, 1] * np.sin(course)
    across = wind[:, 1] * np.cos(course) - wind[:, 0] * np.sin(course)
    rest = air_speed * air_speed - across * across
    return np.maximum(along + np.sqrt(np.maximum(rest, 0.0)), LEAST_SPEED_MPS)


def ahead(
    now: Moving,
    route: Floats,
    horizons_s: Floats,
    turning_rps: Floats,
    *,
    rule: Rule = "default",
    wind: Floats | None = None,
    braking: Floats | None = None,
    circles: Circles | None = None,
    air_speed: Floats | None = None,
    slower: Floats | None = None,
    lead_m: Floats | None = None,
    over: Bools | None = None,
    join: Floats | None = None,
) -> Ahead:
    """The paths of n aircraft along their routes (n, p, 2) at horizons (h,) or (n, h); past the last point straight on.

    `turning_rps` (n,) is how fast they turn where they do not turn yet; `wind` (n, 2) where the air moves to, m/s, 0 where it
    is not known, and `air_speed` (n,) the speed through it that is kept; `slower` (n, p) what that is multiplied by on the way
    from one point to the next. `lead_m` (n,) is how near to a point the turn to the next begins, if it need not begin earlier;
    None = it begins where the usual turn needs, and `over` (n, p) who turns only at the point. `join` (n, 2) is a place on the
    way to the first point, NaN = none. `braking` (n,) m/s2 of who comes to rest beyond the last point, 0 of others; `circles`
    which points are flown round. Who cannot come to point at the route is carried on in its present turn, and does not follow.
    """
    n = len(now.position)
    if rule == "literal":
        route, wind = route[:, :1], None
    calm, following = np.zeros((n, 2)) if wind is None else wind, _following(route)
    course, speed, air = _as_now(now, calm, air_speed)
    path = Path.at_start(now.position, course, np.broadcast_to(horizons_s, (n, np.shape(horizons_s)[-1])))
    target, arrived = entered(path, following[:, 0], circles, 0, speed / turning_rps)
    arrived = arrived | _passed(now, course, following, lead_m)
    via = target if join is None else np.where(np.isnan(join), target, join)
    turn, rate, follows = _first_turn(now, speed, course, via, following, turning_rps, rule, arrived)
    ground, cornering, slower_from, looked_at_s = speed, turning_rps, np.full(n, math.inf), path.horizons.max(axis=1)

    def speed_on(heading: Floats) -> Floats:
        return ground_speed(heading, air, calm)

    turn, rate = (turn, rate) if join is None else _by_way_of(path, join, target, turn, rate, turning_rps, speed_on)
    for leg in range(route.shape[1]):
        if leg:
            if (path.time_s > looked_at_s).all():  # what comes after the last horizon is nothing to anybody
                break
            if slower is not None:
                slower_from = np.where(slower[:, leg] < 1.0, np.minimum(slower_from, path.time_s), slower_from)
                air = air * slower[:, leg]
            target, arrived = entered(path, following[:, leg], circles, leg, ground / turning_rps)
            turn, rate = _next_turn(path, target, ground, cornering)
            turn = np.where(arrived | (following[:, leg] == following[:, leg - 1]).all(axis=1), 0.0, turn)
        path.extend(ground, rate, turn / np.maximum(np.abs(rate), STRAIGHT_RPS), leg)
        ground = speed_on(path.course)
        straight_m, cornering = _straight(path, target, following, leg, ground, turning_rps, lead_m, over)
        path.straight(ground, np.where(arrived, 0.0, straight_m) / ground, leg)
        if circles is not None:
            go_round(path, circles, leg, following, arrived, turning_rps, speed_on)
            ground = speed_on(path.course)
    path.stop(ground, np.zeros(n) if braking is None else braking, route.shape[1])
    return _either(path, _carried_on(now, course, speed, path.horizons, follows), slower_from, follows)


def _as_now(now: Moving, wind: Floats, air_speed: Floats | None) -> tuple[Floats, Floats, Floats]:
    """Courses, ground speeds and speeds through the air (n,); where that is told, the ground speed is what it makes."""
    course = np.arctan2(now.velocity[:, 1], now.velocity[:, 0])
    if air_speed is not None:
        return course, ground_speed(course, air_speed, wind), air_speed
    speed = np.sqrt(now.velocity[:, 0] * now.velocity[:, 0] + now.velocity[:, 1] * now.velocity[:, 1])
    return course, speed, np.sqrt(((now.velocity - wind) ** 2).sum(axis=1))


def _carried_on(now: Moving, course: Floats, speed: Floats, horizons_s: Floats, follows: Bools) -> OnPath:
    """The paths of n aircraft on in their present turns; of those that follow none is looked at."""
    if follows.all():
        return OnPath.nowhere(horizons_s)
    on = Path.at_start(now.position, course, horizons_s)
    on.extend(speed, now.turn_rate, np.zeros(len(speed)), 0)
    return on.at_horizons()


def _either(path: Path, on: OnPath, slower_from: Floats, follows: Bools) -> Ahead:
    """Along the route of who follows it, on in the present turn of others."""
    chosen, there = follows[:, None], path.at_horizons()
    return Ahead(
        np.stack([np.where(chosen, there.east, on.east), np.where(chosen, there.north, on.north)], axis=-1),
        np.where(chosen, there.course, on.course),
        np.where(chosen, there.turned, on.turned),
        np.where(chosen, there.passed, 0.0),
        np.where(chosen, np.maximum(path.horizons - path.time_s[:, None], 0.0), 0.0),
        np.where(chosen, np.maximum(path.horizons - slower_from[:, None], 0.0), 0.0),
        follows,
    )


def _following(route: Floats) -> Floats:
    """The route with its last point once more at its end: (n, p + 1, 2); NaN beyond a route's own end becomes its last point."""
    points = [route[:, 0]]
    for leg in range(1, route.shape[1]):
        points.append(np.where(np.isnan(route[:, leg]), points[-1], route[:, leg]))
    return np.stack([*points, points[-1]], axis=1)


def _passed(now: Moving, course: Floats, following: Floats, lead_m: Floats | None) -> Bools:
    """Who (n,) has just flown by the first point, and has another one to go to: nobody has said yet that it goes there."""
    if lead_m is None:
        return np.zeros(len(course), dtype=np.bool_)
    way = following[:, 0] - now.position
    behind = way[:, 0] * np.cos(course) + way[:, 1] * np.sin(course) <= 0.0
    near = (way * way).sum(axis=1) <= lead_m * lead_m
    return np.asarray(behind & near & (following[:, 0] != following[:, -1]).any(axis=1))


def _first_turn(
    now: Moving,
    speed: Floats,
    course: Floats,
    target: Floats,
    following: Floats,
    turning_rps: Floats,
    rule: Rule,
    arrived: Bools,
) -> tuple[Floats, Floats, Bools]:
    """The angle and rate of the turn that leads to the first point, and whether there is one; who has `arrived` needs none."""
    turns = np.abs(now.turn_rate) > STRAIGHT_RPS
    known = ~np.isnan(following[:, 0, 0])
    off = or_zero(_off(now.position, course, target))
    short = np.where(off < 0.0, -1.0, 1.0)
    goes_on = turns
    if rule == "default":  # who has turned a little too far rolls out, and does not go round once more
        beyond = np.sign(now.turn_rate) * off
        goes_on = turns & ~((beyond < 0.0) & (beyond > -ROLL_OUT_RAD))
    rate = np.where(goes_on, now.turn_rate, short * turning_rps)
    go = angle_to_go(now.position, course, speed / np.abs(rate), np.sign(rate), target)
    turn = np.where(~turns & (np.abs(off) <= ALIGNED_RAD), 0.0, or_zero(go))
    if rule == "literal":
        leads = np.where(turns, ~np.isnan(go), np.abs(off) <= intent.ALIGNED_RAD)
    else:
        there_is_more = (following[:, 0] != following[:, -1]).any(axis=1)  # inside the circle: it is all but there
        leads = ~np.isnan(go) | there_is_more | (turn == 0.0) & (np.abs(off) <= ALIGNED_RAD)
    return np.where(arrived, 0.0, turn), rate, known & leads | arrived


def _by_way_of(
    path: Path,
    join: Floats,
    target: Floats,
    turn: Floats,
    rate: Floats,
    turning_rps: Floats,
    speed_on: Callable[[Floats], Floats],
) -> tuple[Floats, Floats]:
    """Who flies by a place (n, 2) first does so, from a first turn on; then the turn to the target (n, 2), and its rate."""
    there = ~np.isnan(join[:, 0])
    off = or_zero(_off(path.position, path.course, join))
    direct = there & (turn == 0.0)  # inside the turn's circle
    turn = np.where(direct, np.abs(off), turn)
    rate = np.where(direct, np.where(off < 0.0, -turning_rps, turning_rps), rate)
    path.extend(speed_on(path.course), rate, np.where(there, turn / np.maximum(np.abs(rate), STRAIGHT_RPS), 0.0), 0)
    ground = speed_on(path.course)
    way, line = join - path.position, target - join
    distance = or_zero(way[:, 0] * np.cos(path.course) + way[:, 1] * np.sin(path.course))
    bend = np.abs(or_zero(wrap_rad(np.arctan2(line[:, 1], line[:, 0]) - path.course)))
    straight_m = np.maximum(distance - ground / turning_rps * np.tan(0.5 * np.minimum(bend, 0.5 * math.pi)), 0.0)
    path.straight(ground, np.where(there, straight_m / ground, 0.0), 0)
    onto, rate_onto = _next_turn(path, target, ground, turning_rps)
    return np.where(there, onto, turn), np.where(there, rate_onto, rate)


def _next_turn(path: Path, point: Floats, ground: Floats, turning_rps: Floats) -> tuple[Floats, Floats]:
    """The angle and rate of the turn from a path's end to a next point, the short way."""
    off = or_zero(_off(path.position, path.course, point))
    side = np.where(off < 0.0, -1.0, 1.0)
    go = angle_to_go(path.position, path.course, ground / turning_rps, side, point)
    small = np.abs(off) <= ALIGNED_RAD
    return np.where(small, 0.0, np.where(np.isnan(go), np.abs(off), go)), side * turning_rps


def _straight(
    path: Path,
    target: Floats,
    following: Floats,
    leg: int,
    ground: Floats,
    turning_rps: Floats,
    lead_m: Floats | None,
    over: Bools | None,
) -> tuple[Floats, Floats]:
    """How far (n,) it is straight on to a leg's target (n, 2), less what the turn to the point after it needs; its rate.

    Who begins to turn late for the corner turns faster; who is to fly `over` (n, p) it begins no earlier than there.
    """
    way = target - path.position
    distance = or_zero(way[:, 0] * np.cos(path.course) + way[:, 1] * np.sin(path.course))
    point = following[:, leg]
    further = following[:, leg + 1] - point
    turn = wrap_rad(np.arctan2(further[:, 1], further[:, 0]) - path.course)
    entering = (target != point).any(axis=1)  # a circle: it is not cut short
    turn = np.where((further == 0.0).all(axis=1) | np.isnan(turn) | entering, 0.0, np.abs(turn))
    radius, bend = ground / turning_rps, np.tan(0.5 * np.minimum(turn, 0.75 * math.pi))
    if lead_m is None:
        return np.maximum(distance - radius * np.minimum(bend, MOST_LEAD), 0.0), turning_rps
    faster = np.clip(radius * bend / lead_m, 1.0, FASTER)
    straight_m = np.maximum(distance - np.minimum(radius * bend / faster, lead_m), 0.0)
    return straight_m if over is None else straight_m + np.where(over[:, leg], lead_m, 0.0), turning_rps * faster


def _off(position: Floats, course: Floats, point: Floats) -> Floats:
    """How far to the left (n,) of a course a point lies, in [-pi, pi)."""
    way = point - position
    return wrap_rad(np.arctan2(way[:, 1], way[:, 0]) - course)
