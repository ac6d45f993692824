"""A source's clock, and the session's."""

from adapters.clock import SourceClock
from adapters.epoch import SessionEpoch
from adapters.meters import Envelope
from gateway.observation import Timing

SECOND = 10**9
MS = 10**6
T0 = 1_790_000_000 * SECOND
YEAR_AGO = T0 - 365 * 86_400 * SECOND


def test_utc_is_boot_time_plus_the_median_offset_of_system_time() -> None:
    clock = SourceClock()
    for number, jitter_ms in enumerate((0, 3, -2, 1, 0)):
        boot = clock.hear(1000 * number, T0 + number * SECOND)
        assert boot is not None
        clock.set_utc(boot, YEAR_AGO + boot + jitter_ms * MS)
    assert clock.utc(10 * SECOND) == YEAR_AGO + 10 * SECOND


def test_no_utc_is_believed_before_gps_lock_nor_from_a_single_message() -> None:
    clock = SourceClock()
    assert not clock.set_utc(5 * SECOND, 0)
    assert not clock.set_utc(5 * SECOND, 7 * SECOND)
    assert clock.set_utc(6 * SECOND, YEAR_AGO + 6 * SECOND)
    assert clock.utc(6 * SECOND) is None
    clock.set_utc(7 * SECOND, YEAR_AGO + 7 * SECOND)
    assert clock.utc(7 * SECOND) == YEAR_AGO + 7 * SECOND


def test_a_clock_that_is_set_anew_is_followed_at_once() -> None:
    clock = SourceClock()
    for second in range(20):
        clock.set_utc(second * SECOND, YEAR_AGO + second * SECOND)
    for second in range(20, 22):
        clock.set_utc(second * SECOND, YEAR_AGO + (second + 18) * SECOND)
    assert clock.utc(0) == YEAR_AGO + 18 * SECOND


def test_boot_time_goes_on_over_the_wrap_at_49_days() -> None:
    clock = SourceClock()
    assert clock.hear(2**32 - 500, T0) == (2**32 - 500) * MS
    assert clock.hear(500, T0 + SECOND) == (2**32 + 500) * MS
    assert clock.hear(2**32 - 100, T0 + SECOND) == (2**32 - 100) * MS  # held back from before
    assert clock.reboots == 0


def test_a_frame_held_back_for_two_seconds_is_no_reboot() -> None:
    clock = SourceClock()
    for number in range(100):
        clock.hear(100_000 + 100 * number, T0 + number * SECOND // 10)
    assert clock.hear(107_000, T0 + 10 * SECOND) == 107_000 * MS
    assert clock.hear(110_000, T0 + 10 * SECOND) == 110_000 * MS
    assert clock.reboots == 0


def test_frames_shuffled_within_five_seconds_are_no_reboot() -> None:
    import random

    chance, clock = random.Random(3), SourceClock()
    order = sorted(range(2000), key=lambda number: number + chance.uniform(0, 50))
    for place, number in enumerate(order):
        assert clock.hear(100_000 + 100 * number, T0 + place * SECOND // 10) == (100_000 + 100 * number) * MS
    assert clock.reboots == 0


def test_a_reboot_begins_a_new_clock_after_three_frames() -> None:
    clock = SourceClock()
    for number in range(600):
        boot = clock.hear(1000 * number, T0 + number * SECOND)
        assert boot is not None
        clock.set_utc(boot, YEAR_AGO + boot)
    again = [clock.hear(3000 + 100 * number, T0 + 620 * SECOND + number * SECOND // 10) for number in range(4)]
    assert again == [None, None, 3200 * MS, 3300 * MS]
    assert clock.reboots == 1
    assert clock.utc(0) is None


def test_a_reboot_soon_after_boot_is_told_from_a_late_frame() -> None:
    clock = SourceClock()
    for number in range(60):
        clock.hear(100 * number, T0 + number * SECOND // 10)
    for number in range(30):
        clock.hear(100 * number, T0 + 10 * SECOND + number * SECOND // 10)
    assert clock.reboots == 1


def test_without_utc_the_least_delayed_frame_sets_the_clock() -> None:
    clock = SourceClock()
    for number, delay_ms in enumerate((300, 40, 900, 1700, 5)):
        clock.hear(1000 * number, T0 + number * SECOND + delay_ms * MS)
    assert clock.by_envelope(4 * SECOND) == T0 + 4 * SECOND + 5 * MS


def test_the_envelope_forgets_what_is_more_than_a_minute_old() -> None:
    envelope = Envelope()
    envelope.hear(T0, -100)
    for second in range(1, 70):
        least = envelope.hear(T0 + second * SECOND, 7)
    assert least == 7


def _epoch(offset: int, speed: float | None = 1.0) -> SessionEpoch:
    epoch = SessionEpoch()
    epoch.hear("first", T0 + offset, T0, speed)
    return epoch


def test_a_source_within_five_seconds_of_ours_leaves_the_session_alone() -> None:
    epoch = _epoch(-1430 * MS)
    assert epoch.offset_s == 0
    assert epoch.session_time(T0 + 7) == T0 + 7
    assert epoch.timing("first") is Timing.UTC


def test_beyond_that_the_session_has_one_offset_in_whole_seconds() -> None:
    epoch = _epoch(YEAR_AGO - T0 + 300 * MS)
    assert epoch.offset_s == -365 * 86_400
    assert epoch.session_time(T0 + 7) == YEAR_AGO + 7
    epoch.hear("second", T0, T0 + SECOND, 1.0)
    assert epoch.offset_s == -365 * 86_400


def test_sources_within_five_seconds_of_the_session_are_fused_and_others_are_foreign() -> None:
    epoch = _epoch(YEAR_AGO - T0)
    epoch.hear("near", YEAR_AGO + 4 * SECOND, T0, 1.0)
    epoch.hear("ours", T0, T0, 1.0)
    assert epoch.timing("near") is Timing.UTC
    assert epoch.timing("ours") is Timing.FOREIGN
    assert epoch.timing("never heard") is Timing.PROVISIONAL


def test_a_link_that_stalls_for_eight_seconds_makes_nobody_foreign() -> None:
    epoch = _epoch(0)
    for second in range(20):
        epoch.hear("radio", T0 + second * SECOND, T0 + second * SECOND, 1.0)
    epoch.hear("radio", T0 + 20 * SECOND, T0 + 28 * SECOND, 1.0)
    assert epoch.timing("radio") is Timing.UTC


def test_a_far_clock_gives_the_epoch_only_once_its_speed_is_known() -> None:
    assert _epoch(YEAR_AGO - T0, None).offset_s is None


def test_a_stream_at_ten_times_our_speed_takes_the_sessions_time_along() -> None:
    """Session time follows its reference within a second and never goes back."""
    clock, epoch = SourceClock(), SessionEpoch()
    session, lags = 0, []
    for number in range(600):  # SYSTEM_TIME each simulated second, ten in one of ours
        received = T0 + number * SECOND // 10
        boot = clock.hear(1000 * number, received)
        assert boot is not None
        clock.set_utc(boot, YEAR_AGO + boot)
        utc = clock.utc(boot)
        if utc is not None:
            epoch.hear("sitl", utc, received, clock.speed.speed)
            if epoch.offset_s is not None:
                now = epoch.session_time(received)
                assert now >= session
                session = now
                lags.append(abs(now - utc) / SECOND)
    assert clock.speed.speed is not None
    assert abs(clock.speed.speed - 10.0) < 0.1
    assert len(lags) > 400
    assert max(lags) < 1.0


def test_a_stall_and_the_burst_after_it_are_no_other_speed() -> None:
    clock = SourceClock()
    for number in range(400):
        late = max(number, 60) if 20 <= number < 60 else number  # everything of 4 s comes at once
        clock.hear(100 * number, T0 + late * SECOND // 10)
    assert clock.speed.speed == 1.0
