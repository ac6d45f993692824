"""The conflict probe: how many staged conflicts it finds, how long before separation is lost, and how often it is wrong.

The whole gateway, from the wires' bytes on, over scenes: `conflicts`, pairs that lose their separation in six ways, `traffic`,
with and without a radar, and four times as much of it, in which many lose it. What is lost and what is not is told by the true
ways. Nobody has told a plan: all is foretold from how they fly.
Source: 000, what the prediction is for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
QUIET = "duration_s=3600", "aircraft=60"
CROWDED = "duration_s=900", "aircraft=60", "radars=0"
EDGES = (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.01)
EVERY_S = 20  # of a conflict that goes on its probability is looked at


@dataclass(frozen=True, slots=True)
class Outcome:
    """Of one scene: how long before each loss of separation it was told, s (NaN: not at all), and what was told for nothing."""

    kind: tuple[str, ...]  # (k,) how each pair meets
    lead_s: Floats  # (k,)
    told: int
    wrong: tuple[str, ...]
    first: Floats  # (m,) the probability as it was first told, of each conflict
    came: NDArray[np.bool_]  # (m,)
    later: Floats  # (l,) and each 20 s after, as long as separation is not lost
    came_later: NDArray[np.bool_]  # (l,)
    hours: float

    @property
    def found(self) -> float:
        """The share of losses told at least a minute ahead."""
        return float((np.nan_to_num(self.lead_s, nan=-1.0) >= AHEAD_S).mean()) if len(self.lead_s) else 1.0


def run(runs: int = 5, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """A run: twenty staged conflicts, an hour of `traffic` with a radar and one without, and a crowded quarter of an hour.

    There are no figures to draw.
    """
    kinds: dict[str, tuple[str, tuple[str, ...]]] = {
        "conflicts": ("conflicts", ()),
        "traffic": ("traffic", QUIET),
        "traffic, no radar": ("traffic", (*QUIET, "radars=0")),
        "traffic, crowded": ("traffic", CROWDED),
    }
    found: dict[str, list[Outcome]] = {name: [] for name in kinds}
    for index in range(runs):
        for place, (name, (scene, changes)) in enumerate(kinds.items()):
            progress(name, (index + 0.25 * place) / runs)
            found[name].append(outcome(build_scene(scene, start_ns=START, seed=seed + index, changes=changes)))
    figures = {"found, %": 100.0 * float(np.mean([one.found for one in found["conflicts"]]))} | {
        f"false alarms an hour, {name}": sum(len(one.wrong) for one in many) / sum(one.hours for one in many)
        for name, many in found.items()
        if name != "conflicts"
    }
    notes = tuple(
        f"false alarm in {text}"
        for name, many in found.items()
        if "crowded" not in name
        for one in many
        for text in one.wrong
    )
    tables = (_found(found["conflicts"]), _alarms(found, notes), *(_honest(name, many) for name, many in found.items()))
    return Study("conflicts", runs, seed, tuple(one for one in tables if one.rows), figures)


def outcome(scene: Scene) -> Outcome:
    """What the gateway told of a scene, held against the truth."""
    separation = scene.site.separation
    lost = losses(scene, separation)
    first: dict[Pair, float] = {}
    wrong, probability, came, later = [], [], [], []
    until_s = (
        scene.duration_s - separation.look_ahead_s - LATER_S
    )  # who is told after that nobody knows what becomes of
    told_at: dict[Pair, float] = {}
    for at_s, pair, state, chance in alarms(pictures(scene, "apply")):
        true = [t for t in lost.get(pair, ()) if at_s - 10.0 <= t <= at_s + separation.look_ahead_s + LATER_S]
        if state == "found":
            first.setdefault(pair, at_s)
            told_at[pair] = at_s
            probability.append(chance)
            came.append(bool(true))
            if not true:
                wrong.append(f"{scene.name}, seed {scene.seed}: {pair[0]} and {pair[1]} at {at_s:.0f} s, {chance:.2f}")
        elif (
            at_s < until_s
            and not any(t <= at_s for t in true)
            and round(at_s - told_at.setdefault(pair, at_s)) % EVERY_S == 0
        ):
            later.append((chance, bool(true)))
    kinds = {aircraft.name: aircraft.kind for aircraft in scene.aircraft}
    leads = [times[0] - first.get(pair, np.nan) for pair, times in lost.items()]
    return Outcome(
        tuple(kinds[pair[0]] if kinds[pair[0]] == kinds[pair[1]] else "other" for pair in lost),
        np.array(leads, dtype=np.float64),
        len(probability),
        tuple(wrong),
        np.array(probability),
        np.array(came, dtype=np.bool_),
        np.array([chance for chance, _ in later]),
        np.array([true for _, true in later], dtype=np.bool_),
        scene.duration_s / 3600.0,
    )


def alarms(seen: Iterable[Picture]) -> Iterable[tuple[float, Pair, str, float]]:
    """Each second of each conflict, s after the start: of which aircraft, whether it is new or goes on, with what probability."""
    names: dict[int, str] = {}
    for picture in seen:
        names |= {
            track: name
            for track, name in zip(picture.fuse.track.tolist(), picture.fuse.aircraft, strict=True)
            if name is not None
        }
        found = picture.predict.conflicts
        for row, state in enumerate(found.state):
            if state != "over":
                one, other = sorted(names.get(track, f"track {track}") for track in found.pair[row])
                yield (int(found.time[row]) - START) / SECOND, (one, other), state, float(found.probability[row])


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


def _alarms(outcomes: Mapping[str, Sequence[Outcome]], notes: tuple[str, ...]) -> Table:
    rows = []
    for name, many in outcomes.items():
        hours = sum(one.hours for one in many)
        wrong, told = sum(len(one.wrong) for one in many), sum(one.told for one in many)
        rows.append((name, hours, sum(len(one.lead_s) for one in many), told, wrong, wrong / hours))
    columns = ("scene", "hours", "losses", "conflicts told", "for nothing", "an hour")
    return Table("false alarms", columns, tuple(rows), notes)


def _honest(name: str, many: Sequence[Outcome]) -> Table:
    """How many of the conflicts came true that were told with a probability, at first and while they went on."""
    first, came = np.concatenate([one.first for one in many]), np.concatenate([one.came for one in many])
    later, came_later = np.concatenate([one.later for one in many]), np.concatenate([one.came_later for one in many])
    rows: list[tuple[str | float, ...]] = []
    for low, high in pairwise(EDGES):
        row: list[str | float] = [f"{low:g} to {min(high, 1.0):g}"]
        for probability, lost in ((first, came), (later, came_later)):
            mine = (probability >= low) & (probability < high)
            row += [int(mine.sum()), 100.0 * float(lost[mine].mean()) if mine.any() else float("nan")]
        if row[1] or row[3]:
            rows.append(tuple(row))
    columns = ("probability", "first told", "lost, %", "going on, each 20 s", "lost, %")
    return Table(f"what came of conflicts, {name}", columns, tuple(rows))
