"""Sequence numbers, held against whole numbers that never wrap."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.columns import read_columns
from adapters.sequences import SequenceCheck, Siblings

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"


def _counted(heard: list[tuple[int, int]]) -> dict[str, int]:
    check, counters = SequenceCheck(), Counter[str]()
    for number, message in heard:
        check.hear(number & 255, message, counters)
    return {reason: total for reason, total in counters.items() if total}


def _truth(numbers: list[int]) -> dict[str, int]:
    """By brute force, over numbers that do not wrap."""
    told, heard, newest = Counter[str](), set[int](), numbers[0]
    for number in numbers:
        if number in heard:
            told["duplicate"] += 1
        elif number < newest:
            told["reordered"] += 1
        newest = max(newest, number)
        heard.add(number)
    told["lost"] = newest - numbers[0] + 1 - sum(number >= numbers[0] for number in heard)
    return {reason: total for reason, total in told.items() if total}


FATES = st.lists(
    st.tuples(st.integers(0, 9), st.integers(0, 20), st.integers(1, 190)), min_size=1, max_size=300
)  # what happens, how late, how many are lost


@settings(max_examples=200)
@given(st.integers(0, 255), FATES)
def test_losses_duplicates_and_late_frames_are_counted_as_they_are(
    first: int, fates: list[tuple[int, int, int]]
) -> None:
    """Gaps of up to 190, frames up to 20 places late, in any mixture and over any number of turns of 256."""
    arrivals, number = [(0.0, first)], first
    for fate, late, gap in fates:
        number += gap + 1 if fate == 0 else 1
        if fate == 1:
            arrivals.append((number + late + 0.5, number))
        else:
            arrivals.append((float(number), number))
        if fate == 2:
            arrivals.append((number + late + 0.25, number))
    numbers = [one for _, one in sorted(arrivals)]
    assert _counted([(one, one % 7) for one in numbers]) == _truth(numbers)


def test_what_comes_late_from_before_the_first_was_never_lost() -> None:
    assert _counted([(10, 1), (8, 2), (9, 3), (11, 4), (13, 5)]) == {"reordered": 2, "lost": 1}


def test_a_source_that_begins_anew_has_lost_nothing_and_doubled_nothing() -> None:
    """Numbers heard lately come again, with other messages: no duplicates."""
    before = [(number, number % 5) for number in range(41)]
    after = [(number, (number + 1) % 5) for number in range(20, 200)]
    assert _counted(before + after) == {"restarted": 1}


def test_the_same_number_is_a_duplicate_while_numbers_move_and_else_no_numbering() -> None:
    assert _counted([(1, 7), (2, 7), (2, 7), (3, 7)]) == {"duplicate": 1}
    assert _counted([(0, 7)] * 4) == {"unsequenced": 3}
    assert _counted([(0, message) for message in (7, 8, 9, 7, 8)]) == {"unsequenced": 3}


def test_the_real_copter_lost_224_frames_and_its_radio_4() -> None:
    """The difference of neighbours, modulo 256, adds up to 450 for the copter. But one step of 227 of them is no loss of 226:
    the autopilot rebooted there (its boot time falls from 279 s to 19 s), and its numbers began anew, 29 below the last.
    """
    path = RECORDINGS / "copter-lossy-radio.tlog"
    if not path.exists():
        pytest.skip("the recording copter-lossy-radio.tlog is not beside the project")
    frames = read_columns(path, wanted=()).frames
    steps, counted = {}, {}
    for system in (1, 51):
        own = frames[frames["system"] == system]
        steps[system] = np.diff(own["sequence"].astype(int)) % 256
        counted[system] = _counted(list(zip(own["sequence"].tolist(), own["message"].tolist(), strict=True)))
    assert ((steps[1] - 1) % 256).sum() == 450
    assert (steps[1] == 227).sum() == 1
    assert counted == {1: {"lost": 224, "restarted": 1}, 51: {"lost": 4}}


def _two(numbers: list[tuple[int, int]]) -> tuple[Counter[str], Counter[str]]:
    """What is counted of two components of one system; each item is which of them, and its number."""
    siblings, counters = Siblings(), (Counter[str](), Counter[str]())
    checks = (SequenceCheck(siblings), SequenceCheck(siblings))
    for which, number in numbers:
        checks[which].hear(number & 255, 7, counters[which])
    return counters


def test_components_that_share_a_counter_lose_nothing_by_it() -> None:
    """A companion computer that sends for two components counts with one counter; what is lost of both still shows."""
    senders = [0 if number % 5 else 1 for number in range(2000)]
    whole = list(zip(senders, range(2000), strict=True))
    assert [counters["lost"] for counters in _two(whole)] == [0, 0]
    holes = [one for place, one in enumerate(whole) if place not in (1000, 1001, 1503)]
    assert sum(counters["lost"] for counters in _two(holes)) == 3


@settings(max_examples=50)
@given(st.integers(0, 255), st.integers(0, 255), st.lists(st.booleans(), min_size=50, max_size=800))
def test_components_with_counters_of_their_own_are_never_taken_together(
    first: int, second: int, turns: list[bool]
) -> None:
    """Every tenth frame of either is lost, and all of that is counted, however the two take turns."""
    numbers, heard, expected, pending = [first, second], [], [0, 0], [0, 0]
    for place, turn in enumerate(turns):
        which = int(turn)
        numbers[which] += 1
        if place % 10 == 9:
            pending[which] += 1
        else:
            if any(one == which for one, _ in heard):
                expected[which] += pending[which]
            pending[which] = 0
            heard.append((which, numbers[which]))
    assert [counters["lost"] for counters in _two(heard)] == expected


def test_the_submarine_s_companion_lost_nothing() -> None:
    """Its GPS input and its heartbeat come from one program: 1272 gaps in each other's numbers, and none in both together."""
    path = RECORDINGS / "sub-five-components.tlog"
    if not path.exists():
        pytest.skip("the recordings beside the project are not here")
    frames = read_columns(path, []).frames
    frames = frames[(frames["system"] == 1) & np.isin(frames["component"], (194, 220))]
    heard = list(zip((frames["component"] == 220).astype(int).tolist(), frames["sequence"].tolist(), strict=True))
    assert len(heard) == 1275
    assert [counters["lost"] for counters in _two(heard)] == [0, 0]
