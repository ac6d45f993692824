"""The system tracks and their recent past: where a measurement belongs in time, and what must be worked again after it.

Each track keeps its measurements of the last `history_s` with the state after each. A late one goes back to its place and
what came after it, in this track only, is worked again; a pair made or lost in hindsight moves its plots from one track to
another and works both again from there. So the last row of a track for any time is that of in-order processing, at the
cost of that track's own few measurements, not of everything that was heard since.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gateway.align import SECOND, Fix, Plot, ReckonedFix, bracket
from gateway.associate import Spans, aircraft_of, ordinal_of
from gateway.fuse.diverging import is_misled
from gateway.fuse.events import Doubt
from gateway.fuse.filtering import Job, Measure, Near, Neighbour, rank
from gateway.fuse.headings import Headings
from gateway.fuse.lanes import Lane, Lanes, contains
from gateway.fuse.life import lane_of_report
from gateway.settings import Options
from gateway.track import Key, RadarTracks, name_of

LEAST_PLOTS = 3  # before a radar track that nobody claims becomes a system track
COMPLETED_WITHIN_S = 1.6  # components of neighbouring plots this close may complete the first one


@dataclass(frozen=True, slots=True)
class Scene:
    """What lanes are built from: the radar tracks, which aircraft they are when, and the options."""

    tracks: RadarTracks
    spans: Spans
    options: Options
    headings: Headings = Headings()
    contradicted: frozenset[str] = frozenset()  # aircraft whose velocities are not those of their positions
    doubted: frozenset[str] = frozenset()  # and those of whom dead reckoning has found it as they turned wrong

    def doubt(self, lane: Lane) -> Doubt:
        """What is known of the velocities of this lane's reports."""
        if lane.aircraft in self.contradicted:
            return Doubt.ALL_ALONG
        return Doubt.LATELY if lane.aircraft in self.doubted else Doubt.NONE

    def neighbour(self, lane: Lane) -> Neighbour:
        """The plot of this lane's radar track at a report's time, for the literal weighting."""

        def at_time_of(fix: Fix) -> Near | None:
            for span in self.spans.by_aircraft.get(lane.aircraft or "", ()):
                if aircraft_of(self.spans, span.key, fix.at) != lane.aircraft:
                    continue
                # Only plots that are this aircraft's: a late one of those has this report worked again, another has not.
                known = self.tracks.plots.get(span.key, ())
                plots = [p for p in known if p.at >= span.since and (span.until is None or p.at < span.until)]
                value, sigma = bracket(plots, fix.at, self.options.association_wait_s)
                if not all(map(math.isnan, value)):
                    return span.key[0], value, sigma
            return None

        return at_time_of


def take_fix(lanes: Lanes, fix: Fix, scene: Scene) -> tuple[Lanes, Job | None]:
    """The lanes with a GPS report in its aircraft's, and what is to be worked; no job means that it came too late."""
    track = lanes.by_aircraft.get(fix.aircraft)
    if track is not None:
        return _inserted(lanes, lanes.lanes[track], fix, scene)
    lanes, lane = lane_of_report(lanes, fix, scene.options)
    return _inserted(lanes, lane, fix, scene) if lane is not None else (lanes, None)


def take_plot(lanes: Lanes, plot: Plot, key: Key, scene: Scene) -> tuple[Lanes, Job | None]:
    """The lanes with a plot in the track that it belongs to; no job means too late, or that nothing can start yet."""
    name = aircraft_of(scene.spans, key, plot.at)
    if name is not None:
        track = lanes.track_of(name)
        return _inserted(lanes, lanes.lanes[track], plot, scene) if track is not None else (lanes, None)
    ordinal = ordinal_of(scene.spans, key, plot.at)
    track = lanes.by_key.get((key, ordinal))
    if track is None:
        return _begun_from_plots(lanes, key, ordinal, scene)
    lane = lanes.lanes[track]
    if lane.whole and (not lane.events or rank(plot) < rank(lane.events[0].measure)):
        return _rebuilt(lanes, lane, 0, scene)
    return _inserted(lanes, lane, plot, scene)


def lane_of(lanes: Lanes, plot: Plot, key: Key, scene: Scene) -> int | None:
    """The track that a plot belongs to, or None where none has begun."""
    name = aircraft_of(scene.spans, key, plot.at)
    if name is not None:
        return lanes.track_of(name)
    return lanes.by_key.get((key, ordinal_of(scene.spans, key, plot.at)))


def reroute(lanes: Lanes, old: Spans, scene: Scene) -> tuple[Lanes, list[Job]]:
    """The lanes after pairs were made, lost or moved in time; and what of them is to be worked again."""
    from_when: dict[str, int] = {}
    keys: dict[Key, int] = {}
    for key in sorted({span.key for span in {*old} ^ {*scene.spans}}):
        for at in sorted(
            {t for s in (*old, *scene.spans) if s.key == key for t in (s.since, s.until) if t is not None}
        ):
            before, now = aircraft_of(old, key, at), aircraft_of(scene.spans, key, at)
            if before == now:
                continue
            keys.setdefault(key, at)
            for name in (before, now):
                if name is not None:
                    from_when[name] = min(at, from_when.get(name, at))
    jobs = []
    for name, at in sorted(from_when.items()):
        track = lanes.track_of(name)
        if track is not None:
            lanes, job = _rebuilt(lanes, lanes.lanes[track], at, scene)
            jobs.append(job)
    for key, at in keys.items():
        for (known, _), track in list(lanes.by_key.items()):
            if known == key:
                lanes, job = _rebuilt(lanes, lanes.lanes[track], at, scene)
                jobs.append(job)
        ordinal = ordinal_of(scene.spans, key, scene.tracks.plots[key][-1].at) if key in scene.tracks.plots else 0
        free = key in scene.tracks.plots and aircraft_of(scene.spans, key, scene.tracks.plots[key][-1].at) is None
        if free and (key, ordinal) not in lanes.by_key:
            lanes, begun = _begun_from_plots(lanes, key, ordinal, scene)
            jobs.append(begun)
    return lanes, [job for job in jobs if job is not None]


def give_back(lanes: Lanes, plot: Plot, key: Key, scene: Scene) -> tuple[Lanes, Job | None]:
    """The lanes after a plot was taken out of its radar track: its track is to be worked again from there."""
    track = lane_of(lanes, plot, key, scene)
    if track is None or not contains(lanes, track, plot):
        return lanes, None
    return _rebuilt(lanes, lanes.lanes[track], plot.at, scene)


def _inserted(lanes: Lanes, lane: Lane, measure: Measure, scene: Scene) -> tuple[Lanes, Job | None]:
    """The measurement in its place, and the job of working it and what came after."""
    order = rank(measure)
    events = lane.events
    place = len(events)
    while place and rank(events[place - 1].measure) > order:
        place -= 1
    if place == 0 and events and (not lane.whole or isinstance(measure, Plot)):
        return lanes, None
    until = measure.at + int(scene.options.coast_after_s * SECOND)
    following: list[Measure] = [measure, *(e.measure for e in events[place:] if not _is_moot(e.measure, until))]
    if scene.options.weighting == "literal" and isinstance(measure, Plot):
        # A report shortly before this plot was fused with an interpolation that this plot changes.
        first = measure.at - int(scene.options.association_wait_s * SECOND)
        touched = next(
            (i for i in range(1, place) if events[i].at >= first and isinstance(events[i].measure, Fix)), place
        )
        following = [*(event.measure for event in events[touched:place]), *following]
        place = touched
    doubt = scene.doubt(lane)
    is_report = isinstance(measure, Fix) and not isinstance(measure, ReckonedFix)
    if is_report and events and is_misled(lane.last, doubt):
        # All that is remembered is worked again without velocities: two positions tell the speed that one does not.
        first = 0 if lane.whole else 1
        following = _without_reckoned([*(event.measure for event in events[first:place]), *following])
        place = min(first, place)
    job = Job(
        lane.track,
        events[place - 1] if place else None,
        following,
        scene.neighbour(lane),
        measure.serial,
        scene.headings.of(lane.aircraft),
        doubt,
    )
    return lanes if place == len(events) else lanes.with_lane(lane.with_events(events[:place])), job


def _is_moot(measure: Measure, until: int) -> bool:
    """Whether dead reckoning has led the track only because something that was heard late was not there yet."""
    return isinstance(measure, ReckonedFix) and not measure.is_forced and measure.at <= until


def _without_reckoned(measures: Sequence[Measure]) -> list[Measure]:
    """Measurements of a track that wrong velocities misled: dead reckoning that led it learnt from them too."""
    return [one for one in measures if not isinstance(one, ReckonedFix)]


def _rebuilt(lanes: Lanes, lane: Lane, at: int, scene: Scene) -> tuple[Lanes, Job | None]:
    """The lane with everything from an instant on taken out, and the job of putting in what belongs there now."""
    keep = bisect_left(lane.events, at, key=lambda event: event.at)
    if keep == 0 and not lane.whole:
        keep = 1
    if lane.aircraft is not None:
        floor = lane.events[keep - 1].at if keep else at
        measures: list[Measure] = [e.measure for e in lane.events[keep:] if isinstance(e.measure, Fix)]
        measures += [plot for plot in _plots_of(lane.aircraft, scene) if plot.at >= max(at, floor)]
    else:
        if lane.whole:
            keep = 0
        plots = sorted([*_free_plots(lane, scene), *_plots_of(lane.name, scene)], key=rank)
        measures = [*begin(plots)] if not keep else [p for p in plots if p.at >= at]
    headings, doubt = scene.headings.of(lane.aircraft), scene.doubt(lane)
    if lane.events and is_misled(lane.last, doubt):
        measures = _without_reckoned(measures)
    lane = lane.with_events(lane.events[:keep])
    lanes = lanes.with_lane(lane)
    base = lane.events[-1] if keep else None
    if base is not None:
        measures = [measure for measure in measures if rank(measure) > rank(base.measure)]
    measures.sort(key=rank)
    if not measures:
        return lanes, None
    return lanes, Job(lane.track, base, measures, scene.neighbour(lane), headings=headings, doubt=doubt)


def _begun_from_plots(lanes: Lanes, key: Key, ordinal: int, scene: Scene) -> tuple[Lanes, Job | None]:
    """A new lane for a radar track that nobody claims, once its plots allow to start one."""
    measures = begin(_free_plots(Lane(0, None, key, ordinal), scene))
    if not measures:
        return lanes, None
    lanes, lane = lanes.begun(None, key, ordinal, f"radar track {name_of(key)}, seen for the first time")
    return lanes, Job(lane.track, None, measures, scene.neighbour(lane))


def _plots_of(name: str, scene: Scene) -> list[Plot]:
    """All remembered plots of the radar tracks that are an aircraft, or in another radar's track, at the times when they are."""
    found = []
    for span in scene.spans.by_aircraft.get(name, ()):
        plots = scene.tracks.plots.get(span.key, ())
        found += [plot for plot in plots if plot.at >= span.since and (span.until is None or plot.at < span.until)]
    return found


def _free_plots(lane: Lane, scene: Scene) -> list[Plot]:
    """The plots of a lane's radar track in the free time that is this lane's."""
    key = lane.key
    if key is None:
        return []
    return [
        plot
        for plot in scene.tracks.plots.get(key, ())
        if ordinal_of(scene.spans, key, plot.at) == lane.ordinal and aircraft_of(scene.spans, key, plot.at) is None
    ]


def begin(plots: Sequence[Plot]) -> list[Measure]:
    """The measurements of a radar track from the first one that can start a state: complete, or completed by neighbours."""
    for place in range(LEAST_PLOTS - 1, len(plots)):
        plot = plots[place]
        polar, sigma = list(plot.polar), list(plot.sigma)
        for component in range(3):
            if not math.isnan(polar[component]):
                continue
            for other in reversed(plots[:place]):
                is_near = other.radar == plot.radar and plot.at - other.at <= COMPLETED_WITHIN_S * SECOND
                if is_near and not math.isnan(other.polar[component]):
                    polar[component] = other.polar[component]
                    moved_m = 150.0 * (plot.at - other.at) / SECOND
                    sigma[component] += moved_m if component == 0 else moved_m / max(polar[0], 300.0)
                    break
        if not any(map(math.isnan, polar)):
            first = replace(plot, polar=(polar[0], polar[1], polar[2]), sigma=(sigma[0], sigma[1], sigma[2]))
            return [first, *plots[place + 1 :]]
    return []
