"""A radar track with a new number that goes on where another one fell silent: the same track, if that is beyond doubt.

Radars lose a target and number it anew. When a new radar track has the plots to begin with, every confirmed track whose
own radar track is silent is carried on to them; the sum of squared distances (Mahalanobis) of these plots must be within
the chi-square gate. It must also be plain: no other silent track explains the plots nearly as well, and no other new radar
track is within the same gate. Then an aircraft's new radar track is the aircraft's at once (`Adopted`, until association
has found the same, or GPS speaks against it), and a track that only a radar knows keeps its number. Else a new one begins.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from gateway.align import SECOND, Plot
from gateway.associate import Span, Spans, aircraft_of, ordinal_of
from gateway.estimators.kalman import Estimate
from gateway.fuse.agreement import CONFIRMED, expected
from gateway.fuse.events import NEVER, Event, Job, rank
from gateway.fuse.joints import closed, with_joints
from gateway.fuse.lanes import Adopted, Joint, Lane, Lanes
from gateway.fuse.placing import Scene, begin
from gateway.fuse.weighting import Model
from gateway.track import Key, RadarTracks, name_of

GATE_SIGMAS = 3.09  # one sided: of right ones, one in a thousand is refused
PLAIN_ODDS = 100.0  # of the best explanation against each other one
PLOTS, LONG_ENOUGH_S = (
    5,
    2.0,
)  # of a new radar track: so many are compared at most, so long a time at least if there are fewer
DOUBTFUL_REPORTS = 15  # so many, and association has not found the same: then they speak against it


@dataclass(frozen=True, slots=True)
class Continuation:
    """A track that goes on with another radar track, since when, and what its radar track was."""

    lane: Lane
    key: Key
    since: int
    former: Key | None  # None: nothing is remembered of it

    def reason(self) -> str:
        """For people: "radar track 1/7, which was 1/3"."""
        new, old = name_of(self.key), name_of(self.former) if self.former else ""
        return f"radar track {new}" + (" again" if new == old else f", which was {old}" if old else "")


@dataclass(frozen=True, slots=True)
class _Fit:
    """How plots lie to a track that is carried on to them."""

    within: bool
    log_likelihood: float


def continued(lanes: Lanes, key: Key, scene: Scene, model: Model) -> Continuation | Literal["not yet"] | None:
    """The track that a radar track without one continues, or None while it has too few plots or nothing is plain.

    "not yet": it may be one, and some more plots will show whether it also flies like it.
    """
    plots = scene.tracks.plots.get(key, ())
    if not begin(plots) or aircraft_of(scene.spans, key, plots[-1].at) is not None:
        return None
    fits = [(lane, former, _fit(lane, plots, model)) for lane, former in _silent(lanes, key[0], plots[0].at, scene)]
    near = [(fit.log_likelihood, lane, former) for lane, former, fit in fits if fit is not None and fit.within]
    if not near:
        return None
    if len(plots) < PLOTS and plots[-1].at - plots[0].at < LONG_ENOUGH_S * SECOND:
        return "not yet"
    best, lane, former = max(near, key=lambda one: (one[0], -one[1].track))
    others = [fit.log_likelihood for other, _, fit in fits if fit is not None and other is not lane]
    if any(other > best - math.log(PLAIN_ODDS) for other in others) or _has_rival(lane, key, scene, model):
        return None
    return Continuation(lane, key, plots[0].at, former)


def _silent(lanes: Lanes, radar: int, at: int, scene: Scene) -> Iterator[tuple[Lane, Key | None]]:
    """Confirmed tracks that a radar saw lately, but none of its radar tracks since an instant; with the last of these.

    Where other radars see it still, only one that this radar has seen, too.
    """
    longest = int(scene.options.end_after_s * SECOND)
    for lane in lanes.lanes.values():
        if not lane.events or lane.ended_at is not None or lane.last.score != CONFIRMED:
            continue
        if lane.last.radar_at == NEVER or at - lane.last.radar_at > longest:
            continue
        keys = {span.key for span in scene.spans.by_aircraft.get(lane.name, ()) if span.until is None}
        keys |= {lane.key} if lane.key is not None else set()
        last = {key: scene.tracks.plots[key][-1].at for key in sorted(keys) if key in scene.tracks.plots}
        if any(seen >= at for seen in last.values()):
            last = {key: seen for key, seen in last.items() if key[0] == radar}
            if radar in lane.last.latest and all(seen < at for seen in last.values()):
                yield lane, max(last, key=lambda key: last[key], default=None)
            continue
        yield lane, max(last, key=lambda key: last[key]) if last else lane.key


def _fit(lane: Lane, plots: Sequence[Plot], model: Model) -> _Fit | None:
    """A track carried on to the first plots of a radar track; None where it has no state from before them."""
    base = next((event for event in reversed(lane.events) if event.at <= plots[0].at), None)
    if base is None:
        return None
    return _compared(base, plots[:PLOTS], model)


def _compared(base: Event, plots: Sequence[Plot], model: Model) -> _Fit:
    state, at = Estimate(base.mean[None], base.covariance[None]), base.at
    distance, degrees, log_likelihood = 0.0, 0, 0.0
    for plot in plots:
        state, told = expected(state, (plot.at - at) / SECOND, plot, model)
        at = plot.at
        distance += float(told.normalised[0])
        degrees += int(told.measured.sum())
        log_likelihood += float(told.log_likelihood[0])
    return _Fit(distance <= chi_square_gate(degrees), log_likelihood)


def chi_square_gate(degrees: int) -> float:
    """What chi-square with so many degrees exceeds once in a thousand times (Wilson and Hilferty; to 1 % from 2 on)."""
    share = 2.0 / (9.0 * max(degrees, 1))
    return degrees * (1.0 - share + GATE_SIGMAS * math.sqrt(share)) ** 3


def _has_rival(lane: Lane, key: Key, scene: Scene, model: Model) -> bool:
    """Whether another radar track of the same radar, begun since this track fell silent, may be it as well."""
    for other, plots in scene.tracks.plots.items():
        if other == key or other == lane.key or other[0] != key[0] or plots[0].at <= lane.last.radar_at:
            continue
        fit = _fit(lane, plots[:PLOTS], model)
        if fit is not None and fit.within:
            return True
    return False


def spans_with(spans: Spans, adopted: Sequence[Adopted], joints: Sequence[Joint] = ()) -> Spans:
    """Which radar track is which aircraft when, or in which other track.

    What association found; what was adopted until it did; and what is there because another radar's track is.
    """
    mine = {one.key: one for one in adopted}
    since = {one.former: one.since for one in adopted if one.former is not None}
    found = []
    for span in spans:
        if span.key in mine:
            span = replace(span, index=span.index + 1)
        elif span.key in since and (span.until is None or span.until > since[span.key]):
            span = replace(span, until=max(since[span.key], span.since))
        found.append(span)
    for one in adopted:
        ends = [at for at in (one.until, *(span.since for span in spans.by_key.get(one.key, ()))) if at is not None]
        found.append(Span(one.key, one.aircraft, one.since, min(ends, default=None)))
    known = Spans(sorted((s for s in found if s.until is None or s.until > s.since), key=lambda span: span.since))
    return with_joints(known, joints) if joints else known


def reviewed(lanes: Lanes, spans: Spans, tracks: RadarTracks, at: int) -> tuple[Lanes, list[Adopted]]:
    """The lanes without what was adopted and is no longer needed; and what GPS speaks against, which ends now.

    `spans` are those that association has found.
    """
    kept, doubted = [], []
    for one in lanes.adopted:
        if one.key not in tracks.plots or _is_found(one, spans, tracks, lanes):
            continue
        lane = lanes.lanes.get(lanes.by_aircraft.get(one.aircraft, 0))
        gps_at = lane.last.gps_at if lane is not None and lane.events else one.gps_at
        if one.until is None and one.key not in spans.pairs and gps_at > one.gps_at:
            one = replace(one, gps_at=gps_at, reports=one.reports + 1)
            if one.reports >= DOUBTFUL_REPORTS:
                one = replace(one, until=at)
                doubted.append(one)
        kept.append(one)
    adopted = tuple(kept)
    return (lanes if adopted == lanes.adopted else replace(lanes, adopted=adopted)), doubted


def _is_found(one: Adopted, spans: Spans, tracks: RadarTracks, lanes: Lanes) -> bool:
    """Whether association has found the same, and nothing that is remembered is from before it had."""
    found = spans.by_key.get(one.key, ())
    if not found or found[0].aircraft != one.aircraft or tracks.plots[one.key][0].at < found[0].since:
        return False
    is_old_held = any(span.until is None for span in spans if span.key == one.former)
    return not is_old_held and not any(key == one.key for key, _ in lanes.by_key)


def adopted_earlier(lanes: Lanes, key: Key, at: int) -> Lanes | None:
    """The lanes where an adopted radar track begins earlier, because a plot from before came late; None = none does."""
    if not any(one.key == key and at < one.since for one in lanes.adopted):
        return None
    adopted = (replace(one, since=at) if one.key == key and at < one.since else one for one in lanes.adopted)
    return replace(lanes, adopted=tuple(adopted))


def taken_on(lanes: Lanes, found: Continuation, scene: Scene) -> tuple[Lanes, Job | None]:
    """The lanes with a radar track going on as another one's: an aircraft's is adopted; what else is there goes on as it is.

    The job is that of the new plots, where they are its only ones; else the track is to be worked again from `since` on.
    """
    lane = found.lane
    if lane.aircraft is not None:
        one = Adopted(found.key, lane.aircraft, found.since, found.former, gps_at=max(found.since, lane.last.gps_at))
        return replace(lanes, adopted=(*lanes.adopted, one)), None
    if found.former != lane.key:  # that of another radar than its first
        joints = closed(lanes.joints, found.former, found.since) if found.former is not None else lanes.joints
        return replace(lanes, joints=(*joints, Joint(found.key, lane.name, found.since))), None
    # Its past cannot be made again from the new radar track's plots, so none of it may be given up.
    lane = replace(lane, key=found.key, ordinal=ordinal_of(scene.spans, found.key, found.since), whole=False)
    plots = sorted(scene.tracks.plots[found.key], key=rank)
    return lanes.added(lane), Job(lane.track, lane.last, plots, scene.neighbour(lane))
