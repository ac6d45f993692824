"""What `bench.estimation` runs in a process of its own: every side on the same problems, turn by turn."""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from bench.estimation_sides import PEERS, Problem, Run, ours, textbook

ONE_STEPS, MANY, MANY_STEPS = 300, 1000, 3
LEAST_S = 0.2  # of a measurement: what is faster runs again and again
TURN_RPS, SIGMA_M, CALM, HARD = math.radians(3.0), 25.0, 0.1, 0.6


def problem(tracks: int, steps: int) -> Problem:
    """Aircraft of 40 to 130 m/s that fly straight, and turn left in the second half."""
    random = np.random.default_rng(1)
    half = math.sin(TURN_RPS) / TURN_RPS, (1.0 - math.cos(TURN_RPS)) / TURN_RPS
    straight, turning = np.eye(4), np.eye(4)
    straight[0, 2] = straight[1, 3] = 1.0
    turning[0, 2] = turning[1, 3] = half[0]
    turning[1, 2], turning[0, 3] = half[1], -half[1]
    turning[2:, 2:] = [[math.cos(TURN_RPS), -math.sin(TURN_RPS)], [math.sin(TURN_RPS), math.cos(TURN_RPS)]]
    grown = np.kron([[1 / 3, 1 / 2], [1 / 2, 1.0]], np.eye(2))
    speed, course = random.uniform(40.0, 130.0, tracks), random.uniform(0.0, 2.0 * math.pi, tracks)
    mean = np.stack([*random.normal(0.0, 3e4, (2, tracks)), speed * np.cos(course), speed * np.sin(course)], axis=1)
    true, measured = mean, []
    for step in range(steps):
        true = true @ (turning if 2 * step >= steps else straight).T
        measured.append(true[:, :2] + random.normal(0.0, SIGMA_M, (tracks, 2)))
    return Problem(
        np.array([straight, turning]),
        np.array([CALM * grown, HARD * grown]),
        np.array([[0.95, 0.05], [0.1, 0.9]]),
        np.array([0.7, 0.3]),
        SIGMA_M**2,
        mean,
        np.diag([SIGMA_M**2, SIGMA_M**2, 100.0, 100.0]),
        np.array(measured),
    )


def measure(runs: int) -> dict[str, Any]:
    """Everything in this process, side after side, again and again."""
    sides = {"ours": ours, "textbook loop": textbook}
    left_out = []
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
