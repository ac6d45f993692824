"""Paper 000's first experiment: which filter tells straight flight and turns apart, and how soon.

Straight, a turn to the right, straight, a turn to the left, straight, measured each second with noise. All runs of one
variant are one batch of tracks, on the same draws and at equal tuning. Source: 000, 2.1 and 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.estimators import intent
from gateway.estimators.batch.tracks import Tracks as Batch
from gateway.estimators.batch.tracks import begin
from gateway.estimators.kalman import SIZE, Estimate, Motion, start
from gateway.estimators.modes import Mode, Modes, Rule
from sim.studies import Progress, Study, Table, silent

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STRAIGHT, LEFT, RIGHT = 0, 1, 2  # places of the modes
END_S, TURN_RPS = 500, math.radians(3.0)
LEGS = ((0, STRAIGHT), (100, RIGHT), (200, STRAIGHT), (300, LEFT), (350, STRAIGHT))  # from when on which mode
START_M, START_MPS = 1000.0, 300.0 / 3.6  # on each axis
SIGMA_M = 50.0
STAYS = 0.97  # probability of staying in a mode over a second
NOISE_MPS2 = (0.2, 0.5)  # straight, turning
SETTLED_S = (30, 30, 30, 20, 30)  # after a change this long is not counted where modes are told apart
COUNTED_FROM_S = 50  # for errors
# where the flight is going up to each time: a point this many seconds beyond, straight on (000 2.2 and 3)
POINTS = ((100, 40.0), (300, 30.0), (END_S, 20.0))
# from straight, left, right to the same, over a second; whoever leaves a turn with the point ahead rolls out
ALIGNED = np.array([[0.98, 0.01, 0.01], [0.10, 0.90, 0.00], [0.10, 0.00, 0.90]])
NOT_ALIGNED = np.full((3, 3), 0.5 * (1.0 - STAYS)) + (1.5 * STAYS - 0.5) * np.eye(3)


@dataclass(frozen=True, slots=True)
class Flight:
    """The true motion each second from t = 1 s on, and what was measured: position (t, 2), velocity, mode (t,)."""

    position: Floats
    velocity: Floats
    mode: Ints
    measured: Floats  # (t, runs, 2 or 4): position, and velocity where it is measured
    sigma: Floats  # (2 or 4,)
    start: Estimate  # (runs)
    points: Floats  # (t, 2) where the flight will be going next


@dataclass(frozen=True, slots=True)
class Tracks:
    """What a filter made of a flight: means (t, runs, 9) and the modes' probabilities (t, runs, 3)."""

    mean: Floats
    nees: Floats  # (t, runs) of position and velocity, four degrees
    probability: Floats


@dataclass(frozen=True, slots=True)
class Reached:
    """A row of the table: RMS errors, by leg separation and share of wrong modes, delays at the four changes."""

    position_m: float
    velocity_mps: float
    separation: tuple[float, ...]
    wrong: tuple[float, ...]
    delay_s: tuple[float, ...]


VARIANTS: tuple[tuple[str, Rule, bool], ...] = (
    ("IMM", "imm", False),
    ("RMIMM literal", "literal", False),
    ("RMIMM default", "rmimm", False),
    ("IMM, known TCP", "imm", True),
    ("default, known TCP", "rmimm", True),
)


def run(runs: int = 200, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """000's first table, every variant, with positions alone and with velocity measured.

    `rrd`: where errors, modes' probabilities and delays are drawn, or None.
    """
    tables: list[Table] = []
    figures: dict[str, float] = {}
    for place, speed in enumerate((False, True)):
        suffix = ", velocity measured" if speed else ""
        flown = flight(runs, seed, velocity=speed)
        rows: list[tuple[str | float, ...]] = []
        for turn, (name, rule, known) in enumerate(VARIANTS):
            progress(f"{name}{suffix}", (place + turn / len(VARIANTS)) / 2.2)
            one = reached(flown, filtered(flown, rule, known_point=known))
            rows.append((name, *_cells(one)))
            figures |= {f"position {name}{suffix}": one.position_m, f"velocity {name}{suffix}": one.velocity_mps}
            figures |= {f"separation {name}{suffix}": min(one.separation), f"delay {name}{suffix}": max(one.delay_s)}
        measured = "position (10 m) and velocity (1 m/s) measured" if speed else "position (50 m) measured"
        tables.append(Table(f"000: {measured}, {runs} runs", COLUMNS, tuple(rows), () if speed else NOTES))
    if rrd is not None:
        from sim.studies.rmimm_figures import draw

        progress("drawing", 2.0 / 2.2)
        draw(rrd, runs, seed)
    return Study("rmimm", runs, seed, tuple(tables), figures, str(rrd) if rrd else None)


COLUMNS = (
    *("variant", "position RMSE m", "velocity m/s", "separation, least", "greatest", "wrong %, least", "greatest"),
    *("delay s at 100", "200", "300", "350"),
)
NOTES = (
    "errors from t = 50 s on; separation: probability of the true mode less that of the likeliest other, by settled leg",
    "delay: updates from a change on until the true mode is the likeliest",
)


def _cells(one: Reached) -> tuple[float, ...]:
    percent = [100.0 * share for share in one.wrong]
    ends = (min(one.separation), max(one.separation), min(percent), max(percent))
    return (one.position_m, one.velocity_mps, *ends, *one.delay_s)


def modes(rule: Rule) -> Modes:
    """The paper's three modes; the same tuning for every rule."""
    lasts_s = -1.0 / math.log(1.5 * STAYS - 0.5)  # three modes kept with STAYS over a second
    motions = [Motion((sigma**2, sigma**2, sigma**2), 0.0) for sigma in NOISE_MPS2]
    straight, left, right = Mode(0.0, motions[0]), Mode(1.0, motions[1]), Mode(-1.0, motions[1])
    return Modes((straight, left, right), rule, lasts_s, TURN_RPS)


def flight(runs: int, seed: int, *, velocity: bool = False) -> Flight:
    """The paper's case measured `runs` times; the draws of one seed are those of every variant."""
    time_s = np.arange(1, END_S + 1)
    mode = np.zeros(END_S, dtype=np.int64)  # between t and t + 1
    for since, which in LEGS:
        mode[since:] = which
    turned = np.array([0.0, TURN_RPS, -TURN_RPS])[mode]
    course = math.radians(45.0) + np.concatenate([[0.0], np.cumsum(turned)])
    speed = START_MPS * math.sqrt(2.0)
    # over a second's turn the aircraft gets a chord further, half of the turn aside
    chord = speed * np.sinc(turned / (2.0 * math.pi))
    step = chord[:, None] * np.stack([np.cos(course[:-1] + turned / 2), np.sin(course[:-1] + turned / 2)], axis=1)
    position = START_M + np.cumsum(step, axis=0)
    heading = np.stack([np.cos(course), np.sin(course)], axis=1)
    sigma = np.array([10.0, 10.0, 1.0, 1.0]) if velocity else np.full(2, SIGMA_M)
    true = np.concatenate([position, speed * heading[1:]], axis=1)
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal((END_S, runs, 4))[:, :, : len(sigma)]
    points = np.array([position[until - 1] + ahead * speed * heading[until] for until, ahead in POINTS])
    following = np.searchsorted([until for until, _ in POINTS], time_s, side="left")
    begun = START_MPS + 10.0 * generator.standard_normal((runs, 2))
    return Flight(
        position,
        true[:, 2:],
        mode,
        true[:, None, : len(sigma)] + sigma * noise,
        sigma,
        _start(begun, float(sigma[0])),
        points[following],
    )


def _start(velocity: Floats, sigma_m: float) -> Estimate:
    """Where the paper's flight begins, not known better than measured; the velocity to 30 m/s."""
    runs = len(velocity)
    place = np.tile([START_M, START_M, 0.0], (runs, 1))
    spread = np.tile(np.diag([sigma_m**2, sigma_m**2, 1.0]), (runs, 1, 1))
    return start(place, spread, np.pad(velocity, ((0, 0), (0, 1))), np.full(runs, 30.0), 0.0)


def filtered(flight: Flight, rule: Rule, *, known_point: bool = False) -> Tracks:
    """A filter over a flight, all runs as one batch; with `known_point` it is told where the flight is going."""
    chosen = modes(rule)
    runs, measured = flight.measured.shape[1:]
    sensitivity = np.zeros((1, measured, SIZE))
    sensitivity[0, np.arange(measured), [0, 1, 3, 4][:measured]] = 1.0
    variance = np.tile(flight.sigma**2, (runs * chosen.count, 1))
    batch, second = begin(flight.start, chosen), np.ones(runs)
    means, nees, probability = [], [], []
    for step, told in enumerate(flight.measured):
        transition = _towards(batch, flight.points[step]) if known_point else None
        batch = batch.predict(second, transition)
        innovation = np.repeat(told, chosen.count, axis=0) - (sensitivity @ batch.means[:, :, None])[:, :, 0]
        batch, _, _ = batch.update(innovation, sensitivity, variance)
        state = batch.combine()
        means.append(state.mean)
        probability.append(batch.weights)
        off = (state.mean[:, _LEVEL] - np.concatenate([flight.position[step], flight.velocity[step]]))[:, :, None]
        inverse = np.linalg.inv(state.covariance[:, _LEVEL][:, :, _LEVEL])
        nees.append((off.transpose(0, 2, 1) @ inverse @ off)[:, 0, 0])
    return Tracks(np.array(means), np.array(nees), np.array(probability))


_LEVEL = [0, 1, 3, 4]


def _towards(batch: Batch, point: Floats) -> Floats:
    """Transitions (n, m, m) over a second with a known point: who flies at it goes straight. Source: 000 2.2, feedback."""
    state = batch.combine()
    off = intent.off_course(state.mean[:, :2], state.mean[:, 3:5], point[None, None])
    aligned = np.abs(off[:, 0]) <= intent.ALIGNED_RAD
    return np.where(aligned[:, None, None], ALIGNED, NOT_ALIGNED)


def reached(flight: Flight, tracks: Tracks) -> Reached:
    """The figures of a row."""
    since = COUNTED_FROM_S
    off = tracks.mean[since:, :, :2] - flight.position[since:, None]
    speed_off = tracks.mean[since:, :, 3:5] - flight.velocity[since:, None]
    likeliest = tracks.probability.argmax(axis=2)
    ends = [*(begin for begin, _ in LEGS[1:]), END_S]
    separation, wrong = [], []
    for (begins, mode), settled, end in zip(LEGS, SETTLED_S, ends, strict=True):
        leg = slice(begins + settled, end)
        others = np.delete(tracks.probability[leg], mode, axis=2).max(axis=2)
        separation.append(float((tracks.probability[leg, :, mode] - others).mean()))
        wrong.append(float((likeliest[leg] != mode).mean()))
    delays = [delays_s(tracks, begins, mode).mean() for begins, mode in LEGS[1:]]
    return Reached(
        float(np.sqrt((off**2).sum(axis=2).mean())),
        float(np.sqrt((speed_off**2).sum(axis=2).mean())),
        tuple(separation),
        tuple(wrong),
        tuple(map(float, delays)),
    )


def delays_s(tracks: Tracks, since: int, mode: int) -> Floats:
    """By run, how many updates after a change at `since` until its mode is the likeliest; 50 where it is not by then."""
    found = tracks.probability[since : since + 50].argmax(axis=2) == mode
    return np.where(found.any(axis=0), found.argmax(axis=0) + 1.0, 50.0)
