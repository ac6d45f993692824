"""The papers' experiments: each module has `run(runs, seed, ...)`, which returns tables, and draws its figures into an .rrd."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

STUDIES = (
    "fusion",
    "smoothing",
    "alpha-beta-gamma",
    "rmimm",
    "prediction",
    "sigmas",
    "conflicts",
    "consistency",
    "noise",
    "tuning",
    "registration",
    "live-registration",
    "clutter",
    "reconstruction",
    "dead-reckoning",
    "flows",
    "routes",
    "ship",
)  # the modules of this package that have a `run`, `-` for `_`

Progress = Callable[[str, float], None]  # what is being done, and the share of the whole that is done


@dataclass(frozen=True, slots=True)
class Table:
    """One table of a study: a title, the columns' headings with their units, and rows of texts and numbers."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str | float, ...], ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Study:
    """What a study found: its tables, the same figures by name, and where its drawings are."""

    name: str
    runs: int
    seed: int
    tables: tuple[Table, ...]
    figures: dict[str, float] = field(default_factory=dict)
    recording: str | None = None


Found = tuple[Table, dict[str, float]]
Steps = Sequence[tuple[str, Callable[[], Found]]]


def gather(steps: Steps, progress: Progress) -> tuple[tuple[Table, ...], dict[str, float]]:
    """The tables of a study's steps, one after another, and their figures together; drawing counts as one step more."""
    tables: list[Table] = []
    figures: dict[str, float] = {}
    for place, (what, make) in enumerate(steps):
        progress(what, place / (len(steps) + 1))
        table, found = make()
        tables.append(table)
        figures |= found
    return tuple(tables), figures


def silent(what: str, share: float) -> None:
    """No progress shown."""
