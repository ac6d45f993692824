"""The picture: everything that a step of the pipeline found. Sinks see nothing else, so a sink cannot change a number."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.align import Aligned
from gateway.associate import Associated
from gateway.frames import DeckPose
from gateway.fuse import Fused
from gateway.observation import Observation, Truth
from gateway.predict import Predicted
from gateway.reckon import Reckoned
from gateway.register import Registered
from gateway.track import Tracked


@dataclass(frozen=True, slots=True)
class SourceHealth:
    """How one source is doing. `counters` are totals by reason, such as ("crc error", 3)."""

    name: str
    kind: str  # "mavlink", "radar"
    age_s: float  # since it was last heard
    rate_hz: float  # observations a second, over the last 10 s
    lost: int
    counters: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, slots=True)
class VehicleHealth:
    """How one vehicle is heard, and what it last said of itself.

    `readings` and `words` are for people: names with their unit ("airspeed, m/s", 21.3) and ("landed", "on ground").
    """

    aircraft: str
    clock: str  # where its time comes from: "UTC", "least delay", "not settled", "foreign"
    clock_sigma_s: float  # how well its time is known, 1 sigma; NaN = not known yet
    delay_s: (
        float  # the median over the last minute of how much longer than the fastest its frames took; NaN = not known
    )
    delay_99_s: float  # and its 99th percentile
    readings: tuple[tuple[str, float], ...] = ()
    words: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Health:
    """The state of every source, of every vehicle, and of the gateway itself."""

    sources: tuple[SourceHealth, ...] = ()
    vehicles: tuple[VehicleHealth, ...] = ()


@dataclass(frozen=True, slots=True)
class Event:
    """Something that a person should read once. Level: "info", "warning", "error"."""

    at: int  # session time, ns
    level: str
    text: str


@dataclass(frozen=True, slots=True)
class MutedError:
    """How far something was from a position that is muted, level, and by its own word (1 sigma an axis; NaN = none)."""

    aircraft: str
    at: int
    since_s: float  # since the first position that is missing
    what: str  # "track", "dead reckoning", "constant velocity"
    error_m: float
    sigma_m: float
    is_inside: bool  # both axes within three sigma


@dataclass(frozen=True, slots=True)
class Picture:
    """One step's results, in the order of the data path, and what went in.

    `now` is the session's time of the step (ns since 1970 UTC); `step` counts from 0.
    """

    step: int
    now: int
    observations: tuple[Observation, ...]
    align: Aligned
    track: Tracked
    associate: Associated
    register: Registered
    fuse: Fused
    predict: Predicted
    truth: tuple[Truth, ...]
    health: Health
    events: tuple[Event, ...]
    reckoned: tuple[Reckoned, ...] = ()  # where dead reckoning had vehicles at the whole seconds of the step
    muted: tuple[MutedError, ...] = ()
    deck: tuple[DeckPose, ...] = ()  # where a runway that follows a ship was at whole seconds of the step
