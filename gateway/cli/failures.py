"""Failures that people are told in one plain sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from adapters.reasons import reason_of


class Failure(Exception):
    """Something expected that ends the program; the message is one plain sentence."""

    exit_code = 1


class UsageError(Failure):
    """Wrong usage or a wrong site file."""

    exit_code = 2


class RunError(Failure):
    """A failure while running."""

    exit_code = 1


@contextmanager
def reading(session: Path) -> Iterator[None]:
    """A session, or another file, is read in here. Raises UsageError where it is no whole session, RunError by OSError."""
    from gateway.runtime.folder import FolderError

    try:
        yield
    except FolderError as error:
        raise UsageError(str(error)) from error
    except OSError as error:
        raise RunError(f"{session} could not be read: {reason_of(error)}.") from error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """A file, or a folder of them, is written in here. Raises RunError where the disk refuses."""
    try:
        yield
    except OSError as error:
        raise RunError(f"{path} could not be written: {reason_of(error)}.") from error


@contextmanager
def sending() -> Iterator[None]:
    """Datagrams or frames are sent in here. Raises RunError where the system refuses."""
    try:
        yield
    except OSError as error:
        raise RunError(f"Sending failed: {reason_of(error)}.") from error
