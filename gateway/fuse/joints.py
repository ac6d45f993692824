"""Joints: radar tracks of several radars in one system track, with or without a position source (paper 004, figure 1).

Association finds which radar tracks are one target; here they are brought into one track, once a second. An aircraft's track
takes them where a position source finds one of them, or is silent; else the oldest of the radars' tracks does. What is in a
track because another radar's track is leaves it when these two are one no more. Who is where is decided once, from the
instant of the decision on: nothing of the past is worked again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from gateway.align import SECOND
from gateway.associate import Span, Spans, aircraft_of, ordinal_of
from gateway.fuse.becoming import is_alive
from gateway.fuse.lanes import Joint, Lane, Lanes
from gateway.track import Key, RadarTracks, name_of

SEEN_WITHIN_S = 10.0  # a position source that was heard this lately speaks for itself
FOUND_WITHIN_S = 10.0  # so long two radar tracks have until they must be found to be one
JOINTS_AT_MOST = 20  # of one radar track: what comes and goes more often is left alone


@dataclass(frozen=True, slots=True)
class Regrouped:
    """The lanes after radar tracks were brought together or taken apart, and what people should know of it."""

    lanes: Lanes
    told: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class _Sky:
    """Which radar tracks are alive, in which system track each is, and which an aircraft's own reports hold there."""

    at: int
    lanes: Lanes
    home: Mapping[Key, int]
    alive: Mapping[int, tuple[Key, ...]]  # of each system track
    held: frozenset[Key]


def with_joints(spans: Spans, joints: Sequence[Joint]) -> Spans:
    """Spans with those of joints where nothing else was found; a radar track's spans are numbered anew, in their order."""
    by_key: dict[Key, list[Joint]] = {}
    for joint in joints:
        by_key.setdefault(joint.key, []).append(joint)
    kept = [span for span in spans if span.key not in by_key]
    for key, mine in by_key.items():
        known = spans.by_key.get(key, ())
        pieces = [piece for joint in mine if (piece := _piece(joint, known)) is not None]
        index, before = 0, 0
        for span in sorted([*known, *pieces], key=lambda span: span.since):
            is_piece = span.index == 0
            before += is_piece
            index = index + 1 if is_piece else span.index + before
            kept.append(replace(span, index=index))
    return Spans(sorted(kept, key=lambda span: span.since))


def _piece(joint: Joint, known: Sequence[Span]) -> Span | None:
    """What is left of a joint beside what association found of its radar track; index 0."""
    if any(span.since <= joint.since and (span.until is None or joint.since < span.until) for span in known):
        return None
    ends = [at for at in (joint.until, *(s.since for s in known if s.since > joint.since)) if at is not None]
    until = min(ends, default=None)
    return Span(joint.key, joint.name, joint.since, until, 0) if until is None or until > joint.since else None


def closed(joints: Iterable[Joint], key: Key, at: int) -> tuple[Joint, ...]:
    """The joints with a radar track's present one ended."""
    return tuple(replace(one, until=at) if one.key == key and one.until is None else one for one in joints)


def remembered(lanes: Lanes, tracks: RadarTracks, spans: Spans) -> Lanes:
    """The lanes without the joints of radar tracks that are no more; a track whose first one is gone is named by another."""
    joints = tuple(one for one in lanes.joints if one.key in tracks.plots)
    lanes = lanes if len(joints) == len(lanes.joints) else replace(lanes, joints=joints)
    for one in joints:
        lane = lanes.lanes.get(lanes.track_of(one.name) or 0)
        if one.until is None and lane is not None and lane.key is not None and lane.key not in tracks.plots:
            ordinal = ordinal_of(spans, one.key, one.since)
            lanes = lanes.with_lane(replace(lane, key=one.key, ordinal=ordinal, whole=False))
    return lanes


def regrouped(
    lanes: Lanes,
    groups: Sequence[Sequence[Key]],
    compared: frozenset[Key],
    found: Spans,
    spans: Spans,
    tracks: RadarTracks,
    at: int,
) -> Regrouped:
    """Radar tracks that are one target brought into one system track from an instant on, and others out of it.

    `groups`: of those that were compared now, which are one. `found`: what reports have associated, and nothing else.
    """
    sky = _sky(lanes, found, spans, tracks, at)
    joints, told, moved = lanes.joints, list[str](), dict[Key, str]()
    often = {key for key, count in Counter(one.key for one in joints).items() if count >= JOINTS_AT_MOST}
    group_of = {key: place for place, group in enumerate(groups) for key in group}
    for group in groups:
        target = _target(group, sky)
        moving = [] if target is None else _moving(group, target, sky, often)
        moved |= dict.fromkeys(moving, lanes.lanes[target or 0].name) if moving else {}
        if moving:
            names = ", ".join(name_of(key) for key in group)
            told.append(f"radar tracks {names} are one target: {_who(lanes.lanes[target or 0])}")
    if moved:
        ended = (replace(one, until=at) if one.until is None and one.key in moved else one for one in joints)
        joints = (*ended, *(Joint(key, name, at) for key, name in moved.items()))
    new = {one.key for one in joints if one.since > at - int(FOUND_WITHIN_S * SECOND)}  # they may not be found yet
    for one in lanes.joints:
        mine = lanes.track_of(one.name)
        if one.until is not None or one.key not in compared - new or mine is None or sky.home.get(one.key) != mine:
            continue
        others = [key for key in sky.alive[mine] if key != one.key and key in compared - new]
        if others and not any(group_of.get(key, -1) == group_of.get(one.key, -2) for key in others):
            joints = closed(joints, one.key, at)
            names = ", ".join(name_of(key) for key in others)
            told.append(f"radar track {name_of(one.key)} is not the same target as {names} any more")
    return Regrouped(replace(lanes, joints=joints) if joints is not lanes.joints else lanes, tuple(told))


def _sky(lanes: Lanes, found: Spans, spans: Spans, tracks: RadarTracks, at: int) -> _Sky:
    home: dict[Key, int] = {}
    alive: dict[int, tuple[Key, ...]] = {}
    for key in tracks.plots:
        if not is_alive(tracks, key, at):
            continue
        name = aircraft_of(spans, key, at)
        free = lanes.by_key.get((key, ordinal_of(spans, key, at)))
        track = free if name is None else lanes.track_of(name)
        if track is not None and track in lanes.lanes:
            home[key] = track
            alive[track] = (*alive.get(track, ()), key)
    return _Sky(at, lanes, home, alive, frozenset(found.pairs))


def _target(group: Sequence[Key], sky: _Sky) -> int | None:
    """The system track that a group belongs into; None where it is there, or where that is not plain."""
    homes = {sky.home[key] for key in group if key in sky.home}
    if len(homes) < 2:
        return None
    aircraft = {track for track in homes if sky.lanes.lanes[track].aircraft is not None}
    fit = {track for track in aircraft if _speaks_for(track, sky)}
    if len(fit) > 1:
        return None
    return min(fit or homes - aircraft, default=None)


def _speaks_for(track: int, sky: _Sky) -> bool:
    """Whether an aircraft's own reports hold one of the radar tracks in its track, or it makes none."""
    lane = sky.lanes.lanes[track]
    silent = not lane.events or sky.at - lane.last.gps_at > int(SEEN_WITHIN_S * SECOND)
    return silent or any(key in sky.held for key in sky.alive[track])


def _moving(group: Sequence[Key], target: int, sky: _Sky, often: set[Key]) -> list[Key]:
    """The radar tracks of a group that go over into a system track; of a radars' track all or none do."""
    radars = {key[0] for key in sky.alive[target]}
    moving: list[Key] = []
    for track in sorted({sky.home[key] for key in group if key in sky.home} - {target}):
        mine = [key for key in sky.alive[track] if key not in sky.held]
        if sky.lanes.lanes[track].aircraft is not None:
            mine = [key for key in mine if key in group]
        if not often & set(mine) and set(mine) <= set(group) and not radars & {key[0] for key in mine}:
            moving += mine
            radars |= {key[0] for key in mine}
    return moving


def radar_tracks_of_aircraft(lanes: Lanes, spans: Spans, keys: Iterable[Key]) -> dict[int, list[Key]]:
    """Of some radar tracks, those that are aircraft now, by their system tracks."""
    found: dict[int, list[Key]] = {}
    for key in keys:
        track = lanes.by_aircraft.get(spans.pairs.get(key, ""))
        if track is not None:
            found.setdefault(lanes.lanes[track].number, []).append(key)
    return found


def _who(lane: Lane) -> str:
    return f"track {lane.number}" + (f", {lane.aircraft}" if lane.aircraft else "")
