"""A mission as a vehicle carries it out: which item is next, jumps, and the commands that are done on the way.

Item 0 is home, as with ArduPilot. What to fly to are the commands up to 95 (MAV_CMD_NAV_LAST); the others are done when they
come up: DO_JUMP (177) here, the rest by the vehicle, which `advance` gives them to.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from adapters.mission_writing import (
    CHANGE_SPEED,
    LAND,
    LANDING_SEQUENCE,
    LOITER_TO_ALTITUDE,
    TAKE_OFF,
    WAYPOINT,
    MissionItem,
)

LAST_NAVIGATION = 95
LOITER_UNLIMITED, LOITER_TURNS, LOITER_TIME = 17, 18, 19
RETURN_HOME, SPLINE, DELAY = 20, 82, 93
JUMP = 177
TAKEN = frozenset(
    (
        *(WAYPOINT, SPLINE, TAKE_OFF, LAND, RETURN_HOME, DELAY),
        *(LOITER_UNLIMITED, LOITER_TURNS, LOITER_TIME, LOITER_TO_ALTITUDE),
        *(JUMP, CHANGE_SPEED, LANDING_SEQUENCE),
        *(112, 179, 181, 183, 201, 203, 205, 206, 530),  # what others do on the way, a camera, a servo: passed over
    )
)
"""What a mission may hold."""
_JUMPS_IN_A_ROW = 100  # jumps that only lead to jumps would never end


@dataclass(slots=True)
class Mission:
    """The items of one vehicle and how far it has come. `reached` only grows: every item as it was reached."""

    items: tuple[MissionItem, ...] = ()
    current: int = 0
    is_complete: bool = False
    reached: list[int] = field(default_factory=list)
    _jumped: dict[int, int] = field(default_factory=dict)

    @property
    def item(self) -> MissionItem | None:
        """The one that is being flown; None before the start, at the end, or without a mission."""
        return self.items[self.current] if 0 < self.current < len(self.items) and not self.is_complete else None

    def replace(self, items: tuple[MissionItem, ...]) -> None:
        """Another mission, from its beginning. A mission that is being flown goes on at the same number where that exists."""
        self.items = items
        self._jumped.clear()
        if self.current >= len(items):
            self.restart()

    def restart(self) -> None:
        """Back to before the first item."""
        self.current, self.is_complete = 0, False
        self._jumped.clear()

    def go_to(self, number: int) -> list[MissionItem] | None:
        """Go on with this item, or the first after it that can be flown; None, and nothing changes, where it does not exist."""
        if not 0 <= number < len(self.items):
            return None
        self.current, self.is_complete = max(number, 1) - 1, False
        return self.advance()

    def advance(self) -> list[MissionItem]:
        """To the next item that is flown; the commands to be done that were passed on the way."""
        to_do: list[MissionItem] = []
        at, jumps = self.current + 1, 0
        while at < len(self.items) and self.items[at].command > LAST_NAVIGATION and jumps < _JUMPS_IN_A_ROW:
            item = self.items[at]
            if item.command == JUMP:
                jumps += 1
                at = self._jump(at, item)
            else:
                to_do.append(item)
                at += 1
        self.is_complete = at >= len(self.items) or jumps == _JUMPS_IN_A_ROW
        if not self.is_complete:
            self.current = at
        return to_do

    def reach(self) -> list[MissionItem]:
        """The current item is reached: note it, and `advance`."""
        self.reached.append(self.current)
        return self.advance()

    def following(self) -> MissionItem | None:
        """The place after the current one, jumps left aside."""
        return next((one for one in self.items[self.current + 1 :] if one.command <= LAST_NAVIGATION), None)

    def landing_sequence(self) -> int | None:
        """The number of the item at which a landing begins (DO_LAND_START); None where the mission has none."""
        return next((at for at, one in enumerate(self.items) if one.command == LANDING_SEQUENCE), None)

    def _jump(self, at: int, item: MissionItem) -> int:
        """Where a DO_JUMP at `at` leads: to its target so many times (-1: always), then on."""
        target, times = item.parameters[:2]
        if not 1 <= target < len(self.items) or (times >= 0 and self._jumped.get(at, 0) >= times) or times != times:
            return at + 1
        self._jumped[at] = self._jumped.get(at, 0) + 1
        return int(target)
