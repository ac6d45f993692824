"""A vehicle that says what a test tells it to."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameEncoder, definitions
from gateway.observation import Observation
from gateway.picture import VehicleHealth

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
BOOT_S = 100


def _zeros(name: str) -> dict[str, Any]:
    """Every field of a message with nothing in it."""
    (message,) = (one for one in definitions().values() if one.msgname == name)
    lengths = dict(zip(message.ordered_fieldnames, message.array_lengths, strict=True))
    kinds = dict(zip(message.fieldnames, message.fieldtypes, strict=True))
    return {
        name: b"" if kind == "char" else [0] * lengths[name] if lengths[name] else 0 for name, kind in kinds.items()
    }


class Speaker:
    """One component on one source of a decoder, at its own time since boot; fields that are not named are 0."""

    T0 = T0

    def __init__(self, decoder: Decoder, source: int, system: int, component: int) -> None:
        self.decoder, self.source = decoder, source
        self.encoder = FrameEncoder(system, component)
        self.second = 0.0
        self.looks = 0
        self.notes: list[str] = []
        if source not in decoder._listened:
            decoder.add(Source(source, "mavlink", f"mavlink-{source + 1}", f"udpin:{source}"))

    @property
    def boot_ms(self) -> int:
        return round((BOOT_S + self.second) * 1000)

    @property
    def stamp(self) -> int:
        return (T0 + round(self.second * SECOND)) // 4000 * 4000

    def say(self, name: str, **values: Any) -> tuple[Observation, ...]:
        heard = self.decoder.feed(
            Arrival(self.stamp, self.source, self.encoder.encode(name, **(_zeros(name) | values)))
        )
        self.notes += [text for _, text in heard.notes]
        return heard.observations

    def one(self, name: str, **values: Any) -> Any:
        """The one observation that comes of it."""
        (observation,) = self.say(name, **values)
        return observation

    def heartbeat(self, kind: int = 1, autopilot: int = 3) -> tuple[Observation, ...]:
        return self.say("HEARTBEAT", type=kind, autopilot=autopilot, base_mode=128, custom_mode=10, mavlink_version=3)

    def estimate(self, **values: Any) -> tuple[Observation, ...]:
        """GLOBAL_POSITION_INT at a place, now."""
        place = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 500_000, "hdg": 9000}
        return self.say("GLOBAL_POSITION_INT", **({"time_boot_ms": self.boot_ms} | place | values))

    def fix(self, **values: Any) -> tuple[Observation, ...]:
        """GPS_RAW_INT with a fix at the same place, now."""
        place = {"lat": 310_000_000, "lon": 1_040_000_000, "alt": 500_000, "alt_ellipsoid": 500_000}
        rest = {"fix_type": 3, "time_usec": self.boot_ms * 1000, "vel": 65535}
        return self.say("GPS_RAW_INT", **(place | rest | values))

    def settle(self) -> None:
        """Three SYSTEM_TIMEs: from then on its time is UTC."""
        for _ in range(3):
            self.second += 1.0
            usec = T0 // 1000 + round(self.second * 1e6)
            self.say("SYSTEM_TIME", time_unix_usec=usec, time_boot_ms=self.boot_ms)

    def counter(self, reason: str) -> int:
        return self.decoder.counters().get(f"mavlink-{self.source + 1} {reason}", 0)

    def health(self) -> SimpleNamespace:
        """What is shown of the first vehicle: `words` and `readings` as dicts."""
        self.looks += 1  # health is made once for each second of stamps
        shown: VehicleHealth = self.decoder.health(self.stamp + SECOND * self.looks).vehicles[0]
        return SimpleNamespace(words=dict(shown.words), readings=dict(shown.readings))


@pytest.fixture
def speaker() -> Callable[..., Speaker]:
    """Makes speakers: `speaker(decoder=None, source=0, system=1, component=1)`."""

    def make(decoder: Decoder | None = None, source: int = 0, system: int = 1, component: int = 1) -> Speaker:
        return Speaker(decoder or Decoder(), source, system, component)

    return make


@pytest.fixture
def plane(speaker: Callable[..., Speaker]) -> Speaker:
    """An ArduPilot plane with a heartbeat and a clock that has settled on UTC."""
    one = speaker()
    one.heartbeat()
    one.settle()
    return one
