"""What a MAVLink component is, in words: by the type and autopilot of its HEARTBEAT, before that by its number.

A vehicle is a component whose HEARTBEAT names an autopilot and a type that moves. Before its first heartbeat component 1
is taken for a vehicle (by custom it is the autopilot), every other component is not.
"""

from __future__ import annotations

ARDUPILOT, INVALID_AUTOPILOT, PX4 = 3, 8, 12
_STATIONS = {
    5: "antenna tracker",
    6: "ground station",
    18: "companion computer",
    26: "gimbal",
    27: "ADS-B receiver",
    30: "camera",
    31: "charging station",
    32: "FLARM",
    33: "servo",
    34: "Remote ID",
    36: "battery",
    37: "parachute",
    38: "log",
    39: "display",
    40: "inertial unit",
    41: "GPS",
    42: "winch",
    44: "illuminator",
}
STATIONS = frozenset(_STATIONS)  # they ride along or stand beside

_BY_NUMBER = (
    (range(1, 2), "autopilot"),
    (range(68, 69), "telemetry radio"),
    (range(100, 106), "camera"),
    (range(140, 154), "servo"),
    (range(154, 155), "gimbal"),
    (range(155, 156), "log"),
    (range(156, 157), "ADS-B receiver"),
    (range(157, 158), "display"),
    (range(160, 161), "FLARM"),
    (range(161, 162), "parachute"),
    (range(169, 170), "winch"),
    (range(171, 176), "gimbal"),
    (range(180, 182), "battery"),
    (range(190, 191), "ground station"),
    (range(191, 199), "companion computer"),
    (range(200, 203), "inertial unit"),
    (range(220, 222), "GPS"),
    (range(236, 239), "Remote ID"),
    (range(240, 243), "bridge"),
)


def is_vehicle(kind: int, autopilot: int) -> bool:
    """Whether a HEARTBEAT of this type and autopilot is a vehicle's."""
    return autopilot != INVALID_AUTOPILOT and kind not in STATIONS


def by_number(component: int) -> str:
    """What a component with this number is by custom."""
    return next((word for numbers, word in _BY_NUMBER if component in numbers), "component")


def by_heartbeat(kind: int, autopilot: int, component: int) -> str:
    """What a component says that it is."""
    if is_vehicle(kind, autopilot):
        return "vehicle"
    return _STATIONS.get(kind) or (by_number(component) if component != 1 else "component")
