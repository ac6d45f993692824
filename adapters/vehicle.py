"""One vehicle: its name, what it last said of itself, and which of its links told what."""

from __future__ import annotations

from dataclasses import dataclass, field

from adapters.fixes import Fixes
from adapters.plans import PlanBook
from gateway.observation import VehicleStatus

_TIMES = 1024


@dataclass(slots=True)
class Vehicle:
    """One vehicle, over all links that carry it."""

    name: str
    system: int
    fixes: Fixes
    plan: PlanBook = field(default_factory=PlanBook)
    sources: set[int] = field(default_factory=set)
    last_heard: int = 0  # stamp
    first_heartbeat: int | None = None  # session time
    has_position_warning: bool = False
    has_sim_state: bool = False
    fix_notes: int = 0
    had_fix: bool = False
    status: VehicleStatus | None = None  # what its last heartbeat said
    last_attitude: int = -1  # time since boot, ns
    attitude_rad: tuple[float, float, float] | None = None  # what it last said, for people
    inertial: dict[tuple[int, int], tuple[float, float, float]] = field(default_factory=dict)  # likewise, by sensor
    readings: dict[str, float] = field(default_factory=dict)  # what it last said, for people: "airspeed, m/s": 21.3
    words: dict[str, str] = field(default_factory=dict)  # and in words: "landed": "on ground"
    told: dict[tuple[int, int, bytes], int] = field(default_factory=dict)  # (component, message, time): its source
    tellers: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)  # (component, message): source, stamp

    def is_told(self, source: int, component: int, message: int, time: bytes) -> bool:
        """Whether another source has told what a component's message says of this time, as its payload has it."""
        key = (component, message, time)
        teller = self.told.setdefault(key, source)
        if len(self.told) > _TIMES:
            del self.told[next(iter(self.told))]
        return teller != source
