"""A mission as it is carried out."""

from __future__ import annotations

from adapters.mission_writing import MissionItem
from sim.vehicles.missions import Mission

HOME, A, B, C = (MissionItem(16, 47.0, 8.0 + number) for number in range(4))
SPEED = MissionItem(178, parameters=(0.0, 12.0, 0.0, 0.0))


def jump(to: int, times: int) -> MissionItem:
    return MissionItem(177, parameters=(to, times, 0.0, 0.0))


def order_of(mission: Mission, most: int = 12) -> list[int]:
    """The items as they are flown."""
    mission.advance()
    while not mission.is_complete and len(mission.reached) < most:
        mission.reach()
    return mission.reached


def test_commands_on_the_way_are_given_to_be_done_and_are_no_places() -> None:
    mission = Mission((HOME, SPEED, A, B))
    assert mission.item is None
    assert mission.advance() == [SPEED]
    assert mission.item is A
    assert order_of(Mission((HOME, SPEED, A, B))) == [2, 3]


def test_a_jump_is_done_as_often_as_it_says_and_for_ever_where_it_says_so() -> None:
    assert order_of(Mission((HOME, A, B, jump(1, 2), C))) == [1, 2, 1, 2, 1, 2, 4]
    assert order_of(Mission((HOME, A, B, jump(1, -1), C)), most=7) == [1, 2, 1, 2, 1, 2, 1]


def test_jumps_that_only_lead_to_jumps_end_the_mission() -> None:
    mission = Mission((HOME, A, jump(3, -1), jump(2, -1)))
    assert order_of(mission) == [1]
    assert mission.is_complete


def test_a_jump_to_nowhere_is_passed_over() -> None:
    assert order_of(Mission((HOME, A, jump(9, 5), B))) == [1, 3]


def test_going_to_an_item_goes_on_from_there_and_one_that_is_not_there_changes_nothing() -> None:
    mission = Mission((HOME, A, B, C))
    assert mission.go_to(3) == []
    assert mission.item is C
    assert mission.go_to(4) is None
    assert mission.item is C
    assert mission.go_to(0) == []
    assert mission.item is A


def test_another_mission_goes_on_at_the_same_number_or_begins_where_that_is_gone() -> None:
    mission = Mission((HOME, A, B, C))
    mission.go_to(2)
    mission.replace((HOME, B, C))
    assert mission.item is C
    mission.replace((HOME, A))
    assert mission.item is None
    assert not mission.is_complete
