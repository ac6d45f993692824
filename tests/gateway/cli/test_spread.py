"""Options that come in groups are options like any other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import pytest
import typer

from gateway.cli.spread import spread


@dataclass(frozen=True)
class Pair:
    """Two options, one of them needed."""

    left: Annotated[int, typer.Option("--left")]
    right: Annotated[str, typer.Option("--right")] = "r"


def test_the_fields_of_a_group_are_options_between_those_of_the_command() -> None:
    """They are read from a command line, and passed on as the group; what has no default is asked for."""
    heard: list[tuple[str, Pair, bool]] = []

    def command(name: str, pair: Pair, loud: bool = False) -> None:
        heard.append((name, pair, loud))

    app = typer.Typer()
    app.command()(spread(command))
    app(["x", "--left", "3", "--loud"], standalone_mode=False)
    app(["x", "--left", "4", "--right", "s"], standalone_mode=False)
    assert heard == [("x", Pair(3), True), ("x", Pair(4, "s"), False)]
    with pytest.raises(Exception, match="left"):
        app(["x"], standalone_mode=False)
