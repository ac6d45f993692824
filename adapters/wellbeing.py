"""How each vehicle of a session is heard, for people: its clock, its link's delays, its message rates, who rides along."""

from __future__ import annotations

import math

from adapters import motion
from adapters.epoch import SessionEpoch
from adapters.mavlink_frames import message_name
from adapters.vehicle import Vehicle
from adapters.vehicles import Component, Registry
from gateway.observation import Timing
from gateway.picture import VehicleHealth

_CLOCKS = {
    Timing.UTC: "UTC",
    Timing.ENVELOPE: "least delay",
    Timing.PROVISIONAL: "not settled",
    Timing.FOREIGN: "foreign",
}


def vehicles_health(
    registry: Registry, epoch: SessionEpoch, names: dict[int, str], received_at: int
) -> tuple[VehicleHealth, ...]:
    """Every vehicle at a stamp. `names`: of the sources, by number. Changes nothing."""
    by_place: dict[tuple[int, int], list[Component]] = {}
    by_source: dict[int, list[Component]] = {}
    for key, component in registry.components.items():
        by_place.setdefault(key[:2], []).append(component)
        by_source.setdefault(key[0], []).append(component)
    found = []
    for vehicle in registry.vehicles():
        own = [
            component
            for source in sorted(vehicle.sources)
            for component in by_place.get((source, vehicle.system), ())
            if component.is_vehicle
        ]
        if own:
            around = [component for source in sorted(vehicle.sources) for component in by_source[source]]
            found.append(_vehicle(vehicle, own, around, epoch, names, received_at))
    return tuple(found)


def _vehicle(
    vehicle: Vehicle,
    own: list[Component],
    around: list[Component],
    epoch: SessionEpoch,
    names: dict[int, str],
    received_at: int,
) -> VehicleHealth:
    leader = min(own, key=_delay)
    clock = leader.clock
    told = clock.authority()
    timing = Timing.PROVISIONAL if told.utc_offset is None else epoch.timing(told.key)
    if timing is Timing.PROVISIONAL and clock.has_been_heard() and clock.is_old(received_at):
        timing = Timing.ENVELOPE
    settled = timing is not Timing.PROVISIONAL
    delay_s, delay_99_s = clock.delays.quantiles(0.5, 0.99)
    words = dict(vehicle.words)
    if len(vehicle.sources) > 1:
        words["heard over"] = ", ".join(names[source] for source in sorted(vehicle.sources))
    if beside := _beside(around, own):
        words["also on this link"] = beside
    if told.date_steps:
        words["date"] = "set anew while the session ran; the session keeps the one that it began with"
    return VehicleHealth(
        vehicle.name,
        _CLOCKS[timing],
        (told if timing in (Timing.UTC, Timing.FOREIGN) else clock).sigma_s() if settled else math.nan,
        delay_s,
        delay_99_s,
        (*motion.readings(vehicle).items(), *sorted(vehicle.readings.items()), *_rates(own, received_at)),
        tuple(words.items()),
    )


def _delay(component: Component) -> tuple[bool, int]:
    least = component.clock.least_delay()
    return least is None, least or 0


def _beside(around: list[Component], own: list[Component]) -> str:
    """Who else is heard there: "ground station 255/190, gimbal 1/154" (system and component)."""
    others = {
        component.key[1:]: component.role
        for component in around
        if not component.is_vehicle and component.key[1:] not in {one.key[1:] for one in own}
    }
    return ", ".join(f"{role} {system}/{number}" for (system, number), role in sorted(others.items()))


def _rates(own: list[Component], received_at: int) -> list[tuple[str, float]]:
    """Messages a second by kind, over all links: ("RAW_IMU, 1/s", 25.0)."""
    rates: dict[int, float] = {}
    for component in own:
        for kind, rate in component.rates.per_second(received_at).items():
            rates[kind] = rates.get(kind, 0.0) + rate
    return [(f"{message_name(kind)}, 1/s", rate) for kind, rate in sorted(rates.items())]
