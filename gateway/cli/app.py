"""The command line's root: registers the commands, turns failures into one plain sentence and an exit code."""

from __future__ import annotations

import importlib.util
import sys

import click
import typer


class UsageError(click.ClickException):
    """Wrong usage or a wrong site file: one sentence on stderr, exit code 2."""

    exit_code = 2


class RunError(click.ClickException):
    """A failure while running: one sentence on stderr, exit code 1."""

    exit_code = 1


app = typer.Typer(
    name="talkdown",
    help="A live fusion gateway: MAVLink positions and a landing radar become one track, drawn, archived, replayable.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def run(arguments: list[str]) -> int:
    """Run one command line; the exit code."""
    raise NotImplementedError
