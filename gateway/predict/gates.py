"""Gates of a stabilised approach: who is too high, too low, off the centreline or too fast on final, and for how long.

`excess` and `alerts` are over arrays of any approach, live or archived; `Gates` is what is remembered of live ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.predict.approach import Deviations, deviations
from gateway.settings import Runway, Stabilised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

KINDS = ("too high", "too low", "off centreline", "too fast")
UPPER_M, LOWER_M = 304.8, 152.4  # 1000 and 500 ft, the most that the gates are by default
UPPER_S, LOWER_S = 83.0, 41.5  # and how long an airliner has from there to the runway
BEGINS_AFTER, ENDS_AFTER = 2, 3  # seconds in a row
ENDS_BELOW = 0.8  # of what is allowed
ON_FINAL_RAD = math.radians(10.0)  # seen from the aiming point, within this of the centreline
TOWARDS = math.cos(math.radians(30.0))  # of the course against the landing direction
CLIMBS_MPS = 1.5  # who climbs faster goes around
ANEW_AFTER = 30 * SECOND  # without being on final: the next one is another


@dataclass(frozen=True, slots=True)
class Excess:
    """How far off (n, 4) approaches are, by kind: m, and m/s of the speed; and that over what is allowed: above 1 is too much.

    NaN where nothing is judged: above the upper gate, or not on the approach.
    """

    off: Floats
    ratio: Floats


def gate_heights(limits: Stabilised, runway: Runway, approach_mps: ArrayLike) -> tuple[Floats, Floats]:
    """The upper and the lower gate (n,), m above the runway, of who approaches at speeds (n,)."""
    sinks = np.asarray(approach_mps, dtype=np.float64) * math.tan(runway.glide_path_rad)
    given = ((UPPER_S, UPPER_M, limits.upper_gate_m), (LOWER_S, LOWER_M, limits.lower_gate_m))
    upper, lower = (
        np.minimum(time_s * sinks, most_m) if gate_m is None else np.full_like(sinks, gate_m)
        for time_s, most_m, gate_m in given
    )
    return upper, lower


def excess(
    limits: Stabilised,
    runway: Runway,
    distance_m: ArrayLike,
    above_m: ArrayLike,
    left_m: ArrayLike,
    speed_mps: ArrayLike,
    approach_mps: ArrayLike,
) -> Excess:
    """How far off each of n instants of approaches is: at `distance_m` (n,) from the threshold, above the glide path, left of the
    centreline, at ground speeds, and at the speed that it should approach at. NaN in = not known, NaN out.
    """
    distance, above, left, speed, wanted = (
        np.asarray(one, dtype=np.float64) for one in (distance_m, above_m, left_m, speed_mps, approach_mps)
    )
    before_aim = np.maximum(distance + runway.aiming_point_x_m - runway.threshold_x_m, 0.0)
    high = np.maximum(before_aim * math.tan(limits.glide_path_rad), limits.least_vertical_m)
    wide = np.maximum(before_aim * math.tan(limits.centreline_rad), limits.least_lateral_m)
    fast = np.maximum(limits.speed_share * wanted, limits.least_fast_mps)
    off = np.stack([above, -above, np.abs(left), speed - wanted], axis=-1)
    ratio = off / np.stack([high, high, wide, np.maximum(fast, 0.1)], axis=-1)
    height = before_aim * math.tan(runway.glide_path_rad) + above
    judged = height <= gate_heights(limits, runway, wanted)[0]
    return Excess(np.where(judged[..., None], off, math.nan), np.where(judged[..., None], ratio, math.nan))


def on_final(off: Deviations, velocity_mps: Floats) -> Bools:
    """Who (n,) is on final, of deviations (n,) and velocities (n, 3) in the runway frame: near the centreline, flying at the
    runway, and not going around.
    """
    along, left, up = np.moveaxis(velocity_mps, -1, 0)
    towards = along > TOWARDS * np.sqrt(along * along + left * left)
    return np.asarray((np.abs(off.lateral_rad) < ON_FINAL_RAD) & towards & (up < CLIMBS_MPS))


@dataclass(frozen=True, slots=True)
class Held:
    """An alert with hysteresis: seconds in a row beyond what is allowed, and within again; and whether it stands."""

    beyond: int = 0
    within: int = 0
    stands: bool = False

    def after(self, ratio: float) -> Held:
        """After one second more."""
        if not self.stands:
            beyond = self.beyond + 1 if ratio > 1.0 else 0
            return Held(beyond, 0, beyond >= BEGINS_AFTER)
        within = 0 if ratio >= ENDS_BELOW else self.within + 1  # NaN, nothing to judge, is within
        return Held(0, within, within < ENDS_AFTER)


@dataclass(frozen=True, slots=True)
class Alert:
    """A time in which an approach was not stabilised: from an index to the one at which it ended, and the worst of it."""

    kind: str
    begins: int
    ends: int
    worst: float  # m, or m/s


def alerts(found: Excess) -> list[Alert]:
    """The alerts of one approach, whose instants (n,) are a second apart."""
    told = []
    for place, kind in enumerate(KINDS):
        held, began = Held(), 0
        for row, ratio in enumerate(found.ratio[:, place].tolist()):
            now = held.after(ratio)
            if now.stands and not held.stands:
                began = row - BEGINS_AFTER + 1
            if held.stands and not now.stands:
                told.append(Alert(kind, began, row, float(np.nanmax(found.off[began : row + 1, place]))))
            held = now
        if held.stands:
            told.append(Alert(kind, began, len(found.ratio), float(np.nanmax(found.off[began:, place]))))
    return sorted(told, key=lambda one: one.begins)


@dataclass(frozen=True, slots=True)
class Final:
    """What is remembered of one track's final."""

    at: int  # when it was last on it
    least_mps: float
    height_m: float
    held: tuple[Held, ...] = (Held(),) * len(KINDS)


@dataclass(frozen=True, slots=True)
class GateAlerts:
    """Alerts as they stood at some instants, n rows, and where the aircraft was then (n, 3) in the runway frame."""

    time: Ints
    track: Ints
    kind: tuple[str, ...]
    off: Floats
    places_m: Floats
    rounds: tuple[tuple[int, tuple[int, ...]], ...] = ()  # instants, and the tracks that were judged then or had been


@dataclass(frozen=True, slots=True)
class Judged:
    """One instant's judgement: the alerts that stand, and what is said."""

    at: int
    tracks: tuple[int, ...]  # of the round
    standing: tuple[tuple[int, str, float, tuple[float, float, float]], ...] = ()  # track, kind, off, place
    said: tuple[tuple[str, str], ...] = ()  # level, text


@dataclass(frozen=True, slots=True)
class Gates:
    """What is remembered of all finals, by track."""

    finals: Mapping[int, Final] = field(default_factory=dict)

    def judged(
        self,
        at: int,
        tracks: Sequence[int],
        numbers: Sequence[int],
        aircraft: Sequence[str | None],
        place_enu: Floats,
        velocity: Floats,
        has_height: Bools,
        limits: Stabilised,
        frame: RunwayFrame,
    ) -> tuple[Gates, Judged | None]:
        """One instant of tracks at (n, 3) with (n, 3) m/s; None where nobody is or was on final.

        `numbers` are those that people know the tracks by, `aircraft` who they are.
        """
        place, flies = frame.relative(at, place_enu, velocity)
        off = deviations(frame.runway, place, flies[:, 0])
        speed = np.sqrt(velocity[:, 0] ** 2 + velocity[:, 1] ** 2)
        on = on_final(off, flies) & has_height
        rows = [row for row, track in enumerate(tracks) if on[row] or track in self.finals]
        if not rows:
            return self, None
        finals, standing, said = dict(self.finals), [], []
        for row in rows:
            track, known = tracks[row], self.finals.get(tracks[row])
            if not on[row]:
                if known is not None and at - known.at > ANEW_AFTER:
                    del finals[track]
                elif known is not None:
                    finals[track] = replace(known, held=(Held(),) * len(KINDS))
                continue
            one = (float(off.distance_m[row]), float(off.vertical_m[row]), float(off.lateral_m[row]))
            finals[track], seen = _judged(known, at, one, float(speed[row]), float(place[row, 2]), limits, frame.runway)
            name = f"track {numbers[row]}" + (f" ({aircraft[row]})" if aircraft[row] else "")
            said += _said(known, finals[track], seen, name, one, limits, frame.runway)
            standing += [
                (
                    numbers[row],
                    kind,
                    float(seen.off[number]),
                    (float(place[row, 0]), float(place[row, 1]), float(place[row, 2])),
                )
                for number, kind in enumerate(KINDS)
                if finals[track].held[number].stands
            ]
        return Gates(finals), Judged(at, tuple(numbers[row] for row in rows), tuple(standing), tuple(said))

    def without(self, alive: Mapping[int, object]) -> Gates:
        """The same without tracks that are not alive."""
        kept = {track: one for track, one in self.finals.items() if track in alive}
        return self if len(kept) == len(self.finals) else Gates(kept)


def _judged(
    known: Final | None,
    at: int,
    off: tuple[float, float, float],
    speed: float,
    height_m: float,
    limits: Stabilised,
    runway: Runway,
) -> tuple[Final, Excess]:
    least = speed if known is None else min(speed, known.least_mps)
    wanted = least if limits.approach_speed_mps is None else limits.approach_speed_mps
    seen = excess(limits, runway, *off, speed, wanted)
    held = (Held(),) * len(KINDS) if known is None else known.held
    after = tuple(one.after(ratio) for one, ratio in zip(held, seen.ratio.tolist(), strict=True))
    return Final(at, least, height_m, after), seen


def _said(
    known: Final | None,
    now: Final,
    seen: Excess,
    name: str,
    off: tuple[float, float, float],
    limits: Stabilised,
    runway: Runway,
) -> list[tuple[str, str]]:
    """What began, what is over, and how a gate was passed."""
    said = []
    before = (Held(),) * len(KINDS) if known is None else known.held
    for kind, was, held, value in zip(KINDS, before, now.held, seen.off.tolist(), strict=True):
        if held.stands and not was.stands:
            said.append(("warning", f"{name} is {kind} on final: {_by(kind, value)}, {off[0] / 1000.0:.1f} km to go"))
        elif was.stands and not held.stands:
            said.append(("info", f"{name} is no longer {kind}"))
    if known is not None:
        wanted = now.least_mps if limits.approach_speed_mps is None else limits.approach_speed_mps
        for gate in gate_heights(limits, runway, wanted):
            if known.height_m > float(gate) >= now.height_m:
                wrong = [
                    _by(kind, value)
                    for kind, value, held in zip(KINDS, seen.off.tolist(), now.held, strict=True)
                    if held.stands
                ]
                how = f"not stabilised: {', '.join(wrong)}" if wrong else "stabilised"
                said.append(("warning" if wrong else "info", f"{name} passes the gate at {float(gate):.0f} m {how}"))
    return said


def _by(kind: str, value: float) -> str:
    return {
        "too high": f"{value:.0f} m above the glide path",
        "too low": f"{value:.0f} m below the glide path",
        "off centreline": f"{value:.0f} m off the centreline",
        "too fast": f"{value:.0f} m/s too fast",
    }[kind]


def table(rounds: Sequence[Judged]) -> GateAlerts:
    """Judgements as columns."""
    rows = [(one.at, *row) for one in rounds for row in one.standing]
    return GateAlerts(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.int64),
        tuple(row[2] for row in rows),
        np.array([row[3] for row in rows], dtype=np.float64),
        np.array([row[4] for row in rows], dtype=np.float64).reshape(-1, 3),
        tuple((one.at, one.tracks) for one in rounds),
    )


NONE_JUDGED = table(())
"""Where nobody was on final."""
