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

from gateway.estimators.intent import wrapped

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rule = Literal["literal", "default"]

FULL_TURN = 2.0 * math.pi
STRAIGHT_RPS = 1e-9  # slower turns are none
ALIGNED_RAD = math.radians(0.5)  # a turn by less is a straight
LITERAL_ALIGNED_RAD = math.radians(7.5)  # `literal` turns to a point this close to its course, and knows no other way
ROLL_OUT_RAD = math.radians(45.0)  # who is no more than this beyond its point turns back to it
ON_CIRCLE = 1.3  # radii: who is this near to a circle's middle is on it
FOR_GOOD_RAD = 1000.0
QUARTERS, QUARTER_RAD = 8, 0.5 * math.pi  # of a circle: two turns, and all that is left at once
MOST_LEAD = 2.0  # radii: no turn begins earlier before its point
LEAST_SPEED_MPS = 0.1


@dataclass(frozen=True, slots=True)
class Moving:
    """n aircraft as they move now: position (n, 2), velocity (n, 2), turn rate (n,) rad/s, positive to the left."""

    position: Floats
    velocity: Floats
    turn_rate: Floats


@dataclass(frozen=True, slots=True)
class Circles:
    """Which of n routes' p points are flown round: radius (n, p), positive to the left, NaN = it is flown by; how far (n, p).

    `least` is the angle after which it is left, as soon as the course points at the next point; infinite = never.
    """

    radius: Floats
    least: Floats


@dataclass(frozen=True, slots=True)
class Ahead:
    """Where n aircraft are at h horizons: position (n, h, 2), course (n, h) from x towards y, not wrapped."""

    position: Floats
    course: Floats
    turned: Floats  # (n, h) radians turned by until then, whichever way
    passed: Floats  # (n, h) how many points of the route were passed by then
    over_s: Floats  # (n, h) seconds past the route's last point
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
            self.follows,
        )


@dataclass(slots=True)
class _Path:
    """The end of a path so far, (n,) or (n, 2), and what is known of the horizons (n, h)."""

    position: Floats
    course: Floats
    time_s: Floats
    turned: Floats
    horizons: Floats
    east_at: Floats
    north_at: Floats
    course_at: Floats
    turned_at: Floats
    passed_at: Floats

    @classmethod
    def at_start(cls, position: Floats, course: Floats, horizons: Floats) -> _Path:
        """A path of no length."""
        nothing, zero = np.zeros(len(course)), np.zeros(horizons.shape)
        return cls(position, course, nothing, nothing, horizons, zero, zero, zero, zero, zero)

    def extend(self, speed: Floats, rate: Floats, duration_s: Floats, passed: int) -> None:
        """Fly on with these ground speeds and turn rates (n,) for so long (n,); all later horizons are on it so far."""
        since = self.horizons - self.time_s[:, None]
        on = since >= 0.0
        chord, bend = _arc(rate[:, None] * since)
        middle = self.course[:, None] + bend
        length = speed[:, None] * since * chord
        self.east_at = np.where(on, self.position[:, 0, None] + length * np.cos(middle), self.east_at)
        self.north_at = np.where(on, self.position[:, 1, None] + length * np.sin(middle), self.north_at)
        self.course_at = np.where(on, self.course[:, None] + 2.0 * bend, self.course_at)
        self.turned_at = np.where(on, self.turned[:, None] + np.abs(2.0 * bend), self.turned_at)
        self.passed_at = np.where(on, float(passed), self.passed_at)
        chord, bend = _arc(rate * duration_s)
        length = speed * duration_s * chord
        middle = self.course + bend
        self.position = self.position + np.stack([length * np.cos(middle), length * np.sin(middle)], axis=-1)
        self.course = self.course + 2.0 * bend
        self.turned = self.turned + np.abs(2.0 * bend)
        self.time_s = self.time_s + duration_s

    def stop(self, speed: Floats, braking: Floats, passed: int) -> None:
        """Straight on for good, brought to rest where `braking` (n,) m/s2 is not 0."""
        since = np.maximum(self.horizons - self.time_s[:, None], 0.0)
        on = self.horizons >= self.time_s[:, None]
        moving = np.minimum(since, (speed / np.maximum(braking, 1e-9))[:, None])
        length = speed[:, None] * moving - 0.5 * braking[:, None] * moving * moving
        self.east_at = np.where(on, self.position[:, 0, None] + length * np.cos(self.course)[:, None], self.east_at)
        self.north_at = np.where(on, self.position[:, 1, None] + length * np.sin(self.course)[:, None], self.north_at)
        self.course_at = np.where(on, self.course[:, None], self.course_at)
        self.turned_at = np.where(on, self.turned[:, None], self.turned_at)
        self.passed_at = np.where(on, float(passed), self.passed_at)


def _arc(angle: Floats) -> tuple[Floats, Floats]:
    """Chord over arc, and half the angle, of an arc by an angle."""
    return np.sinc(angle / FULL_TURN), 0.5 * angle


def angle_to_go(position: Floats, course: Floats, radius: Floats, side: Floats, point: Floats) -> Floats:
    """By how much (n,) who turns about a radius (n,) to a side (n,), 1 left, -1 right, turns until a point lies ahead.

    In [0, 2 pi); NaN where the point is inside the circle: then it never does.
    """
    centre = position + (side * radius)[:, None] * np.stack([-np.sin(course), np.cos(course)], axis=-1)
    way = point - centre
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    outside = distance > radius
    ratio = np.where(outside, radius / np.where(outside, distance, 1.0), 1.0)
    # the velocity at the tangent point is the way to the point: the direction from the centre, turned by the rest of the angle
    wanted = np.arctan2(way[:, 1], way[:, 0]) + side * np.arcsin(ratio)
    turn = np.remainder(side * (wanted - course), FULL_TURN)
    return np.where(outside, np.where(turn > FULL_TURN - 1e-6, 0.0, turn), math.nan)


def ground_speed(course: Floats, speed: Floats, air_course: Floats, wind: Floats) -> Floats:
    """Ground speed (n,) on a course, of who has ground speed `speed` on course `air_course`, in a wind (n, 2)."""
    air_x = speed * np.cos(air_course) - wind[:, 0]
    air_y = speed * np.sin(air_course) - wind[:, 1]
    along = wind[:, 0] * np.cos(course) + wind[:, 1] * np.sin(course)
    across = wind[:, 1] * np.cos(course) - wind[:, 0] * np.sin(course)
    rest = air_x * air_x + air_y * air_y - across * across
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
) -> Ahead:
    """The paths of n aircraft along their routes (n, p, 2) at horizons (h,) or (n, h); past the last point straight on.

    `turning_rps` (n,) is how fast they turn where they do not turn yet; `wind` (n, 2) where the air moves to, m/s, 0 where it
    is not known; `braking` (n,) m/s2 of who comes to rest beyond the last point, 0 of others; `circles` which points are flown
    round. Who cannot come to point at the route is carried on in its present turn, and does not follow.
    """
    n = len(now.position)
    speed = np.sqrt(now.velocity[:, 0] * now.velocity[:, 0] + now.velocity[:, 1] * now.velocity[:, 1])
    course = np.arctan2(now.velocity[:, 1], now.velocity[:, 0])
    path = _Path.at_start(now.position, course, np.broadcast_to(horizons_s, (n, np.shape(horizons_s)[-1])))
    if rule == "literal":
        route, wind = route[:, :1], None
    following = _following(route)
    target, arrived = _entered(path, following[:, 0], circles, 0)
    turn, rate, follows = _first_turn(now, speed, course, target, following, turning_rps, rule)
    turn, follows = np.where(arrived, 0.0, turn), follows | arrived
    ground = speed

    def speed_on(heading: Floats) -> Floats:
        return speed if wind is None else ground_speed(heading, speed, course, wind)

    for leg in range(route.shape[1]):
        if leg:
            target, arrived = _entered(path, following[:, leg], circles, leg)
            turn, rate = _next_turn(path, target, ground, turning_rps)
            turn = np.where(arrived, 0.0, turn)
        path.extend(ground, rate, turn / np.maximum(np.abs(rate), STRAIGHT_RPS), leg)
        ground = speed_on(path.course)
        straight_m = np.where(arrived, 0.0, _straight(path, target, following[:, leg : leg + 2], ground / turning_rps))
        path.extend(ground, np.zeros(n), straight_m / ground, leg)
        if circles is not None:
            _go_round(path, circles, leg, following, speed_on)
            ground = speed_on(path.course)
    path.stop(ground, np.zeros(n) if braking is None else braking, route.shape[1])
    on = _Path.at_start(now.position, course, path.horizons)
    on.extend(speed, now.turn_rate, np.zeros(n), 0)
    chosen = follows[:, None]
    return Ahead(
        np.stack([np.where(chosen, path.east_at, on.east_at), np.where(chosen, path.north_at, on.north_at)], axis=-1),
        np.where(chosen, path.course_at, on.course_at),
        np.where(chosen, path.turned_at, on.turned_at),
        np.where(chosen, path.passed_at, 0.0),
        np.where(chosen, np.maximum(path.horizons - path.time_s[:, None], 0.0), 0.0),
        follows,
    )


def _following(route: Floats) -> Floats:
    """The route with its last point once more at its end: (n, p + 1, 2); NaN beyond a route's own end becomes its last point."""
    points = [route[:, 0]]
    for leg in range(1, route.shape[1]):
        points.append(np.where(np.isnan(route[:, leg]), points[-1], route[:, leg]))
    return np.stack([*points, points[-1]], axis=1)


def _entered(path: _Path, point: Floats, circles: Circles | None, leg: int) -> tuple[Floats, Bools]:
    """What a leg is flown at (n, 2): its point, or where its circle is entered; and who (n,) is on that circle already."""
    if circles is None:
        return point, np.zeros(len(point), dtype=np.bool_)
    radius = np.abs(circles.radius[:, leg])
    way = point - path.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    round_it = ~np.isnan(radius)
    arrived = round_it & (distance <= ON_CIRCLE * radius)
    sine = np.where(round_it & ~arrived, radius / np.maximum(distance, 1e-9), 0.0)
    towards = np.arctan2(way[:, 1], way[:, 0]) - np.sign(circles.radius[:, leg]) * np.arcsin(np.minimum(sine, 1.0))
    length = distance * np.sqrt(np.maximum(1.0 - sine * sine, 0.0))
    entry = path.position + length[:, None] * np.stack([np.cos(towards), np.sin(towards)], axis=-1)
    return np.where((round_it & ~arrived)[:, None], entry, point), arrived


def _go_round(path: _Path, circles: Circles, leg: int, following: Floats, speed_on: Callable[[Floats], Floats]) -> None:
    """Round a leg's circle, where it has one, until the next point is ahead and the least angle is flown.

    In quarters, each at the ground speed of its middle.
    """
    radius = circles.radius[:, leg]
    round_it = ~np.isnan(radius)
    if not round_it.any():
        return
    way = following[:, leg] - path.position
    distance = np.sqrt(way[:, 0] * way[:, 0] + way[:, 1] * way[:, 1])
    near = (distance > 0.5 * np.abs(radius)) & (distance <= ON_CIRCLE * np.abs(radius))
    size = np.where(near, distance, np.abs(radius))  # who is on it stays at the distance that he has
    size, side = np.where(round_it, size, 1.0), np.sign(np.where(round_it, radius, 1.0))
    go = np.nan_to_num(angle_to_go(path.position, path.course, size, side, following[:, leg + 1]))
    least = np.minimum(np.where(round_it, circles.least[:, leg], 0.0), FOR_GOOD_RAD)
    go = go + FULL_TURN * np.ceil(np.maximum(least - go, 0.0) / FULL_TURN)
    last = (following[:, leg + 1] == following[:, leg]).all(axis=1)
    go = np.where(round_it, np.where(last, FOR_GOOD_RAD, go), 0.0)
    for quarter in range(QUARTERS):
        arc = np.minimum(go, QUARTER_RAD) if quarter + 1 < QUARTERS else go
        ground = speed_on(path.course + 0.5 * side * np.minimum(arc, QUARTER_RAD))
        path.extend(ground, np.where(round_it, side * ground / size, 0.0), arc * size / ground, leg)
        go = go - arc


def _first_turn(
    now: Moving, speed: Floats, course: Floats, target: Floats, following: Floats, turning_rps: Floats, rule: Rule
) -> tuple[Floats, Floats, Bools]:
    """The angle and rate of the turn that leads to the first point, and whether there is one."""
    turns = np.abs(now.turn_rate) > STRAIGHT_RPS
    known = ~np.isnan(following[:, 0, 0])
    off = np.nan_to_num(_off(now.position, course, target))
    short = np.where(off < 0.0, -1.0, 1.0)
    goes_on = turns
    if rule == "default":  # who has turned a little too far rolls out, and does not go round once more
        beyond = np.sign(now.turn_rate) * off
        goes_on = turns & ~((beyond < 0.0) & (beyond > -ROLL_OUT_RAD))
    rate = np.where(goes_on, now.turn_rate, short * turning_rps)
    go = angle_to_go(now.position, course, speed / np.abs(rate), np.sign(rate), target)
    turn = np.where(~turns & (np.abs(off) <= ALIGNED_RAD), 0.0, np.nan_to_num(go))
    if rule == "literal":
        return turn, rate, known & np.where(turns, ~np.isnan(go), np.abs(off) <= LITERAL_ALIGNED_RAD)
    there_is_more = (following[:, 0] != following[:, -1]).any(axis=1)  # inside the circle: it is all but there
    return turn, rate, known & (~np.isnan(go) | there_is_more | (turn == 0.0) & (np.abs(off) <= ALIGNED_RAD))


def _next_turn(path: _Path, point: Floats, ground: Floats, turning_rps: Floats) -> tuple[Floats, Floats]:
    """The angle and rate of the turn from a path's end to a next point, the short way."""
    off = np.nan_to_num(_off(path.position, path.course, point))
    side = np.where(off < 0.0, -1.0, 1.0)
    go = angle_to_go(path.position, path.course, ground / turning_rps, side, point)
    small = np.abs(off) <= ALIGNED_RAD
    return np.where(small, 0.0, np.where(np.isnan(go), np.abs(off), go)), side * turning_rps


def _straight(path: _Path, target: Floats, following: Floats, radius: Floats) -> Floats:
    """How far (n,) it is straight on to a target (n, 2), less what the turn to the point after it, (n, 1, 2), needs."""
    way = target - path.position
    distance = np.nan_to_num(way[:, 0] * np.cos(path.course) + way[:, 1] * np.sin(path.course))
    further = following[:, 1] - following[:, 0]
    turn = wrapped(np.arctan2(further[:, 1], further[:, 0]) - path.course)
    entering = (target != following[:, 0]).any(axis=1)  # a circle: it is not cut short
    turn = np.where((further == 0.0).all(axis=1) | np.isnan(turn) | entering, 0.0, np.abs(turn))
    lead = radius * np.minimum(np.tan(0.5 * np.minimum(turn, 0.75 * math.pi)), MOST_LEAD)
    return np.maximum(distance - lead, 0.0)


def _off(position: Floats, course: Floats, point: Floats) -> Floats:
    """How far to the left (n,) of a course a point lies, in [-pi, pi)."""
    way = point - position
    return wrapped(np.arctan2(way[:, 1], way[:, 0]) - course)
