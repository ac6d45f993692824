"""Fixed-interval smoothing: what all measurements, the later ones too, say of a track at each of its instants.

It goes back over what a filter left behind, the states after each measurement, and needs no measurement again: `kalman`'s one
model by the smoother of Rauch, Tung and Striebel, several modes (`modes`) by the same for each pair of modes that follow
each other. Arrays are time first: t instants of n tracks in m modes (one for a single model).

Rauch, Tung, Striebel: with x, P after an instant, carried on by F with noise Q to F x, S = F P F' + Q, and x*, P* smoothed
at the next one,

    G = P F' S^-1,    x + G (x* - F x),    (I - G F) P (I - G F)' + G (Q + P*) G'

which is their formula in a form that stays positive whatever the rounding.

Modes: what the future says of the next instant, in mode i, is the Gaussian that takes the predicted N(m_i, S_i) to the smoothed
N(x*_i, P*_i): information B = P*^-1 - S_i^-1. Each mode j before it has its own prediction N(m_ji, S_ji), which that information
corrects, and by whose likelihood the pair counts beside the filter's own p(j | i); from there one step as above. The pairs of
a mode j are joined into one Gaussian again, like the filter's. All of it is done with S_i's root divided out, in which B is
diagonal and never negative.

Source: Rauch, Tung, Striebel (1965); the pairs are those of Blom and Bar-Shalom (1990) read backwards.
Decision: on 003's case this is better than the same without the likelihoods (Kim's weights, which lose the track where the
radar is noisy), than all modes' smoothed states taken as one, and than one smoother over the joined state; see
docs/decisions/smoothing.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.kalman import ERROR, SIZE, Estimate, Motion, carried
from gateway.estimators.modes import Modes, moved

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

AT_ONCE = 512  # instants x tracks whose transitions are worked out together: bounds memory
LEAST_INFORMATION = 1e-9  # of the future, in units of what is predicted: less is rounding
LEAST_SPREAD = 1e-13  # of a prediction in any direction, against its greatest
LEAST_PAIR = 1e-12  # of a pair of modes, against the filter's own weight: none is ever impossible


@dataclass(frozen=True, slots=True)
class States:
    """t instants of n tracks in m modes: mean (t, n, m, d), covariance (t, n, m, d, d), weight (t, n, m), which sums to 1."""

    mean: Floats
    covariance: Floats
    weight: Floats

    def combined(self) -> Estimate:
        """One Gaussian an instant and track, with the mixture's mean and covariance: (t, n, d) and (t, n, d, d)."""
        mean = (self.weight[..., None, :] @ self.mean)[..., 0, :]
        off = self.mean - mean[..., None, :]
        spread = self.covariance + off[..., :, None] * off[..., None, :]
        return Estimate(mean, (self.weight[..., None, None] * spread).sum(axis=-3))

    def between(self, first: int, last: int) -> States:
        """The instants from `first` up to `last`."""
        return States(self.mean[first:last], self.covariance[first:last], self.weight[first:last])


def smooth(filtered: States, elapsed_s: Floats, how: Motion | Modes, later: States | None = None) -> States:
    """The smoothed states of tracks from a filter's, (t, n, ...), with the times between them (t - 1, n), not negative.

    `how` they move is the filter's own: one motion for states of one mode, else the set of modes. `later` is what is known of
    the last instant, (1, n, ...), where smoothing has come to it already: a long track is smoothed in pieces that share
    an instant, the last piece first, with the bits of one go.
    """
    motions = [how] if isinstance(how, Motion) else [mode.motion for mode in how.modes]
    # Without an error allowed its covariance is zero, and no prediction could be divided by.
    live = np.arange(filtered.mean.shape[-1])
    if not any(motion.error_sigma_m for motion in motions):
        live = np.delete(live, ERROR)
    mean, covariance, weight = filtered.mean.copy(), filtered.covariance.copy(), filtered.weight.copy()
    if later is not None:
        mean[-1:], covariance[-1:], weight[-1:] = later.mean, later.covariance, later.weight
    smoothed = States(mean[..., live], _among(covariance, live), weight)
    steps, tracks = elapsed_s.shape
    piece = max(AT_ONCE // max(tracks, 1), 1)
    for end in range(steps, 0, -piece):
        begin = max(end - piece, 0)
        before, times = filtered.between(begin, end), elapsed_s[begin:end]
        if isinstance(how, Motion):
            _one_model(smoothed, begin, before, times, how, live)
        else:
            _many_modes(smoothed, begin, before, times, how, live)
    mean[..., live], covariance[..., live[:, None], live] = smoothed.mean, smoothed.covariance
    return States(mean, covariance, weight)


def _among(matrix: Floats, live: Ints) -> Floats:
    """The rows and columns of some states."""
    return matrix[..., live[:, None], live]


def _one_model(smoothed: States, begin: int, before: States, elapsed_s: Floats, motion: Motion, live: Ints) -> None:
    """Smooth some instants of one mode in place; the one after them is smoothed already."""
    shape = elapsed_s.shape
    steps = carried(motion, elapsed_s.ravel())
    carry, noise = (_among(part.reshape(*shape, SIZE, SIZE), live) for part in steps)
    mean, covariance = before.mean[:, :, 0, live], _among(before.covariance[:, :, 0], live)
    gain, rest, _ = _back(covariance, carry, noise)
    ahead = (carry @ mean[..., None])[..., 0]
    for step in range(len(elapsed_s) - 1, -1, -1):
        at, g = begin + step, gain[step]
        off = smoothed.mean[at + 1, :, 0] - ahead[step]
        smoothed.mean[at, :, 0] = mean[step] + (g @ off[..., None])[..., 0]
        smoothed.covariance[at, :, 0] = _even(rest[step] + g @ smoothed.covariance[at + 1, :, 0] @ g.swapaxes(-1, -2))


def _back(covariance: Floats, carry: Floats, noise: Floats) -> tuple[Floats, Floats, Floats]:
    """The gain G back over a step, the covariance that the next state leaves open, and that of the prediction."""
    cross = carry @ covariance
    ahead = _even(cross @ carry.swapaxes(-1, -2) + noise)
    scale = 1.0 / np.sqrt(np.diagonal(ahead, axis1=-2, axis2=-1))  # metres and metres a second side by side
    rows = scale[..., :, None]
    gain = (rows * np.linalg.solve(ahead * rows * scale[..., None, :], rows * cross)).swapaxes(-1, -2)
    kept = np.eye(covariance.shape[-1]) - gain @ carry
    turned = gain.swapaxes(-1, -2)
    return gain, kept @ covariance @ kept.swapaxes(-1, -2) + gain @ noise @ turned, ahead


def _even(matrix: Floats) -> Floats:
    return np.asarray(0.5 * (matrix + matrix.swapaxes(-1, -2)))


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Some steps of n tracks by pairs: mode i after the step, mode j before it. Predictions are in units of mode i's own.

    The unit is the root R of S_i, about m_i.
    """

    middle: Floats  # (t, n, m, 9) m_i
    unit: Floats  # (t, n, m, 9, 9) R^-1
    log_share: Floats  # (t, n, i, j) of the filter's p(j | i)
    off: Floats  # (t, n, i, j, 9) of m_ji
    spread: Floats  # (t, n, i, j, 9, 9) S_ji
    gain: Floats  # (t, n, i, j, 9, 9) from these units back to mode j's state
    rest: Floats  # (t, n, i, j, 9, 9)


def _pairs(before: States, elapsed_s: Floats, modes: Modes, live: Ints) -> _Pairs:
    shape, m = elapsed_s.shape, modes.count
    joint = before.weight[..., :, None] * modes.transition(elapsed_s.ravel()).reshape(*shape, m, m)
    weight = joint.sum(axis=-2)
    share = (joint / weight[..., None, :]).swapaxes(-1, -2)  # i, j
    whole, size = before.mean.shape[-1], len(live)
    mixed = (share @ before.mean).reshape(-1, m, whole)
    steps = moved(mixed, weight.reshape(-1, m), elapsed_s.ravel(), modes)
    carry, noise = (_among(part.reshape(*shape, m, 1, whole, whole), live) for part in steps)
    covariance = _among(before.covariance[:, :, None], live)
    gain, rest, spread = _back(covariance, carry, np.broadcast_to(noise, (*shape, m, m, size, size)))
    ahead = (carry @ before.mean[:, :, None][..., live, None])[..., 0]
    middle, joined = _joined(share, ahead, spread)
    root = _root(joined)
    unit = np.asarray(np.linalg.solve(root, np.broadcast_to(np.eye(size), root.shape)), dtype=np.float64)
    one = unit[..., None, :, :]
    off = (one @ (ahead - middle[..., None, :])[..., None])[..., 0]
    with np.errstate(divide="ignore"):  # over no time at all no mode follows another
        log_share = np.log(share)
    inner = _even(one @ spread @ one.swapaxes(-1, -2))
    return _Pairs(middle, unit, log_share, off, inner, gain @ root[..., None, :, :], rest)


def _root(covariance: Floats) -> Floats:
    """The lower root of covariances, also of those that rounding has left a little less than positive."""
    size = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    alike = _even(covariance) / (size[..., :, None] * size[..., None, :])
    return np.asarray(size[..., None] * np.linalg.cholesky(alike + LEAST_SPREAD * np.eye(covariance.shape[-1])))


def _joined(share: Floats, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """The Gaussian that matches k of them in shares (..., k), of means (..., k, s)."""
    joined = (share[..., None, :] @ mean)[..., 0, :]
    off = mean - joined[..., None, :]
    spread = covariance + off[..., :, None] * off[..., None, :]
    return joined, (share[..., None, None] * spread).sum(axis=-3)


def _many_modes(smoothed: States, begin: int, before: States, elapsed_s: Floats, modes: Modes, live: Ints) -> None:
    """Smooth some instants of several modes in place; the one after them is smoothed already."""
    pairs = _pairs(before, elapsed_s, modes, live)
    for step in range(len(elapsed_s) - 1, -1, -1):
        at, unit = begin + step, pairs.unit[step]
        moved_off = (unit @ (smoothed.mean[at + 1] - pairs.middle[step])[..., None])[..., 0]
        left = _even(unit @ smoothed.covariance[at + 1] @ unit.swapaxes(-1, -2))
        root, seen = _future(moved_off, left)
        off, spread, fit = _told(pairs.off[step], pairs.spread[step], root[..., None, :, :], seen[..., None, :])
        weight = _weights(pairs.log_share[step], fit, smoothed.weight[at + 1])
        gain = pairs.gain[step]
        mean = before.mean[step][:, None][..., live] + (gain @ (off - pairs.off[step])[..., None])[..., 0]
        covariance = pairs.rest[step] + gain @ spread @ gain.swapaxes(-1, -2)
        total = weight.sum(axis=-2)
        share = (weight / total[..., None, :]).swapaxes(-1, -2)  # j, i
        joined = _joined(share, mean.swapaxes(-2, -3), covariance.swapaxes(-3, -4))
        smoothed.mean[at], smoothed.covariance[at] = joined[0], _even(joined[1])
        smoothed.weight[at] = total


def _future(off: Floats, left: Floats) -> tuple[Floats, Floats]:
    """What the future measured of the next state: L (..., 9, 9), and what it found of L' x, with unit noise.

    From where it moved the state, (..., 9), and the covariance that it left, (..., 9, 9), in units of the prediction: what it
    left is no more than 1 in any direction, but for the joining of Gaussians.
    """
    share, axes = np.linalg.eigh(left)
    share = np.clip(share, LEAST_INFORMATION, 1.0)
    information = 1.0 / share - 1.0
    told = information > LEAST_INFORMATION
    root = np.sqrt(np.where(told, information, 1.0))
    along = (axes.swapaxes(-1, -2) @ off[..., None])[..., 0]
    return axes * np.where(told, root, 0.0)[..., None, :], np.where(told, along / (share * root), 0.0)


def _told(off: Floats, spread: Floats, root: Floats, seen: Floats) -> tuple[Floats, Floats, Floats]:
    """Gaussians (..., 9), (..., 9, 9) corrected by measurements of L' x with unit noise, and their log-likelihoods."""
    across = root.swapaxes(-1, -2)
    cross = spread @ root
    innovation = np.eye(spread.shape[-1]) + across @ cross
    wrong = (seen - (across @ off[..., None])[..., 0])[..., None]
    solved = np.linalg.solve(innovation, np.concatenate([wrong, cross.swapaxes(-1, -2)], axis=-1))
    gain = solved[..., 1:].swapaxes(-1, -2)
    kept = np.eye(spread.shape[-1]) - gain @ across
    after = kept @ spread @ kept.swapaxes(-1, -2) + gain @ gain.swapaxes(-1, -2)
    fit = (wrong.swapaxes(-1, -2) @ solved[..., :1])[..., 0, 0] + np.linalg.slogdet(innovation)[1]
    return off + (gain @ wrong)[..., 0], after, -0.5 * fit


def _weights(log_share: Floats, fit: Floats, weight: Floats) -> Floats:
    """How likely each pair (..., i, j) is, in all 1, from p(j | i), the pairs' likelihoods and the weights (..., i)."""
    likely = np.exp(fit - fit.max(axis=-1, keepdims=True))
    share = np.exp(log_share) * np.maximum(likely, LEAST_PAIR)
    pairs = share / share.sum(axis=-1, keepdims=True) * weight[..., None]
    return np.asarray(pairs / pairs.sum(axis=(-1, -2), keepdims=True))
