"""UTM_GLOBAL_POSITION (340): what a drone tells the traffic management of where it is, and where it goes next.

    time            us since 1970 UTC                                     valid with flag 1
    lat, lon        degE7; h_acc mm, 1 sigma                              flag 4
    alt             mm above the ELLIPSOID; v_acc mm, 1 sigma             flag 8
    vx, vy          cm/s north, east                                      flag 32
    vz              cm/s DOWN                                             flag 64
    vel_acc         cm/s, 1 sigma
    next_lat, next_lon, next_alt   degE7, mm above the ellipsoid          flag 128: a declared intent
    flight_state    2 on ground, 3 in the air, 16 emergency, 32 without control

An accuracy of 0 or 65535 is not given. relative_alt (above what?) is not used.
"""

from __future__ import annotations

from collections import Counter

from adapters.condition import say_emergency, set_landed
from adapters.fixes import UTM, is_place
from adapters.mavlink_frames import fields
from adapters.moments import Moments, Observations, When
from adapters.positions import DEGE7, is_altitude, show
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import GpsReport, Intent

_FIELDS = ("time", "lat", "lon", "alt", "vx", "vy", "vz", "h_acc", "v_acc", "vel_acc", "flags")
_NEXT = ("next_lat", "next_lon", "next_alt", "flags")
UTM_GLOBAL_POSITION, _read = fields("UTM_GLOBAL_POSITION", *_FIELDS)
_, _read_next = fields("UTM_GLOBAL_POSITION", *_NEXT)
_, _read_state = fields("UTM_GLOBAL_POSITION", "flight_state", "flags")

_TIME, _POSITION, _ALTITUDE, _HORIZONTAL, _VERTICAL, _NEXT_WAYPOINT = 1, 4, 8, 32, 64, 128
_LANDED = {2: "on ground", 3: "in air"}
_EMERGENCIES = {16: "emergency", 32: "no control"}


def utm_position(
    moments: Moments, component: Component, vehicle: Vehicle, payload: bytes, received_at: int, counters: Counter[str]
) -> Observations:
    """A report, an intent when it has changed, or both."""
    usec, *_, flags = _read(payload)
    when = moments.unix(component, vehicle.name, usec if flags & _TIME else 0, received_at)
    state, _ = _read_state(payload)
    set_landed(vehicle, _LANDED.get(state))
    say_emergency(moments, vehicle, _EMERGENCIES.get(state, ""))
    report = _report(moments, component, vehicle, payload, when, received_at, counters)
    intent = _intent(vehicle, payload, when, received_at, counters)
    return tuple(one for one in (report, intent) if one is not None)


def _report(
    moments: Moments,
    component: Component,
    vehicle: Vehicle,
    payload: bytes,
    when: When,
    received_at: int,
    counters: Counter[str],
) -> GpsReport | None:
    usec, latitude, longitude, altitude, north, east, down, *accuracies, flags = _read(payload)
    if not flags & _POSITION:
        counters["position marked invalid"] += 1
        return None
    key = (usec if flags & _TIME else 0, latitude, longitude, altitude, north, east, down)
    fixes, now = vehicle.fixes, moments.epoch.session_time(received_at)
    if fixes.refuses(UTM, key, (latitude, longitude), now):
        return None
    given = bool(flags & _ALTITUDE) and is_altitude(altitude, counters)
    horizontally, vertically = bool(flags & _HORIZONTAL), bool(flags & _VERTICAL)
    if (horizontally and max(abs(north), abs(east)) >= 32767) or (vertically and abs(down) >= 32767):
        counters["velocity out of range"] += 1
        horizontally = vertically = False
    told = [accuracy / 1000 if 0 < accuracy < 65535 else None for accuracy in accuracies]
    told[2] = None if told[2] is None else told[2] * 10  # cm/s
    receiver = fixes.sigmas(moments.now(component, received_at))
    horizontal, vertical, velocity = (own or other for own, other in zip(told, receiver, strict=True))
    show(vehicle, UTM, horizontal)
    return GpsReport(
        vehicle.name,
        when[0],
        received_at,
        latitude * DEGE7,
        longitude * DEGE7,
        height_m=altitude / 1000 if given else None,
        velocity_east_mps=east / 100 if horizontally else None,
        velocity_north_mps=north / 100 if horizontally else None,
        velocity_up_mps=-down / 100 if vertically else None,
        horizontal_sigma_m=horizontal,
        vertical_sigma_m=vertical,
        velocity_sigma_mps=velocity,
        timing=when[1],
    )


def _intent(vehicle: Vehicle, payload: bytes, when: When, received_at: int, counters: Counter[str]) -> Intent | None:
    latitude, longitude, altitude, flags = _read_next(payload)
    if not flags & _NEXT_WAYPOINT:
        withdrawn = vehicle.plan.is_withdrawn("utm")
        return Intent(vehicle.name, when[0], received_at, "utm") if withdrawn else None
    if not is_place(latitude, longitude) or latitude == longitude == 0:
        counters["next waypoint out of range"] += 1
        return None
    if not vehicle.plan.is_new_intent("utm", (latitude, longitude, altitude)):
        return None
    vehicle.words["next waypoint"] = f"{latitude / 1e7:.6f}, {longitude / 1e7:.6f}"
    return Intent(
        vehicle.name,
        when[0],
        received_at,
        "utm",
        latitude_rad=latitude * DEGE7,
        longitude_rad=longitude * DEGE7,
        height_m=altitude / 1000 if is_altitude(altitude, counters) else None,
    )
