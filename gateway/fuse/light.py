"""The alpha-beta-gamma filter as an estimator of the gateway: reports and plots as positions, axis by axis, for very many tracks.

The filter's state of a track is kept as one array, rows by axes, so that a batch is gathered in one copy. Paper 002-1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Fix, Plot
from gateway.estimators import alpha_beta_gamma as light
from gateway.estimators import fading, source_error
from gateway.estimators.alpha_beta_gamma import WINDOW, Tuning
from gateway.estimators.axis_covariance import Three
from gateway.estimators.axis_innovation import Innovation
from gateway.estimators.completed_plots import completed
from gateway.estimators.kalman import POSITION, SIZE, VELOCITY, Estimate
from gateway.frames import polar_from_xyz
from gateway.fuse.estimating import FAR_SIGMA, Advanced, Group, stacked, start_one
from gateway.fuse.events import Belief, Event, Measure
from gateway.fuse.weighting import Model, weigh_literally

Floats = NDArray[np.float64]

LONGEST_STEP_S = 10.0  # that an acceleration is held over, two reports of a slow source
FADES_IN_S = 2.0  # accelerations, while nothing is measured
_S, _V, _E = np.arange(3), np.arange(3, 6), np.arange(6, 9)


@dataclass(frozen=True, slots=True)
class LightFilter:
    """Constant acceleration with steady gains; a position source's error is followed beside it, where one is allowed."""

    model: Model
    tuning: Tuning

    def begin(self, measure: Measure) -> tuple[Estimate, Belief]:
        """See `Estimator`. The same first state as every other estimator's, each axis by itself."""
        first = start_one(measure, self.model)
        variance = first.covariance[:, _S, _S]
        by_source = np.zeros_like(variance)
        allowed_m = self.model.motion.error_sigma_m
        if isinstance(measure, Fix):
            by_source[:, : 3 if measure.has_height else 2] = 1.0
            variance = variance - by_source * allowed_m**2
        speed_variance = first.covariance[:, _V, _V]
        known = speed_variance < 0.5 * light.UNKNOWN_SPEED_MPS**2
        velocity = np.where(known, first.mean[:, VELOCITY], np.nan)
        sigma = np.sqrt(np.maximum(variance, 0.0))
        state = light.start(first.mean[:, POSITION], sigma, self.tuning, velocity, np.sqrt(speed_variance))
        state = _with_error(state, source_error.begun(by_source, allowed_m) if allowed_m else None)
        return _current(state), _packed(state)[0]

    def advance(self, before: Sequence[Event], group: Group) -> Advanced:
        """See `Estimator`."""
        state = self._carried(before, group.elapsed_s)
        memory = group.memory
        if group.kind in ("plot", "literal"):
            after, told = self._seen_by_radar(state, group)
        else:
            after, told, memory = self._reported(state, group)
        far = told.normalised > FAR_SIGMA**2 * np.maximum(told.measured.sum(axis=1), 1)
        return Advanced(_current(after), list(_packed(after)), memory, told.outlying, far)

    def ahead(self, events: Sequence[Event], elapsed_s: Floats) -> tuple[Estimate, Floats]:
        """See `Estimator`."""
        if not events:
            return Estimate(np.zeros((0, SIZE)), np.zeros((0, SIZE, SIZE))), np.zeros((0, 3))
        state = self._loosened(_unpacked(_rows(events)), elapsed_s)
        return _gaussian(*self._faded(state, elapsed_s)), np.full((len(events), 3), np.nan)

    def directions(self, event: Event) -> Floats:
        """See `Estimator`."""
        return np.full(3, np.nan)

    def _carried(self, events: Sequence[Event], elapsed_s: Floats) -> light.Estimate:
        """The filter's own step. Beyond a long one, nothing is known of the acceleration any more."""
        before = self._loosened(_unpacked(_rows(events)), elapsed_s)
        state = light.predict(before, elapsed_s)
        silent = (elapsed_s > LONGEST_STEP_S)[:, None]
        if not silent.any():
            return state
        (position, velocity, _), (ss, sv, vv), error = self._faded(before, elapsed_s)
        zero, sure = np.zeros_like(ss), np.full_like(ss, light.UNKNOWN_ACCELERATION_MPS2**2)
        return light.Estimate(
            np.where(silent, position, state.position),
            np.where(silent, velocity, state.velocity),
            np.where(silent, zero, state.acceleration),
            np.where(silent, np.stack([ss, sv, zero, vv, zero, sure]), state.terms),
            np.where(silent, zero, state.since_s),
            state.density,
            state.surprises,
            state.p,
            state.sped_s,
            None if error is None or state.error is None else np.where(silent, error, state.error),
        )

    def _faded(self, state: light.Estimate, elapsed_s: Floats) -> tuple[Three, Three, Floats | None]:
        """Means, ss, sv, vv and source errors a time later.

        The acceleration fades, and turns may follow that it tells nothing of: those of the one motion.
        """
        mean, (ss, sv, vv) = light.ahead(state, elapsed_s, FADES_IN_S)
        error, t = state.error, elapsed_s[:, None]
        if error is not None:
            done = fading.moved((error[0], error[1], error[2]), t, FADES_IN_S)
            error = np.stack([*done, error[3], error[4]])
        turns = np.array(self.model.motion.acceleration_density) * t
        return mean, (ss + turns * t * t / 3.0, sv + turns * t / 2.0, vv + turns), error

    def _loosened(self, state: light.Estimate, elapsed_s: Floats) -> light.Estimate:
        """The states with the source's error known less well than a time ago."""
        if state.error is None:
            return state
        motion = self.model.motion
        error = source_error.loosened(state.error, elapsed_s, motion.error_sigma_m, motion.error_time_constant_s)
        return _with_error(state, error)

    def _seen_by_radar(self, state: light.Estimate, group: Group) -> tuple[light.Estimate, Innovation]:
        """After plots of one radar, or after reports that were weighed literally against plots."""
        frame = self.model.radars[group.radar]
        if group.kind == "literal":
            fixes = [measure for measure in group.measures if isinstance(measure, Fix)]
            seen = [near for near in group.near if near is not None]
            position, sigma = stacked([fix.enu_m for fix in fixes]), stacked([fix.sigma_m for fix in fixes])
            polar, spread = np.array([one[1] for one in seen]), np.array([one[2] for one in seen])
            off, variance, _ = weigh_literally(state.position, position, sigma, polar, spread, frame)
            polar, spread = polar_from_xyz(frame.from_enu(state.position)) + off, np.sqrt(variance)
        else:
            plots = [measure for measure in group.measures if isinstance(measure, Plot)]
            polar, spread = np.array([plot.polar for plot in plots]), np.array([plot.sigma for plot in plots])
        position, sigma, share = completed(polar, spread, state.position, _position_variance(state), frame)
        return light.update(state, position, sigma, self.tuning, share=share)

    def _reported(self, state: light.Estimate, group: Group) -> tuple[light.Estimate, Innovation, Floats]:
        """After reports; what one lacks of its components is left out."""
        fixes = [measure for measure in group.measures if isinstance(measure, Fix)]
        position, sigma = stacked([fix.enu_m for fix in fixes]), stacked([fix.sigma_m for fix in fixes])
        velocity = stacked([fix.velocity_mps for fix in fixes])
        speed_sigma = np.array([fix.velocity_sigma_mps for fix in fixes])[:, None]
        by_source = np.ones_like(position)
        expected = state.position if state.error is None else state.position + state.error[3]
        off = position - expected
        if group.kind == "in part":
            has_height = np.array([fix.has_height for fix in fixes])
            off, faster = _in_part(fixes, off, state.velocity)
            velocity = state.velocity + faster
            known = _position_variance(state)[:, 2]
            off[:, 2], sigma = _held(off[:, 2], sigma, position[:, 2] - state.position[:, 2], known, has_height)
            by_source[:, 2] = has_height
        memory = group.memory
        if memory.shape[1]:
            remembered = np.concatenate([memory, off[:, None]], axis=1)
            square = np.where(np.isnan(remembered), 0.0, remembered * remembered)
            mean_square = square.sum(axis=1) / np.maximum((~np.isnan(remembered)).sum(axis=1), 1)
            sigma = np.sqrt(np.maximum(sigma * sigma, mean_square - _position_variance(state)))
            memory = remembered[:, 1:]
        after, told = light.update(
            state, state.position + off, sigma, self.tuning, velocity, speed_sigma, by_source=by_source
        )
        return after, told, memory


def _in_part(fixes: Sequence[Fix], off: Floats, velocity: Floats) -> tuple[Floats, Floats]:
    """Residuals of position and velocity (n, 3) of reports that lack components, NaN on the axes nearest to these.

    What is measured counts along the axes at the reported points, which are not quite those of the runway.
    """
    parts = [fix.local for fix in fixes if fix.local is not None]
    axes = np.array([part.from_enu for part in parts])
    has_height = np.array([part.has_height for part in parts])
    faster = np.array([part.velocity_mps for part in parts]) - (axes @ velocity[:, :, None])[:, :, 0]
    along = (axes @ off[:, :, None])[:, :, 0]
    along[~has_height, 2] = np.nan
    found = []
    for each in (along, faster):
        missing = np.isnan(each)
        back = axes.transpose(0, 2, 1) @ np.where(missing, 0.0, each)[:, :, None]
        found.append(np.where(missing, np.nan, back[:, :, 0]))
    return found[0], found[1]


def _held(
    off: Floats, sigma: Floats, guessed: Floats, variance: Floats, has_height: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """Vertical residuals (n,) and sigmas (n, 3) with guessed heights where the vertical is known worse than by the guess.

    It is brought to the guess's own sigma and no further, however often the guess is repeated.
    """
    guess = sigma[:, 2] * sigma[:, 2]
    loose = ~has_height & (variance > guess)
    noise = np.where(loose, variance * guess / np.where(loose, variance - guess, 1.0), guess)
    return np.where(loose, guessed, off), np.concatenate([sigma[:, :2], np.sqrt(noise)[:, None]], axis=1)


def _with_error(state: light.Estimate, error: Floats | None) -> light.Estimate:
    kept = state.terms, state.since_s, state.density, state.surprises, state.p, state.sped_s
    return light.Estimate(state.position, state.velocity, state.acceleration, *kept, error)


def _position_variance(state: light.Estimate) -> Floats:
    """(n, 3), with what the source's error is not known by."""
    own = light.own_terms(state)[0]
    return own if state.error is None else own + state.error[0] * state.error[0] * state.error[4]


def _current(state: light.Estimate) -> Estimate:
    mean = state.position, state.velocity, state.acceleration
    ss, sv, _, vv, _, _ = light.own_terms(state)
    return _gaussian(mean, (ss, sv, vv), state.error)


def _gaussian(mean: Three, own: Three, error: Floats | None) -> Estimate:
    """What everybody reads: position, velocity and source error, with their covariance."""
    ss, sv, vv = own
    covariance = np.zeros((len(ss), SIZE, SIZE))
    value = np.zeros_like(ss)
    if error is not None:
        place, speed, _, value, variance = error
        ss, sv, vv = ss + place * place * variance, sv + place * speed * variance, vv + speed * speed * variance
        covariance[:, _S, _E] = covariance[:, _E, _S] = place * variance
        covariance[:, _V, _E] = covariance[:, _E, _V] = speed * variance
        covariance[:, _E, _E] = variance
    covariance[:, _S, _S], covariance[:, _V, _V] = ss, vv
    covariance[:, _S, _V] = covariance[:, _V, _S] = sv
    return Estimate(np.concatenate([mean[0], mean[1], value], axis=1), covariance)


def _rows(events: Sequence[Event]) -> list[Floats]:
    return [event.belief for event in events if isinstance(event.belief, np.ndarray)]


def _packed(state: light.Estimate) -> Floats:
    """States as one array (n, k, 3)."""
    single = (state.position, state.velocity, state.acceleration, state.since_s, state.density, state.p, state.sped_s)
    several = (state.terms, state.surprises) if state.error is None else (state.terms, state.surprises, state.error)
    return np.ascontiguousarray(np.concatenate([np.stack(single), *several]).transpose(1, 0, 2))


def _unpacked(rows: Sequence[Floats]) -> light.Estimate:
    """The states of some tracks, each (k, 3), as one."""
    whole = rows[0][:, None] if len(rows) == 1 else np.stack(rows, axis=1)
    position, velocity, acceleration, since_s, density, p, sped_s = whole[:7]
    terms, surprises, error = whole[7:13], whole[13 : 13 + WINDOW], whole[13 + WINDOW :]
    kept = terms, since_s, density, surprises, p, sped_s
    return light.Estimate(position, velocity, acceleration, *kept, error if len(error) else None)
