"""The place that a stream tells of while it comes in."""

from dataclasses import replace
from pathlib import Path

from gateway.observation import GpsReport, Heard
from gateway.runtime.places import PlaceFinder
from gateway.runtime.playback import open_playback

SECOND = 1_000_000_000
NOW, RECORDED = 1_790_000_000 * SECOND, 1_767_000_000 * SECOND


def test_a_place_is_found_also_when_the_clock_is_set_back_by_a_year() -> None:
    """A recording played into a live session: its first reports are dated now, the later ones when they were made."""
    report = GpsReport("mavlink:1", 0, 0, 0.5, 1.8, altitude_msl_m=500.0, compass_heading_rad=1.0)
    finder = PlaceFinder()
    places = []
    for second in range(30):
        at = (NOW if second < 8 else RECORDED) + second * SECOND
        said = replace(report, valid_at=at, received_at=NOW + second * SECOND)
        moving = replace(said, velocity_north_mps=3.0) if second < 12 else said
        places.append(finder.look([Heard(at, (moving,))]))
    found = [second for second, place in enumerate(places) if place is not None]
    assert found
    assert 17 <= found[0] <= 19  # it stands from second 12 on, and standing takes 5 s


def test_with_a_key_frames_that_are_not_signed_with_it_tell_no_place() -> None:
    """Else a stranger could say where the runway is."""
    excerpt = Path(__file__).parents[2] / "data" / "sitl-landing-excerpt.tlog"
    assert open_playback([excerpt]).find_place() is not None
    assert open_playback([excerpt], signing_key=bytes(range(32))).find_place() is None
