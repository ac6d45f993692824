"""Which message a vehicle says when. Rates are one link's own, as with ArduPilot: stations change them.

RAW_IMU comes only where it is asked for: HIGHRES_IMU is the better of the two.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from sim.vehicles.sayings import SAYS, Sayings, Values

DEFAULT_HZ: Mapping[str, float] = {
    "HEARTBEAT": 1.0,
    "SYSTEM_TIME": 1.0,
    "SYS_STATUS": 1.0,
    "EXTENDED_SYS_STATE": 1.0,
    "HOME_POSITION": 0.2,
    "MISSION_CURRENT": 1.0,
    "NAV_CONTROLLER_OUTPUT": 2.0,
    "ATTITUDE": 10.0,
    "SIM_STATE": 5.0,
    "HIGHRES_IMU": 50.0,
    "SCALED_PRESSURE": 5.0,
    "VFR_HUD": 5.0,
    "WIND": 1.0,
    "GLOBAL_POSITION_INT": 10.0,
    "GPS_RAW_INT": 5.0,
}
"""In this order where several are due at once: truth right after attitude, the autopilot's position before the receiver's."""
STREAMS: Mapping[int, tuple[str, ...]] = {  # MAV_DATA_STREAM, as ArduPilot fills them
    1: ("SCALED_PRESSURE",),
    2: ("SYS_STATUS", "MISSION_CURRENT", "GPS_RAW_INT", "NAV_CONTROLLER_OUTPUT"),
    6: ("GLOBAL_POSITION_INT",),
    10: ("ATTITUDE", "SIM_STATE"),
    11: ("VFR_HUD",),
    12: ("SYSTEM_TIME", "WIND"),
}
_ORDER = {name: order for order, name in enumerate(SAYS)}
_ROUNDING_S = 1e-6


@dataclass(slots=True)
class Teller:
    """One vehicle's messages on one link, as far as they come by themselves."""

    sayings: Sayings
    is_truth_told: bool = True
    _every_s: dict[str, float] = field(default_factory=dict)
    _due: list[tuple[float, int, str]] = field(default_factory=list)
    _reached: int = 0  # how many of the mission's items were told

    def __post_init__(self) -> None:
        for name, rate in DEFAULT_HZ.items():
            if name != "SIM_STATE" or self.is_truth_told:
                self.set_interval(name, 1.0 / rate)

    def set_interval(self, name: str, every_s: float | None) -> None:
        """From the next step on so often, once a step at most; None: not at all.

        Raises KeyError for what this vehicle does not tell.
        """
        SAYS[name]
        vehicle = self.sayings.vehicle
        self._due = [one for one in self._due if one[2] != name]
        self._every_s.pop(name, None)
        if every_s is not None:
            self._every_s[name] = max(every_s, vehicle.step_s)
            self._due.append((vehicle.moment.time_s + vehicle.step_s, _ORDER[name], name))
        heapq.heapify(self._due)

    def interval_s(self, name: str) -> float | None:
        """How often this message comes; None: not at all. Raises KeyError for what this vehicle does not tell."""
        SAYS[name]
        return self._every_s.get(name)

    def due(self) -> Iterator[tuple[str, Values]]:
        """What is to be said at the vehicle's moment."""
        now = self.sayings.vehicle.moment.time_s
        while self._due and self._due[0][0] <= now + _ROUNDING_S:
            at, order, name = self._due[0]
            every = self._every_s[name]
            is_late = at + every <= now + _ROUNDING_S  # nothing is made up for
            heapq.heapreplace(self._due, ((now if is_late else at) + every, order, name))
            if (values := self.sayings.now(name)) is not None:
                yield name, values
        reached = self.sayings.vehicle.mission.reached
        while self._reached < len(reached):
            yield "MISSION_ITEM_REACHED", {"seq": reached[self._reached]}
            self._reached += 1
