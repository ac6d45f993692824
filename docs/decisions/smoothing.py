"""How the tracks of several modes are smoothed: four ways, measured on paper 003's approach.

python docs/decisions/smoothing.py [RUNS]        # a few minutes
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.estimators.modes import Modes, moved
from gateway.estimators.smoothing import States, smooth
from gateway.offline.pieces import arrays_of, state_of
from gateway.settings import EstimatorName
from sim.cases import Case, case_003
from sim.studies.fusion import START, Accuracy, accuracy_of, filtered

Floats = NDArray[np.float64]
Way = Callable[[States, Floats, Modes], Floats]  # the smoothed means (t, 9) of one track


def back(covariance: Floats, carry: Floats, noise: Floats) -> tuple[Floats, Floats, Floats]:
    """Rauch, Tung and Striebel's gain, what the next state leaves open, and the prediction's covariance."""
    ahead = carry @ covariance @ carry.swapaxes(-1, -2) + noise
    gain = np.linalg.solve(ahead, carry @ covariance).swapaxes(-1, -2)
    return gain, covariance - gain @ ahead @ gain.swapaxes(-1, -2), ahead


def steps(states: States, elapsed_s: Floats, modes: Modes) -> tuple[Floats, Floats, Floats]:
    """Chances of each pair of modes before the next measurement (t, j, i), and how each mode i moves: (t, i, 9, 9) twice."""
    joint = states.weight[:-1, 0, :, None] * modes.transition(elapsed_s)
    weight = joint.sum(axis=1)
    mixed = (joint / weight[:, None]).swapaxes(1, 2) @ states.mean[:-1, 0]
    return joint, *moved(mixed, weight, elapsed_s, modes)


def as_one_state(states: States, elapsed_s: Floats, modes: Modes) -> Floats:
    """One smoother over the joined state, which moves in the modes' mean way; their spread is noise."""
    joined = states.combined()
    mean, covariance = joined.mean[:, 0].copy(), joined.covariance[:, 0].copy()
    joint, carry, noise = steps(states, elapsed_s, modes)
    weight = joint.sum(axis=1)
    each = (carry @ mean[:-1, None, :, None])[..., 0]
    ahead = (weight[..., None] * each).sum(axis=1)
    off = each - ahead[:, None]
    spread = (weight[..., None, None] * (noise + off[..., :, None] * off[..., None, :])).sum(axis=1)
    gain, rest, _ = back(covariance[:-1], (weight[..., None, None] * carry).sum(axis=1), spread)
    for k in range(len(elapsed_s) - 1, -1, -1):
        mean[k] += gain[k] @ (mean[k + 1] - ahead[k])
        covariance[k] = rest[k] + gain[k] @ covariance[k + 1] @ gain[k].T
    return mean


def by_pairs(states: States, elapsed_s: Floats, modes: Modes, *, likely: bool, apart: bool) -> Floats:
    """Pairs of modes that follow each other, each smoothed towards the smoothed next state as it is.

    `likely`: a pair counts by how well it predicts that state, too; without that these are Kim's weights. `apart`: each mode
    keeps its own smoothed state; otherwise they are joined into one at every step.
    """
    joint, carry, noise = steps(states, elapsed_s, modes)
    share = (joint / joint.sum(axis=1, keepdims=True)).swapaxes(1, 2)
    gain, rest, ahead = back(states.covariance[:-1, 0][:, None], carry[:, :, None], noise[:, :, None])
    expected = (carry[:, :, None] @ states.mean[:-1, 0][:, None, :, :, None])[..., 0]
    inverse, size = np.linalg.inv(ahead), np.linalg.slogdet(ahead)[1]
    mean, covariance, weight = (part[:, 0].copy() for part in (states.mean, states.covariance, states.weight))
    joined = states.combined().mean[:, 0].copy()
    for k in range(len(elapsed_s) - 1, -1, -1):
        off = mean[k + 1][:, None] - expected[k]
        x = states.mean[k, 0][None] + (gain[k] @ off[..., None])[..., 0]
        p = rest[k] + gain[k] @ covariance[k + 1][:, None] @ gain[k].swapaxes(-1, -2)
        chance = share[k]
        if likely:
            fit = (off[..., None, :] @ inverse[k] @ off[..., None])[..., 0, 0] + size[k]
            fit += np.einsum("ijab,iba->ij", inverse[k], covariance[k + 1])
            chance = chance * np.exp(-0.5 * (fit - fit.min(axis=1, keepdims=True)))
            chance = chance / chance.sum(axis=1, keepdims=True)
        pair = weight[k + 1][:, None] * chance
        weight[k] = np.maximum(pair.sum(axis=0), 1e-300)
        over = (0,) if apart else (0, 1)
        each = pair / weight[k] if apart else pair
        mean[k] = (each[..., None] * x).sum(axis=over)
        spread = x - mean[k] if apart else x - mean[k][0]
        covariance[k] = (each[..., None, None] * (p + spread[..., :, None] * spread[..., None, :])).sum(axis=over)
        joined[k] = weight[k] @ mean[k]
    return joined


def ours(states: States, elapsed_s: Floats, modes: Modes) -> Floats:
    """The pairs, each corrected by what the future says, and counted by its likelihood."""
    return np.asarray(smooth(states, elapsed_s[:, None], modes).combined().mean[:, 0])


WAYS: dict[str, Way] = {
    "one smoother over the joined state": as_one_state,
    "pairs, Kim's weights": lambda *given: by_pairs(*given, likely=False, apart=True),
    "pairs, likelihood of the smoothed state": lambda *given: by_pairs(*given, likely=True, apart=True),
    "the same, joined at every step": lambda *given: by_pairs(*given, likely=True, apart=False),
    "pairs corrected by the future (chosen)": ours,
}


def at_radar_times(case: Case, time_s: Floats, mean: Floats) -> Floats:
    """Positions (t, 3) at the radar's times, carried on from the latest state."""
    latest = np.maximum(np.searchsorted(time_s, case.plot_s + 1e-6, side="right") - 1, 0)
    return mean[latest, :3] + np.maximum(case.plot_s - time_s[latest], 0.0)[:, None] * mean[latest, 3:6]


def measured(case: Case, estimator: EstimatorName) -> dict[str, Accuracy]:
    """Every way's errors."""
    found: dict[str, list[Floats]] = {name: [] for name in ("filtered", *WAYS)}
    for index in range(case.runs):
        (events,), model = filtered(case, "bias", estimator, [index])
        assert model.modes is not None
        at = np.array([event.at for event in events])
        states = States(*(part[:, None] for part in arrays_of([state_of(event) for event in events])))
        time_s = (at - START) / SECOND
        found["filtered"].append(at_radar_times(case, time_s, states.combined().mean[:, 0]))
        for name, way in WAYS.items():
            found[name].append(at_radar_times(case, time_s, way(states, np.diff(at) / SECOND, model.modes)))
    return {name: accuracy_of(case, np.array(places)) for name, places in found.items()}


def main() -> None:
    """The table."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(f"{f'{runs} runs, RMSE m':<42}{'all':>8}{'50-25 km':>10}{'25-10':>8}{'10-1.2':>8}")
    for name, accuracy in measured(case_003(runs, 1), "rmimm").items():
        one, two, three = accuracy.bands_m
        print(f"{name:<42}{accuracy.overall_m:8.2f}{one:10.2f}{two:8.2f}{three:8.2f}")


if __name__ == "__main__":
    main()
