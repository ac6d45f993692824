"""Radars' tracks that become others: an aircraft's, or another radar's of the same target; and under which number these go on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gateway.align import SECOND
from gateway.associate import SILENT_S, Span, Spans
from gateway.fuse.lanes import Ended, Joint, Lane, Lanes
from gateway.track import Key, RadarTracks

KNOWN_BEFORE_S = 10.0  # a radars' track that is older by more than this gives its number to the aircraft that it is


def joined(lanes: Lanes, spans: Spans, tracks: RadarTracks, at: int) -> tuple[Lanes, list[Ended]]:
    """The lanes with those of radar tracks ended that became another one, and those going on that in hindsight did not."""
    ended = []
    hosted: dict[str, list[Joint]] = {}
    for joint in lanes.joints:
        hosted.setdefault(joint.name, []).append(joint)
    for track in list(lanes.lanes):
        lane = lanes.lanes[track]
        if lane.key is None:
            continue
        to = joined_at(lane, spans, hosted.get(lane.name, ()), tracks, at)
        if (to[0] if to else None) == lane.ended_at:
            continue
        lanes = _with_number(lanes, lane, None)
        host = None if to is None else lanes.lanes.get(lanes.track_of(to[1]) or 0)
        if to is not None and host is not None:
            lanes = _with_number(lanes, lane, (to[0], host))
            stays = lanes.lanes[host.track].number
            if lane.ended_at is None:
                gone = host.number if stays == lane.number else lane.number
                same = host.aircraft or "the same target"
                ended.append(Ended(to[0], gone, f"joined track {stays}, {same}", into=stays))
        lanes = lanes.with_lane(replace(lane, ended_at=to[0] if to else None))
    return lanes, ended


def _with_number(lanes: Lanes, lane: Lane, to: tuple[int, Lane] | None) -> Lanes:
    """The lanes where the track that a radars' track joined goes on under its number, if that was known long before.

    `to`: since when, and which track; None: where it did in hindsight not join, the number is given back.
    """
    if to is None:
        holders = [one for one in lanes.lanes.values() if any(number == lane.number for _, number in one.taken)]
        for one in holders:
            if one.track != lane.track:
                kept = tuple(entry for entry in one.taken if entry[1] != lane.number)
                lanes = lanes.with_lane(replace(one, taken=kept))
        return lanes
    since, host = to
    is_known = bool(host.events and lane.events) and host.began - lane.began > int(KNOWN_BEFORE_S * SECOND)
    if not is_known or lane.number > host.number:
        return lanes
    return lanes.with_lane(replace(host, taken=(*host.taken, (since, lane.number))))


def joined_at(
    lane: Lane, spans: Spans, joints: Sequence[Joint], tracks: RadarTracks, at: int
) -> tuple[int, str] | None:
    """When and to which track a radar track's lane went over, with all its radar tracks; None while it stands alone.

    `joints`: of the other radars' tracks that are in it.
    """
    if lane.key is None:
        return None
    following = _following(spans, lane.key, lane.ordinal)
    if not joints:
        return None if following is None else (following.since, following.aircraft)
    left = [] if following is None else [following]
    stays = following is None and is_alive(tracks, lane.key, at)
    for joint in joints:
        mine = next((s for s in reversed(spans.by_key.get(joint.key, ())) if s.aircraft == lane.name), None)
        after = None if mine is None else _following(spans, joint.key, mine.index)
        if after is not None and mine is not None and after.since == mine.until:
            left.append(after)
        stays |= mine is not None and mine.until is None and is_alive(tracks, joint.key, at)
    if stays or not left:
        return None
    last = max(left, key=lambda span: span.since)
    return (last.since, last.aircraft) if not lane.events or lane.last.at < last.since else None


def _following(spans: Spans, key: Key, index: int) -> Span | None:
    return next((span for span in spans.by_key.get(key, ()) if span.index == index + 1), None)


def is_alive(tracks: RadarTracks, key: Key, at: int) -> bool:
    """Whether a radar track had a plot lately."""
    plots = tracks.plots.get(key, ())
    return bool(plots) and at - plots[-1].at <= int(SILENT_S * SECOND)
