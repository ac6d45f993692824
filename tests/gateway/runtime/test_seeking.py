"""Instants and mutes as people write them."""

import pytest

from gateway.runtime.seeking import SECOND, SeekError, Span
from gateway.settings import Mute

FIRST = 1_767_225_540 * SECOND  # 2025-12-31T23:59:00Z
SPAN = Span(FIRST, FIRST + 4000 * SECOND)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90.0),
        ("0", 0.0),
        ("1:30", 90.0),
        ("1:02:03", 3723.0),
        ("0:00:00.5", 0.5),
        ("2026-01-01T00:05:00Z", 360.0),
        ("2026-01-01T00:05:00", 360.0),
        ("2026-01-01T01:05:00+01:00", 360.0),
        ("2026-01-01 00:05Z", 360.0),
        ("23:59:30Z", 30.0),
        ("00:05:00Z", 360.0),
    ],
)
def test_an_instant_is_read_from_the_start_or_as_utc(text: str, seconds: float) -> None:
    assert SPAN.instant(text, "--from") == FIRST + round(seconds * SECOND)


def test_utc_is_that_of_the_sources_where_the_receivers_clock_is_another() -> None:
    """A recording that was played into a live session: its stamps are of another day."""
    span = Span(FIRST, FIRST + 60 * SECOND, utc_offset=-86_400 * SECOND)
    assert span.instant("2025-12-30T23:59:30Z", "--from") == FIRST + 30 * SECOND


@pytest.mark.parametrize("text", ["4001", "2:00:00", "2026-01-02T00:00:00Z", "2025-12-31T23:58:00Z", "22:00:00Z"])
def test_an_instant_outside_is_refused_with_the_recordings_range(text: str) -> None:
    with pytest.raises(SeekError, match=r"--to .* outside: the recording goes from 2025-12-31T23:59:00Z for 4000\.0 s"):
        SPAN.instant(text, "--to")


@pytest.mark.parametrize("text", ["", "soon", "-5", "1:2:3:4", "2026-13-01T00:00:00Z", "25:00:00Z", "9" * 400])
def test_what_is_no_instant_is_refused(text: str) -> None:
    with pytest.raises(SeekError) as refused:
        SPAN.instant(text, "--from")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("gps:60:90", ("gps", None, 60, 90)),
        ("gps:1:60:90", ("gps", 1, 60, 90)),
        ("radar:1:30:40", ("radar", 1, 30, 40)),
        ("radar:1:30:2:40", ("radar", None, 90, 160)),
        ("radar:2:1:30:2:40", ("radar", 2, 90, 160)),
        ("gps:0:01:00:0:02:00", ("gps", None, 60, 120)),
        ("gps:3:0:01:00:0:02:00", ("gps", 3, 60, 120)),
        ("gps:2026-01-01T00:05:00Z:2026-01-01T00:06:00Z", ("gps", None, 360, 420)),
        ("gps:7:00:05:00Z:00:06:00Z", ("gps", 7, 360, 420)),
        ("gps:60:9000", ("gps", None, 60, 9000)),
    ],
)
def test_a_mute_is_read(text: str, expected: tuple[str, int | None, int, int]) -> None:
    mute = SPAN.mute(text)
    since, until = (mute.since - FIRST) // SECOND, (mute.until - FIRST) // SECOND
    assert (mute.what, mute.number, since, until) == expected


@pytest.mark.parametrize(("text", "number"), [("gps", None), ("radar:2", 2)])
def test_a_mute_without_times_is_throughout(text: str, number: int | None) -> None:
    mute = SPAN.mute(text)
    assert mute == Mute(mute.what, number, SPAN.first, mute.until)
    assert mute.until > SPAN.last


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("lidar:1:2", "not understood"),
        ("gps:a:1:2", "not understood"),
        ("gps:1.5:2:3", "not understood"),
        ("gps:1:2:3:4:5:6:7:8", "not understood"),
        ("gps:90:60", "ends before it begins"),
        ("gps:5000:6000", "is outside: the recording"),
    ],
)
def test_a_mute_that_makes_no_sense_is_refused(text: str, says: str) -> None:
    with pytest.raises(SeekError, match=says):
        SPAN.mute(text)
