"""The filter run over many tracks at once: each track's measurements in order, the k-th of every track in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot, ReckonedFix
from gateway.estimators.kalman import Estimate
from gateway.fuse.agreement import score_after
from gateway.fuse.diverging import (
    DOUBTS,
    MISLED,
    believed,
    can_begin,
    doubts_after,
    far_row,
    is_misled,
    is_sound,
    lost_again,
    may_be_lost,
    why,
    without_velocity,
)
from gateway.fuse.estimating import Estimator, Group, InteractingModels, SingleModel, stacked
from gateway.fuse.events import NEVER, Belief, Doubt, Event, Job, Measure, Near, Neighbour, Residual, rank
from gateway.fuse.headings import Point, goal_at
from gateway.fuse.light import LightFilter
from gateway.fuse.resuming import resumed
from gateway.fuse.weighting import Model

__all__ = ["NEVER", "Event", "Job", "Measure", "Near", "Neighbour", "carried_on", "directions", "rank", "run"]

Floats = NDArray[np.float64]


def run(jobs: Sequence[Job], model: Model) -> list[list[Event]]:
    """The events of each job, one a measurement. Tracks do not touch each other: any batching gives the same bits."""
    estimator = estimator_of(model)
    events: list[list[Event]] = [[] for _ in jobs]
    heads = any(job.headings for job in jobs)
    for turn in range(max((len(job.measures) for job in jobs), default=0)):
        active = [index for index, job in enumerate(jobs) if turn < len(job.measures)]
        bases = [events[index][-1] if turn else jobs[index].base for index in active]
        measures = [jobs[index].measures[turn] for index in active]
        neighbours = [jobs[index].neighbour for index in active]
        goals = None
        if heads:
            goals = [goal_at(jobs[index].headings, measure.at) for index, measure in zip(active, measures, strict=True)]
        doubts = [jobs[index].doubt for index in active]
        advanced = _advance(bases, measures, neighbours, goals, doubts, estimator, model)
        for index, event in zip(active, advanced, strict=True):
            events[index].append(event)
    return events


def estimator_of(model: Model) -> Estimator:
    """The estimator that a model asks for."""
    if model.light is not None:
        return LightFilter(model, model.light)
    return SingleModel(model) if model.modes is None else InteractingModels(model, model.modes)


def carried_on(events: Sequence[Event], elapsed_s: Floats, model: Model) -> tuple[Estimate, Floats]:
    """States of some tracks a while (n,) after their events, and the modes' probabilities (n, 3), NaN if there are none."""
    return estimator_of(model).ahead(events, elapsed_s)


def directions(event: Event, model: Model) -> Floats:
    """Probabilities (3,) of flying straight, left and right; NaN if the model has no modes."""
    return estimator_of(model).directions(event)


def _advance(
    bases: Sequence[Event | None],
    measures: Sequence[Measure],
    neighbours: Sequence[Neighbour],
    goals: Sequence[Point] | None,
    doubts: Sequence[Doubt],
    estimator: Estimator,
    model: Model,
) -> list[Event]:
    """One measurement for each of some tracks: those with one formula and one radar are worked in together."""
    literal = model.weighting == "literal"
    events: dict[int, Event] = {}
    groups: dict[tuple[str, int], list[tuple[int, Event, Measure, Measure, Near | None, bool]]] = {}
    for row, (base, measure, doubt) in enumerate(zip(bases, measures, doubts, strict=True)):
        if isinstance(measure, ReckonedFix):
            events[row] = resumed(base, measure, estimator, model)
            continue
        misled = base is not None and is_misled(base, doubt)
        if base is None or (misled and isinstance(measure, Fix)):
            events[row] = _begun(base, measure, doubt, estimator, model)
            continue
        near = neighbours[row](measure) if literal and isinstance(measure, Fix) and measure.has_height else None
        doubted = bool(doubt) and not misled  # a plot leaves it to the next report to begin anew
        taken = without_velocity(measure) if doubted else believed(base, measure)
        groups.setdefault(_group(measure, near), []).append((row, base, measure, taken, near, doubted))
    for (kind, radar), members in groups.items():
        rows, before, chosen, given, seen, doubtful = zip(*members, strict=True)
        elapsed_s = np.array([(measure.at - base.at) / SECOND for base, measure in zip(before, chosen, strict=True)])
        memory = stacked([base.memory for base in before])
        goal = None if goals is None else np.array([goals[row] for row in rows])
        group = Group(kind, radar, given, seen, elapsed_s, memory, goal)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # what comes of it is begun anew
            after = estimator.advance(before, group)
        all_sound = is_sound(after.state)
        states = zip(after.state.mean, after.state.covariance, after.memory, after.beliefs, strict=True)
        residuals = [None] * len(before) if after.residual is None else list(zip(*after.residual, strict=True))
        told = zip(after.outlying.tolist(), after.far.tolist(), residuals, doubtful, strict=True)
        for row, base, measure, state, (outlying, far, residual, doubted) in zip(
            rows, before, chosen, states, told, strict=True
        ):
            far_off, far_since = far_row(base) if far else (0, NEVER)
            score = score_after(base, measure, model)
            event = _event(measure, *state, base, outlying, score, far_off, far_since, residual, doubted)
            lost = (far_off and may_be_lost(event)) or not all_sound
            events[row] = _begun_again(event, estimator) if lost else event
    return [events[row] for row in range(len(measures))]


def _begun(base: Event | None, measure: Measure, doubt: Doubt, estimator: Estimator, model: Model) -> Event:
    """A track from its first measurement, or, where velocities misled it, from its newest one without these."""
    first, belief = estimator.begin(without_velocity(measure) if doubt else measure)
    nothing = np.full((model.memory, 3), np.nan)
    event = _event(measure, first.mean[0], first.covariance[0], nothing, belief, base, doubted=bool(doubt))
    if base is None:
        return event
    return replace(_anew(event, first, belief, MISLED), restarted_at=base.restarted_at, score=base.score)


def _begun_again(event: Event, estimator: Estimator) -> Event:
    """The same track from its newest measurement alone, if it is lost and that gives a place."""
    if not can_begin(event.measure):
        return event
    first, belief = estimator.begin(believed(event, event.measure))
    reason = why(event, first)
    if reason is None:
        return event
    if lost_again(event):
        first, belief = estimator.begin(without_velocity(event.measure))
        reason = f"{reason}, soon after it started again before: velocities of reports are left out until they fit it"
    after = _anew(event, first, belief, reason)
    return replace(after, restarted_at=event.at, doubts=DOUBTS if lost_again(event) else event.doubts)


def _anew(event: Event, first: Estimate, belief: Belief, reason: str) -> Event:
    """An event with a first state in place of its own."""
    has_height = event.height_at == event.at
    return replace(
        event,
        mean=first.mean[0],
        covariance=first.covariance[0],
        memory=np.full_like(event.memory, np.nan),
        belief=belief,
        height_at=event.at if has_height else NEVER,
        far_off=0,
        far_since=NEVER,
        restarted=reason,
        residual=None,
        latest={},
    )


def _group(measure: Measure, near: Near | None) -> tuple[str, int]:
    """Which measurements can be worked in together."""
    if isinstance(measure, Plot):
        return "plot", measure.radar
    if near is not None:
        return "literal", near[0]
    return ("fix", 0) if measure.local is None else ("in part", 0)


def _event(
    measure: Measure,
    mean: Floats,
    covariance: Floats,
    memory: Floats,
    belief: Belief,
    base: Event | None,
    outlying: bool = False,
    score: float = 0.0,
    far_off: int = 0,
    far_since: int = NEVER,
    residual: tuple[Floats, Floats] | None = None,
    doubted: bool = False,
) -> Event:
    gps_at, radar_at, height_at = (base.gps_at, base.radar_at, base.height_at) if base else (NEVER, NEVER, NEVER)
    barometric, callsign = (base.barometric, base.callsign) if base else (None, None)
    if isinstance(measure, Fix):
        gps_at, has_height = measure.at, measure.has_height
        callsign = measure.callsign or callsign
        if measure.pressure_altitude_m == measure.pressure_altitude_m:
            barometric = measure
    else:
        radar_at, has_height = measure.at, measure.polar[2] == measure.polar[2]
    if has_height:
        height_at = measure.at
    # The longest recent interval, forgotten slowly: tells a source of one report each 5 s from one that fell silent.
    interval = max(measure.at - base.at, base.interval - base.interval // 8) if base else 0
    source, latest, told = measure.radar if isinstance(measure, Plot) else 0, base.latest if base else {}, None
    restarted_at, doubts = (base.restarted_at, base.doubts) if base else (NEVER, 0)
    if doubted:
        doubts = DOUBTS
    elif doubts:
        doubts = doubts_after(doubts, measure, mean, covariance)
    if residual is not None:
        told = Residual.after(latest.get(source), *residual)
        latest = {**latest, source: told}
    return Event(
        measure,
        mean,
        covariance,
        memory,
        gps_at,
        radar_at,
        interval,
        outlying,
        height_at,
        barometric,
        callsign,
        belief,
        far_off,
        far_since,
        restarted_at=restarted_at,
        doubts=doubts,
        score=score,
        residual=told,
        latest=latest,
    )
