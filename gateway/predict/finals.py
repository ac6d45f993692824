"""Finals: who is not stabilised on final, as it is told while it happens, and what is remembered for that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.predict.approach import deviations
from gateway.predict.gates import KINDS, Excess, Held, excess, gate_heights, on_final
from gateway.settings import Runway, Stabilised

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ANEW_AFTER = 30 * SECOND  # without being on final: the next one is another


@dataclass(frozen=True, slots=True)
class Final:
    """What is remembered of one track's final."""

    at: int  # when it was last on it
    through_air: bool  # its speed: as its own word of the wind makes it, else over the ground
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
        winds: Floats,
        has_height: Bools,
        limits: Stabilised,
        frame: RunwayFrame,
    ) -> tuple[Gates, Judged | None]:
        """One instant of tracks at (n, 3) with (n, 3) m/s in winds (n, 2), 0 = not told; None where nobody is or was on final.

        `numbers` are those that people know the tracks by, `aircraft` who they are.
        """
        place, flies = frame.relative(at, place_enu, velocity)
        off = deviations(frame.runway, place, flies[:, 0])
        way = velocity[:, :2] - winds
        speed, through_air = np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2), (winds != 0.0).any(axis=1)
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
            flown = float(speed[row]), bool(through_air[row])
            finals[track], seen = _judged(known, at, one, flown, float(place[row, 2]), limits, frame.runway)
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
    flown: tuple[float, bool],
    height_m: float,
    limits: Stabilised,
    runway: Runway,
) -> tuple[Final, Excess]:
    speed, through_air = flown
    least = speed if known is None or known.through_air != through_air else min(speed, known.least_mps)
    wanted = least if limits.approach_speed_mps is None else limits.approach_speed_mps
    seen = excess(limits, runway, *off, speed, wanted)
    held = (Held(),) * len(KINDS) if known is None else known.held
    after = tuple(one.after(ratio) for one, ratio in zip(held, seen.ratio.tolist(), strict=True))
    return Final(at, through_air, least, height_m, after), seen


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
            how = _by(kind, value, now.through_air)
            said.append(("warning", f"{name} is {kind} on final: {how}, {off[0] / 1000.0:.1f} km to go"))
        elif was.stands and not held.stands:
            said.append(("info", f"{name} is no longer {kind}"))
    if known is not None:
        wanted = now.least_mps if limits.approach_speed_mps is None else limits.approach_speed_mps
        for gate in gate_heights(limits, runway, wanted):
            if known.height_m > float(gate) >= now.height_m:
                wrong = [
                    _by(kind, value, now.through_air)
                    for kind, value, held in zip(KINDS, seen.off.tolist(), now.held, strict=True)
                    if held.stands
                ]
                how = f"not stabilised: {', '.join(wrong)}" if wrong else "stabilised"
                said.append(("warning" if wrong else "info", f"{name} passes the gate at {float(gate):.0f} m {how}"))
    return said


def _by(kind: str, value: float, through_air: bool) -> str:
    where = "through the air" if through_air else "over the ground"
    return {
        "too high": f"{value:.0f} m above the glide path",
        "too low": f"{value:.0f} m below the glide path",
        "off centreline": f"{value:.0f} m off the centreline",
        "too fast": f"{value:.0f} m/s too fast {where}",
        "too slow": f"{value:.0f} m/s too slow {where}",
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
