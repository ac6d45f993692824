"""Many sessions of scene `traffic` replayed, reported and clustered into flows, by one worker and by two; a long list of them.

python -m bench.archive --sessions 200 --cluster      by itself, 20 minutes; 40 sessions, the default, take three

`--cluster` (pip install '.[cluster]') also replays them on a Dask cluster of two workers, kills one of these in the middle
and counts the sessions that are complete, and whose tracks are those of a replay without a cluster, bit for bit.

Both counts of workers get the same blocks of sessions, in turns, so that a machine that changes its speed favours neither.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from bench.measure import Figure, environment, load, machine, run, talkdown

BLOCKS = 4
WORKERS = (1, 2)
STEPS = ("replayed", "reported", "clustered")
SECONDS, AIRCRAFT = 90.0, 6
LISTED = 2000
LEAST_GAIN = 1.7
_APART_NS = 3600 * 10**9
_BEGAN_NS = 1_767_225_600 * 10**9

Say = Callable[[str], None]


def simulate(seed: int, parent: Path, seconds: float) -> None:
    """One session of the scene, an hour after the one before."""
    from sim.recording import write_session
    from sim.scenes import build_scene

    changes = (f"duration_s={seconds}", f"aircraft={AIRCRAFT}")
    write_session(build_scene("traffic", start_ns=_BEGAN_NS + seed * _APART_NS, seed=seed, changes=changes), parent)


def archive(folder: Path, sessions: int, seconds: float, say: Say) -> list[Figure]:
    """What many sessions take, with how many workers, and what two gain."""
    from gateway.runtime.many import Job, cores, in_processes

    say(f"{sessions} sessions of {seconds:g} s are simulated")
    blocks = [folder / f"block-{number}" for number in range(BLOCKS)]
    of_block = itertools.cycle(blocks)
    things = [(seed, next(of_block)) for seed in range(sessions)]
    for _, outcome in in_processes(Job(partial(_simulate, seconds=seconds), OSError), things, cores()):
        if outcome.failure is not None:
            raise RuntimeError(outcome.failure)
    wall_s: dict[tuple[str, int], float] = defaultdict(float)
    for number, block in enumerate(blocks):
        for workers in WORKERS if number % 2 else WORKERS[::-1]:
            for step, taken_s in _worked(block, folder / f"by-{workers}", workers).items():
                wall_s[step, workers] += taken_s
        say(f"block {number + 1} of {BLOCKS}: " + _told(wall_s))
    for workers in WORKERS:
        into = folder / f"by-{workers}"
        wall_s["clustered", workers] = _timed(
            "flows", str(into), "--archive", str(into / ".flows"), "--workers", str(workers)
        )
    say("all: " + _told(wall_s))
    one, two = (sum(wall_s[step, workers] for step in STEPS) for workers in WORKERS)
    figures = [
        Figure(
            f"{sessions} sessions of traffic {step}, {workers} worker{'s' * (workers > 1)}",
            "s",
            (wall_s[step, workers],),
        )
        for step in STEPS
        for workers in WORKERS
    ]
    return [*figures, Figure("… all of it, two workers against one", "times", (one / two,), at_least=LEAST_GAIN)]


def _simulate(thing: tuple[int, Path], seconds: float) -> None:
    simulate(*thing, seconds)


def _worked(block: Path, into: Path, workers: int) -> dict[str, float]:
    """Seconds that a block of sessions takes."""
    names = sorted(one.name for one in block.iterdir())
    replayed = _timed("replay", str(block), "--archive", str(into), "--workers", str(workers))
    some = [str(into / name) for name in names]
    pages = into / ".reports" / block.name
    return {
        "replayed": replayed,
        "reported": _timed("report", *some, "--html", str(pages), "--workers", str(workers)),
    }


def _timed(*arguments: str) -> float:
    return run(talkdown(*arguments, "--quiet")).wall_s


def _told(wall_s: dict[tuple[str, int], float]) -> str:
    parts = []
    for step in STEPS:
        one, two = (wall_s.get((step, workers)) for workers in WORKERS)
        if one is not None and two is not None:
            parts.append(f"{step} {one:.0f} s and {two:.0f} s")
    return ", ".join(parts)


def killed(folder: Path, sessions: int, say: Say) -> list[Figure]:
    """The sessions that `archive` made, replayed on a cluster of which a worker is killed."""
    import pyarrow.parquet as pq
    from distributed import LocalCluster

    into, alone = folder / "by-cluster", folder / f"by-{WORKERS[0]}"
    blocks = [str(folder / f"block-{number}") for number in range(BLOCKS)]
    quiet = {"dashboard_address": None, "local_directory": folder / "dask"}
    with LocalCluster(n_workers=2, threads_per_worker=1, **quiet) as cluster:
        arguments = ("--archive", str(into), "--scheduler", cluster.scheduler_address, "--quiet")
        with subprocess.Popen(talkdown("replay", *blocks, *arguments), env=environment()) as child:
            while child.poll() is None and len(_complete(into)) < sessions // 2:
                time.sleep(0.2)
            os.kill(cluster.workers[0].pid, signal.SIGKILL)
            say(f"a worker is killed when {len(_complete(into))} are done")
            code = child.wait()
    say(f"the command ends with {code}")
    same = sum(
        pq.read_table(into / name / "tracks.parquet").equals(pq.read_table(alone / name / "tracks.parquet"))
        for name in _complete(into)
    )
    return [Figure("… on a Dask cluster, a worker killed: complete", "sessions", (float(same),), at_least=sessions)]


def _complete(archive: Path) -> list[str]:
    return [one.name for one in archive.glob("[!.]*")]


def listing(folder: Path, runs: int) -> list[Figure]:
    """`talkdown sessions` of a folder of thousands, made of one session's folder: only what a list reads is in them."""
    simulate(0, folder / "one", 5.0)
    (one,) = (folder / "one").iterdir()
    document = json.loads((one / "session.json").read_text(encoding="utf-8"))
    many = folder / "many"
    for number in range(LISTED):
        copy = many / f"session-{number:04d}"
        shutil.copytree(one, copy)
        later = {**document, "started_at": document["started_at"] + number * _APART_NS}
        later["watermark"] = document["watermark"] + number * _APART_NS
        (copy / "session.json").write_text(json.dumps(later), encoding="utf-8")
    samples = tuple(run(talkdown("sessions", str(many))).wall_s for _ in range(runs))
    return [Figure(f"talkdown sessions, {LISTED} of them", "s", samples, 5.0)]


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def main(
    sessions: Annotated[int, typer.Option("--sessions", metavar="N", min=2 * BLOCKS, help="How many.")] = 40,
    seconds: Annotated[float, typer.Option("--seconds", metavar="S", help="How long each is.")] = SECONDS,
    cluster: Annotated[
        bool, typer.Option("--cluster", help="Also on a Dask cluster, a worker of which is killed.")
    ] = False,
) -> None:
    """Measure, print a line a figure; exit code 1 where two workers gain too little."""
    print(f"{machine()}; {load()}")
    with tempfile.TemporaryDirectory(prefix="talkdown-bench-") as name:
        figures = archive(Path(name), sessions, seconds, _say)
        if cluster:
            figures += killed(Path(name), sessions, _say)
        figures += listing(Path(name), 3)
    for one in figures:
        print(
            f"{one.name}: {one.median:.2f} {one.unit} {one.target} {'' if one.holds is not False else 'MISSED'}".rstrip()
        )
    print(load())
    if any(one.holds is False for one in figures):
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
