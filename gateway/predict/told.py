"""What aircraft say, or are said, to be about to do: plans, where they go next, and the wind that they fly in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from gateway.align import SECOND
from gateway.observation import AirData, FlightPlan, Intent

AIRCRAFT_AT_MOST = 10_000  # a bound on what strangers can make us remember
TELLERS = ("utm", "mission", "high latency")  # whoever stands first is believed first
FORGOTTEN_AFTER = 3600 * SECOND  # of aircraft that are not tracked

Said = FlightPlan | Intent | AirData


@dataclass(frozen=True, slots=True)
class Told:
    """What one aircraft has said; each the newest by when it was valid, whenever it was heard."""

    plan: FlightPlan | None = None
    intents: Mapping[str, Intent] = field(
        default_factory=dict
    )  # by teller; one without a goal withdraws the one before
    wind: AirData | None = None
    at: int = 0  # the newest of all

    @property
    def declared(self) -> Intent | None:
        """The intent that counts, or None."""
        goals = (self.intents.get(teller) for teller in TELLERS)
        return next((one for one in goals if one is not None and has_goal(one)), None)


def has_goal(intent: Intent) -> bool:
    """Whether it says where to."""
    return intent.sequence is not None or intent.latitude_rad is not None


@dataclass(frozen=True, slots=True)
class Tellings:
    """What all aircraft have said."""

    by_aircraft: Mapping[str, Told] = field(default_factory=dict)

    def hearing(self, said: Said) -> Tellings:
        """The same with one thing more; what is older than what is known of its kind changes nothing."""
        known = self.by_aircraft.get(said.aircraft)
        if known is None:
            if len(self.by_aircraft) >= AIRCRAFT_AT_MOST:
                return self
            known = Told()
        after = _after(known, said)
        return self if after is known else Tellings({**self.by_aircraft, said.aircraft: after})

    def remembered(self, tracked: Mapping[str, int], at: int) -> Tellings:
        """The same without aircraft that are not tracked and have said nothing for an hour."""
        gone = [
            name for name, told in self.by_aircraft.items() if name not in tracked and told.at < at - FORGOTTEN_AFTER
        ]
        if not gone:
            return self
        return Tellings({name: told for name, told in self.by_aircraft.items() if name not in gone})


def _after(known: Told, said: Said) -> Told:
    at = max(known.at, said.valid_at)
    if isinstance(said, FlightPlan):
        if known.plan is not None and said.valid_at < known.plan.valid_at:
            return known
        return replace(known, plan=said, at=at)
    if isinstance(said, Intent):
        before = known.intents.get(said.told_by)
        if said.told_by not in TELLERS or (before is not None and said.valid_at < before.valid_at):
            return known
        return replace(known, intents={**known.intents, said.told_by: said}, at=at)
    if said.wind_east_mps is None or said.wind_north_mps is None:
        return known
    if known.wind is not None and said.valid_at < known.wind.valid_at:
        return known
    return replace(known, wind=said, at=at)
