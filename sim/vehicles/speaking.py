"""A vehicle on a link: what it says when, and what it answers; no sockets and no clock.

    speaker.vehicle.step()
    speaker.say(now)               the frames that are due at the vehicle's moment
    speaker.hear(frame, now)       the frames that answer a station's

`now` (ns) only times transfers out: where stations are real it is real time, however fast the vehicle's own time goes.
"""

from __future__ import annotations

from dataclasses import dataclass

from adapters.mavlink_frames import Frame, FrameEncoder, fields, message_name
from adapters.mission_server import Said
from sim.sensors import stream
from sim.vehicles.answering import HEARD, SET_MODE, Answerer
from sim.vehicles.motion import Vehicle
from sim.vehicles.sayings import Sayings
from sim.vehicles.sensing import SensorErrors, Sensors
from sim.vehicles.telling import Teller

AUTOPILOT = 1  # MAV_COMP_ID_AUTOPILOT1
_TARGET = {
    number: fields(message_name(number), "target_system", "base_mode" if number == SET_MODE else "target_component")[1]
    for number in HEARD
}


@dataclass(slots=True)
class Speaker:
    """One vehicle on one link: rates and transfers are this link's own."""

    answerer: Answerer
    encoder: FrameEncoder

    @classmethod
    def of(cls, system: int, vehicle: Vehicle, sensors: Sensors, start_ns: int, *, tells_truth: bool = True) -> Speaker:
        """A vehicle of this number. `start_ns`: UTC when it was switched on; `tells_truth`: SIM_STATE."""
        teller = Teller(Sayings(vehicle, sensors, start_ns), tells_truth)
        return cls(Answerer(system, teller), FrameEncoder(system, AUTOPILOT))

    @property
    def vehicle(self) -> Vehicle:
        """Who speaks."""
        return self.answerer.vehicle

    def say(self, now: int) -> list[bytes]:
        """What is due at the vehicle's moment."""
        encode = self.encoder.encode
        frames = [encode(name, **values) for name, values in self.answerer.teller.due()]
        return frames + self._encoded(self.answerer.due(now))

    def hear(self, frame: Frame, now: int) -> list[bytes]:
        """What answers a good frame; nothing where it is not for this vehicle."""
        if frame.message not in HEARD or frame.system == self.encoder.system:
            return []
        system, component = _TARGET[frame.message](frame.payload)
        if system not in (0, self.encoder.system):
            return []
        if frame.message != SET_MODE and component not in (0, AUTOPILOT):
            return []
        return self._encoded(self.answerer.hear(frame, now))

    def _encoded(self, said: list[Said]) -> list[bytes]:
        return [self.encoder.encode(name, **values) for name, values in said]


def sensors_of(seed: int, system: int, errors: SensorErrors | None = None) -> Sensors:
    """The sensors of one vehicle of a world of this seed."""
    return Sensors(errors or SensorErrors(), stream(seed, "sensors", system))
