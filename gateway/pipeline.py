"""The data path, in order: align, track, associate, register, fuse, predict. A newcomer starts here.

`step` works some arrivals into the state and returns the picture of what came of them. The unit of work is the arrival:
how arrivals are grouped into steps changes no number. What happens without an observation (checks that are due, coasting,
ends, predictions) happens at its own instant, after every arrival stamped at or before that instant.
"""

from __future__ import annotations

from collections.abc import Sequence

from gateway.observation import Heard
from gateway.picture import Health, Picture
from gateway.state import State, initial
from gateway.work import Work

__all__ = ["State", "initial", "step"]


def step(state: State, heard: Sequence[Heard], health: Health = Health()) -> tuple[State, Picture]:
    """What was heard, worked into the state; and the picture of what came of it.

    Register and predict have instants of their own between the arrivals, each once a second.
    """
    work = Work(state, heard)
    for arrival in heard:
        for at in work.instants_until(arrival):
            work.register(at)
            work.predict(at)
        if not work.takes(arrival):
            continue
        fixes, plots = work.align(arrival)
        tracked = work.track(plots)
        work.associate(fixes, tracked)
        work.fuse(fixes, tracked)
    return work.picture(health)
