"""Autopilot and ship in two processes, over MAVLink.

    ship        talkdown simulate vehicle --type ship --mission FILE --mavlink udpout:127.0.0.1:14560
    autopilot   talkdown simulate helmsman --mavlink udpin:0.0.0.0:14560

The ship is any vehicle that is served on links; hers take the helm's orders (`ShipSpeaker`). `steer` is the other process. Served
in real time, an order takes effect a step or two after what it answers. `sail_in_step` waits for each: then both are in step
however fast they go, and the way is that of one process but for what the wire rounds.

Source: 002-5 2.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from adapters.mavlink_frames import Frame, FrameEncoder, fields
from gateway.runtime.conversing import Conversation, wait
from gateway.runtime.links import Link
from gateway.runtime.manners import STATION_HEARTBEAT
from sim.ships.helmsman import FULL, Helmsman
from sim.ships.vessel import Vessel
from sim.vehicles.serving import LinkedVehicles
from sim.vehicles.speaking import Speaker

CONTROL, _read_control = fields("MANUAL_CONTROL", "y", "z", "target")
STATION, COMPONENT = 253, 191  # the helmsman's: no ground station's number, MAV_COMP_ID_ONBOARD_COMPUTER
_ONBOARD = 18  # MAV_TYPE_ONBOARD_CONTROLLER
_HEARTBEAT_S, _ANSWER_S, _LONGEST_WAIT_S = 1.0, 1.0, 0.02
_UNSTEERED_S = 0.01  # of ours, for each step of a ship that nobody steers yet


@dataclass(slots=True)
class ShipSpeaker(Speaker):
    """A ship on a link: she also takes rudder and engine from MANUAL_CONTROL. `taken` counts these."""

    taken: int = 0

    def hear(self, frame: Frame, now: int) -> list[bytes]:
        """What answers a good frame; nothing where it is not for her."""
        vessel = self.vehicle
        if frame.message != CONTROL or not isinstance(vessel, Vessel):
            return Speaker.hear(self, frame, now)
        rudder, engine, target = _read_control(frame.payload)
        if target == self.encoder.system and abs(rudder) <= FULL and abs(engine) <= FULL:
            vessel.take_helm(rudder / FULL * vessel.hull.rudder_limit_rad, engine / FULL)
            self.taken += 1
        return []


def steer(
    link: Link,
    helmsman: Helmsman,
    *,
    asked_to_stop: Callable[[], object] = lambda: None,
    tell: Callable[[str], None] = lambda text: None,
) -> None:
    """Steer whatever ship is on a link until her mission is done, or asked to stop. `tell` is given what people should know."""
    encoder, conversation = FrameEncoder(STATION, COMPONENT), Conversation(link)
    said_at, told = -_HEARTBEAT_S, 0
    while not helmsman.is_done and not asked_to_stop():
        wait([link], _LONGEST_WAIT_S)
        now = time.monotonic_ns()
        for peer, frame in conversation.hear(now):
            for name, values in helmsman.hear(frame, now):
                link.send(encoder.encode(name, **values), peer)
        asks = helmsman.due(now)
        if now / 1e9 - said_at >= _HEARTBEAT_S:
            said_at = now / 1e9
            asks.append(("HEARTBEAT", STATION_HEARTBEAT | {"type": _ONBOARD}))
        for name, values in asks:
            conversation.tell(encoder.encode(name, **values))
        for note in helmsman.notes[told:]:
            tell(note)
        told = len(helmsman.notes)


def sail_in_step(vessel: Vessel, linked: LinkedVehicles, until_s: float) -> list[tuple[float, float, float]]:
    """Sail until a time of the ship's own, waiting up to a second for the helm's answer to each step in MANUAL; she ends in HOLD.

    The way that she was steered: time, east and north, from the first order on. Raises TimeoutError where no answer comes.
    """
    (speaker,) = linked.speakers
    if not isinstance(speaker, ShipSpeaker):
        raise TypeError("only a ship takes the helm's orders")
    way: list[tuple[float, float, float]] = []
    held_s = 0.0  # long enough that her heartbeat has said so
    while vessel.moment.time_s < until_s - 1e-9 and held_s < 2.0 * _HEARTBEAT_S:
        before, is_steered = speaker.taken, bool(way)
        moment = vessel.step()
        linked.send(speaker.say(time.monotonic_ns()))
        if not is_steered:
            time.sleep(_UNSTEERED_S)
        deadline = time.monotonic() + _ANSWER_S
        while is_steered and speaker.taken == before and vessel.mode != "HOLD" and time.monotonic() < deadline:
            wait([linked.link], _LONGEST_WAIT_S)
            linked.listen(time.monotonic_ns())
        if is_steered and speaker.taken == before and vessel.mode == "MANUAL":
            raise TimeoutError(f"nobody steers the ship since {moment.time_s:.1f} s of her time")
        linked.listen(time.monotonic_ns())
        held_s = held_s + vessel.step_s if way and vessel.mode == "HOLD" else 0.0
        if speaker.taken and not held_s:
            spot = vessel.plane.spot(moment.latitude_rad, moment.longitude_rad, moment.height_m)
            way.append((moment.time_s, spot.east_m, spot.north_m))
    return way
