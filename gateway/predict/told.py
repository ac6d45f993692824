"""What aircraft say, or are said, to be about to do: plans, where they go next, the wind that they fly in; and the weather."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from gateway.align import SECOND
from gateway.observation import AirData, FlightPlan, Intent, VehicleStatus, WeatherArea
from gateway.predict.modes import ends_at_home, returning
from gateway.settings import Site

AIRCRAFT_AT_MOST = 10_000  # a bound on what strangers can make us remember
AREAS_AT_MOST = 200
TELLERS = ("declared", "utm", "mission", "high latency")  # whoever stands first is believed first
BEFORE_MODES = TELLERS[:2]
HOME_NAME = "home"
FIXED_NAMES = ("runway", "go-around")  # of points that every site has
FORGOTTEN_AFTER = 3600 * SECOND  # of aircraft that are not tracked

Said = FlightPlan | Intent | AirData | WeatherArea | VehicleStatus


@dataclass(frozen=True, slots=True)
class Told:
    """What one aircraft has said; each the newest by when it was valid, whenever it was heard."""

    plan: FlightPlan | None = None
    intents: Mapping[str, Intent] = field(
        default_factory=dict
    )  # by teller; one without a goal withdraws the one before
    wind: AirData | None = None
    status: VehicleStatus | None = None  # the first in which it was in the mode that it is in
    at: int = 0  # the newest of all

    @property
    def declared(self) -> Intent | None:
        """The intent that counts, or None. Who flies home by its mode does so whatever item its mission is at."""
        goals = (self.intents.get(teller) for teller in TELLERS)
        best = next((one for one in goals if one is not None and has_goal(one)), None)
        if self.status is None or not returning(self.status) or (best is not None and best.told_by in BEFORE_MODES):
            return best
        since = self.status.valid_at
        return Intent(self.status.aircraft, since, self.status.received_at, "mission", name=HOME_NAME)

    @property
    def ends_at_home(self) -> bool:
        """Whether it flies home when its plan is done."""
        return self.status is not None and ends_at_home(self.status)


def has_goal(intent: Intent) -> bool:
    """Whether it says where to."""
    return intent.sequence is not None or intent.latitude_rad is not None or intent.name is not None


def known_points(told: Told | None, site: Site) -> tuple[str, ...]:
    """The names of the points that one aircraft can be declared to go to, the plan's items by their numbers."""
    points = told.plan.points if told is not None and told.plan is not None else ()
    home = (HOME_NAME,) if any(point.kind == "home" for point in points) else ()
    items = tuple(str(point.sequence) for point in points if point.kind != "home")
    return (*(waypoint.name for waypoint in site.waypoints), *FIXED_NAMES, *home, *items)


@dataclass(frozen=True, slots=True)
class Tellings:
    """What all aircraft have said, and the areas of weather that people told, by name."""

    by_aircraft: Mapping[str, Told] = field(default_factory=dict)
    weather: Mapping[str, WeatherArea] = field(default_factory=dict)

    def hearing(self, said: Said) -> Tellings:
        """The same with one thing more; what is older than what is known of its kind changes nothing."""
        if isinstance(said, WeatherArea):
            return self._hearing_weather(said)
        known = self.by_aircraft.get(said.aircraft)
        if known is None:
            if isinstance(said, VehicleStatus):
                return self  # of who says nothing of where it goes its mode says nothing either
            if len(self.by_aircraft) >= AIRCRAFT_AT_MOST:
                return self
            known = Told()
        after = _after(known, said)
        return self if after is known else Tellings({**self.by_aircraft, said.aircraft: after}, self.weather)

    def _hearing_weather(self, said: WeatherArea) -> Tellings:
        known = self.weather.get(said.name)
        if (known is not None and said.valid_at < known.valid_at) or (known is None and said.area is None):
            return self
        if known is None and len(self.weather) >= AREAS_AT_MOST:
            return self
        return Tellings(self.by_aircraft, {**self.weather, said.name: said})

    def remembered(self, tracked: Mapping[str, int], at: int) -> Tellings:
        """The same without aircraft that are not tracked and have said nothing for an hour."""
        gone = [
            name for name, told in self.by_aircraft.items() if name not in tracked and told.at < at - FORGOTTEN_AFTER
        ]
        if not gone:
            return self
        return Tellings({name: told for name, told in self.by_aircraft.items() if name not in gone}, self.weather)


def _after(known: Told, said: FlightPlan | Intent | AirData | VehicleStatus) -> Told:
    if isinstance(said, VehicleStatus):
        return _in_mode(known, said)
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
    # `replace` takes three times as long, and winds come thick
    return Told(known.plan, known.intents, said, known.status, at)


def _in_mode(known: Told, said: VehicleStatus) -> Told:
    """The same with the mode that it says, where that is news."""
    before = known.status
    if before is not None and (
        said.valid_at < before.valid_at
        or (said.vehicle_type, said.autopilot, said.custom_mode)
        == (before.vehicle_type, before.autopilot, before.custom_mode)
    ):
        return known
    return replace(known, status=said, at=max(known.at, said.valid_at))
