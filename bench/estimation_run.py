"""What `bench.estimation` runs in a process of its own: every side on the same problems, turn by turn."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bench.estimation import OURS
from bench.estimation_sides import ERROR_M, PEERS, Problem, Run, compiled, gateway_modes, ours, textbook
from gateway.estimators.batch import packed
from gateway.estimators.kalman import Estimate
from gateway.estimators.modes import begin, moved

CALM, LEFT = 0, 3  # places of the modes that are flown
ONE_STEPS, MANY, MANY_STEPS = 300, 1000, 3
SIGMA_M = 25.0
LEAST_S = 0.2  # of a measurement: what is faster runs again and again


def problem(tracks: int, steps: int) -> Problem:
    """Aircraft of 40 to 130 m/s that fly straight, and turn left in the second half, reported with an error that drifts.

    The gateway's five modes of eleven states: position, velocity, the source's own error, and a level acceleration that lasts in
    one of the modes. The reports measure position and error together.
    """
    random, modes = np.random.default_rng(1), gateway_modes()
    speed, course = random.uniform(40.0, 130.0, tracks), random.uniform(0.0, 2.0 * math.pi, tracks)
    mean = np.zeros((tracks, 9))
    mean[:, :3] = random.normal(0.0, 3e4, (tracks, 3))
    mean[:, 3:5] = np.stack([speed * np.cos(course), speed * np.sin(course)], axis=1)
    covariance = np.diag([SIGMA_M**2] * 3 + [100.0] * 3 + [ERROR_M**2] * 3)
    first = begin(Estimate(mean, np.repeat(covariance[None], tracks, axis=0)), modes)
    carry, noise = (part[0] for part in moved(first.mean[:1], first.weight[:1], np.ones(1), modes))
    true, measured = mean, []
    for step in range(steps):
        true = true @ carry[LEFT if 2 * step >= steps else CALM][:9, :9].T
        measured.append(true[:, :3] + random.normal(0.0, SIGMA_M, (tracks, 3)))
    chance = modes.transition(np.ones(1))[0]
    return Problem(
        carry, noise, chance, modes.shares, SIGMA_M**2, first.mean[:, 0], first.covariance[0, 0], np.array(measured)
    )


def measure(runs: int) -> dict[str, Any]:
    """Everything in this process, side after side, again and again."""
    sides = {"ours": ours, "textbook loop": textbook}
    left_out = []
    if packed.INSTALLED:
        sides[OURS[-1]] = compiled
    else:
        left_out.append("the compiled batch is left out: pip install 'talkdown[fast]'")
    for name, (side, module, package) in PEERS.items():
        if importlib.util.find_spec(module) is None:
            left_out.append(f"{name} is not installed, it is left out: pip install {package}")
        else:
            sides[name] = side
    problems = {"one track": problem(1, ONE_STEPS), f"{MANY} tracks": problem(MANY, MANY_STEPS)}
    rates: dict[str, dict[str, list[float]]] = {size: {name: [] for name in sides} for size in problems}
    off: dict[str, float] = {}
    for turn in range(runs + 1):
        for size, given in problems.items():
            ended = {}
            for name, side in sides.items():
                rate, ended[name] = _rate(lambda side=side, given=given: side(given), given.track_steps)
                if turn:  # the first one warms up
                    rates[size][name].append(rate)
            for name, states in ended.items():
                if name != "ours":
                    off[name] = max(off.get(name, 0.0), _difference(states, ended["ours"]))
    return {"rates": rates, "off": off, "left out": left_out}


def _rate(made: Callable[[], Run], track_steps: int) -> tuple[float, Any]:
    """Track-steps a CPU second, and the states at the end. A side is made anew for each time it runs, unmeasured."""
    spent_s, done, states = 0.0, 0, None
    while spent_s < LEAST_S:
        run = made()
        began = time.process_time()
        states = run()
        spent_s += time.process_time() - began
        done += track_steps
    return done / spent_s, states


def _difference(one: Any, other: Any) -> float:
    """The greatest difference between states, in parts of each state's own sigma or variance."""
    sigma = np.sqrt(other[1].diagonal(axis1=1, axis2=2))
    means = np.abs(one[0] - other[0]) / sigma
    spreads = np.abs(one[1] - other[1]) / (sigma[:, :, None] * sigma[:, None, :])
    return float(max(means.max(), spreads.max()))
