"""The filter run over many tracks at once: each track's measurements in order, the k-th of every track in one batch."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Plot, Polar
from gateway.estimators import modes
from gateway.estimators.kalman import SIZE, Estimate, Innovation, predict
from gateway.estimators.modes import Mixture
from gateway.fuse.weighting import (
    Model,
    start_from_fixes,
    start_from_plots,
    start_in_part,
    update_in_part,
    update_literally,
    update_with_fixes,
    update_with_plots,
)

Floats = NDArray[np.float64]
Measure = Fix | Plot
Near = tuple[int, Polar, Polar]  # radar, range, azimuth, elevation, and their sigmas
Neighbour = Callable[[Fix], Near | None]  # what a track's radar measured at a report's time

NEVER = -(1 << 62)


@dataclass(frozen=True, slots=True, eq=False)
class Event:
    """A track's state after one of its measurements, and when each kind of source last saw it."""

    measure: Measure
    mean: Floats  # (9,)
    covariance: Floats  # (9, 9)
    memory: Floats  # (w, 3) past innovations of the position source
    gps_at: int
    radar_at: int
    interval: int  # ns, the longest of the last few between measurements
    outlying: bool
    height_at: int  # when the vertical was last measured
    barometric: Fix | None  # the last report with a pressure altitude
    callsign: str | None
    mixture: Mixture | None  # of one track, where the model has modes; mean and covariance are then its

    @property
    def at(self) -> int:
        """When the state holds."""
        return self.measure.at


@dataclass(frozen=True, slots=True)
class Job:
    """Measurements of one track, in order, to be worked in after a state; without a state the first one starts it."""

    track: int
    base: Event | None
    measures: Sequence[Measure]
    neighbour: Neighbour
    fresh: int = -1  # serial of the measurement that asked for it


def rank(measure: Measure) -> tuple[int, int, str, int]:
    """The order in which measurements are worked in: by validity; at one instant by source, then by arrival."""
    if isinstance(measure, Fix):
        return measure.at, 0, measure.aircraft, measure.serial
    return measure.at, 1, f"{measure.radar:05d}/{measure.number:05d}", measure.serial


def run(jobs: Sequence[Job], model: Model) -> list[list[Event]]:
    """The events of each job, one a measurement. Tracks do not touch each other: any batching gives the same bits."""
    events: list[list[Event]] = [[] for _ in jobs]
    for turn in range(max((len(job.measures) for job in jobs), default=0)):
        active = [index for index, job in enumerate(jobs) if turn < len(job.measures)]
        bases = [events[index][-1] if turn else jobs[index].base for index in active]
        measures = [jobs[index].measures[turn] for index in active]
        neighbours = [jobs[index].neighbour for index in active]
        for index, event in zip(active, _advance(bases, measures, neighbours, model), strict=True):
            events[index].append(event)
    return events


def _advance(
    bases: Sequence[Event | None], measures: Sequence[Measure], neighbours: Sequence[Neighbour], model: Model
) -> list[Event]:
    """One measurement for each of some tracks: those with one formula and one radar are worked in together."""
    literal = model.weighting == "literal"
    events: dict[int, Event] = {}
    groups: dict[tuple[str, int], list[tuple[int, Event, Measure, Near | None]]] = {}
    for row, (base, measure) in enumerate(zip(bases, measures, strict=True)):
        if base is None:
            first = _start(measure, model)
            mixture = None if model.modes is None else modes.begin(first, model.modes)
            events[row] = _event(measure, first, 0, np.full((model.memory, 3), math.nan), None, False, mixture)
            continue
        near = neighbours[row](measure) if literal and isinstance(measure, Fix) and measure.has_height else None
        groups.setdefault(_group(measure, near), []).append((row, base, measure, near))
    for (kind, radar), members in groups.items():
        rows, before, chosen, seen = zip(*members, strict=True)
        elapsed_s = np.array([(measure.at - base.at) / SECOND for base, measure in zip(before, chosen, strict=True)])
        memory = _stacked([base.memory for base in before])
        if model.modes is None:
            state = Estimate(_stacked([base.mean for base in before]), _stacked([base.covariance for base in before]))
            state = predict(state, elapsed_s, model.motion)
            after, told, memory = _update(kind, radar, state, chosen, seen, memory, model)
            outlying, mixtures = told.outlying, None
        else:
            mixtures = modes.predict(_mixtures(before), elapsed_s, model.modes)
            mixtures, outlying, memory = _update_modes(kind, radar, mixtures, chosen, seen, memory, model)
            after = modes.combine(mixtures)
        for i, row in enumerate(rows):
            mixture = None if mixtures is None else mixtures.row(i)
            events[row] = _event(chosen[i], after, i, memory[i], before[i], bool(outlying[i]), mixture)
    return [events[row] for row in range(len(measures))]


def carried_on(
    events: Sequence[Event], elapsed_s: Floats, model: Model, *, far: bool = False
) -> tuple[Estimate, Floats]:
    """States of some tracks a while (n,) after their events, and the modes' probabilities (n, 3), NaN if there are none.

    `far`: a look ahead, in which the likeliest mode is kept, and not the filter's own step to what comes next.
    """
    if model.modes is None or not events:
        mean = np.array([event.mean for event in events]).reshape(-1, SIZE)
        covariance = np.array([event.covariance for event in events]).reshape(-1, SIZE, SIZE)
        state = Estimate(mean, covariance)
        return predict(state, elapsed_s, model.motion), np.full((len(events), 3), math.nan)
    mixtures = _mixtures(events)
    if far:
        return modes.held(mixtures, elapsed_s, model.modes), model.modes.directions(mixtures.weight)
    mixtures = modes.predict(mixtures, elapsed_s, model.modes)
    return modes.combine(mixtures), model.modes.directions(mixtures.weight)


def directions(event: Event, model: Model) -> Floats:
    """Probabilities (3,) of flying straight, left and right; NaN if the model has no modes."""
    if model.modes is None or event.mixture is None:
        return np.full(3, math.nan)
    return np.asarray(model.modes.directions(event.mixture.weight)[0])


def _mixtures(events: Sequence[Event]) -> Mixture:
    return modes.stacked([event.mixture for event in events if event.mixture is not None])


def _update_modes(
    kind: str,
    radar: int,
    mixtures: Mixture,
    measures: Sequence[Measure],
    near: Sequence[Near | None],
    memory: Floats,
    model: Model,
) -> tuple[Mixture, NDArray[np.bool_], Floats]:
    """One group's update in every mode; what is remembered of the innovations is their mean over the modes."""
    assert model.modes is not None
    m = model.modes.count
    measures, near = [one for one in measures for _ in range(m)], [one for one in near for _ in range(m)]
    after, each, known = _update(kind, radar, mixtures.each(), measures, near, np.repeat(memory, m, axis=0), model)
    known = (mixtures.weight[:, :, None, None] * known.reshape(len(memory), m, *memory.shape[1:])).sum(axis=1)
    weighed, told = modes.weigh(mixtures, after, each, model.modes)
    return weighed, told.outlying, known


def _stacked(rows: Sequence[Floats]) -> Floats:
    """Arrays as the rows of one; a single one, the usual case, is not copied."""
    return rows[0][None] if len(rows) == 1 else np.array(rows)


def _group(measure: Measure, near: Near | None) -> tuple[str, int]:
    """Which measurements can be worked in together."""
    if isinstance(measure, Plot):
        return "plot", measure.radar
    if near is not None:
        return "literal", near[0]
    return ("fix", 0) if measure.local is None else ("in part", 0)


def _update(
    kind: str,
    radar: int,
    state: Estimate,
    measures: Sequence[Measure],
    near: Sequence[Near | None],
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """One group's update: the states after it, what the measurements told, the memories."""
    if kind == "plot":
        plots = [measure for measure in measures if isinstance(measure, Plot)]
        polar, sigma = np.array([plot.polar for plot in plots]), np.array([plot.sigma for plot in plots])
        after, told = update_with_plots(state, polar, sigma, model.radars[radar], model.together)
        return after, told, memory
    fixes = [measure for measure in measures if isinstance(measure, Fix)]
    position, sigma = _stacked([fix.enu_m for fix in fixes]), _stacked([fix.sigma_m for fix in fixes])
    if kind == "literal":
        seen = [one for one in near if one is not None]
        polar, spread = np.array([one[1] for one in seen]), np.array([one[2] for one in seen])
        after, told = update_literally(state, position, sigma, polar, spread, model.radars[radar], model.together)
        return after, told, memory
    speed_sigma = np.array([fix.velocity_sigma_mps for fix in fixes])
    if kind == "in part":
        parts = [fix.local for fix in fixes if fix.local is not None]
        return update_in_part(state, position, sigma, parts, speed_sigma, memory, model)
    velocity = _stacked([fix.velocity_mps for fix in fixes])
    return update_with_fixes(state, position, sigma, velocity, speed_sigma, memory, model)


def _start(measure: Measure, model: Model) -> Estimate:
    if isinstance(measure, Plot):
        return start_from_plots(np.array([measure.polar]), np.array([measure.sigma]), measure.radar, model)
    sigma = np.array([measure.velocity_sigma_mps])
    if measure.local is not None:
        return start_in_part(measure.enu_m[None], measure.sigma_m[None], measure.local, sigma, model)
    return start_from_fixes(measure.enu_m[None], measure.sigma_m[None], measure.velocity_mps[None], sigma, model)


def _event(
    measure: Measure,
    after: Estimate,
    row: int,
    memory: Floats,
    base: Event | None,
    outlying: bool,
    mixture: Mixture | None,
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
    mean, covariance = after.mean[row], after.covariance[row]
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
        mixture,
    )
