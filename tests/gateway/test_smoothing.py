"""The smoother against a batch solution, against the textbook, and against every sequence of modes worked out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.estimators import kalman, modes
from gateway.estimators.kalman import SIZE, Estimate, Motion, carried
from gateway.estimators.modes import Mode, Modes
from gateway.estimators.smoothing import States, smooth

Floats = NDArray[np.float64]

MOTION = Motion((1.6, 1.6, 0.4), 30.0)
SENSITIVITY = np.concatenate([np.eye(3), np.zeros((3, 3)), np.eye(3)], axis=1)[None]
VARIANCE = np.full((1, 3), 15.0**2)
SURE = np.concatenate([np.eye(3), np.zeros((3, 6))], axis=1)[None]  # a source without an error of its own


def begun() -> Estimate:
    """A first state that is known in part."""
    place = np.array([[100.0, -50.0, 20.0]])
    return kalman.start(place, 400.0 * np.eye(3)[None], np.array([[60.0, 5.0, -3.0]]), np.array([20.0]), 30.0)


def measured(count: int, seed: int = 1) -> tuple[Floats, Floats]:
    """Irregular times between instants (count,) and what was measured at each, (count, 3)."""
    generator = np.random.default_rng(seed)
    elapsed = generator.uniform(0.3, 2.0, count)
    path = np.cumsum(elapsed)[:, None] * [60.0, 5.0, -3.0] + [120.0, -40.0, 25.0]
    return elapsed, path + generator.normal(0.0, 15.0, (count, 3))


def taken_turns(step: int) -> Floats:
    """Which source measures: one with an error and one without, in turns."""
    return SENSITIVITY if step % 2 else SURE


def filtered(motion: Motion, elapsed: Floats, told: Floats) -> Estimate:
    """The Kalman filter's states after the first and after each measurement."""
    state = begun()
    means, covariances = [state.mean], [state.covariance]
    for step, (time, position) in enumerate(zip(elapsed, told, strict=True)):
        state = kalman.predict(state, np.array([time]), motion)
        sensitivity = taken_turns(step)
        off = position - (sensitivity @ state.mean[:, :, None])[:, :, 0]
        state, _ = kalman.update(state, off, sensitivity, VARIANCE)
        means.append(state.mean)
        covariances.append(state.covariance)
    return Estimate(np.array(means), np.array(covariances))


def one_mode(state: Estimate) -> States:
    return States(state.mean[:, :, None], state.covariance[:, :, None], np.ones((*state.mean.shape[:2], 1)))


def batch_solution(motion: Motion, elapsed: Floats, told: Floats) -> tuple[Floats, Floats]:
    """Every state at once: the joint Gaussian of all instants, conditioned on all measurements."""
    first, count = begun(), len(elapsed) + 1
    mean, joint = [first.mean[0]], np.zeros((count * SIZE, count * SIZE))
    joint[:SIZE, :SIZE] = first.covariance[0]
    for step, time in enumerate(elapsed):
        carry, noise = (part[0] for part in carried(motion, np.array([time])))
        now, then = slice(step * SIZE, (step + 1) * SIZE), slice((step + 1) * SIZE, (step + 2) * SIZE)
        mean.append(carry @ mean[-1])
        joint[then, : then.start] = carry @ joint[now, : then.start]
        joint[: then.start, then] = joint[then, : then.start].T
        joint[then, then] = carry @ joint[now, now] @ carry.T + noise
    sensitivity = np.zeros((len(elapsed) * 3, count * SIZE))
    for step in range(len(elapsed)):
        sensitivity[3 * step : 3 * step + 3, (step + 1) * SIZE : (step + 2) * SIZE] = taken_turns(step)[0]
    flat = np.concatenate(mean)
    innovation = sensitivity @ joint @ sensitivity.T + VARIANCE[0, 0] * np.eye(len(sensitivity))
    gain = np.linalg.solve(innovation, sensitivity @ joint).T
    flat = flat + gain @ (told.ravel() - sensitivity @ flat)
    left = joint - gain @ sensitivity @ joint
    blocks = [left[i * SIZE : (i + 1) * SIZE, i * SIZE : (i + 1) * SIZE] for i in range(count)]
    return flat.reshape(count, SIZE), np.array(blocks)


def test_it_is_the_batch_solution() -> None:
    """Mean and covariance of every instant are those of all states solved for at once, to 1e-9."""
    elapsed, told = measured(12)
    found = smooth(one_mode(filtered(MOTION, elapsed, told)), elapsed[:, None], MOTION)
    mean, covariance = batch_solution(MOTION, elapsed, told)
    np.testing.assert_allclose(found.mean[:, 0, 0], mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.covariance[:, 0, 0], covariance, rtol=1e-9, atol=1e-9 * covariance.max())


def test_it_is_the_textbook() -> None:
    """The same as Rauch, Tung and Striebel's formulas with inverses, on a long track, to 1e-9."""
    elapsed, told = measured(300)
    state = filtered(MOTION, elapsed, told)
    found = smooth(one_mode(state), elapsed[:, None], MOTION)
    mean, covariance = state.mean[-1, 0], state.covariance[-1, 0]
    for step in range(len(elapsed) - 1, -1, -1):
        carry, noise = (part[0] for part in carried(MOTION, elapsed[step : step + 1]))
        x, p = state.mean[step, 0], state.covariance[step, 0]
        ahead = carry @ p @ carry.T + noise
        gain = p @ carry.T @ np.linalg.inv(ahead)
        mean, covariance = x + gain @ (mean - carry @ x), p + gain @ (covariance - ahead) @ gain.T
        np.testing.assert_allclose(found.mean[step, 0, 0], mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found.covariance[step, 0, 0], covariance, rtol=1e-8, atol=1e-9 * p.max())


def test_later_measurements_only_tell_more() -> None:
    """No smoothed covariance exceeds the filtered one in any direction, and each is symmetric and positive."""
    elapsed, told = measured(200)
    state = filtered(MOTION, elapsed, told)
    found = smooth(one_mode(state), elapsed[:, None], MOTION).covariance[:, 0, 0]
    assert (found == found.swapaxes(-1, -2)).all()
    assert np.linalg.eigvalsh(found).min() > 0.0
    assert np.linalg.eigvalsh(state.covariance[:, 0] - found).min() > -1e-8


def test_without_an_error_allowed_its_states_stay_nothing() -> None:
    """With no source error the three states are 0 before and after, and the others are smoothed all the same."""
    motion, first = Motion((1.6, 1.6, 0.4), 0.0), begun()
    elapsed, told = measured(10)
    state = filtered(motion, elapsed, told)
    state.mean[:, :, 6:] = state.covariance[:, :, 6:] = state.covariance[:, :, :, 6:] = 0.0
    found = smooth(one_mode(state), elapsed[:, None], motion)
    assert not found.mean[..., 6:].any()
    assert not found.covariance[..., 6:].any()
    assert found.covariance[0, 0, 0, 0, 0] < 0.9 * first.covariance[0, 0, 0]


def mixed(chosen: Modes, elapsed: Floats, told: Floats) -> States:
    """The interacting modes' states after the first and after each measurement."""
    mixture = modes.begin(begun(), chosen)
    kept = [mixture]
    for step, (time, position) in enumerate(zip(elapsed, told, strict=True)):
        mixture = modes.predict(mixture, np.array([time]), chosen)
        rows, sensitivity = mixture.each(), taken_turns(step)
        off = position - (sensitivity @ rows.mean[:, :, None])[:, :, 0]
        variance = np.repeat(VARIANCE, chosen.count, axis=0)
        mixture, _ = modes.update(mixture, off, sensitivity, variance, chosen)
        kept.append(mixture)
    mean, covariance = np.array([one.mean for one in kept]), np.array([one.covariance for one in kept])
    return States(mean, covariance, np.array([one.weight for one in kept]))


CALM, ROUGH = Motion((0.05, 0.05, 0.05), 30.0), Motion((20.0, 20.0, 20.0), 30.0)
THREE = Modes((Mode(0.0, CALM, 2.0), Mode(0.0, ROUGH), Mode(1.0, CALM)), rule="imm", lasts_s=8.0)


def test_a_set_of_one_mode_is_the_one_model() -> None:
    """Pairs of modes reduce to Rauch, Tung and Striebel where there is one mode, to 1e-8 of its sigma."""
    elapsed, told = measured(60)
    alone = Modes((Mode(0.0, MOTION),), rule="imm")
    state = mixed(alone, elapsed, told)
    found, known = smooth(state, elapsed[:, None], alone), smooth(state, elapsed[:, None], MOTION)
    sigma = np.sqrt(np.diagonal(known.covariance, axis1=-2, axis2=-1))
    assert (np.abs(found.mean - known.mean) / sigma).max() < 1e-8
    np.testing.assert_allclose(found.covariance, known.covariance, rtol=1e-7, atol=1e-8)


def test_modes_that_never_follow_each_other_are_smoothed_alone() -> None:
    """Where a mode never ends, each is its own smoother, and at every instant counts as much as it does in the end."""
    elapsed, told = measured(25)
    chosen = Modes((Mode(0.0, CALM), Mode(0.0, ROUGH)), rule="imm", lasts_s=1e12)
    state = mixed(chosen, elapsed, told)
    found = smooth(state, elapsed[:, None], chosen)
    np.testing.assert_allclose(found.weight, np.broadcast_to(state.weight[-1], found.weight.shape), atol=1e-6)
    for place, motion in enumerate((CALM, ROUGH)):
        alone = States(*(part[:, :, place : place + 1] for part in (state.mean, state.covariance)), np.ones((26, 1, 1)))
        known = smooth(alone, elapsed[:, None], motion)
        np.testing.assert_allclose(found.mean[:, :, place], known.mean[:, :, 0], atol=1e-3)


def every_sequence(chosen: Modes, elapsed: Floats, told: Floats) -> tuple[Floats, Floats]:
    """The exact smoothed means (t, 9) and weights (t, m): a Kalman filter and a smoother for each sequence of modes."""
    means, weights, logs = [], [], []
    shares = chosen.shares
    chance = chosen.transition(elapsed)
    for sequence in itertools.product(range(chosen.count), repeat=len(elapsed) + 1):
        log = np.log(shares[sequence[0]])
        state, states, carries = begun(), [begun()], []
        for step, time in enumerate(elapsed):
            motion = chosen.modes[sequence[step + 1]].motion
            log += np.log(chance[step, sequence[step], sequence[step + 1]])
            state = kalman.predict(state, np.array([time]), motion)
            sensitivity = taken_turns(step)
            off = told[step] - (sensitivity @ state.mean[:, :, None])[:, :, 0]
            state, heard = kalman.update(state, off, sensitivity, VARIANCE)
            log += heard.log_likelihood[0]
            states.append(state)
            carries.append(tuple(part[0] for part in carried(motion, np.array([time]))))
        mean = states[-1].mean[0]
        track = [mean]
        for before, (carry, noise) in zip(states[-2::-1], carries[::-1], strict=True):
            ahead = carry @ before.covariance[0] @ carry.T + noise
            gain = before.covariance[0] @ carry.T @ np.linalg.inv(ahead)
            mean = before.mean[0] + gain @ (mean - carry @ before.mean[0])
            track.append(mean)
        means.append(np.array(track[::-1]))
        weights.append(np.eye(chosen.count)[list(sequence)])
        logs.append(log)
    share = np.exp(np.array(logs) - max(logs))
    share /= share.sum()
    return np.einsum("s,stx->tx", share, np.array(means)), np.einsum("s,stm->tm", share, np.array(weights))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_comes_close_to_every_sequence_of_modes(seed: int) -> None:
    """On seven instants, against all 128 sequences worked out: positions to 0.15 of what smoothing changed, weights to 0.1."""
    elapsed, told = measured(6, seed)
    told[3:] += [0.0, 60.0, 0.0]  # something happens that only one of the modes allows
    chosen = Modes((Mode(0.0, CALM), Mode(0.0, ROUGH)), rule="imm", lasts_s=8.0)
    state = mixed(chosen, elapsed, told)
    found = smooth(state, elapsed[:, None], chosen)
    mean, weight = every_sequence(chosen, elapsed, told)
    changed = np.abs(state.combined().mean[:, 0, :3] - mean[:, :3]).max()
    assert np.abs(found.combined().mean[:, 0, :3] - mean[:, :3]).max() < 0.15 * changed
    assert np.abs(found.weight[:, 0] - weight).max() < 0.1


def test_smoothed_modes_are_proper() -> None:
    """Weights sum to 1, covariances are symmetric and positive, though a mode has all but died out."""
    elapsed, told = measured(150)
    found = smooth(mixed(THREE, elapsed, told), elapsed[:, None], THREE)
    np.testing.assert_allclose(found.weight.sum(axis=-1), 1.0, rtol=1e-12)
    assert (found.covariance == found.covariance.swapaxes(-1, -2)).all()
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    assert np.linalg.eigvalsh(found.combined().covariance).min() > 0.0


@pytest.mark.parametrize("cut", [1, 37, 99])
def test_pieces_are_the_whole(cut: int) -> None:
    """A long track smoothed in two pieces, the last one first, has the bits of one go; one model and several."""
    elapsed, told = measured(100)
    for state, how in ((one_mode(filtered(MOTION, elapsed, told)), MOTION), (mixed(THREE, elapsed, told), THREE)):
        whole = smooth(state, elapsed[:, None], how)
        last = smooth(state.between(cut, 101), elapsed[cut:, None], how)
        first = smooth(state.between(0, cut + 1), elapsed[:cut, None], how, last.between(0, 1))
        assert (first.mean == whole.mean[: cut + 1]).all()
        assert (first.covariance == whole.covariance[: cut + 1]).all()
        assert (last.weight == whole.weight[cut:]).all()


def test_many_tracks_are_one_by_one() -> None:
    """The bits of a track do not depend on how many come along; one model and several."""
    each = [measured(40, seed) for seed in range(5)]
    elapsed = np.stack([one for one, _ in each], axis=1)
    for how in (MOTION, THREE):
        alone = [mixed(how, *one) if isinstance(how, Modes) else one_mode(filtered(how, *one)) for one in each]
        parts = ("mean", "covariance", "weight")
        together = States(*(np.concatenate([getattr(one, part) for one in alone], axis=1) for part in parts))
        found = smooth(together, elapsed, how)
        for place, one in enumerate(alone):
            single = smooth(one, elapsed[:, place : place + 1], how)
            assert (found.mean[:, place] == single.mean[:, 0]).all()
            assert (found.covariance[:, place] == single.covariance[:, 0]).all()
