"""Interacting multiple models: one Kalman filter for each way of moving (straight, left, right), weighed by how it fits.

The state is `kalman`'s nine numbers, once a mode. Arrays are over n tracks and m modes; the filters of all modes of all
tracks run as one batch of n m rows, and the bits of one track do not depend on how many come along.

What tells the modes apart (`Modes.rule`):

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
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.actual_error import carried_on, corrected
from gateway.estimators.kalman import SIZE, Estimate, Innovation, Motion
from gateway.estimators.kalman import update as update_each
from gateway.estimators.mean_residual import excess, faded, in_metres, mean_size_m
from gateway.estimators.mixed_innovation import Told
from gateway.estimators.turning import carried

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Rule = Literal["imm", "rmimm", "literal"]

GRAVITY_MPS2 = 9.80665
LEAST_SPEED_MPS = 5.0  # below it a bank says nothing of the turn rate
LEAST_WEIGHT = 1e-6  # of a mode: none is ever impossible
MEAN_PERIOD_S = 1.0  # the paper's period: in this time the mean counts once, however often it is measured
WINDOW = 5  # residuals that `literal` takes the mean of


@dataclass(frozen=True, slots=True)
class Mode:
    """One way of moving. `turn` is a multiple of the set's turn rate: 0 is straight, positive to the left.

    `share` is how much of its time an aircraft spends so, against the other modes'.
    """

    turn: float
    motion: Motion
    share: float = 1.0


@dataclass(frozen=True, slots=True)
class Modes:
    """A set of modes and how they follow each other.

    The turn rate is `turn_rate_rps`, or that of a level turn at `bank_rad` where this is more: 3 degrees/s is a standard
    turn of an airliner, while a drone of 15 m/s turns at 20.
    """

    modes: tuple[Mode, ...]
    rule: Rule = "rmimm"
    lasts_s: float = 22.0  # mean time until the mode is drawn anew; of three equal ones, each is left after 33 s
    turn_rate_rps: float = math.radians(3.0)
    bank_rad: float = math.radians(30.0)
    fade: float = 0.92  # of the residuals' mean, over MEAN_PERIOD_S

    @property
    def count(self) -> int:
        """How many modes there are."""
        return len(self.modes)

    def turn_rate(self, speed_mps: Floats) -> Floats:
        """Turn rate (n, m) in rad/s, positive to the left, of each mode at level speeds (n,)."""
        banked = GRAVITY_MPS2 * math.tan(self.bank_rad) / np.maximum(speed_mps, LEAST_SPEED_MPS)
        turns = np.array([mode.turn for mode in self.modes])
        return np.asarray(np.maximum(banked, self.turn_rate_rps)[:, None] * turns)

    def directions(self, weight: Floats) -> Floats:
        """Probabilities (n, 3) of flying straight, turning left, turning right, from the modes' weights (n, m)."""
        sides = np.sign([mode.turn for mode in self.modes])
        return np.stack([(weight * (sides == side)).sum(axis=1) for side in (0.0, 1.0, -1.0)], axis=1)

    def transition(self, elapsed_s: Floats) -> Floats:
        """Probabilities (n, m, m) of being in mode j after times (n,), having been in mode i.

        At a constant rate the mode is drawn anew, by the modes' shares, so that two short times equal one long one.
        Source: 000 2.1.2, p_ij. Deviation: of the time since the last update, never of a fixed period.
        """
        keep = np.exp(elapsed_s / -self.lasts_s)[:, None, None]
        return np.asarray(keep * np.eye(self.count) + (1.0 - keep) * self.shares)

    @property
    def shares(self) -> Floats:
        """How much of its time an aircraft spends in each mode, (m,), in all 1."""
        shares = np.array([mode.share for mode in self.modes])
        return np.asarray(shares / shares.sum())


@dataclass(frozen=True, slots=True)
class Mixture:
    """n tracks in m modes: mean (n, m, 9), covariance (n, m, 9, 9), weight (n, m), which sums to 1.

    What is remembered of the residuals: their faded score (n, m, 3) with its information (n, m, 3, 3), and for `literal` the
    last ones in metres (n, m, 5, 3), NaN before they are (for the other rules there is none).
    """

    mean: Floats
    covariance: Floats
    weight: Floats
    score: Floats
    information: Floats
    recent: Floats
    elapsed_s: Floats  # (n,) since the last measurement
    error: Floats  # (n, 9, 9) of the combined state, as `actual_error` has it
    unmixed: Floats  # (n, m) the weights before the modes last mixed

    def each(self) -> Estimate:
        """The modes' states as n m rows, those of one track together."""
        return Estimate(self.mean.reshape(-1, SIZE), self.covariance.reshape(-1, SIZE, SIZE))

    def row(self, place: int) -> Mixture:
        """One of the tracks, as a mixture of one."""
        one = slice(place, place + 1)
        return Mixture(
            self.mean[one],
            self.covariance[one],
            self.weight[one],
            self.score[one],
            self.information[one],
            self.recent[one],
            self.elapsed_s[one],
            self.error[one],
            self.unmixed[one],
        )


def stacked(rows: Sequence[Mixture]) -> Mixture:
    """Mixtures of some tracks as one."""
    if len(rows) == 1:
        return rows[0]
    return Mixture(
        np.concatenate([row.mean for row in rows]),
        np.concatenate([row.covariance for row in rows]),
        np.concatenate([row.weight for row in rows]),
        np.concatenate([row.score for row in rows]),
        np.concatenate([row.information for row in rows]),
        np.concatenate([row.recent for row in rows]),
        np.concatenate([row.elapsed_s for row in rows]),
        np.concatenate([row.error for row in rows]),
        np.concatenate([row.unmixed for row in rows]),
    )


def begin(state: Estimate, modes: Modes) -> Mixture:
    """Mixtures of n tracks that were just started: the modes in their shares."""
    n, m = len(state.mean), modes.count
    return Mixture(
        np.repeat(state.mean[:, None], m, axis=1),
        np.repeat(state.covariance[:, None], m, axis=1),
        np.repeat(modes.shares[None], n, axis=0),
        np.zeros((n, m, 3)),
        np.zeros((n, m, 3, 3)),
        np.full((n, m, WINDOW if modes.rule == "literal" else 0, 3), math.nan),
        np.zeros(n),
        state.covariance.copy(),
        np.repeat(modes.shares[None], n, axis=0),
    )


def combine(mixture: Mixture) -> Estimate:
    """One Gaussian a track with the mixture's mean and covariance. Source: 000 2.1.2 eq 14, 15."""
    mean, covariance = _matched(mixture.weight[:, :, None], mixture.mean, mixture.covariance)
    return Estimate(mean[:, 0], covariance[:, 0])


def stated(mixture: Mixture) -> Estimate:
    """What is told of each track: the mixture's mean, with the covariance of the error that it really has.

    `combine` has the covariance that the filter reckons with.
    """
    mean, spread = _spread(mixture.weight[:, :, None], mixture.mean)
    return Estimate(mean[:, 0], mixture.error + spread[:, 0])


def predict(mixture: Mixture, elapsed_s: Floats, modes: Modes, transition: Floats | None = None) -> Mixture:
    """The mixtures `elapsed_s` (n,), not negative, later: modes mix, then each moves in its own way.

    `transition` (n, m, m) stands in for the set's own where more is known of what comes next.
    Source: 000 2.1.2 eq 5 to 7. Deviation: eq 3 and 4 are lost in the print; see `turning.carried`.
    """
    chance = modes.transition(elapsed_s) if transition is None else transition
    joint = mixture.weight[:, :, None] * chance
    weight = joint.sum(axis=1)
    mean, covariance = mixture.mean, mixture.covariance
    if modes.count > 1:
        mean, covariance = _matched(joint / weight[:, None], mean, covariance)
    carry, noise = moved(mean, weight, elapsed_s, modes)
    mean = (carry @ mean[..., None])[..., 0]
    covariance = carry @ covariance @ carry.swapaxes(-1, -2) + noise
    covariance = 0.5 * (covariance + covariance.swapaxes(-1, -2))
    passed_s = mixture.elapsed_s + elapsed_s
    error, before = carried_on(mixture.error, weight, carry, noise), mixture.weight
    return Mixture(
        mean, covariance, weight, mixture.score, mixture.information, mixture.recent, passed_s, error, before
    )


def moved(mean: Floats, weight: Floats, elapsed_s: Floats, modes: Modes) -> tuple[Floats, Floats]:
    """Transition and noise (n, m, 9, 9) over times (n,) of modes that have mixed: means (n, m, 9), weights (n, m)."""
    level = (weight[:, None, :] @ mean[:, :, 3:5])[:, 0]
    rate = modes.turn_rate(np.sqrt(level[:, 0] * level[:, 0] + level[:, 1] * level[:, 1]))
    return carried([mode.motion for mode in modes.modes], elapsed_s, rate)


def held(mixture: Mixture, elapsed_s: Floats, modes: Modes) -> Estimate:
    """The states `elapsed_s` (n,) later if each track goes on in the mode that is likeliest now.

    A look far ahead is not an average of turning round to the left and to the right.
    """
    ahead = predict(mixture, elapsed_s, modes, np.eye(modes.count)[None])
    rows, likeliest = np.arange(len(elapsed_s)), mixture.weight.argmax(axis=1)
    return Estimate(ahead.mean[rows, likeliest], ahead.covariance[rows, likeliest])


def _matched(share: Floats, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Means (n, j, 9) and covariances (n, j, 9, 9) of the Gaussians that match m ones in shares (n, m, j)."""
    matched, spread = _spread(share, mean)
    n, m, j = share.shape
    within = share.transpose(0, 2, 1) @ covariance.reshape(n, m, SIZE * SIZE)
    return matched, np.asarray(spread + within.reshape(n, j, SIZE, SIZE))


def _spread(share: Floats, mean: Floats) -> tuple[Floats, Floats]:
    """Means (n, j, 9) of m ones in shares (n, m, j), and how they lie about these, (n, j, 9, 9)."""
    across = share.transpose(0, 2, 1)
    middle = across @ mean
    off = (mean[:, None] - middle[:, :, None]) * np.sqrt(across)[..., None]
    return middle, off.swapaxes(-1, -2) @ off


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
    column = told.innovation[:, :, None]
    fit = (column.transpose(0, 2, 1) @ told.inverse @ column)[:, 0, 0]
    _, log_determinant = np.linalg.slogdet(told.covariance)
    degrees = told.measured.sum(axis=1)
    likelihood = (-0.5 * (fit + log_determinant + degrees * math.log(2.0 * math.pi))).reshape(n, m)
    score, information, recent = mixture.score, mixture.information, mixture.recent
    log = np.log(mixture.weight) + likelihood
    if modes.rule == "rmimm":
        score, information = faded(score, information, told, modes.fade ** (mixture.elapsed_s / MEAN_PERIOD_S))
        share = np.minimum(mixture.elapsed_s / MEAN_PERIOD_S, 1.0)
        log -= (0.5 * share)[:, None] * np.log1p(excess(score, information))
    elif modes.rule == "literal":
        recent = np.concatenate([recent[:, :, 1:], in_metres(told).reshape(n, m, 1, 3)], axis=2)
        log -= np.log(mean_size_m(recent))
    weight = np.exp(log - log.max(axis=1, keepdims=True))
    weight = np.maximum(weight / weight.sum(axis=1, keepdims=True), LEAST_WEIGHT)
    weight /= weight.sum(axis=1, keepdims=True)
    mean, covariance = after.mean.reshape(n, m, SIZE), after.covariance.reshape(n, m, SIZE, SIZE)
    _, reckoned = _matched(weight[:, :, None], mean, covariance)
    error = corrected(mixture.error, weight, told, reckoned[:, 0])
    mixture_after = Mixture(mean, covariance, weight, score, information, recent, np.zeros(n), error, weight)
    return mixture_after, Told(mixture.weight, told, likelihood, mixture.error, mixture.unmixed)
