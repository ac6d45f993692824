"""MAVLink frames to observations: what each message means, in SI and radians, and which of them mean nothing.

    HEARTBEAT (0)               VehicleStatus
    SYSTEM_TIME (2)             sets the source's clock
    GPS_RAW_INT (24)            fix, accuracies and ellipsoid height of the positions; a GpsReport where there are no others
    ATTITUDE (30)               Attitude
    GLOBAL_POSITION_INT (33)    GpsReport: degE7, mm above mean sea level, cm/s north, east, DOWN, cdeg of yaw
    SIM_STATE (108)             Truth; SIMSTATE (164) only where SIM_STATE does not come (it has no altitude)
    HOME_POSITION (242), MISSION_COUNT (44), MISSION_ITEM (39), MISSION_ITEM_INT (73)   FlightPlan, overheard

Only vehicles make reports (see vehicles.py). Frames of system 0 are nobody's. A message without a time of its own
(HEARTBEAT, SIM_STATE, mission items) holds at the newest time since boot that its component has told.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from adapters.clock import SessionEpoch
from adapters.fixes import GLOBAL_POSITION_INT, GPS_RAW_INT, fix_time
from adapters.mavlink_frames import Frame, fields
from adapters.meters import SECOND
from adapters.plans import MISSION_MESSAGES, overheard
from adapters.vehicles import Component, Registry, Vehicle
from gateway.observation import Attitude, FlightPlan, Observation, Timing, Truth, VehicleStatus

HEARTBEAT, _read_heartbeat = fields("HEARTBEAT", "type", "autopilot", "base_mode", "custom_mode")
SYSTEM_TIME, _read_system_time = fields("SYSTEM_TIME", "time_unix_usec", "time_boot_ms")
ATTITUDE, _read_attitude = fields("ATTITUDE", "time_boot_ms", "roll", "pitch", "yaw")
SIM_STATE, _read_sim_state = fields("SIM_STATE", "lat_int", "lon_int", "lat", "lon", "alt", "vn", "ve", "vd")
SIMSTATE, _read_simstate = fields("SIMSTATE", "lat", "lng")
HOME_POSITION, _read_home = fields("HOME_POSITION", "latitude", "longitude", "altitude")

_ARMED = 128
_NO_POSITION_NS = 10 * SECOND
_FIX_NOTES = 6  # a fix that comes and goes is told so often and no more
_DEGE7 = math.pi / 180.0 / 1e7

Observations = tuple[Observation, ...]


@dataclass(slots=True)
class MavlinkObserver:
    """All MAVLink sources of a session. What there is to say once gathers in `notes` as (level, text)."""

    epoch: SessionEpoch
    origins: dict[int, str] = field(default_factory=dict)
    notes: list[tuple[str, str]] = field(default_factory=list)
    registry: Registry = field(init=False)
    _readers: dict[int, Callable[[_Heard], Observations]] = field(init=False)

    def __post_init__(self) -> None:
        self.registry = Registry(self.origins, self.notes)
        self._readers = {
            HEARTBEAT: self._heartbeat,
            SYSTEM_TIME: self._system_time,
            GPS_RAW_INT: self._gps_raw,
            GLOBAL_POSITION_INT: self._position,
            ATTITUDE: self._attitude,
            SIM_STATE: self._sim_state,
            SIMSTATE: self._simstate,
            HOME_POSITION: self._home,
        }

    def hear(self, source: int, frame: Frame, received_at: int, counters: Counter[str]) -> Observations:
        """One frame of a source: what it observed; counts in the source's counters what is refused. Never raises."""
        system, message = frame.system, frame.message
        if system == 0:
            counters["system 0"] += 1
            return ()
        component = self.registry.component(source, system, frame.component)
        component.sequence.hear(frame.sequence, message, counters)
        if frame.verdict != "good":
            return ()
        if message in MISSION_MESSAGES:
            return self._mission(component, frame, received_at)
        reader = self._readers.get(message)
        if reader is None:
            return ()
        if message == HEARTBEAT:
            self._role(component, frame)
        if not component.is_vehicle:
            return ()
        vehicle = self.registry.hear(component, frame, received_at, counters)
        if vehicle is None:
            return ()
        return reader(_Heard(component, vehicle, frame.payload, received_at, counters))

    def _role(self, component: Component, frame: Frame) -> None:
        kind, autopilot, _, _ = _read_heartbeat(frame.payload)
        component.take_role(kind, autopilot)

    def _heartbeat(self, heard: _Heard) -> Observations:
        kind, autopilot, base_mode, custom_mode = _read_heartbeat(heard.payload)
        vehicle, now = heard.vehicle, self.epoch.session_time(heard.received_at)
        if vehicle.first_heartbeat is None or vehicle.first_heartbeat > now:
            vehicle.first_heartbeat = now
        if vehicle.fixes.last_report is None and not vehicle.has_position_warning:
            patience = _NO_POSITION_NS * (3 if vehicle.fixes.reason else 1)
            if now - vehicle.first_heartbeat > patience:
                vehicle.has_position_warning = True
                self.notes.append(("warning", _no_position(vehicle)))
        valid_at, _ = self._at_receipt(heard)
        armed = bool(base_mode & _ARMED)
        return (VehicleStatus(vehicle.name, valid_at, heard.received_at, kind, autopilot, armed, custom_mode),)

    def _system_time(self, heard: _Heard) -> Observations:
        unix_usec, boot_ms = _read_system_time(heard.payload)
        boot_ns = self._boot(heard, boot_ms)
        clock = heard.component.clock
        if boot_ns is None or not clock.set_utc(boot_ns, unix_usec * 1000):
            return ()
        utc = clock.utc(boot_ns)
        if utc is not None:
            key = heard.component.key
            if self.epoch.hear(key, utc, heard.received_at, clock.speed.speed):
                self._say_epoch(heard.vehicle.name)
            self._say_foreign(heard.component, heard.vehicle)
        return ()

    def _say_epoch(self, name: str) -> None:
        if self.epoch.offset_s:
            text = f"The session runs on the clock of {name}, {self.epoch.offset_s:+d} s from this machine's."
            self.notes.append(("info", text))

    def _say_foreign(self, component: Component, vehicle: Vehicle) -> None:
        if component.is_named_foreign or self.epoch.timing(component.key) is not Timing.FOREIGN:
            return
        component.is_named_foreign = True
        lag = self.epoch.lag_s(component.key)
        side = "behind" if lag > 0 else "ahead of"
        text = f"The clock of {vehicle.name} is {abs(lag):.0f} s {side} the session's: it is shown, not fused."
        self.notes.append(("warning", text))

    def _gps_raw(self, heard: _Heard) -> Observations:
        clock, fixes = heard.component.clock, heard.vehicle.fixes
        at = clock.boot_at(heard.received_at) if clock.has_been_heard() else fix_time(heard.payload)
        fresh = fixes.hear_fix(heard.payload, at)
        self._say_fix(heard.vehicle)
        if not fresh or not clock.has_been_heard() or not clock.is_settled(heard.received_at):
            return ()
        told = fix_time(heard.payload)
        valid = told if 0 <= at - told <= _LATEST_FIX else at  # the fix's own time, where it is one since this boot
        if fixes.last_position is not None and abs(valid - fixes.last_position) < _SLOWEST_POSITION:
            return ()  # the autopilot's own estimate is better, and it comes
        report = fixes.raw_report(heard.payload, heard.vehicle.name, self._when(heard, valid), heard.received_at, at)
        return () if report is None else (report,)

    def _say_fix(self, vehicle: Vehicle) -> None:
        has_fix = vehicle.fixes.has_fix()
        if has_fix == vehicle.had_fix:
            return
        vehicle.had_fix = has_fix
        vehicle.fix_notes += 1
        if vehicle.fix_notes > _FIX_NOTES:
            return
        if has_fix:
            self.notes.append(("info", f"{vehicle.name} has a GPS fix."))
        else:
            self.notes.append(
                ("warning", f"{vehicle.name} has lost its GPS fix: what it says of its position is not used.")
            )

    def _position(self, heard: _Heard) -> Observations:
        boot_ns = self._boot(heard, int.from_bytes(heard.payload[:4], "little"))
        if boot_ns is None:
            return ()
        when = self._when(heard, boot_ns)
        report = heard.vehicle.fixes.report(heard.payload, heard.vehicle.name, when, heard.received_at, boot_ns)
        return () if report is None else (report,)

    def _attitude(self, heard: _Heard) -> Observations:
        boot_ms, roll, pitch, yaw = _read_attitude(heard.payload)
        boot_ns = self._boot(heard, boot_ms)
        if boot_ns is None:
            return ()
        if not math.isfinite(roll + pitch + yaw):
            heard.counters["not a number"] += 1
            return ()
        valid_at, _ = self._when(heard, boot_ns)
        return (Attitude(heard.vehicle.name, valid_at, heard.received_at, roll, pitch, yaw),)

    def _sim_state(self, heard: _Heard) -> Observations:
        lat_int, lon_int, latitude, longitude, altitude, north, east, down = _read_sim_state(heard.payload)
        heard.vehicle.has_sim_state = True
        if not math.isfinite(latitude + longitude + altitude + north + east + down):
            heard.counters["not a number"] += 1
            return ()
        if lat_int == lon_int == 0:  # an older simulator: floats only, good to a metre
            lat_int, lon_int = latitude * 1e7, longitude * 1e7
        if lat_int == lon_int == 0:
            return ()
        valid_at, _ = self._at_receipt(heard)
        return (
            Truth(
                heard.vehicle.name,
                valid_at,
                heard.received_at,
                lat_int * _DEGE7,
                lon_int * _DEGE7,
                altitude_msl_m=altitude,
                velocity_east_mps=east,
                velocity_north_mps=north,
                velocity_up_mps=-down,
            ),
        )

    def _simstate(self, heard: _Heard) -> Observations:
        latitude, longitude = _read_simstate(heard.payload)
        if heard.vehicle.has_sim_state or latitude == longitude == 0:
            return ()
        valid_at, _ = self._at_receipt(heard)
        return (Truth(heard.vehicle.name, valid_at, heard.received_at, latitude * _DEGE7, longitude * _DEGE7),)

    def _home(self, heard: _Heard) -> Observations:
        latitude, longitude, altitude_mm = _read_home(heard.payload)
        if not heard.vehicle.plan.hear_home(latitude / 1e7, longitude / 1e7, altitude_mm / 1000):
            return ()
        valid_at, _ = self._at_receipt(heard)
        return (FlightPlan(heard.vehicle.name, valid_at, heard.received_at, heard.vehicle.plan.points()),)

    def _mission(self, component: Component, frame: Frame, received_at: int) -> Observations:
        """Mission traffic: of the vehicle that tells its items, or of the one that a station tells them to."""
        told = overheard(frame.message, frame.payload)
        vehicle = self.registry.of_number(
            component.key[0], frame.system if component.is_vehicle else told.target_system
        )
        if not told.act or vehicle is None or not vehicle.plan.hear(told, by_vehicle=component.is_vehicle):
            return ()
        if component.is_vehicle and component.clock.has_been_heard():
            valid_at, _ = self._time(component, component.clock.boot_at(received_at), received_at)
        else:
            valid_at = self.epoch.session_time(received_at)
        return (FlightPlan(vehicle.name, valid_at, received_at, vehicle.plan.points()),)

    def _boot(self, heard: _Heard, boot_ms: int) -> int | None:
        component = heard.component
        boot_ns = component.clock.hear(boot_ms, heard.received_at)
        if boot_ns is None:
            heard.counters["clock unsure"] += 1
        if component.clock.reboots != component.reboots_told:
            component.reboots_told = component.clock.reboots
            heard.counters["reboots"] += 1
            heard.vehicle.fixes.reboot()
            self.notes.append(("warning", f"{heard.vehicle.name} has rebooted: its clock begins anew."))
        return boot_ns

    def _at_receipt(self, heard: _Heard) -> tuple[int, Timing]:
        clock = heard.component.clock
        if not clock.has_been_heard():
            return self.epoch.session_time(heard.received_at), Timing.PROVISIONAL
        return self._when(heard, clock.boot_at(heard.received_at))

    def _when(self, heard: _Heard, boot_ns: int) -> tuple[int, Timing]:
        return self._time(heard.component, boot_ns, heard.received_at)

    def _time(self, component: Component, boot_ns: int, received_at: int) -> tuple[int, Timing]:
        """When something was so in the session's time, and how far that can be trusted."""
        return self.epoch.when(component.clock, boot_ns, received_at)


@dataclass(slots=True)
class _Heard:
    """A frame of a vehicle, on its way to the reader of its message."""

    component: Component
    vehicle: Vehicle
    payload: bytes
    received_at: int
    counters: Counter[str]


_LATEST_FIX = 10 * SECOND  # a fix told later than this is not believed to be of that time
_SLOWEST_POSITION = 12 * SECOND  # a vehicle that sends no position for this long sends none


def _no_position(vehicle: Vehicle) -> str:
    name, reason = vehicle.name, vehicle.fixes.reason
    if reason:
        return f"{name} sends heartbeats but no position that can be used ({reason}): wait for its GPS fix."
    return (
        f"{name} sends heartbeats but no position for 10 s: have it send GLOBAL_POSITION_INT "
        "(ArduPilot: SR0_POSITION = 5 for its link; PX4: mavlink stream -s GLOBAL_POSITION_INT -r 5)."
    )
