"""Which entries of a dataflash log are wanted, and whose log it is: its system, its kind, its UTC.

UTC is GPS time less 18 leap seconds, as ArduPilot itself reckons it, at the time when the receiver's message came (GPA.SMS),
else when it was logged.
"""

from __future__ import annotations

from typing import BinaryIO

from adapters.dataflash_reader import DataflashReader, Values
from adapters.telling import FIXES_FOR_UTC, Identity, utc_offset_us

WANTED = {
    "PARM": ("Name", "Value"),
    "MSG": ("Message",),
    "VER": ("BU",),
    "MODE": ("Mode", "ModeNum"),
    "ARM": ("ArmState",),
    "EV": ("Id",),
    "STAT": ("isFlying", "Armed"),
    "GPS": ("I", "Status", "GMS", "GWk", "NSats", "HDop", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ"),
    "GPA": ("I", "VDop", "HAcc", "VAcc", "SAcc", "SMS", "AEl"),
    "POS": ("Lat", "Lng", "Alt", "RelHomeAlt"),
    "XKF1": ("C", "VN", "VE", "VD"),
    "NKF1": ("C", "VN", "VE", "VD"),
    "XKF2": ("C", "VWN", "VWE"),
    "NKF2": ("C", "VWN", "VWE"),
    "ATT": ("Roll", "Pitch", "Yaw"),
    "IMU": ("I", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ", "T"),
    "MAG": ("I", "MagX", "MagY", "MagZ"),
    "BARO": ("I", "Press", "Temp"),
    "ARSP": ("I", "Airspeed", "DiffPress"),
    "CTUN": ("As", "ThO"),
    "SIM": ("Roll", "Pitch", "Yaw", "Alt", "Lat", "Lng", "Q1", "Q2", "Q3", "Q4"),
    "SIM2": ("VN", "VE", "VD"),
    "ORGN": ("Type", "Lat", "Lng", "Alt"),
    "CMD": ("CTot", "CNum", "CId", "Prm1", "Prm2", "Prm3", "Prm4", "Lat", "Lng", "Alt", "Frame"),
    "MISE": ("CTot", "CNum"),
}
_ARDUPILOT = 3
_TYPES_BY_BUILD = {1: 10, 2: 2, 3: 1, 4: 5, 7: 12, 12: 7, 13: 4}  # VER.BU to MAV_TYPE
_TYPES_BY_WORD = {"Plane": 1, "Copter": 2, "Rover": 10, "Sub": 12, "Blimp": 7, "Tracker": 5}
_BOAT, _ROVER, _BOAT_FRAME = 11, 10, 2
_SYSTEM_PARAMETERS = ("SYSID_THISMAV", "MAV_SYSID")
_GPS_EPOCH_S, _LEAP_S, _WEEK_S = 315_964_800, 18, 604_800


def identity_of(file: BinaryIO) -> Identity:
    """Whose log it is. Reads until its UTC is known, else to the end."""
    system, kind, boat, differences = 1, 0, False, []
    for moment in DataflashReader(file, WANTED).moments():
        latest = {entry.name: entry.values for entry in moment if entry.values.get("I", 0) == 0}
        for entry in moment:
            values = entry.values
            if entry.name == "VER":
                kind = _TYPES_BY_BUILD.get(values.get("BU", 0), kind)
            elif entry.name == "MSG" and not kind:
                said = values.get("Message", "")
                kind = next((one for word, one in _TYPES_BY_WORD.items() if f"Ardu{word}" in said or word == said), 0)
            elif entry.name == "PARM" and values.get("Name") in _SYSTEM_PARAMETERS:
                system = int(values["Value"]) if 1 <= values.get("Value", 0) <= 255 else system
            elif entry.name == "PARM" and values.get("Name") == "FRAME_CLASS":
                boat = values.get("Value") == _BOAT_FRAME
        if "GPS" in latest and (difference := _difference_us(moment[0].time_us, latest)) is not None:
            differences.append(difference)
            if len(differences) == FIXES_FOR_UTC:
                break
    kind = _BOAT if boat and kind == _ROVER else kind
    return Identity(system, 1, kind, _ARDUPILOT, utc_offset_us(differences))


def _difference_us(time_us: int, latest: dict[str, Values]) -> int | None:
    """UTC minus time since boot by one fix; None where the receiver knows no time."""
    fix, accuracies = latest["GPS"], latest.get("GPA", {})
    week, milliseconds, sampled_ms = fix.get("GWk"), fix.get("GMS"), accuracies.get("SMS")
    if not isinstance(week, int) or not isinstance(milliseconds, int) or fix.get("Status", 0) < 3:
        return None
    at_us = sampled_ms * 1000 if sampled_ms and isinstance(sampled_ms, int) else time_us
    return (_GPS_EPOCH_S - _LEAP_S + week * _WEEK_S) * 10**6 + milliseconds * 1000 - at_us
