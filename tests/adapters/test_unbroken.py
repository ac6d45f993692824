"""Frames that are counted many at once are counted, and heard, as each by itself."""

import math
import random
from collections import Counter

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from adapters import Arrival, Source, waiting
from adapters.decode import Decoder
from adapters.mavlink_frames import encode
from adapters.sequences import SequenceCheck, Siblings
from gateway.observation import AirData, Attitude, Heard, ImuSample, Many

SECOND = 10**9
T0 = 1_790_000_000 * SECOND
LINKS = [Source(0, "mavlink", "north", "udpin:0"), Source(1, "mavlink", "south", "udpin:1")]
SENDERS = (  # source, system, component
    *((0, 1, 1), (0, 1, 1), (0, 1, 154), (1, 1, 1), (1, 3, 190)),
    *((0, 2, 1), (0, 2, 1), (0, 2, 1), (0, 4, 1), (0, 4, 1), (1, 5, 1)),
)
NO, HUGE = math.nan, 1e9
AXES = ("xacc", "yacc", "zacc", "xgyro", "ygyro", "zgyro", "xmag", "ymag", "zmag")
HEARTBEAT = {"type": 2, "autopilot": 3, "base_mode": 129, "custom_mode": 4, "system_status": 4, "mavlink_version": 3}
VALUES: dict[str, dict[str, tuple[float, ...]]] = {
    "HEARTBEAT": {name: (value,) for name, value in HEARTBEAT.items()},
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), (0.0, 0.25)),
    "SYSTEM_TIME": {},
    "MEMINFO": {"brkval": (1,), "freemem": (2,)},
    "VIBRATION": dict.fromkeys(
        ("vibration_x", "vibration_y", "vibration_z", *(f"clipping_{n}" for n in range(3))), (0,)
    ),
    "RAW_IMU": dict.fromkeys(AXES, (0, 7, -1000, 7, 32767)) | {"id": (0, 0, 2, 255), "temperature": (0,)},
    "SCALED_IMU": dict.fromkeys(AXES, (0, 0, 0, -980)),
    "SCALED_IMU2": dict.fromkeys(AXES, (250, -32768, 1, 7)),
    "VFR_HUD": dict.fromkeys(("airspeed", "groundspeed", "alt", "climb"), (1.5, -2.5, NO, HUGE, NO, 33.3))
    | {"heading": (0,), "throttle": (0,)},
    "SCALED_PRESSURE": {"press_abs": (945.3, 0.0, NO), "press_diff": (1.1, -HUGE), "temperature": (-1, 2000)},
    "WIND": {"direction": (-181.7, 33.3, NO), "speed": (0.7, 2.2, HUGE), "speed_z": (0.3, NO)},
    "WIND_COV": dict.fromkeys(("wind_x", "wind_y", "wind_z"), (1.1, -0.3, NO, HUGE))
    | dict.fromkeys(("var_horiz", "var_vert", "wind_alt", "horiz_accuracy", "vert_accuracy"), (0.0,)),
}
BOOT_MS = ("ATTITUDE", "SYSTEM_TIME", "SCALED_IMU", "SCALED_IMU2", "SCALED_PRESSURE")
USEC = ("VIBRATION", "RAW_IMU", "WIND_COV")
SHOWN = ("RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "VFR_HUD", "SCALED_PRESSURE", "WIND", "WIND_COV")
FAULTS = ("gap", "twice", "late", "anew", "damage", "version 1", "another sender", "pause", "shared")
CHANGES = ("reboots", "sets another date", "other autopilot", "is none", "over two links")


def _stream(seed: int, faults: dict[str, int]) -> list[Arrival]:
    """Some hundred frames of several components, with each fault at one place; from "shared" on two share a counter.

    From the place of a change on, system 2 is not what it was. System 4 never tells a UTC.
    """
    chance = random.Random(seed)
    at, numbers = {place: fault for fault, place in faults.items()}, dict.fromkeys(SENDERS, 250)
    arrivals, now = [], T0
    for place in range(700):
        fault, sender = at.get(place), chance.choice(SENDERS)
        if sender == (0, 2, 1) and faults.get("over two links", 700) <= place and chance.random() < 0.5:
            sender = (1, 2, 1)
        source, system, component = (0, 9, 9) if fault == "another sender" else sender
        changed = {change for change in CHANGES if system == 2 and faults.get(change, 700) <= place}
        name = chance.choice([*VALUES, *SHOWN, *SHOWN])
        values = {field: chance.choice(some) for field, some in VALUES[name].items()}
        boot_ms = (now - T0) // 10**6 + (20_000 if "reboots" not in changed else 1000 - (faults["reboots"] * 4))
        if name in BOOT_MS:
            values["time_boot_ms"] = max(boot_ms - chance.choice((0, 0, 30)), 0)
        if name in USEC:
            values["time_usec"] = chance.choice((max(boot_ms, 0) * 1000 + 7, 3, 2**64 - 1))
        if name == "SYSTEM_TIME":
            late_us = 3_600_000_000 * ("sets another date" in changed) + chance.randrange(3000)
            values["time_unix_usec"] = 0 if system == 4 else now // 1000 - late_us
        if name == "HEARTBEAT":
            values |= {"autopilot": 12} if "other autopilot" in changed else {}
            values |= {"autopilot": 8, "type": 6} if "is none" in changed else {}
        counter = (0, 1, 1) if sender == (0, 1, 154) and place >= faults.get("shared", 700) else sender
        numbers[counter] = numbers.get(counter, 0) + {"gap": 3, "twice": 0, "late": -4, "anew": -30}.get(fault or "", 1)
        sequence, version = numbers[counter] & 255, 1 if fault == "version 1" else 2
        frame = encode(name, values, system=system, component=component, sequence=sequence, version=version)
        if fault == "damage":
            frame = frame[:-1] + bytes([frame[-1] ^ 0x55])
        now += 6 * SECOND if fault == "pause" else 4_000_000
        arrivals.append(Arrival(now, source, frame))
    return arrivals


def _in_order(said: list[tuple[int, Heard]]) -> list[object]:
    """What a stage reads and what people are told, when it was heard; then all the rest, by what is in it."""
    staged: list[object] = []
    passing: list[object] = []
    for place, heard in said:
        for one in heard.observations:
            if isinstance(one, Many):
                passing += one
            elif isinstance(one, Attitude | ImuSample) or (isinstance(one, AirData) and one.wind_east_mps is None):
                passing.append(one)
            else:
                staged.append((place, heard.now, one))
        staged += [(place, heard.now, note) for note in heard.notes]
    return staged + sorted(passing, key=repr)


def test_what_no_stage_reads_is_one_thing_heard_a_second_and_apart_from_what_one_reads() -> None:
    arrivals = [one for one in _stream(3, {}) if one.source == 0]
    decoder = Decoder(LINKS)
    decoder.hear_many(arrivals[:200])
    said, _ = decoder.hear_many(arrivals[200:])
    passing = [[isinstance(one, Attitude | Many) for one in heard.observations] for _, heard in said]
    assert all(len(set(one)) <= 1 for one in passing)
    gathered = [heard for (_, heard), one in zip(said, passing, strict=True) if any(one)]
    seconds = {heard.now // SECOND for heard in gathered}
    assert len(gathered) <= len(seconds) + sum(bool(heard.notes) for heard in gathered)
    many = [one for heard in gathered for one in heard.observations if isinstance(one, Many)]
    assert max(map(len, many)) > 10


def test_observations_are_counted_for_the_sources_that_made_them_whatever_their_numbers() -> None:
    """Sources 3 and 7, of which 7 sends only what is no number: they are no observations, as one by one."""
    links = [Source(3, "mavlink", "north", "udpin:0"), Source(7, "mavlink", "south", "udpin:1")]
    alone, together = Decoder(links), Decoder(links)
    arrivals = []
    for place in range(600):
        number, sequence, now = (3, 7)[place % 2], place // 2 & 255, T0 + place * 4_000_000
        name = ("HEARTBEAT", "SYSTEM_TIME")[place // 2] if place < 4 else "VFR_HUD"
        values = {field: some[0] for field, some in VALUES[name].items()}
        if name == "SYSTEM_TIME":
            values |= {"time_boot_ms": 20_000 + place * 4, "time_unix_usec": now // 1000}
        if name == "VFR_HUD" and number == 7:
            values |= dict.fromkeys(("airspeed", "groundspeed", "alt", "climb"), NO)
        frame = encode(name, values, system=number, component=1, sequence=sequence)
        arrivals.append(Arrival(now, number, frame))
    for one in arrivals:
        alone.hear(one)
    for first in range(0, len(arrivals), 100):
        together.hear_many(arrivals[first : first + 100])
    rates = {source.name: source.rate_hz for source in together.health(arrivals[-1].received_at).sources}
    assert rates["north"] > 1 > rates["south"]
    assert _all_of(together, arrivals[-1].received_at) == _all_of(alone, arrivals[-1].received_at)


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
    st.dictionaries(st.sampled_from(FAULTS), st.integers(1, 699), max_size=2),
    st.dictionaries(st.sampled_from(CHANGES), st.integers(1, 699), max_size=2),
    st.integers(100, 700),
    st.sampled_from((1, 32)),
)
@example(0, {"shared": 100}, {}, 120, 32)
@example(1, {}, {"reboots": 300}, 350, 1)
@example(2, {}, {"over two links": 200, "is none": 400}, 700, 1)
@example(3, {}, {"other autopilot": 150, "sets another date": 400}, 700, 1)
@settings(max_examples=20)
def test_many_at_once_are_heard_and_counted_as_one_by_one(
    seed: int, faults: dict[str, int], changes: dict[str, int], many: int, few: int
) -> None:
    arrivals, leaps = (
        _stream(seed, faults | changes),
        "sets another date" in changes,
    )  # the session's time may leap then
    alone, together = Decoder(LINKS), Decoder(LINKS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(waiting, "_FEW", few)
        for first in range(0, len(arrivals), many):
            batch = arrivals[first : first + many]
            one_by_one = [(place, heard) for place, one in enumerate(batch) if (heard := alone.hear(one)) is not None]
            said, refused = together.hear_many(batch)
            assert repr(_in_order(said)) == repr(_in_order(one_by_one))  # bit for bit
            assert leaps or [heard.now for _, heard in said] == sorted(heard.now for _, heard in said)
            assert refused == []
            now = batch[-1].received_at
            assert _all_of(together, now) == _all_of(alone, now)


@given(
    st.integers(0, 255), st.lists(st.integers(1, 400), min_size=1, max_size=4), st.lists(st.integers(1, 90), max_size=3)
)
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
