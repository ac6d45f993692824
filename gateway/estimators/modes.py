"""Interacting multiple models: one Kalman filter for each way of moving (straight, left, right), weighed by how it fits.

The state is `kalman`'s nine numbers, once a mode. Arrays are over n tracks and m modes; the filters of all modes of all
tracks run as one batch of n m rows, and the bits of one track do not depend on how many come along.

What tells the modes apart (`mode_set.Modes.rule`):

`imm`       the likelihood of the measurement: Blom's and Bar-Shalom's filter, eq 5 to 10, 14, 15
`rmimm`     the same, and a mode whose residuals have a mean that is not 0 counts less: a wrong mode is wrong to one side
`literal`   as printed: the likelihood over the norm of the mean of the last five residuals

Source: 000 2.1.2 eq 5 to 15.
Deviation: eq 11's mean residual is not defined in the print, and one over its norm is singular and depends on units.
`rmimm` takes the score, the derivative h' S^-1 y of the log-likelihood by the position, faded from update to update, with
its expected spread J = h' S^-1 h faded likewise, and weighs by (1 + s' J^-1 s)^(-1/2): whatever was measured counts by what
it says of the position, no unit matters, and the weight is at most 1 and never singular. The printed exception for a mean
residual of exactly 0 would throw out the mode that fits exactly; `literal` bounds the norm from below instead.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import lagging
from gateway.estimators.actual_error import carried_on, corrected, counted
from gateway.estimators.holding import WIDE, add_held, turn_along, usual
from gateway.estimators.kalman import SIZE, Estimate, Innovation
from gateway.estimators.kalman import update as update_each
from gateway.estimators.matching import matched
from gateway.estimators.mean_residual import excess, faded, in_metres, mean_size_m
from gateway.estimators.mixed_innovation import Told
from gateway.estimators.mixture import Mixture, combine, stacked, stated
from gateway.estimators.mode_set import Mode, Modes, Rule
from gateway.estimators.turning import carried

__all__ = [
    "Mixture",
    "Mode",
    "Modes",
    "Rule",
    "begin",
    "combine",
    "predict",
    "stacked",
    "stated",
    "update",
    "weigh",
]

Floats = NDArray[np.float64]

LEAST_WEIGHT = 1e-6  # of a mode: none is ever impossible
MEAN_PERIOD_S = 1.0  # the paper's period: in this time the mean counts once, however often it is measured
WINDOW = 5  # residuals that `literal` takes the mean of


def begin(state: Estimate, modes: Modes) -> Mixture:
    """Mixtures of n tracks that were just started: the modes in their shares."""
    n, m = len(state.mean), modes.count
    mean, covariance = state.mean, state.covariance
    if modes.acceleration is not None:
        level = state.mean[:, 3:5]
        speed = _speed(level)
        mean, covariance = np.zeros((n, WIDE)), np.zeros((n, WIDE, WIDE))
        mean[:, :SIZE], covariance[:, :SIZE, :SIZE] = state.mean, state.covariance
        covariance[:, SIZE:, SIZE:] = usual(_course(level, speed), speed, modes.acceleration)
    return Mixture(
        np.repeat(mean[:, None], m, axis=1),
        np.repeat(covariance[:, None], m, axis=1),
        np.repeat(modes.shares[None], n, axis=0),
        np.zeros((n, m, 3)),
        np.zeros((n, m, 3, 3)),
        np.zeros((n, 2, 3)),
        np.zeros((n, 2, 3, 3)),
        np.full((n, m, WINDOW if modes.rule == "literal" else 0, 3), math.nan),
        np.zeros(n),
        covariance.copy(),
        np.repeat(modes.shares[None], n, axis=0),
    )


def predict(mixture: Mixture, elapsed_s: Floats, modes: Modes, transition: Floats | None = None) -> Mixture:
    """The mixtures `elapsed_s` (n,), not negative, later: modes mix, then each moves in its own way.

    `transition` (n, m, m) stands in for the set's own where more is known of what comes next.
    Source: 000 2.1.2 eq 5 to 7. Deviation: eq 3 and 4 are lost in the print; see `turning.carried`.
    """
    chance = modes.transition(elapsed_s) if transition is None else transition
    joint = mixture.weight[:, :, None] * chance
    weight = np.add.reduce(joint, axis=1)
    mean, covariance = mixture.mean, mixture.covariance
    if modes.count > 1:
        mean, covariance = matched(joint / weight[:, None], mean, covariance)
    carry, noise = moved(mean, weight, elapsed_s, modes)
    mean = (carry @ mean[..., None])[..., 0]
    moved_on = carry @ covariance @ carry.swapaxes(-1, -2)
    moved_on += noise
    covariance = moved_on + moved_on.swapaxes(-1, -2)
    covariance *= 0.5
    return Mixture(
        mean=mean,
        covariance=covariance,
        weight=weight,
        score=mixture.score,
        information=mixture.information,
        whole_score=mixture.whole_score,
        whole_information=mixture.whole_information,
        recent=mixture.recent,
        elapsed_s=mixture.elapsed_s + elapsed_s,
        error=carried_on(mixture.error, weight, carry, noise),
        counted=counted(mixture.weight, modes.shares),
    )


def moved(mean: Floats, weight: Floats, elapsed_s: Floats, modes: Modes) -> tuple[Floats, Floats]:
    """Transition and noise (n, m, d, d) over times (n,) of modes that have mixed: means (n, m, d), weights (n, m)."""
    level = (weight[:, None, :] @ mean[:, :, 3:5])[:, 0]
    speed = _speed(level)
    rate = modes.turn_rate(speed)
    numbers, held = modes.numbers, modes.acceleration
    carry, noise = carried(numbers.shaken, elapsed_s, rate, SIZE if held is None else WIDE)
    course = _course(level, speed)
    if len(numbers.uneven):
        slow = np.minimum(speed[:, None] * modes.turn_rate_rps / numbers.across, 1.0)
        turn_along(noise, course, numbers.along, slow, numbers.uneven)
    if held is not None:
        add_held(carry, noise, elapsed_s, course, speed, held, numbers.holds)
    return carry, noise


def _speed(level: Floats) -> Floats:
    """Lengths (n,) of level velocities (n, 2)."""
    return np.asarray(np.sqrt(level[:, 0] * level[:, 0] + level[:, 1] * level[:, 1]))


def _course(level: Floats, speed: Floats) -> Floats:
    """Level velocities (n, 2) of lengths (n,) as directions of length 1; 0 of what stands."""
    return np.asarray(level / np.where(speed > 0.0, speed, np.inf)[:, None])


def update(
    mixture: Mixture,
    innovation: Floats,
    sensitivity: Floats,
    variance: Floats,
    modes: Modes,
    robust: float | None = None,
) -> tuple[Mixture, Told]:
    """One measurement for each of n tracks, by every mode: arrays over n m rows as in `kalman.update`."""
    after, told = update_each(mixture.each(), innovation, sensitivity, variance, robust, modes.count)
    return weigh(mixture, after, told, modes)


def weigh(mixture: Mixture, after: Estimate, told: Innovation, modes: Modes) -> tuple[Mixture, Told]:
    """The mixtures after an update of each mode, n m rows, of which the mixtures before it were `mixture`.

    The likelihoods are normalised once, as logarithms; no weight falls below a millionth.
    Source: 000 2.1.2 eq 10 to 12.
    """
    n, m = mixture.weight.shape
    _, log_determinant = np.linalg.slogdet(told.covariance)
    degrees = told.measured.sum(axis=1)
    likelihood = (-0.5 * (told.fit + log_determinant + degrees * math.log(2.0 * math.pi))).reshape(n, m)
    score, information, recent = mixture.score, mixture.information, mixture.recent
    log = np.log(mixture.weight) + likelihood
    if modes.rule == "rmimm":
        score, information = faded(score, information, told, modes.fade ** (mixture.elapsed_s / MEAN_PERIOD_S))
        share = np.minimum(mixture.elapsed_s / MEAN_PERIOD_S, 1.0)
        log -= (0.5 * share)[:, None] * np.log1p(excess(score, information))
    elif modes.rule == "literal":
        recent = np.concatenate([recent[:, :, 1:], in_metres(told).reshape(n, m, 1, 3)], axis=2)
        log -= np.log(mean_size_m(recent))
    weight = np.exp(log - np.maximum.reduce(log, axis=1, keepdims=True))
    weight = np.maximum(weight / np.add.reduce(weight, axis=1, keepdims=True), LEAST_WEIGHT)
    weight /= np.add.reduce(weight, axis=1, keepdims=True)
    mean, covariance = after.mean.reshape(n, m, -1), after.covariance.reshape(mixture.covariance.shape)
    whole = Told.of(mixture.weight, told, likelihood, mixture.error, mixture.counted)
    whole_score, whole_information = lagging.faded(
        mixture.whole_score,
        mixture.whole_information,
        whole.innovation,
        whole.scatter,
        whole.sensitivity,
        mixture.elapsed_s,
    )
    lag = lagging.lag(mixture.whole_score, mixture.whole_information, mixture.error)
    error = corrected(mixture.error, weight, told, mean, covariance)
    mixture_after = Mixture(
        mean,
        covariance,
        weight,
        score,
        information,
        whole_score,
        whole_information,
        recent,
        np.zeros(n),
        error,
        counted(weight, modes.shares),
    )
    return mixture_after, whole if lag is None else whole.lagging(lag)
