"""The work of `many` on a Dask cluster: the same jobs, the same outcomes. Its workers see the same files under the same names.

Dask gives what a worker died on to another one, and gives it up when four have died on it.
"""

from __future__ import annotations

import uuid
from collections.abc import Generator, Sequence
from typing import Any

from gateway.runtime.many import Ended, Job, Outcome, program_error

_PATIENCE_S = 20.0


class ClusterError(Exception):
    """A cluster that cannot be used; the message is one plain sentence."""


def on_cluster(job: Job[Any, Any], things: Sequence[Any], scheduler: str) -> Generator[Ended, None, None]:
    """Work on things on the workers of a scheduler, such as "tcp://10.0.0.5:8786"; each outcome as it comes.

    Raises ClusterError when Dask is not installed, or there is no such scheduler.
    """
    try:
        from distributed import Client, as_completed
    except ModuleNotFoundError as error:
        raise ClusterError(
            "--scheduler needs Dask, which is not installed: pip install 'talkdown[cluster]'."
        ) from error
    try:
        client = Client(scheduler, timeout=_PATIENCE_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(
            f"There is no Dask scheduler at {scheduler}: start one with `dask scheduler`, and workers with "
            f"`dask worker {scheduler}`."
        ) from error
    with client:
        run = uuid.uuid4().hex
        futures = [
            client.submit(job.on, thing, key=f"talkdown-{run}-{place}", pure=False)
            for place, thing in enumerate(things)
        ]
        places = {future.key: place for place, future in enumerate(futures)}
        for future in as_completed(futures, loop=client.loop):
            yield places[future.key], _outcome(future)
            future.release()


def _outcome(future: Any) -> Outcome[Any]:
    if future.status == "finished":
        outcome: Outcome[Any] = future.result()
        return outcome
    if future.status == "error":
        return Outcome(failure=_reason(future.exception()))
    return Outcome(failure="The cluster let go of it before it was done.")


def _reason(error: BaseException) -> str:
    from distributed import KilledWorker

    if isinstance(error, KilledWorker):
        return "Every worker of the cluster that worked on it died; perhaps it needs more memory than they have."
    return program_error(error)
