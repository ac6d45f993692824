"""When what a frame says was so, in the session's time: by its source's own clock, else by the time of its receipt.

time_boot_ms      ms since boot: sets the source's clock, wraps after 49.7 days
time_usec         microseconds since boot, or since 1970 UTC where it is greater than 10^15
no time at all    the newest time since boot that the component has told, and what has passed since
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from adapters.clock import LIMIT_NS
from adapters.epoch import SessionEpoch, foreign_clock
from adapters.meters import SECOND, SpeedMeter
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import Observation, Timing

Observations = tuple[Observation, ...]
When = tuple[int, Timing]

LEAST_UNIX_USEC = 10**15
_GREATEST_UNIX_USEC = 7_258_118_400 * 10**6  # 2200
WRAP_NS = (1 << 32) * 10**6
STRAY_NS = 10 * SECOND  # a time this far from the component's newest is not of this boot
_SETTLED_NS = 15 * SECOND
_FOREIGN_AT_MOST = 256  # names; of drones anybody can make up any number


@dataclass(slots=True)
class Moments:
    """The times of all MAVLink frames of a session. What there is to say once goes to `notes` as (level, text)."""

    epoch: SessionEpoch
    notes: list[tuple[str, str]]
    _unix_speeds: dict[object, SpeedMeter] = field(default_factory=dict)
    _foreign: set[object] = field(default_factory=set)
    _traffic_since: int | None = None

    def now(self, component: Component, received_at: int) -> int:
        """The component's newest time since boot, ns; the session's time where it has told none."""
        clock = component.clock
        return clock.boot_at(received_at) if clock.has_been_heard() else self.epoch.session_time(received_at)

    def boot(
        self, component: Component, vehicle: Vehicle, boot_ms: int, received_at: int, counters: Counter[str]
    ) -> int | None:
        """A time since boot, unwrapped, ns; None (counted) while it cannot be told whether the source has rebooted."""
        clock = component.clock
        boot_ns = clock.hear(boot_ms, received_at)
        if boot_ns is None:
            counters["clock unsure"] += 1
        if clock.reboots != component.reboots_told:
            component.reboots_told = clock.reboots
            counters["reboots"] += 1
            vehicle.fixes.reboot()
            vehicle.last_attitude = -1
            self.notes.append(("warning", f"{vehicle.name} has rebooted: its clock begins anew."))
        return boot_ns

    def when(self, component: Component, boot_ns: int, received_at: int) -> When:
        """The session's time of a time since boot, and how far that can be trusted."""
        return self.epoch.when(component.clock, boot_ns, received_at)

    def at_receipt(self, component: Component, received_at: int) -> When:
        """When a frame that carries no time was sent, as far as the component's other frames tell."""
        clock = component.clock
        if not clock.has_been_heard():
            return self.epoch.session_time(received_at), Timing.PROVISIONAL
        return self.epoch.when(clock, clock.boot_at(received_at), received_at)

    def shown_at_receipt(self, component: Component, received_at: int) -> int:
        """The same for what is shown and not fused: it leaves no trace."""
        clock = component.clock
        if not clock.has_been_heard():
            return self.epoch.session_time(received_at)
        return clock.boot_at(received_at) + self.epoch.added(clock, received_at)

    def shown_near(self, component: Component, usec: int, received_at: int) -> int:
        """When a time_usec was of something that is shown and not fused; its receipt where that is a time of another clock."""
        boot_ns = self.since_boot(component, usec, received_at)
        if boot_ns is None:
            return self.shown_at_receipt(component, received_at)
        return boot_ns + self.epoch.added(component.clock, received_at)

    def since_boot(self, component: Component, usec: int, received_at: int) -> int | None:
        """A time_usec as time since boot, ns; None where it is UTC, or further than 10 s from the component's newest."""
        clock = component.clock
        if usec >= LEAST_UNIX_USEC or not clock.has_been_heard():
            return None
        boot_ns, newest = usec * 1000, clock.boot_at(received_at)
        if abs(boot_ns - newest) <= STRAY_NS:
            return boot_ns
        apart = (boot_ns - newest + WRAP_NS // 2) % WRAP_NS - WRAP_NS // 2  # one of them has wrapped
        return newest + apart if abs(apart) <= STRAY_NS else None

    def told(
        self, component: Component, vehicle: Vehicle, usec: int, received_at: int, counters: Counter[str]
    ) -> When | None:
        """When a time_usec was that also sets the source's clock; None (counted) while that is unsure."""
        if usec >= LEAST_UNIX_USEC:
            return self.unix(component, vehicle.name, usec, received_at)
        boot_ns = self.boot(component, vehicle, usec // 1000 & 0xFFFFFFFF, received_at, counters)
        return None if boot_ns is None else self.when(component, boot_ns + usec % 1000 * 1000, received_at)

    def unix(self, component: Component, name: str, usec: int, received_at: int) -> When:
        """When a UTC that a message tells was, in the session; the time of receipt as long as that cannot be told."""
        if not LEAST_UNIX_USEC <= usec < _GREATEST_UNIX_USEC:
            return self.at_receipt(component, received_at)
        key = (*component.key, "UTC")
        speed = self._unix_speeds.setdefault(key, SpeedMeter())
        speed.hear(received_at, usec * 1000)
        self.hear_utc(key, name, usec * 1000, received_at, speed.speed)
        timing = self.epoch.timing(key)
        if timing is Timing.PROVISIONAL:
            return self.at_receipt(component, received_at)
        return usec * 1000, timing

    def hear_utc(self, key: object, name: str, utc: int, received_at: int, speed: float | None) -> None:
        """A source's own UTC at a stamp: may settle the session's time, or show that this source is of another."""
        if self.epoch.hear(key, utc, received_at, speed) and self.epoch.offset_s:
            text = f"The session runs on the clock of {name}, {self.epoch.offset_s:+d} s from this machine's."
            self.notes.append(("info", text))
        if self.epoch.timing(key) is Timing.FOREIGN:
            self._say_foreign(key, name, self.epoch.lag_s(key))

    def of_traffic(self, received_at: int) -> When:
        """The session's time of receipt, for what others are heard to say: there is no clock of theirs to ask."""
        if self._traffic_since is None:
            self._traffic_since = received_at
        if self.epoch.offset_s is not None:
            timing = Timing.UTC
        else:
            old = received_at - self._traffic_since >= _SETTLED_NS
            timing = Timing.ENVELOPE if old else Timing.PROVISIONAL
        return self.epoch.session_time(received_at), timing

    def of_hour(self, seconds: float, name: str, received_at: int) -> When:
        """A time told as seconds after the full hour UTC, by the hour that brings it nearest to the session's time."""
        now, timing = self.of_traffic(received_at)
        hour = 3600 * SECOND
        apart = (round(seconds * SECOND) - now % hour + hour // 2) % hour - hour // 2
        if abs(apart) >= LIMIT_NS and timing is Timing.UTC:
            self._say_foreign(name, name, -apart / SECOND)
            timing = Timing.FOREIGN
        return now + apart, timing

    def _say_foreign(self, key: object, name: str, lag_s: float) -> None:
        if key in self._foreign or len(self._foreign) >= _FOREIGN_AT_MOST:
            return
        self._foreign.add(key)
        self.notes.append(("warning", foreign_clock(name, lag_s)))


Reader = Callable[[Moments, Component, Vehicle, bytes, int, Counter[str]], Observations]
