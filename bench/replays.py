"""Commands from start to prompt: recordings replayed at full speed into an archive, and the help."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from bench.measure import Cost, Figure, run, talkdown

RATES = ("gps.period_s=0.2", "radar.period_s=0.4")  # 5 Hz and 2.5 Hz
LATENCIES = {"0.8-2 s late": (0.8, 2.0), "0.05-0.2 s late": (0.05, 0.2)}
TEN_MINUTES_S, TEN_HOURS_S = 600, 36_000

Say = Callable[[str], None]


def settings(*changes: str) -> list[str]:
    """Changes to a scene as `talkdown simulate` takes them."""
    return [word for change in changes for word in ("--set", change)]


def late(low_s: float, high_s: float) -> tuple[str, str]:
    """The setting of how late GPS reports arrive."""
    return f"gps.latency_low_s={low_s}", f"gps.latency_high_s={high_s}"


def ten_minutes(folder: Path, runs: int, say: Say) -> list[Figure]:
    """An approach of ten minutes replayed with .rrd and Parquet."""
    figures = []
    for label, (low_s, high_s) in LATENCIES.items():
        recordings = folder / label.replace(" ", "")
        changes = settings(*RATES, f"duration_s={TEN_MINUTES_S}", *late(low_s, high_s))
        run(talkdown("simulate", "landing", "--speed", "max", "--archive", str(recordings), "--quiet", *changes))
        session = next(recordings.iterdir())
        costs = []
        for turn in range(runs):
            costs.append(_replay(session, folder / f"replayed-{recordings.name}-{turn}"))
            say(f"ten minutes, GPS {label}: {costs[-1].wall_s:.2f} s, of CPU {costs[-1].cpu_s:.2f} s")
        figures += [
            Figure(f"replay of 10 minutes, GPS {label}", "s", tuple(cost.wall_s for cost in costs), 5.0),
            Figure(f"… CPU time, GPS {label}", "s", tuple(cost.cpu_s for cost in costs)),
        ]
    return figures


def help_text(runs: int) -> list[Figure]:
    """The first thing that a person types."""
    return [Figure("talkdown --help", "s", tuple(run(talkdown("--help")).wall_s for _ in range(runs)), 0.5)]


def ten_hours(folder: Path, say: Say) -> list[Figure]:
    """One aircraft that circles before the runway for ten hours, replayed: what it holds in memory at most."""
    say("ten hours are simulated")
    run([sys.executable, "-m", "bench.circles", str(folder / "ten-hours"), str(TEN_HOURS_S)])
    session = next((folder / "ten-hours").iterdir())
    say("ten hours are replayed")
    cost = _replay(session, folder / "ten-hours-replayed")
    return [
        Figure("replay of 10 hours, peak memory", "MB", (cost.peak_mb,), 500.0),
        Figure("replay of 10 hours", "s", (cost.wall_s,)),
        Figure("… CPU time, 10 hours", "s", (cost.cpu_s,)),
    ]


def _replay(session: Path, into: Path) -> Cost:
    return run(talkdown("replay", str(session), "--viewer", "none", "--archive", str(into), "--quiet"))
