"""The data path, in order: align, track, associate, register, fuse, predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.observation import Heard
from gateway.picture import Health, Picture
from gateway.settings import Options, Site


@dataclass(frozen=True, slots=True)
class State:
    """Everything the picture remembers; immutable."""

    site: Site
    options: Options


def initial(site: Site, options: Options = Options()) -> State:
    """The state before the first arrival."""
    return State(site, options)


def step(state: State, heard: Sequence[Heard], health: Health = Health()) -> tuple[State, Picture]:
    """What was heard, worked into the state; and the picture of what came of it."""
    raise NotImplementedError  # replaced in the next commits
