"""The command line's root: registers the commands, turns failures into one plain sentence and an exit code."""

from __future__ import annotations

import importlib
import sys
from typing import Annotated, cast

import typer

from gateway import __version__
from gateway.cli import (
    check,
    columns,
    declare,
    demo,
    flows,
    live,
    plan,
    play,
    reconstruct,
    register,
    replay,
    report,
    score,
    sessions,
    simulate,
    site,
    study,
)
from gateway.cli.failures import Failure
from gateway.cli.help_texts import flowing

app = typer.Typer(
    name="talkdown",
    help="A live fusion gateway: MAVLink positions and a landing radar become one track, drawn, archived, replayable.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
_COMMANDS = (
    demo,
    live,
    replay,
    simulate,
    declare,
    plan,
    play,
    check,
    columns,
    register,
    reconstruct,
    flows,
    report,
    score,
    site,
    study,
    sessions,
)
for command in _COMMANDS:
    command.register(app)
for registered in app.registered_commands:
    registered.help = flowing(registered.help or "")

# click's UsageError, wherever this version of typer keeps its click
_WRONG_USAGE = cast("type[Exception]", typer.BadParameter.__bases__[0])


@app.callback()
def root(
    version: Annotated[bool, typer.Option("--version", help="Print the version and end.", is_eager=True)] = False,
) -> None:
    """Only there for --version, and so that every command keeps its name."""


_INTERRUPTED = 130  # what the command line's library makes of a KeyboardInterrupt, depending on where it strikes


def run(arguments: list[str]) -> int:
    """Run one command line; the exit code."""
    if arguments == ["--version"]:
        print(f"talkdown {__version__}")
        return 0
    try:
        check_packages()
        result = app(arguments or ["--help"], prog_name="talkdown", standalone_mode=False)
    except Failure as failure:
        return _tell(str(failure), failure.exit_code)
    except typer.Exit as left:
        result = left.exit_code
    except _WRONG_USAGE as refusal:
        return _tell(_sentence(refusal), 2)
    except (KeyboardInterrupt, typer.Abort):
        result = _INTERRUPTED
    except BrokenPipeError:  # the reader of our output has seen enough
        sys.stderr.close()
        return 0
    if result == _INTERRUPTED:
        return _tell(
            "Stopped at once; `talkdown sessions` on the archive's folder completes what was being written.", 1
        )
    return result if isinstance(result, int) else 0


def check_packages() -> None:
    """Raise Failure when another distribution's package `adapters` stands where ours should."""
    found = importlib.import_module("adapters")
    if getattr(found, "DISTRIBUTION", None) != "talkdown":
        where = getattr(found, "__file__", None) or "unknown place"
        raise Failure(
            f"The package 'adapters' found here is another distribution's ({where}); "
            "install talkdown in a virtual environment of its own."
        )


def _sentence(refusal: BaseException) -> str:
    """What the command line's parser says, in one line."""
    told = getattr(refusal, "format_message", None)
    text = " ".join((told() if callable(told) else str(refusal)).split())
    return text if text.endswith((".", "?", "!")) else f"{text}."


def _tell(sentence: str, code: int) -> int:
    print(sentence, file=sys.stderr)
    return code
