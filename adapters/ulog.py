"""PX4's .ulg log told as MAVLink; read by pyulog, which the extra `ulog` installs. What becomes what:

    vehicle_status                            HEARTBEAT (each second)
    vehicle_land_detected                     EXTENDED_SYS_STATE (each second)
    vehicle_gps_position, else sensor_gps     GPS_RAW_INT; its UTC becomes that of SYSTEM_TIME
    vehicle_global_position                   GLOBAL_POSITION_INT; velocity and heading where it has none: vehicle_local_position
    vehicle_attitude                          ATTITUDE_QUATERNION
    sensor_combined, vehicle_magnetometer     HIGHRES_IMU
    vehicle_air_data                          HIGHRES_IMU, of its pressure only
    airspeed_validated, else airspeed         VFR_HUD
    wind, else wind_estimate                  WIND_COV
    home_position                             HOME_POSITION
    mission, navigator_mission_item           MISSION_CURRENT, MISSION_ITEM_INT

What a log does not hold is not told. pyulog holds a log's wanted topics in memory.
"""

from __future__ import annotations

import contextlib
import heapq
import io
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from adapters.telling import (
    FIXES_FOR_UTC,
    LONGEST_US,
    Identity,
    Teller,
    utc_offset_us,
)
from adapters.ulog_told import UlogTeller, Values

_CHOICES = (  # the first of each line that the log holds
    ("vehicle_status",),
    ("vehicle_land_detected",),
    ("vehicle_gps_position", "sensor_gps"),
    ("vehicle_local_position",),
    ("vehicle_global_position",),
    ("vehicle_attitude",),
    ("sensor_combined",),
    ("vehicle_magnetometer",),
    ("vehicle_air_data",),
    ("airspeed_validated", "airspeed"),
    ("wind", "wind_estimate"),
    ("home_position",),
    ("mission",),
    ("navigator_mission_item",),
)
_PX4 = 12


class UlogMissing(RuntimeError):
    """pyulog is not installed; the message is one plain sentence."""


class UlogDamaged(ValueError):
    """pyulog could not read the log; the message says why."""


@dataclass(slots=True)
class UlogFrames:
    """A .ulg log, read when it is made: raises UlogMissing and UlogDamaged."""

    path: Path
    identity: Identity = field(init=False)
    _topics: dict[str, Any] = field(init=False)
    _is_damaged: bool = False

    def __post_init__(self) -> None:
        log = _load(self.path)
        self._is_damaged = bool(log.file_corruption)
        present = {data.name: data for data in reversed(log.data_list) if data.multi_id == 0}
        chosen = [next((name for name in names if name in present), None) for names in _CHOICES]
        self._topics = {name: present[name].data for name in chosen if name is not None}
        status = self._first("vehicle_status")
        parameters = log.initial_parameters
        self.identity = Identity(
            _byte(status.get("system_id"), parameters.get("MAV_SYS_ID"), 1),
            _byte(status.get("component_id"), parameters.get("MAV_COMP_ID"), 1),
            _byte(status.get("system_type"), parameters.get("MAV_TYPE"), 0),
            _PX4,
            self._utc_offset_us(),
        )

    def _first(self, name: str) -> Values:
        return next((values for _, _, values in self._entries(name)), {})

    def _utc_offset_us(self) -> int | None:
        differences: list[int] = []
        for name in ("vehicle_gps_position", "sensor_gps"):
            for at_us, _, fix in self._entries(name):
                if fix.get("fix_type", 0) >= 3 and fix.get("time_utc_usec", 0) and len(differences) < FIXES_FOR_UTC:
                    differences.append(int(fix["time_utc_usec"]) - at_us)
        return utc_offset_us(differences)

    def _entries(self, name: str) -> Iterator[tuple[int, int, Values]]:
        """Time, the topic's place in order, and values of every entry of a topic."""
        columns = self._topics.get(name)
        if columns is None or "timestamp" not in columns:
            return
        order = list(self._topics).index(name)
        names = list(columns)
        at = names.index("timestamp")
        for row in zip(*(columns[column] for column in names), strict=False):
            yield int(row[at]), order, {column: value.item() for column, value in zip(names, row, strict=True)}

    def frames(self, counters: Counter[str]) -> Iterator[tuple[int, bytes]]:
        """Stamp (ns since 1970 UTC, strictly increasing multiples of 4000) and frame.

        Counters: "values not usable", "bad timestamps", "damaged parts".
        """
        if self._is_damaged:
            counters["damaged parts"] += 1
        teller = UlogTeller(Teller(self.identity, counters))
        names = list(self._topics)
        merged = heapq.merge(*(self._entries(name) for name in names), key=lambda entry: entry[:2])
        for at_us, order, values in merged:
            if at_us >= LONGEST_US:
                counters["bad timestamps"] += 1
                continue
            yield from teller.hear(at_us, names[order], values)


def _load(path: Path) -> Any:
    try:
        from pyulog import ULog
    except ImportError as error:
        raise UlogMissing("Reading a .ulg log needs pyulog: pip install talkdown[ulog].") from error
    wanted = [name for names in _CHOICES for name in names]
    try:
        # pyulog prints what it stumbles over, and leaves a file open that it opened
        with path.open("rb") as file, contextlib.redirect_stdout(io.StringIO()):
            return ULog(file, wanted)
    except Exception as error:
        raise UlogDamaged(f"it is damaged ({type(error).__name__.lower()}: {error})") from error


def _byte(*candidates: Any) -> int:
    """The first that a MAVLink header can hold."""
    return next(int(one) for one in candidates if isinstance(one, int | float) and 0 <= one <= 255)
