"""The life of a track: tentative, confirmed, coasting, ended; and how an aircraft comes back.

    tentative   begun, and not yet sure to be one thing that flies (agreement.py)
    confirmed   its measurements agreed; it stays so until it ends
    coasting    confirmed, and silent for longer than its own rhythm explains: it is carried on, ever less certain
    ended       silent for too long, or it became another track

Which sources see it is another question (`state` of a row). A tentative track ends sooner, and nobody is told. An aircraft
says who it is: when it comes back soon enough, to where it can have flown, it is its old track again, under its number.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from gateway.align import SECOND, Fix
from gateway.estimators.kalman import POSITION
from gateway.fuse.agreement import CONFIRMED, NOISE_SIGMAS
from gateway.fuse.lanes import Ended, Gone, Lane, Lanes
from gateway.settings import Options
from gateway.track import GREATEST_SPEED_MPS, name_of

Life = Literal["tentative", "confirmed", "coasting"]

REMEMBERED_S = 3600.0  # an aircraft that comes back later is not told to have been a track before
REMEMBERED = 1000  # and of these, so many at most


@dataclass(frozen=True, slots=True)
class LifeChange:
    """A track that began (tentative), was confirmed, or coasts; when, and why. How it ends is in `Ended`."""

    at: int
    track: int
    life: Life
    reason: str


def life_of(lane: Lane, at: int, options: Options) -> Life:
    """What part of its life a track with events is in."""
    if lane.last.score != CONFIRMED:
        return "tentative"
    return "coasting" if lane.coasting_at(at, options) else "confirmed"


def told(lanes: Lanes, at: int, options: Options) -> tuple[Lanes, list[LifeChange]]:
    """The lanes after people were told what has changed until an instant, and that."""
    changed: dict[int, Lane] = {}
    changes: list[LifeChange] = []
    for lane in lanes.lanes.values():
        if not lane.events or lane.ended_at is not None:
            continue
        life = life_of(lane, at, options)
        if life == lane.told:
            continue
        if not lane.told:
            changes.append(LifeChange(lane.events[0].at, lane.number, "tentative", lane.origin))
        if life == "confirmed":
            changes.append(_confirmed(lane))
        elif life == "coasting":
            silence_s = (at - lane.last.heard_at) / SECOND
            changes.append(LifeChange(at, lane.number, life, f"nothing for {silence_s:.0f} s"))
        elif lane.told:
            changes.append(LifeChange(at, lane.number, life, "in hindsight its measurements do not agree"))
        changed[lane.track] = replace(lane, told=life)
    return (lanes.with_lanes(changed) if changed else lanes), changes


def _confirmed(lane: Lane) -> LifeChange:
    """Confirmed for the first time, or heard again."""
    if lane.told == "coasting":
        gap_s = max((b.at - a.heard_at for a, b in zip(lane.events, lane.events[1:], strict=False)), default=0) / SECOND
        return LifeChange(lane.last.at, lane.number, "confirmed", f"heard again after {gap_s:.0f} s")
    first = next(event for event in lane.events if event.score == CONFIRMED)
    return LifeChange(first.at, lane.number, "confirmed", "its measurements agree")


def sentence(change: LifeChange, lanes: Lanes) -> str | None:
    """What the log says of a change; nothing of a track that has just begun, unless it was one before."""
    lane = lanes.numbered(change.track)
    who = lane.aircraft or (f"radar track {name_of(lane.key)}" if lane.key else "")
    if change.life == "tentative":
        return f"track {change.track} is {change.reason}" if "again" in change.reason else None
    verb = "is coasting" if change.life == "coasting" else "is confirmed"
    return f"track {change.track}, {who}, {verb}: {change.reason}"


def end_silent(lanes: Lanes, at: int, options: Options) -> tuple[Lanes, list[Ended]]:
    """The lanes without those that have been silent for too long, and without those that joined another long ago."""
    history = int(options.history_s * SECOND)
    ended, out, gone = [], [], {}
    for lane in lanes.lanes.values():
        if lane.ended_at is not None:
            if lane.ended_at < at - history:
                out.append(lane.track)
            continue
        is_tentative = bool(lane.events) and lane.last.score != CONFIRMED
        limit_s = min(options.end_after_s, options.tentative_end_after_s) if is_tentative else options.end_after_s
        if at - (lane.last.at if lane.events else lane.emptied_at) > int(limit_s * SECOND):
            out.append(lane.track)
            never = ", and it was never confirmed" if is_tentative else ""
            ended.append(Ended(at, lane.number, f"no data for {limit_s:.0f} s{never}", is_tentative))
            if lane.aircraft is not None and lane.events:
                last = lane.last
                place = tuple(last.mean[POSITION].tolist())
                gone[lane.aircraft] = Gone(lane.track, last.at, at, place, last, lane.taken)
    if out:
        lanes = lanes.without(out)
    if gone or lanes.gone:
        lanes = replace(lanes, gone=_remembered({**lanes.gone, **gone}, at, options))
    return lanes, ended


def _remembered(gone: Mapping[str, Gone], at: int, options: Options) -> Mapping[str, Gone]:
    """Those that may still come back, at most `REMEMBERED`; with their last state only while late data may need it."""
    longest, late = int(REMEMBERED_S * SECOND), int((options.history_s + options.end_after_s) * SECOND)
    kept = {}
    for aircraft in list(gone)[-REMEMBERED:]:
        one = gone[aircraft]
        if at - one.at <= longest:
            needed = one.event is None or at - max(one.ended_at, one.at) <= late
            kept[aircraft] = one if needed else replace(one, event=None)
    return kept


def lane_of_report(lanes: Lanes, fix: Fix, options: Options) -> tuple[Lanes, Lane | None]:
    """The lanes with one for a report of an aircraft that has none: its old one, or a new one; None = it came too late.

    Where the silence was no longer than a track lives, in-order processing would not have ended it: it goes on from its
    last state. After a longer one the filter begins anew, since no model of motion holds for a minute.
    """
    known = lanes.gone.get(fix.aircraft)
    if known is None:
        return lanes.begun(fix.aircraft, None, 0, f"{fix.aircraft}, heard for the first time")
    silence_s = (fix.at - known.at) / SECOND
    ended_at = max(known.ended_at, known.at + int(options.end_after_s * SECOND))
    back = f"{fix.aircraft} again, after {silence_s:.0f} s"
    if known.event is not None and fix.at <= ended_at:
        if fix.at < known.at:
            return lanes, None
        life = "coasting" if known.event.score == CONFIRMED else "tentative"
        lane = Lane(
            known.track, fix.aircraft, None, 0, (known.event,), False, origin=back, told=life, taken=known.taken
        )
    elif silence_s <= options.returns_within_s and _is_within_reach(known, fix, silence_s):
        lane = Lane(known.track, fix.aircraft, None, 0, origin=back, taken=known.taken)
    else:
        return lanes.begun(fix.aircraft, None, 0, f"{fix.aircraft} again, which was track {known.number}")
    return lanes.added(lane), lane


def _is_within_reach(known: Gone, fix: Fix, silence_s: float) -> bool:
    """Whether the aircraft can have flown from where it was last to where it says that it is."""
    far_m = math.dist(known.enu_m, fix.enu_m.tolist())
    return far_m <= GREATEST_SPEED_MPS * silence_s + NOISE_SIGMAS * float(fix.sigma_m.max())
