"""What autopilots' modes say of where a vehicle goes: who flies home, and who does so once its mission is done.

ArduPilot       aeroplanes and vehicles on the ground and on water: mode 11 is RTL; copters: 6. An aeroplane whose mission
                has no more items goes over to RTL, flies home and circles there; others stay where they are
PX4             main mode 4 (auto), sub mode 5 is return; whose mission is done stays where it is
"""

from __future__ import annotations

from gateway.observation import AEROPLANES, COPTERS, VehicleStatus

ARDUPILOT, PX4 = 3, 12
ARDUPILOT_RTL, COPTER_RTL = 11, 6
PX4_RETURN = 5 << 24 | 4 << 16


def returning(status: VehicleStatus) -> bool:
    """Whether a vehicle is in the mode in which it goes home by itself."""
    if status.autopilot == PX4:
        return status.custom_mode == PX4_RETURN
    wanted = COPTER_RTL if status.vehicle_type in COPTERS else ARDUPILOT_RTL
    return status.autopilot == ARDUPILOT and status.custom_mode == wanted


def ends_at_home(status: VehicleStatus) -> bool:
    """Whether a vehicle goes home when its mission has no more items."""
    return status.autopilot == ARDUPILOT and status.vehicle_type in AEROPLANES


def circles_at_home(status: VehicleStatus) -> bool:
    """Whether a vehicle that has come home circles there: the others land."""
    return status.vehicle_type in AEROPLANES
