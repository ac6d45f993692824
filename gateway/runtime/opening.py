"""What was said before a session's beginning (replay --from) and still holds then.

That is plans, what people declared, states, and where radars stand.
"""

from __future__ import annotations

from collections import deque

from adapters.declared import DECLARED
from gateway.observation import FlightPlan, Heard, Intent, Observation, RadarStatus, VehicleStatus, WeatherArea

_NOTES_AT_MOST = 32


class Opening:
    """Gathers until `begins_at` (a stamp); of each aircraft and radar the newest is kept."""

    def __init__(self, begins_at: int) -> None:
        self.begins_at = begins_at
        self._holding: dict[tuple[type, str | int], Observation] = {}
        self._notes: deque[tuple[str, str]] = deque(maxlen=_NOTES_AT_MOST)

    def keep(self, heard: Heard) -> None:
        """Take in what came before the beginning."""
        for observation in heard.observations:
            if isinstance(observation, FlightPlan | VehicleStatus) or (
                isinstance(observation, Intent) and observation.told_by == DECLARED
            ):
                self._holding[type(observation), observation.aircraft] = observation
            elif isinstance(observation, WeatherArea):
                self._holding[type(observation), observation.name] = observation
            elif isinstance(observation, RadarStatus):
                self._holding[type(observation), observation.radar] = observation
        self._notes += heard.notes

    def deliver(self, now: int) -> Heard:
        """What holds at the beginning, `now` in the session's time."""
        return Heard(now, tuple(self._holding.values()), tuple(self._notes))
