"""The conflict probe: how many staged conflicts it finds, how long before separation is lost, and how often it is wrong.

The whole gateway, from the wires' bytes on, over scenes: `conflicts`, pairs that lose their separation in six ways, and
`traffic`. What is lost and what is not is told by the true ways. Nobody has told a plan: all is foretold from how they fly.
Source: 000, what the prediction is for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.settings import Separation
from sim.scene import Scene
from sim.scenes import build_scene
from sim.studies import Progress, Study, Table, silent
from sim.studies.live_registration import pictures

Floats = NDArray[np.float64]
Pair = tuple[str, str]

START = 1_790_000_000 * SECOND
AHEAD_S = 60.0
LATER_S = 60.0  # a conflict that was told is true if separation is lost within the time looked ahead, and so much more
QUIET_S = 3600.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one scene: how long before each loss of separation it was told, s (NaN: not at all), and what was told for nothing."""

    kind: tuple[str, ...]  # (k,) how each pair meets
    lead_s: Floats  # (k,)
    told: int
    wrong: tuple[str, ...]
    probability: Floats  # (m,) as it was first told, of each conflict
    came: NDArray[np.bool_]  # (m,)
    hours: float

    @property
    def found(self) -> float:
        """The share of losses told at least a minute ahead."""
        return float((np.nan_to_num(self.lead_s, nan=-1.0) >= AHEAD_S).mean()) if len(self.lead_s) else 1.0


def run(runs: int = 5, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """Staged conflicts, twenty a run, and an hour of `traffic` a run, each with one radar. There are no figures to draw."""
    staged, quiet = [], []
    for index in range(runs):
        progress("staged conflicts", index / runs)
        staged.append(outcome(build_scene("conflicts", start_ns=START, seed=seed + index)))
        progress("traffic", (index + 0.4) / runs)
        changes = (f"duration_s={QUIET_S}", "aircraft=60")
        quiet.append(outcome(build_scene("traffic", start_ns=START, seed=seed + index, changes=changes)))
    figures = {
        "found, %": 100.0 * float(np.mean([one.found for one in staged])),
        "false alarms an hour, traffic": sum(len(one.wrong) for one in quiet) / sum(one.hours for one in quiet),
    }
    notes = tuple(f"false alarm in {text}" for one in (*staged, *quiet) for text in one.wrong)
    tables = (_found(staged), _alarms({"conflicts": staged, "traffic": quiet}, notes), _honest([*staged, *quiet]))
    return Study("conflicts", runs, seed, tables, figures)


def outcome(scene: Scene) -> Outcome:
    """What the gateway told of a scene, held against the truth."""
    separation = scene.site.separation
    lost = losses(scene, separation)
    first: dict[Pair, float] = {}
    wrong, probability, came = [], [], []
    for at_s, pair, chance in alarms(pictures(scene, "apply")):
        first.setdefault(pair, at_s)
        true = [t for t in lost.get(pair, ()) if at_s - 10.0 <= t <= at_s + separation.look_ahead_s + LATER_S]
        probability.append(chance)
        came.append(bool(true))
        if not true:
            wrong.append(f"{scene.name}, seed {scene.seed}: {pair[0]} and {pair[1]} at {at_s:.0f} s, {chance:.2f}")
    kinds = {aircraft.name: aircraft.kind for aircraft in scene.aircraft}
    leads = [times[0] - first.get(pair, np.nan) for pair, times in lost.items()]
    return Outcome(
        tuple(kinds[pair[0]] if kinds[pair[0]] == kinds[pair[1]] else "other" for pair in lost),
        np.array(leads, dtype=np.float64),
        len(probability),
        tuple(wrong),
        np.array(probability),
        np.array(came, dtype=np.bool_),
        scene.duration_s / 3600.0,
    )


def alarms(seen: Iterable[Picture]) -> Iterable[tuple[float, Pair, float]]:
    """When each conflict was told, s after the start, of which aircraft, with what probability."""
    names: dict[int, str] = {}
    for picture in seen:
        names |= {
            track: name
            for track, name in zip(picture.fuse.track.tolist(), picture.fuse.aircraft, strict=True)
            if name is not None
        }
        found = picture.predict.conflicts
        for row, state in enumerate(found.state):
            if state == "found":
                one, other = sorted(names.get(track, f"track {track}") for track in found.pair[row])
                yield (int(found.time[row]) - START) / SECOND, (one, other), float(found.probability[row])


def losses(scene: Scene, separation: Separation) -> dict[Pair, list[float]]:
    """By pair of aircraft the seconds, from the scene's start, in which they were nearer than the separation, truly."""
    times = np.arange(0.0, scene.duration_s)
    frame = RunwayFrame(scene.site.runway)
    place = np.full((len(scene.aircraft), len(times), 3), np.nan)
    for row, aircraft in enumerate(scene.aircraft):
        start, end = scene.present(aircraft)
        here = (times >= start) & (times < end)
        if here.any():
            flown = scene.flown(aircraft, times[here])
            place[row, here] = frame.runway_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
            place[row, here, 2] = flown.height_m - scene.site.runway.height_m
    place[place[..., 2] < separation.least_height_m] = np.nan
    found: dict[Pair, list[float]] = {}
    for row in range(len(place)):
        way = place[row + 1 :] - place[row]
        near = (way[..., 0] ** 2 + way[..., 1] ** 2 < separation.horizontal_m**2) & (
            np.abs(way[..., 2]) < separation.vertical_m
        )
        for other in np.flatnonzero(near.any(axis=1)).tolist():
            one, two = sorted((scene.aircraft[row].name, scene.aircraft[row + 1 + other].name))
            found[one, two] = times[near[other]].tolist()
    return found


def _found(staged: Sequence[Outcome]) -> Table:
    kind = np.array([name for one in staged for name in one.kind])
    lead_s = np.concatenate([one.lead_s for one in staged])
    rows: list[tuple[str | float, ...]] = []
    for name in (*dict.fromkeys(kind.tolist()), "all"):
        mine = lead_s[(kind == name) | (name == "all")]
        in_time = np.nan_to_num(mine, nan=-1.0)
        shares = [100.0 * float((in_time >= limit).mean()) for limit in (AHEAD_S, 30.0)]
        rows.append((name, len(mine), *shares, float(np.nanmedian(mine)), float(np.nanmin(mine))))
    columns = ("how they meet", "pairs", "found 60 s ahead, %", "30 s ahead, %", "ahead s, median", "least")
    return Table("losses of separation", columns, tuple(rows))


def _alarms(outcomes: dict[str, Sequence[Outcome]], notes: tuple[str, ...]) -> Table:
    rows = []
    for name, many in outcomes.items():
        hours = sum(one.hours for one in many)
        wrong, told = sum(len(one.wrong) for one in many), sum(one.told for one in many)
        rows.append((name, hours, sum(len(one.lead_s) for one in many), told, wrong, wrong / hours))
    columns = ("scene", "hours", "losses", "conflicts told", "for nothing", "an hour")
    return Table("false alarms", columns, tuple(rows), notes)


def _honest(many: Sequence[Outcome]) -> Table:
    probability, came = np.concatenate([one.probability for one in many]), np.concatenate([one.came for one in many])
    edges = (0.0, 0.1, 0.2, 0.4, 1.0)
    rows: list[tuple[str | float, ...]] = []
    for low, high in pairwise(edges):
        mine = (probability >= low) & (probability < high)
        if mine.any():
            rows.append((f"{low:g} to {high:g}", int(mine.sum()), 100.0 * float(came[mine].mean())))
    return Table(
        "what came of conflicts, by the probability first told", ("probability", "told", "lost, %"), tuple(rows)
    )
