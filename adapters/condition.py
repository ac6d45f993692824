"""What a vehicle says of its own condition.

HEARTBEAT (0)              type, autopilot, base_mode (128 = armed), custom_mode: VehicleStatus
EXTENDED_SYS_STATE (245)   landed_state 1 on ground, 2 in air, 3 taking off, 4 landing, 0 = not known: VehicleStatus
                           when it has changed, and with each heartbeat
SYSTEM_TIME (2)            time_unix_usec, 0 until there is a fix; time_boot_ms: sets the source's clock
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

from adapters.mavlink_frames import fields
from adapters.meters import SECOND
from adapters.moments import Moments, Observations
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import VehicleStatus

HEARTBEAT, read_heartbeat = fields("HEARTBEAT", "type", "autopilot", "base_mode", "custom_mode")
EXTENDED_SYS_STATE, _read_state = fields("EXTENDED_SYS_STATE", "landed_state", "vtol_state")
SYSTEM_TIME, _read_system_time = fields("SYSTEM_TIME", "time_unix_usec", "time_boot_ms")

ARMED = 128
_NO_POSITION_NS = 10 * SECOND
_LANDED = {1: "on ground", 2: "in air", 3: "taking off", 4: "landing"}


def heartbeat(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """HEARTBEAT."""
    kind, autopilot, base_mode, custom_mode = read_heartbeat(payload)
    now = moments.epoch.session_time(received_at)
    if vehicle.first_heartbeat is None or vehicle.first_heartbeat > now:
        vehicle.first_heartbeat = now
    if vehicle.fixes.last_report is None and not vehicle.has_position_warning:
        patience = _NO_POSITION_NS * (3 if vehicle.fixes.reason else 1)
        if now - vehicle.first_heartbeat > patience:
            vehicle.has_position_warning = True
            moments.notes.append(("warning", _no_position(vehicle)))
    valid_at, _ = moments.at_receipt(component, received_at)
    armed = bool(base_mode & ARMED)
    return (keep_status(vehicle, valid_at, received_at, kind, autopilot, armed, custom_mode),)


def keep_status(
    vehicle: Vehicle, valid_at: int, received_at: int, kind: int, autopilot: int, armed: bool, custom_mode: int
) -> VehicleStatus:
    """What a vehicle says of itself, kept for what needs it later."""
    landed = vehicle.words.get("landed")
    status = VehicleStatus(vehicle.name, valid_at, received_at, kind, autopilot, armed, custom_mode, landed)
    vehicle.status = status
    vehicle.words["armed"] = "yes" if armed else "no"
    vehicle.readings["mode"] = custom_mode
    return status


def extended_state(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """EXTENDED_SYS_STATE."""
    landed, _ = _read_state(payload)
    if landed > max(_LANDED):
        counters["landed state unknown"] += 1
        return ()
    set_landed(vehicle, _LANDED.get(landed))
    if vehicle.status is None or vehicle.status.landed == vehicle.words.get("landed"):
        return ()
    valid_at, _ = moments.at_receipt(component, received_at)
    vehicle.status = replace(
        vehicle.status, valid_at=valid_at, received_at=received_at, landed=vehicle.words.get("landed")
    )
    return (vehicle.status,)


def system_time(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """SYSTEM_TIME: nothing is observed; a clock is set."""
    unix_usec, boot_ms = _read_system_time(payload)
    boot_ns = moments.boot(component, vehicle, boot_ms, received_at, counters)
    clock = component.clock
    if boot_ns is None:
        return ()
    if not clock.set_utc(boot_ns, unix_usec * 1000):
        counters["bad time"] += unix_usec >= _LEAST_UNIX_USEC  # less is no date at all: before the first fix
        return ()
    if clock.date_steps and not component.has_date_note:
        component.has_date_note = True
        text = f"{vehicle.name} has set its clock to another date: the session keeps the one that it began with."
        moments.notes.append(("warning", text))
    utc = clock.utc(boot_ns)
    if utc is not None:
        moments.hear_utc(component.key, vehicle.name, utc, received_at, clock.speed.speed)
    return ()


_LEAST_UNIX_USEC = 10**15


def set_landed(vehicle: Vehicle, landed: str | None) -> None:
    """Keep whether a vehicle is on the ground; None where it does not know."""
    if landed is not None:
        vehicle.words["landed"] = landed
    else:
        vehicle.words.pop("landed", None)


def say_emergency(moments: Moments, vehicle: Vehicle, emergency: str) -> None:
    """Say once that a vehicle tells of an emergency; an empty text ends it."""
    if emergency and vehicle.words.get("emergency") != emergency:
        moments.notes.append(("warning", f"{vehicle.name} says of itself: {emergency}."))
        vehicle.words["emergency"] = emergency
    elif not emergency:
        vehicle.words.pop("emergency", None)


def _no_position(vehicle: Vehicle) -> str:
    name, reason = vehicle.name, vehicle.fixes.reason
    if reason:
        return f"{name} sends heartbeats but no position that can be used ({reason}): wait for its GPS fix."
    return (
        f"{name} sends heartbeats but no position for 10 s: have it send GLOBAL_POSITION_INT "
        "(ArduPilot: SR0_POSITION = 5 for its link; PX4: mavlink stream -s GLOBAL_POSITION_INT -r 5)."
    )
