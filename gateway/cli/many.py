"""Commands on many sessions: which they are, how many are worked on at once, and which could not be."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from gateway.cli.failures import Failure, RunError, UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from gateway.runtime.many import Outcome

Thing = TypeVar("Thing")
Result = TypeVar("Result")

_LONG_LINES = 240

SessionsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="SESSION|DIR...", help="Archived sessions, or folders of them.", show_default=False),
]


@dataclass(frozen=True, slots=True)
class Crew:
    """Who works on many sessions."""

    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            metavar="N",
            min=1,
            help="Of many sessions, how many at once. (default: one a core)",
            show_default=False,
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="tcp://HOST:PORT",
            help="Work on many sessions on this Dask cluster, whose workers see the same files.",
            show_default=False,
        ),
    ] = None

    def work_on(
        self,
        work: Callable[[Thing], Result],
        things: Sequence[Thing],
        what: str,
        *,
        show: bool,
    ) -> list[Outcome[Result]]:
        """What comes of each thing, in their order, with a progress bar. Raises UsageError, RunError."""
        from gateway.cli.progress import progressing
        from gateway.runtime.cluster import ClusterError, on_cluster
        from gateway.runtime.many import Job, cores, gathered, in_processes

        if self.scheduler is not None and self.workers is not None:
            raise UsageError("--workers is of this machine: with --scheduler the cluster's workers do it.")
        job, done = Job(work, Failure), 0
        ended = (
            in_processes(job, things, self.workers or cores())
            if self.scheduler is None
            else on_cluster(job, things, self.scheduler)
        )

        def told(count: int) -> None:
            nonlocal done
            done = count
            tell(count / len(things))

        try:
            with closing(ended), progressing(what, show=show) as tell:
                return gathered(ended, len(things), told)
        except ClusterError as error:
            raise UsageError(str(error)) from error
        except KeyboardInterrupt as stopped:
            raise RunError(f"Stopped by Ctrl-C: {done} of {len(things)} sessions were done.") from stopped


def expanded(paths: Sequence[Path], crew: Crew) -> list[Path]:
    """Paths with folders of sessions replaced by their sessions; for a cluster absolute, and so the same elsewhere.

    Raises UsageError for a folder without sessions.
    """
    from gateway.runtime.folder import FolderError
    from gateway.runtime.sessions import session_folders

    found: dict[Path, None] = {}
    for path in paths:
        try:
            inside = session_folders(path) if path.is_dir() else [path]
        except FolderError as error:
            raise UsageError(str(error)) from error
        if not inside:
            raise UsageError(f"{path} is no session, and holds none: session.json is neither in it nor in its folders.")
        found.update(dict.fromkeys(inside if crew.scheduler is None else (one.absolute() for one in inside)))
    return list(found)


def sessions_of(paths: Sequence[Path], crew: Crew) -> list[Path] | None:
    """The sessions that paths name, where they name many: folders of sessions, or several sessions; else None.

    Raises UsageError for what is neither.
    """
    from gateway.runtime.sessions import is_session

    if len(paths) == 1 and (is_session(paths[0]) or not paths[0].is_dir()):
        return None
    for path in paths:
        if not path.is_dir():
            is_file = path.exists()
            raise UsageError(f"{path} is no session: it is no folder." if is_file else f"There is no folder {path}.")
    return expanded(paths, crew)


def wide_console() -> Console:
    """A terminal as it is; elsewhere lines as long as they need to be, for other programs."""
    from rich.console import Console

    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=_LONG_LINES)


def names_of(sessions: Sequence[Path], taken: Callable[[str], bool] = lambda name: False) -> list[str]:
    """What sessions are called where their results stand side by side: their folders' names, numbered where they meet."""
    names: dict[str, None] = {}
    for session in sessions:
        name, number = session.name, 1
        while name in names or taken(name):
            number += 1
            name = f"{session.name}-{number}"
        names[name] = None
    return list(names)


def failures(sessions: Sequence[Path], outcomes: Sequence[Outcome[Any]]) -> list[dict[str, str]]:
    """The sessions that failed, each with its sentence, as plain values."""
    pairs = zip(sessions, outcomes, strict=True)
    return [{"session": str(path), "reason": one.failure} for path, one in pairs if one.failure is not None]


def tell_failures(failed: Sequence[dict[str, str]], of: int) -> None:
    """Name the sessions that failed, on stderr; raises RunError if there are any."""
    for one in failed:
        name, reason = one["session"], one["reason"]
        print(reason if name in reason else f"{name}: {reason}", file=sys.stderr)
    if failed:
        raise RunError(f"{len(failed)} of {of} sessions failed.")
