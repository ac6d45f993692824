"""A source's clock in the field: locks, reboots, wraps, jitter, duplicates, wrong dates."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.clock import SourceClock
from adapters.epoch import SessionEpoch
from adapters.meters import Delays, Rates, SpeedMeter
from gateway.observation import Timing

SECOND = 10**9
MS = 10**6
T0 = 1_790_000_000 * SECOND
DAY_MS = 86_400_000
WRAP_MS = 2**32
WEEK_ROLLOVER_NS = 1024 * 7 * 86_400 * SECOND


class Told:
    """A source whose frames are heard with delays, each with the time that it was placed at."""

    def __init__(self, *, boot_ms: int = 100_000, at: int = T0) -> None:
        self.clock, self.epoch = SourceClock("plane"), SessionEpoch()
        self.boot_ms, self.at = boot_ms, at
        self.placed: list[
            tuple[int, int, Timing]
        ] = []  # the truth by our clock, when it was placed, what that is worth

    def say(self, *, delay_ms: float = 5.0, utc_ns: int | None = None, step_ms: int = 200) -> tuple[int, Timing] | None:
        """One position, and where `utc_ns` (ahead of our clock) is given a SYSTEM_TIME before it."""
        self.boot_ms, self.at = self.boot_ms + step_ms, self.at + step_ms * MS
        received = self.at + round(delay_ms * MS)
        boot = self.clock.hear(self.boot_ms % WRAP_MS, received)
        if boot is None:
            return None
        if utc_ns is not None and self.clock.set_utc(boot, self.at + utc_ns):
            utc = self.clock.utc(boot)
            if utc is not None:
                self.epoch.hear("plane", utc, received, self.clock.speed.speed)
        when = self.epoch.when(self.clock, boot, received)
        self.placed.append((self.at, *when))
        return when

    def fly(self, seconds: float, **values: float | int | None) -> None:
        for _ in range(round(seconds * 5)):
            self.say(**values)  # type: ignore[arg-type]


def test_a_gps_lock_in_the_middle_of_a_flight_brings_utc_and_pulls_no_track_back() -> None:
    """Before the lock the clock of receipt is 1.43 s wrong: what falls into times told before is not fused."""
    plane = Told()
    plane.fly(30, utc_ns=0 - T0)  # SYSTEM_TIME without a UTC
    assert plane.placed[-1][2] is Timing.ENVELOPE
    plane.fly(20, utc_ns=-1430 * MS)
    assert plane.placed[-1][1:] == (plane.at - 1430 * MS, Timing.UTC)
    used = [valid for _, valid, timing in plane.placed if timing in (Timing.UTC, Timing.ENVELOPE)]
    assert used == sorted(used)
    left_out = [valid for _, valid, timing in plane.placed if timing is Timing.FOREIGN]
    assert 6 <= len(left_out) <= 8  # 1.43 s at 5 Hz


def test_a_gps_lock_that_moves_time_on_loses_no_report() -> None:
    plane = Told()
    plane.fly(30)
    plane.fly(20, utc_ns=1430 * MS)
    assert plane.placed[-1][1:] == (plane.at + 1430 * MS, Timing.UTC)
    assert Timing.FOREIGN not in {timing for _, _, timing in plane.placed}


def test_jitter_of_seconds_moves_no_time_by_more_than_the_least_delay() -> None:
    """4 ms typical, 1.7 s at 99 %: over the envelope, and after 15 s, every time is within 5 ms."""
    chance, plane = random.Random(7), Told()
    for _ in range(1500):
        slow = chance.random() < 0.02
        plane.say(delay_ms=chance.uniform(1000, 2500) if slow else 3 + chance.expovariate(1.0))
    late = [valid - truth for truth, valid, timing in plane.placed if timing is Timing.ENVELOPE]
    assert len(late) > 1400
    assert max(abs(one) for one in late) < 5 * MS


def test_delays_are_told_by_their_median_and_their_last_percent() -> None:
    chance, delays = random.Random(7), Delays()
    for number in range(6000):
        slow = number % 50 == 0
        delays.hear(T0 + number * SECOND // 200, round((chance.uniform(1500, 1900) if slow else 4.0) * MS))
    middle, late = delays.quantiles(0.5, 0.99)
    assert middle == pytest.approx(0.004, abs=0.001)
    assert late == pytest.approx(1.7, rel=0.15)
    assert math.isnan(Delays().quantiles(0.5)[0])


def test_delays_of_a_minute_ago_are_forgotten() -> None:
    delays = Delays()
    for number in range(100):
        delays.hear(T0 + number * SECOND // 10, 900 * MS)
    for number in range(700):
        delays.hear(T0 + 20 * SECOND + number * SECOND // 10, 2 * MS)
    assert delays.quantiles(0.999) == (0.002,)


def test_the_quality_of_a_clock_is_the_spread_of_its_utc_and_of_delays_without_it() -> None:
    steady, jumpy, without = Told(), Told(), Told()
    for number in range(100):
        steady.say(utc_ns=0)
        jumpy.say(utc_ns=(number % 3 - 1) * 60 * MS)
        without.say(delay_ms=5 + 40 * (number % 2 + number % 10))
    assert steady.clock.sigma_s() == 0.001
    assert jumpy.clock.sigma_s() == pytest.approx(0.089, abs=0.002)
    assert 0.1 < without.clock.sigma_s() < 0.25
    assert math.isnan(SourceClock().sigma_s())


def test_a_system_time_heard_twice_is_heard_once() -> None:
    clock = SourceClock()
    for _ in range(5):
        clock.set_utc(6 * SECOND, T0)
    assert clock.utc(6 * SECOND) is None


def test_two_utc_in_eight_hundred_that_disagree_set_no_clock() -> None:
    plane = Told()
    for number in range(794):
        plane.say(utc_ns={300: 0, 301: 4 * SECOND}.get(number))
    assert plane.placed[-1][2] is Timing.ENVELOPE
    assert plane.clock.utc_offset is None


def test_a_date_of_a_gps_week_that_rolled_over_is_none() -> None:
    clock = SourceClock()
    assert not clock.set_utc(SECOND, T0 - WEEK_ROLLOVER_NS)


def test_a_leap_second_is_followed_and_a_single_wrong_date_is_not() -> None:
    plane = Told()
    plane.fly(10, utc_ns=0)
    plane.say(utc_ns=-18 * SECOND)
    assert plane.placed[-1][1:] == (plane.at, Timing.UTC)
    plane.fly(10, utc_ns=SECOND)
    assert plane.placed[-1][1:] == (plane.at + SECOND, Timing.UTC)


def test_the_session_keeps_the_date_it_began_with_when_its_source_sets_another() -> None:
    """A wrong date, then the right one: the times go on, and everything is fused as before."""
    plane, wrong = Told(), -400 * 86_400 * SECOND
    plane.fly(20, utc_ns=wrong)
    assert plane.epoch.offset_s == -400 * 86_400
    plane.fly(20, utc_ns=0)
    truth, valid, timing = plane.placed[-1]
    assert (valid - truth, timing) == (wrong, Timing.UTC)
    assert plane.clock.date_steps == 1


def test_another_source_that_sets_its_date_right_is_fused_from_then_on() -> None:
    plane, other = Told(), Told()
    other.epoch = plane.epoch
    other.clock.key = "other"
    for number in range(200):
        plane.say(utc_ns=0)
        boot = other.clock.hear(100_000 + 200 * number, plane.at)
        assert boot is not None
        ahead = -400 * 86_400 * SECOND if number < 100 else 0
        other.clock.set_utc(boot, plane.at + ahead)
        utc = other.clock.utc(boot)
        if utc is not None:
            plane.epoch.hear("other", utc, plane.at, 1.0)
        if number == 99:
            assert plane.epoch.when(other.clock, boot, plane.at)[1] is Timing.FOREIGN
    assert boot is not None
    assert plane.epoch.when(other.clock, boot, plane.at) == (plane.at, Timing.UTC)


def test_a_wrap_in_flight_is_no_reboot_and_utc_goes_on() -> None:
    plane = Told(boot_ms=WRAP_MS - 20_000)
    plane.fly(40, utc_ns=0)
    assert plane.clock.reboots == 0
    assert plane.placed[-1][1:] == (plane.at, Timing.UTC)
    used = [valid for _, valid, _ in plane.placed]
    assert used == sorted(used)


def test_a_reboot_in_flight_over_a_late_link_is_one_reboot() -> None:
    """Frames from before the reboot are still on their way when those from after it come: they are of neither."""
    plane = Told(boot_ms=600_000)
    plane.fly(30, utc_ns=0)
    old_ms, now = plane.boot_ms, plane.at
    placed = []
    for number in range(200):
        received = now + number * SECOND // 20
        if number % 4 == 3 and number < 60:
            placed.append(plane.clock.hear(old_ms + 20 * number, received + 2 * SECOND))
        elif number >= 20:
            placed.append(plane.clock.hear(3000 + 50 * number, received))
    assert plane.clock.reboots == 1
    newest = [one for one in placed if one is not None][-150:]
    assert max(newest) <= 13_000 * MS


def test_a_slower_path_on_the_same_link_is_no_reboot() -> None:
    """A router that mixes two radios: one falls silent, the other is 3 s behind and goes on."""
    clock = SourceClock()
    for number in range(300):
        clock.hear(100_000 + 100 * number, T0 + number * SECOND // 10)
    for number in range(270, 600):
        assert clock.hear(100_000 + 100 * number, T0 + (number + 30) * SECOND // 10) == (100_000 + 100 * number) * MS
    assert clock.reboots == 0


def test_rates_are_of_the_last_seconds() -> None:
    rates = Rates()
    for number in range(400):
        rates.hear(30, T0 + number * SECOND // 20)
    assert rates.per_second(T0 + 20 * SECOND)[30] == pytest.approx(20.0, rel=0.05)
    assert rates.per_second(T0 + 40 * SECOND) == {}


@given(
    st.lists(st.integers(0, 5_000), min_size=1, max_size=200),
    st.integers(0, WRAP_MS - 1),
    st.integers(0, 3_000),
)
@settings(max_examples=200)
def test_unwrapped_time_grows_as_the_source_counts_in_order(steps: list[int], first: int, delay_ms: int) -> None:
    clock, boot_ms, told = SourceClock(), first, []
    for step in steps:
        boot_ms += step
        told.append(clock.hear(boot_ms % WRAP_MS, T0 + (boot_ms - first + delay_ms) * MS))
    assert None not in told
    assert clock.reboots == 0
    since = [one - told[0] for one in told if one is not None and told[0] is not None]
    total, expected = -steps[0], []
    for step in steps:
        total += step
        expected.append(total * MS)
    assert since == expected


_FRAMES = st.tuples(
    st.one_of(st.integers(0, WRAP_MS - 1), st.integers(0, 200_000), st.integers(WRAP_MS - 200_000, WRAP_MS - 1)),
    st.integers(-10 * SECOND, 400 * SECOND),
    st.one_of(st.none(), st.integers(0, 2**64 - 1), st.integers(T0 - 100 * SECOND, T0 + 100 * SECOND)),
)


@given(st.lists(_FRAMES, max_size=120))
@settings(max_examples=200)
def test_no_sequence_of_times_raises_and_the_sessions_time_is_always_a_time(
    frames: list[tuple[int, int, int | None]],
) -> None:
    clock, epoch = SourceClock("any"), SessionEpoch()
    for boot_ms, after, unix_ns in frames:
        received = T0 + after
        boot = clock.hear(boot_ms, received)
        if boot is None:
            continue
        assert 0 <= boot % (WRAP_MS * MS) == boot_ms * MS
        if unix_ns is not None and clock.set_utc(boot, unix_ns):
            utc = clock.utc(boot)
            if utc is not None:
                epoch.hear("any", utc, received, clock.speed.speed)
        valid, timing = epoch.when(clock, boot, received)
        assert isinstance(valid, int)
        assert isinstance(timing, Timing)
        assert isinstance(epoch.session_time(received), int)
        assert not clock.sigma_s() < 0.001


@given(st.lists(st.tuples(st.integers(0, 100 * SECOND), st.integers(0, 100 * SECOND)), max_size=60))
def test_no_pair_of_clocks_stops_the_measuring_of_their_speed(pairs: list[tuple[int, int]]) -> None:
    meter = SpeedMeter()
    for ours, theirs in pairs:
        meter.hear(ours, theirs)
        assert meter.speed is None or meter.speed >= 0.0
