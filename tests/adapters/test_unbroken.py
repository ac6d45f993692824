"""Frames that are counted many at once are counted, and heard, as each by itself."""

import random
from collections import Counter

from hypothesis import example, given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import encode
from adapters.sequences import SequenceCheck, Siblings
from gateway.observation import Attitude, Heard

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
LINKS = [Source(0, "mavlink", "north", "udpin:0"), Source(1, "mavlink", "south", "udpin:1")]
SENDERS = ((0, 1, 1), (0, 1, 1), (0, 1, 154), (0, 2, 1), (1, 1, 1), (1, 3, 190))  # source, system, component
MESSAGES = {
    "HEARTBEAT": {
        "type": 2,
        "autopilot": 3,
        "base_mode": 129,
        "custom_mode": 4,
        "system_status": 4,
        "mavlink_version": 3,
    },
    "ATTITUDE": dict.fromkeys(("time_boot_ms", "roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), 0),
    "SYSTEM_TIME": {"time_boot_ms": 0, "time_unix_usec": 0},
    "MEMINFO": {"brkval": 1, "freemem": 2},
    "VIBRATION": {"time_usec": 1, "vibration_x": 0, "vibration_y": 0, "vibration_z": 0}
    | {f"clipping_{n}": 0 for n in range(3)},
}
FAULTS = ("gap", "twice", "late", "anew", "damage", "version 1", "another sender", "pause", "shared")


def _stream(seed: int, faults: dict[str, int]) -> list[Arrival]:
    """Some hundred frames of several components, with each fault at one place; from "shared" on two share a counter."""
    chance = random.Random(seed)
    at, numbers = {place: fault for fault, place in faults.items()}, dict.fromkeys(SENDERS, 250)
    arrivals, now = [], T0
    for place in range(700):
        fault, sender = at.get(place), chance.choice(SENDERS)
        source, system, component = (0, 9, 9) if fault == "another sender" else sender
        name = chance.choice(list(MESSAGES))
        boot_ms = 20_000 + (now - T0) // 10**6
        times = {"time_boot_ms": boot_ms, "time_unix_usec": now // 1000}
        values = MESSAGES[name] | {key: value for key, value in times.items() if key in MESSAGES[name]}
        counter = (0, 1, 1) if sender == (0, 1, 154) and place >= faults.get("shared", 700) else sender
        numbers[counter] += {"gap": 3, "twice": 0, "late": -4, "anew": -30}.get(fault or "", 1)
        sequence, version = numbers[counter] & 255, 1 if fault == "version 1" else 2
        frame = encode(name, values, system=system, component=component, sequence=sequence, version=version)
        if fault == "damage":
            frame = frame[:-1] + bytes([frame[-1] ^ 0x55])
        now += 6 * SECOND if fault == "pause" else 4_000_000
        arrivals.append(Arrival(now, source, frame))
    return arrivals


def _in_order(said: list[tuple[int, Heard]]) -> list[object]:
    """What was said, one after the other; when it was heard, of what a stage reads and of what people are told."""
    told: list[object] = []
    for place, heard in said:
        for one in heard.observations:
            told.append(one if isinstance(one, Attitude) else (place, heard.now, one))
        told += [(place, heard.now, note) for note in heard.notes]
    return told


def test_what_no_stage_reads_is_one_thing_heard_and_apart_from_what_one_reads() -> None:
    arrivals = [one for one in _stream(3, {}) if one.source == 0]
    decoder = Decoder(LINKS)
    decoder.hear_many(arrivals[:200])
    said, _ = decoder.hear_many(arrivals[200:])
    kinds = [[type(one) is Attitude for one in heard.observations] for _, heard in said]
    assert all(len(set(kind)) <= 1 for kind in kinds)
    assert max(len(kind) for kind in kinds if kind and kind[0]) > 3
    assert max(len(kind) for kind in kinds if kind and not kind[0]) == 1


def _all_of(decoder: Decoder, now: int) -> str:
    """Everything that is known of the components, in words."""
    components = decoder._mavlink.registry.components
    siblings = {
        key: next((other for other in components if components[other].sequence is one.sequence.siblings.newest), None)
        for key, one in components.items()
        if one.sequence.siblings is not None
    }
    states = [
        (key, one.is_vehicle, one.rates.per_second(now), _state(one.sequence))
        for key, one in sorted(components.items())
    ]
    return repr((states, siblings, decoder.counters(), decoder.health(now)))


def _state(check: SequenceCheck) -> tuple[object, ...]:
    return (
        check.last,
        check.message,
        check.recent,
        check.missing,
        check.moved,
        check.messages,
        check.open,
        check.filled,
    )


@given(
    st.integers(0, 1000),
    st.dictionaries(st.sampled_from(FAULTS), st.integers(1, 699), max_size=3),
    st.integers(100, 700),
)
@example(0, {"shared": 100}, 120)
@settings(max_examples=25, deadline=None)
def test_many_at_once_are_heard_and_counted_as_one_by_one(seed: int, faults: dict[str, int], many: int) -> None:
    arrivals, now = _stream(seed, faults), 0
    alone, together = Decoder(LINKS), Decoder(LINKS)
    for first in range(0, len(arrivals), many):
        batch = arrivals[first : first + many]
        one_by_one = [(place, heard) for place, one in enumerate(batch) if (heard := alone.hear(one)) is not None]
        said, refused = together.hear_many(batch)
        assert _in_order(said) == _in_order(one_by_one)
        assert refused == []
        now = batch[-1].received_at
        assert _all_of(together, now) == _all_of(alone, now)


@given(
    st.integers(0, 255), st.lists(st.integers(1, 400), min_size=1, max_size=4), st.lists(st.integers(1, 90), max_size=3)
)
@settings(deadline=None)
def test_numbers_that_run_on_leave_the_check_as_if_each_were_heard(
    first: int, runs: list[int], gaps: list[int]
) -> None:
    alone, together = SequenceCheck(Siblings()), SequenceCheck(Siblings())
    counters, number = Counter[str](), first
    for run, gap in zip(runs, [*gaps, *[1] * len(runs)], strict=False):
        messages = [(number + place) % 5 for place in range(run)]
        for check in (alone, together):
            check.hear(number & 255, 7, counters)
        assert together.goes_on(number + 1 & 255)
        assert not together.goes_on(number + 2 & 255)
        for place, message in enumerate(messages):
            alone.hear(number + 1 + place & 255, message, counters)
        together.run_on(number + 1 & 255, messages)
        assert _state(together) == _state(alone)
        number += run + gap


def test_what_never_was_heard_goes_on_nowhere() -> None:
    assert not SequenceCheck().goes_on(0)


def test_a_component_without_a_counter_of_its_own_is_heard_frame_by_frame() -> None:
    siblings, counters = Siblings(), Counter[str]()
    checks = (SequenceCheck(siblings), SequenceCheck(siblings))
    for number in range(40):
        checks[number % 2].hear(number, 7, counters)
    sharing = [check for check in checks if check.joined is not None]
    assert len(sharing) == 1
    assert not any(check.goes_on(check.last + 1 & 255) for check in sharing)
