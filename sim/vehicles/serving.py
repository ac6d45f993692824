"""Vehicles that stations talk to: flown at the pace of real time or so many times as fast, on links that send and receive.

On a link that listens everybody who was heard is sent everything, as a router would. Behind real time for more than a
second (too many vehicles, too high a speed), the vehicles' time runs slower than asked, and that is said once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from gateway.runtime.conversing import Conversation, wait
from gateway.runtime.links import Link
from sim.vehicles.flying import STEP_S
from sim.vehicles.motion import Vehicle
from sim.vehicles.speaking import Speaker

_LONGEST_WAIT_S = 0.02
_BEHIND_S = 1.0
_QUIET_PEER_NS = 30_000_000_000


@dataclass(slots=True)
class LinkedVehicles:
    """All vehicles on one link. `speakers` are theirs on this link."""

    link: Link
    speakers: Sequence[Speaker]
    sent: int = 0
    _conversation: Conversation = field(init=False)

    def __post_init__(self) -> None:
        self._conversation = Conversation(self.link)

    def send(self, frames: list[bytes]) -> None:
        """To whoever is there."""
        for frame in frames:
            self.sent += self._conversation.tell(frame)

    def listen(self, now: int) -> None:
        """Take in what stations say, and answer."""
        for _, frame in self._conversation.hear(now):
            for speaker in self.speakers:
                self.send(speaker.hear(frame, now))
        self._conversation.forget(now - _QUIET_PEER_NS)


def serve(
    vehicles: Sequence[Vehicle],
    links: Sequence[LinkedVehicles],
    *,
    speed: float = 1.0,
    asked_to_stop: Callable[[], object] = lambda: None,
    tell: Callable[[str], None] = lambda text: None,
) -> None:
    """Fly the vehicles and talk on the links until asked to stop. `tell` is given what people should know, once."""
    voices = [(one, _voices(one, links)) for one in vehicles]
    began, steps, is_slow = time.monotonic(), 0, False
    while not asked_to_stop():
        turn = time.monotonic()
        goal_s = (turn - began) * speed
        while (steps + 1) * STEP_S <= goal_s and time.monotonic() - turn < _LONGEST_WAIT_S:
            steps += 1
            for vehicle, heard in voices:
                _fly_to(vehicle, heard, steps * STEP_S)
        behind_s = goal_s - steps * STEP_S
        if behind_s > _BEHIND_S * speed:
            began += behind_s / speed
            if not is_slow:
                is_slow = True
                tell(
                    f"This machine is too slow for {len(vehicles)} vehicles at {speed:g} times real time: theirs is slower."
                )
        for linked in links:
            linked.listen(time.monotonic_ns())
            for level, text in linked.link.news:
                tell(f"{level}: {text}")
            linked.link.news.clear()
        wait([linked.link for linked in links], min((STEP_S - behind_s) / speed, _LONGEST_WAIT_S))


def _voices(vehicle: Vehicle, links: Sequence[LinkedVehicles]) -> list[tuple[LinkedVehicles, Speaker]]:
    return [(linked, speaker) for linked in links for speaker in linked.speakers if speaker.vehicle is vehicle]


def _fly_to(vehicle: Vehicle, voices: list[tuple[LinkedVehicles, Speaker]], time_s: float) -> None:
    while vehicle.moment.time_s + vehicle.step_s <= time_s + 1e-6:
        vehicle.step()
        for linked, speaker in voices:
            linked.send(speaker.say(time.monotonic_ns()))
