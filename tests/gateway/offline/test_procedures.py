"""Arrivals beside published procedures: as published, direct, joined later, another way; and the command that tells it."""

from __future__ import annotations

import gzip
import json
import math
from pathlib import Path

import numpy as np
import pytest

from gateway.cli.app import run
from gateway.cli.arrivals_selected import read_sector
from gateway.cli.failures import UsageError
from gateway.offline.flows import Track
from gateway.offline.procedures import Procedure, compared, lands_on, runway_of
from gateway.settings.procedures import parse_procedures
from gateway.settings.reading import SiteError

POINTS = ((-60e3, 30e3, 3000.0), (-40e3, 30e3, 2500.0), (-25e3, 20e3, 1800.0), (-20e3, 0.0, 1000.0), (0.0, 0.0, 0.0))
NAN = math.nan
EAST = Procedure(
    "WEST 1",
    ("ENTRY", "TURN", "BASE", "FINAL", "THR"),
    np.array(POINTS)[:, :2],
    np.array([2800.0, NAN, NAN, NAN, NAN]),
    np.array([3200.0, NAN, 1900.0, NAN, NAN]),
)


def flown(*points: tuple[float, float, float], aside_m: float = 0.0) -> Track:
    """Along straight lines at 100 m/s; `aside_m` to the north all the way."""
    corners = np.add(points, [0.0, aside_m, 0.0])
    times = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1) / 100.0)])
    seconds = np.arange(0.0, times[-1])
    places = np.stack([np.interp(seconds, times, column) for column in corners.T], axis=-1)
    return Track("a flight", seconds - times[-1], places)


def test_a_flight_along_all_points_is_as_published_with_its_distance_aside_and_its_heights() -> None:
    """Five hundred metres aside on the eastward legs; heights where it passes."""
    (one,) = compared([flown(*POINTS, aside_m=500.0)], [EAST]).flights
    assert one is not None
    assert one.as_published(EAST)
    assert one.passed == (0, 1, 2, 3, 4)
    assert 250.0 < one.aside_m < 500.0
    assert np.abs(one.heights_m - np.array(POINTS)[:, 2]).max() < 60.0
    assert one.too_low(EAST) == one.too_high(EAST) == []


def test_a_shortcut_is_named_with_what_it_saves() -> None:
    """From the turn straight to the final: one point skipped; also from halfway along a leg."""
    begin, turn, _, final, end = POINTS
    for leaves in (turn, (-50e3, 30e3, 2700.0)):
        track = flown(begin, leaves, final, end)
        (one,) = compared([track], [EAST]).flights
        assert one is not None
        assert not one.as_published(EAST)
        (direct,) = one.directs
        assert EAST.points[direct.to] == "FINAL"
        straight = math.dist(leaves[:2], final[:2])
        published = EAST.lengths_m[:3].sum() - math.dist(begin[:2], leaves[:2])
        assert direct.saved_m == pytest.approx(published - straight, abs=1000.0)


def test_who_joins_later_has_his_entry_there_and_who_comes_another_way_is_on_none() -> None:
    """A height at the entry is that of the first point that is passed."""
    joins = flown((-40e3, 60e3, 2600.0), *POINTS[1:])
    other = flown((60e3, 30e3, 3000.0), (30e3, 10e3, 1500.0), (-15e3, 6e3, 900.0), (-10e3, 0.0, 500.0), POINTS[-1])
    first, second = compared([joins, other], [EAST]).flights
    assert first is not None
    assert EAST.points[first.entry] == "TURN"
    assert not first.as_published(EAST)
    assert first.heights_m[first.entry] == pytest.approx(2500.0, abs=60.0)
    assert second is None


def test_vectors_between_two_points_are_no_shortcut() -> None:
    """A detour that skips a point is neither its leg nor direct: that part does not count as flown."""
    begin, turn, _, final, end = POINTS
    (one,) = compared([flown(begin, turn, (-30e3, 45e3, 2300.0), (-10e3, 20e3, 1500.0), final, end)], [EAST]).flights
    assert one is None or not one.directs


def test_too_low_and_too_high_are_named() -> None:
    """Below the least at the entry, above the most at the base."""
    lifted = [(x, y, z - 400.0 if place == 0 else z + 300.0) for place, (x, y, z) in enumerate(POINTS)]
    (one,) = compared([flown(*lifted)], [EAST]).flights
    assert one is not None
    assert (one.too_low(EAST), one.too_high(EAST)) == ([0], [2])


def test_landing_directions_and_parallel_runways_are_told_apart() -> None:
    """09 and not 27; the nearer of two parallel centrelines, none of those that lead another way."""
    track = flown(*POINTS)
    assert lands_on(track, 9)
    assert not lands_on(track, 27)
    thresholds, directions = (
        np.array([[-1500.0, 2000.0], [-1500.0, 100.0], [1500.0, 0.0]]),
        np.radians([90.0, 90.0, 270.0]),
    )
    assert runway_of(track, thresholds, directions) == 1
    assert runway_of(track, thresholds[2:], directions[2:]) is None


@pytest.mark.parametrize(
    ("written", "middle", "half"), [("W", 270, 45), ("ne", 45, 22.5), ("240-300", 270, 30), ("330-30", 0, 30)]
)
def test_a_sector_is_a_quadrant_an_octant_or_degrees(written: str, middle: float, half: float) -> None:
    """Clockwise, over north too."""
    found = np.degrees(read_sector(written))
    assert found[0] % 360.0 == pytest.approx(middle)
    assert found[1] == pytest.approx(half)


def test_a_sector_that_is_none_is_refused() -> None:
    """With what to write."""
    with pytest.raises(UsageError, match="240-300"):
        read_sector("north")


FILE = """airport_altitude_m = 100.0
[[runway]]
name = "09"
latitude_deg = 49.0
longitude_deg = 2.5
direction_deg = 90.0
"""


def _written() -> str:
    """The procedure about 49, 2.5 degrees."""
    text = FILE + '[[procedure]]\nname = "WEST 1"\nrunway = "09"\n'
    for name, (east, north, _) in zip(EAST.points, POINTS, strict=True):
        place = f"latitude_deg = {49.0 + north / 111_200.0}\nlongitude_deg = {2.5 + east / 73_000.0}\n"
        text += f'[[procedure.point]]\nname = "{name}"\n{place}' + (
            "least_altitude_ft = 9500\n" if name == "ENTRY" else ""
        )
    return text


@pytest.mark.parametrize(
    ("spoil", "by", "says"),
    [
        ("least_altitude_ft", "least_altitude_nm", "line 14.*least_altitude"),
        ("airport_altitude_m = 100.0\n", "", "ENTRY has an altitude, so airport_altitude_m is needed"),
        ('runway = "09"', 'runway = "27"', "'27', which no"),
        ("[[procedure.point]]", "[procedure.point]", "at least two points|not TOML"),
        ("direction_deg = 90.0\n", "", "lacks direction_deg"),
    ],
)
def test_a_wrong_file_is_told_in_a_sentence(spoil: str, by: str, says: str) -> None:
    """With its line where it has one."""
    with pytest.raises(SiteError, match=says):
        parse_procedures(_written().replace(spoil, by), "p.toml")


def test_the_command_compares_what_lands_on_a_runway_from_a_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Six as published, three direct, four from the east on the same runway that --from leaves out."""
    generator, rows = np.random.default_rng(2), ["fid,timestamp,latitude,longitude,altitude"]
    begin, turn, _, final, end = POINTS
    ways = (
        [POINTS] * 6 + [(begin, turn, final, end)] * 3 + [((60e3, 30e3, 3000.0), (-30e3, 20e3, 1500.0), final, end)] * 4
    )
    for number, way in enumerate(ways):
        track = flown(*way, aside_m=300.0 * generator.standard_normal())
        for second, (east, north, up) in zip(track.time_s[::10], track.place_m[::10], strict=True):
            place = f"{49.0 + north / 111_200.0:.6f},{2.5 + east / 73_000.0:.6f},{(up + 100.0) / 0.3048:.0f}"
            rows.append(f"f{number},{1.6e9 + 9000.0 * number + second},{place}")
    data, file = tmp_path / "arrivals.csv.gz", tmp_path / "published.toml"
    with gzip.open(data, "wt") as written:
        written.write("\n".join(rows) + "\n")
    file.write_text(_written())
    words = ["flows", str(data), "--airport", "49,2.5", "--runway", "09", "--from", "W", "--procedure", str(file)]
    assert run([*words, "--archive", str(tmp_path / "out"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    (found,) = told["procedures"]
    assert told["flights"] == len(found["flights"]) == 9
    assert sum(one["as_published"] for one in found["flights"]) == 6
    assert [[direct["to"] for direct in one["direct"]] for one in found["flights"] if one["direct"]] == [["FINAL"]] * 3
    assert told["flows"][0]["procedure"] == "WEST 1"
    assert run(words) == 0
    assert "3 direct to FINAL after TURN" in capsys.readouterr().out
    assert run([*words[:4], "--runway", "26L"]) == 2
    assert "--procedure" in capsys.readouterr().err
