"""A recording or a session run again: what is wanted of it, and the many sessions of which the same is wanted."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from adapters.reasons import reason_of
from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError
from gateway.cli.many import Crew, failures, names_of, tell_failures, wide_console
from gateway.cli.replay_options import Methods, Section

if TYPE_CHECKING:
    from gateway.runtime.playback import Playback
    from gateway.runtime.setup import Place, Setup
    from gateway.runtime.told_plans import Missions
    from gateway.settings import Options

SMOOTHED = ("kalman", "imm", "rmimm")  # the estimators that a smoother can go back over


@dataclass(frozen=True, slots=True)
class Wanted:
    """What is wanted of recordings that are run again."""

    section: Section = Section()
    methods: Methods = Methods()
    smooth: bool = False
    place: Place | None = None  # None: the recording's own
    keys: Mapping[int, bytes] = field(default_factory=dict)
    signing_key: bytes | None = field(default=None, repr=False)
    command: tuple[str, ...] = ()

    def opened(self, files: Sequence[Path], plans: Missions = ()) -> tuple[Playback, Setup]:
        """The recording, and how it is run. Raises FileError, FolderError, SeekError, UsageError."""
        from gateway.runtime.playback import open_playback

        playback = open_playback(files, plans, self.signing_key)
        options = self.methods.change(playback.options)
        if self.smooth:
            check_smoothing(options)
        playback, options = self.section.cut(playback, options)
        flows = take.read_flows(self.methods.flows)
        has_own_place = self.place is not None or playback.place is not None
        setup = playback.setup(self.place)
        return playback, replace(
            setup,
            options=options,
            flows=setup.flows if flows is None else flows,
            keys=self.keys,
            signing_key=self.signing_key,
            smooth=self.smooth,
            name="" if has_own_place else files[0].stem,
            command=self.command,
        )


def wanted(section: Section, methods: Methods, site: Path | None, key: Path | None, *, smooth: bool = False) -> Wanted:
    """What the command line wants. Raises UsageError."""
    place = take.read_place(site)
    return Wanted(
        section,
        methods,
        smooth,
        place,
        take.read_keys(place, site),
        take.read_signing_key(key),
        tuple(sys.argv[1:]),
    )


def check_smoothing(options: Options) -> None:
    """Raise UsageError where --smooth was asked for with an estimator that it cannot go back over."""
    if options.estimator not in SMOOTHED:
        raise UsageError(
            f"--smooth cannot go back over {options.estimator}, which keeps no covariances that hold together; "
            f"choose --estimator {', '.join(SMOOTHED[:-1])} or {SMOOTHED[-1]}."
        )


def replay_one(thing: tuple[Path, Path | None], wanted: Wanted) -> dict[str, Any]:
    """The unit of work on many: (session, the folder that its replay becomes, or None) -> the summary as plain values.

    The replay grows beside its folder and is moved there when it is complete, so that a process may die at any time.
    Raises UsageError, RunError.
    """
    from adapters.files import FileError
    from gateway.runtime.folder import FolderError
    from gateway.runtime.loop import run_replay
    from gateway.runtime.seeking import SeekError
    from gateway.runtime.setup import RunFailure

    session, target = thing
    try:
        playback, setup = wanted.opened([session])
        if target is not None:
            shutil.rmtree(_growing(target), ignore_errors=True)  # what an attempt before this one left
            setup = replace(setup, archive=_growing(target), folder_name=target.name)
        summary = run_replay(playback, replace(setup, is_watched=False))
        if target is not None and summary.archive is not None:
            _settle(summary.archive, target)
            summary = replace(summary, archive=target)
    except (FileError, FolderError, SeekError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
    except OSError as error:
        raise RunError(f"{target or session}: {reason_of(error)}.") from error
    return summary.document()


def _growing(target: Path) -> Path:
    """Where a replay stands until it is complete; `talkdown sessions` does not see it there."""
    return target.with_name(f".{target.name}.part")


def _settle(folder: Path, target: Path) -> None:
    """Move a complete session to its place. Raises FolderError, OSError."""
    from gateway.runtime.folder import read_record, write_record

    record = read_record(folder)
    write_record(folder, replace(record, summary={**record.summary, "archive": str(target)}))
    os.rename(folder, target)
    folder.parent.rmdir()


def replay_many(
    sessions: Sequence[Path], wanted: Wanted, archive: Path | None, crew: Crew, telling: take.Telling
) -> None:
    """Run many sessions again; those that fail are named at the end. Raises UsageError, RunError."""
    targets = _targets(sessions, archive, crew)
    things = list(zip(sessions, targets, strict=True))
    try:
        outcomes = crew.work_on(partial(replay_one, wanted=wanted), things, "replaying", show=not telling.quiet)
    finally:
        for target in filter(None, targets):
            shutil.rmtree(_growing(target), ignore_errors=True)  # of those that failed or were stopped
    failed = failures(sessions, outcomes)
    if telling.json:
        import json

        documents = [
            {"session": str(session), **one.result}
            for session, one in zip(sessions, outcomes, strict=True)
            if one.result is not None
        ]
        print(json.dumps({"sessions": documents, "failed": failed}, default=str))
    elif not telling.quiet:
        _show(names_of(sessions), [one.result for one in outcomes], archive)
    tell_failures(failed, len(sessions))


def _targets(sessions: Sequence[Path], archive: Path | None, crew: Crew) -> list[Path | None]:
    """What each session's replay becomes in the archive: a folder of its own name."""
    if archive is None:
        return [None] * len(sessions)
    if (archive / "session.json").exists():
        raise UsageError(f"{archive} is a session already; name the folder that sessions are kept in.")
    try:
        archive.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{archive} cannot be written to ({reason_of(error)}); choose another folder for --archive."
        ) from error
    inside = archive if crew.scheduler is None else archive.absolute()
    return [inside / name for name in names_of(sessions, lambda name: (inside / name).exists())]


def _show(names: Sequence[str], documents: Sequence[dict[str, Any] | None], archive: Path | None) -> None:
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for place, column in enumerate(("session", "length", "in", "tracks", "updates", "fused, RMSE m")):
        table.add_column(column, justify="right" if place else "left", no_wrap=True)
    for name, one in zip(names, documents, strict=True):
        if one is None:
            continue
        fused = one["accuracy"].get("fused")
        table.add_row(
            name,
            f"{one['duration_s']:.0f} s",
            f"{one['wall_s']:.1f} s",
            str(one["tracks"]),
            str(one["track_rows"]),
            "-" if fused is None else f"{fused['rmse_m']:.2f}",
        )
    console = wide_console()
    console.print(table)
    if archive is not None:
        console.print(f"archived in {archive}", soft_wrap=True)
