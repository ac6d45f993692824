"""What fuse asks of an estimator, and the two that keep Gaussians: one model of motion, or several that interact.

An estimator works on some tracks' events and returns the tracks' states in the one form that everybody else reads, mean
and covariance of position, velocity and source error. What else it keeps of a track is its own affair (`Event.belief`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gateway.align import Fix, Plot
from gateway.estimators import intent, modes
from gateway.estimators.kalman import SIZE, Estimate, Innovation, predict
from gateway.estimators.modes import Mixture, Modes
from gateway.fuse.events import Belief, Event, Measure, Near
from gateway.fuse.starting import start_from_fixes, start_from_plots, start_in_part
from gateway.fuse.weighting import (
    Model,
    update_in_part,
    update_literally,
    update_with_fixes,
    update_with_plots,
)

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

FAR_SIGMA = 6.0  # for each degree of freedom: twice where a measurement's pull begins to be bounded


@dataclass(frozen=True, slots=True)
class Group:
    """One measurement for each of n tracks that one formula serves: "fix", "in part", "literal", or "plot" of one radar."""

    kind: str
    radar: int
    measures: Sequence[Measure]
    near: Sequence[Near | None]
    elapsed_s: Floats  # (n,) since each track's state
    memory: Floats  # (n, w, 3) past innovations of the position source
    goal: Floats | None = None  # (n, 2) east and north of where it is said to go, NaN = nobody says; None = of nobody


@dataclass(frozen=True, slots=True)
class Advanced:
    """n tracks after a group of measurements, and what these told."""

    state: Estimate
    beliefs: Sequence[Belief]
    memory: Floats
    outlying: Bools  # (n,) so far out that the pull was bounded
    far: Bools  # (n,) so far out that a filter in order hardly ever sees it
    residual: tuple[Floats, Floats] | None = None  # (n, k): innovations, and by what they should scatter by


class Estimator(Protocol):
    """How tracks are begun, carried on and corrected. Tracks do not touch each other: any batching gives the same bits."""

    def begin(self, measure: Measure) -> tuple[Estimate, Belief]:
        """The first state, one row, from a report or a complete plot."""

    def advance(self, before: Sequence[Event], group: Group) -> Advanced:
        """Some tracks carried on from their events to a measurement each, and corrected."""

    def ahead(self, events: Sequence[Event], elapsed_s: Floats) -> tuple[Estimate, Floats]:
        """States a while (n,) after events, and the probabilities (n, 3) of straight, left and right, NaN = no modes."""

    def directions(self, event: Event) -> Floats:
        """Probabilities (3,) of flying straight, left and right; NaN = no modes."""


@dataclass(frozen=True, slots=True)
class SingleModel:
    """The Kalman filter of the one motion."""

    model: Model

    def begin(self, measure: Measure) -> tuple[Estimate, Belief]:
        """See `Estimator`."""
        return start_one(measure, self.model), None

    def advance(self, before: Sequence[Event], group: Group) -> Advanced:
        """See `Estimator`."""
        state = Estimate(stacked([event.mean for event in before]), stacked([event.covariance for event in before]))
        state = predict(state, group.elapsed_s, self.model.motion)
        after, told, memory = _update(group, state, group.measures, group.near, group.memory, self.model)
        far = told.normalised > FAR_SIGMA**2 * np.maximum(told.measured.sum(axis=1), 1)
        residual = None
        if group.kind != "literal":
            residual = _residual(told.innovation, told.covariance, told.measured)
        return Advanced(after, (None,) * len(before), memory, told.outlying, far, residual)

    def ahead(self, events: Sequence[Event], elapsed_s: Floats) -> tuple[Estimate, Floats]:
        """See `Estimator`."""
        mean = np.array([event.mean for event in events]).reshape(-1, SIZE)
        covariance = np.array([event.covariance for event in events]).reshape(-1, SIZE, SIZE)
        state = predict(Estimate(mean, covariance), elapsed_s, self.model.motion)
        return state, np.full((len(events), 3), np.nan)

    def directions(self, event: Event) -> Floats:
        """See `Estimator`."""
        return np.full(3, np.nan)


@dataclass(frozen=True, slots=True)
class InteractingModels:
    """The filter of several modes; what is remembered of the innovations is their mean over the modes."""

    model: Model
    modes: Modes

    def begin(self, measure: Measure) -> tuple[Estimate, Belief]:
        """See `Estimator`."""
        state = start_one(measure, self.model)
        return state, modes.begin(state, self.modes)

    def advance(self, before: Sequence[Event], group: Group) -> Advanced:
        """See `Estimator`."""
        m, n = self.modes.count, len(before)
        mixtures = _mixtures(before)
        mixtures = modes.predict(mixtures, group.elapsed_s, self.modes, self._changes(mixtures, before, group))
        measures, near = (
            [one for one in group.measures for _ in range(m)],
            [one for one in group.near for _ in range(m)],
        )
        memory = np.repeat(group.memory, m, axis=0)
        after, each, known = _update(group, mixtures.each(), measures, near, memory, self.model)
        known = (mixtures.weight[:, :, None, None] * known.reshape(n, m, *known.shape[1:])).sum(axis=1)
        mixtures, told = modes.weigh(mixtures, after, each, self.modes)
        nearest = each.normalised.reshape(n, m).min(axis=1)
        far = nearest > FAR_SIGMA**2 * np.maximum(each.measured.reshape(n, m, -1)[:, 0].sum(axis=1), 1)
        beliefs = [mixtures.row(i) for i in range(n)]
        residual = None
        if group.kind != "literal":  # a weight of a single residual squared leaves nothing to judge it by
            residual = _residual(told.innovation, told.scatter, each.measured[::m])
        return Advanced(modes.stated(mixtures), beliefs, known, told.outlying, far, residual)

    def _changes(self, mixtures: Mixture, before: Sequence[Event], group: Group) -> Floats | None:
        """The modes' transitions of tracks some of which fly at where they say they go; None where nobody says it."""
        if group.goal is None:
            return None
        mean = stacked([event.mean for event in before])
        off = intent.off_course(mean[:, :2], mean[:, 3:5], group.goal[:, None])[:, 0]
        return intent.transition(self.modes, group.elapsed_s, np.abs(off) <= intent.ALIGNED_RAD)

    def ahead(self, events: Sequence[Event], elapsed_s: Floats) -> tuple[Estimate, Floats]:
        """See `Estimator`."""
        if not events:
            return Estimate(np.zeros((0, SIZE)), np.zeros((0, SIZE, SIZE))), np.zeros((0, 3))
        mixtures = modes.predict(_mixtures(events), elapsed_s, self.modes)
        return modes.combine(mixtures), self.modes.directions(mixtures.weight)

    def directions(self, event: Event) -> Floats:
        """See `Estimator`."""
        return np.asarray(self.modes.directions(_mixtures([event]).weight)[0])


def _mixtures(events: Sequence[Event]) -> Mixture:
    return modes.stacked([event.mixture for event in events if event.mixture is not None])


def _residual(innovation: Floats, scatter: Floats, measured: Bools) -> tuple[Floats, Floats]:
    """Innovations (n, k), and the same by the roots of the diagonal of (n, k, k); NaN = not measured."""
    known = np.where(measured, innovation, np.nan)
    along = np.arange(innovation.shape[1])
    return known, known / np.sqrt(scatter[:, along, along])


def stacked(rows: Sequence[Floats]) -> Floats:
    """Arrays as the rows of one; a single one, the usual case, is not copied."""
    return rows[0][None] if len(rows) == 1 else np.array(rows)


def _update(
    group: Group,
    state: Estimate,
    measures: Sequence[Measure],
    near: Sequence[Near | None],
    memory: Floats,
    model: Model,
) -> tuple[Estimate, Innovation, Floats]:
    """One group's update: the states after it, what the measurements told, the memories."""
    if group.kind == "plot":
        plots = [measure for measure in measures if isinstance(measure, Plot)]
        polar, sigma = np.array([plot.polar for plot in plots]), np.array([plot.sigma for plot in plots])
        after, told = update_with_plots(state, polar, sigma, model.radars[group.radar], model.together)
        return after, told, memory
    fixes = [measure for measure in measures if isinstance(measure, Fix)]
    position, sigma = stacked([fix.enu_m for fix in fixes]), stacked([fix.sigma_m for fix in fixes])
    if group.kind == "literal":
        seen = [one for one in near if one is not None]
        polar, spread = np.array([one[1] for one in seen]), np.array([one[2] for one in seen])
        frame = model.radars[group.radar]
        after, told = update_literally(state, position, sigma, polar, spread, frame, model.together)
        return after, told, memory
    speed_sigma = np.array([fix.velocity_sigma_mps for fix in fixes])
    if group.kind == "in part":
        parts = [fix.local for fix in fixes if fix.local is not None]
        return update_in_part(state, position, sigma, parts, speed_sigma, memory, model)
    velocity = stacked([fix.velocity_mps for fix in fixes])
    return update_with_fixes(state, position, sigma, velocity, speed_sigma, memory, model)


def start_one(measure: Measure, model: Model) -> Estimate:
    """The first state of one track from a report or a complete plot."""
    if isinstance(measure, Plot):
        return start_from_plots(np.array([measure.polar]), np.array([measure.sigma]), measure.radar, model)
    sigma = np.array([measure.velocity_sigma_mps])
    if measure.local is not None:
        return start_in_part(measure.enu_m[None], measure.sigma_m[None], measure.local, sigma, model)
    return start_from_fixes(measure.enu_m[None], measure.sigma_m[None], measure.velocity_mps[None], sigma, model)
