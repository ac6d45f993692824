"""What people declare: it beats what is inferred, can be withdrawn, and weather that is told sends predictions around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adapters.declared import Goal, decode, encode_intent, encode_weather, sentence
from gateway.frames import RunwayFrame
from gateway.observation import FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint, WeatherArea
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.predict.told import Tellings, known_points
from gateway.predict.weather import crosses, hull
from gateway.settings import DEMO_SITE, Options, Site, SiteError, Waypoint, Weather
from gateway.settings.declared import parse_declared
from gateway.settings.instants import instant_ns

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
FRAME = RunwayFrame(DEMO_SITE.runway)
AIRCRAFT = "mavlink:1"
SPEED = 60.0


def geodetic(east: float, north: float) -> tuple[float, float]:
    latitude, longitude, _ = FRAME.geodetic_from_enu([east, north, 1000.0])
    return float(latitude), float(longitude)


SITE = replace(
    DEMO_SITE,
    waypoints=(Waypoint("NORTH", *geodetic(0.0, 45_000.0)), Waypoint("Abeam", *geodetic(30_000.0, 31_000.0))),
)


def northward(seconds: int, site: Site, said: Sequence[Observation] = ()) -> list[Picture]:
    """One aircraft northward from 30 km north of the runway, and what was told, a step a second."""
    heard = [Heard(one.received_at, (one,)) for one in said]
    for k in range(seconds):
        latitude, longitude = geodetic(0.0, 30_000.0 + SPEED * k)
        at = T0 + k * SECOND
        told = GpsReport(AIRCRAFT, at, at, latitude, longitude, None, 1500.0, 0.0, SPEED, 0.0, 3.0, 3.0, 0.3)
        heard.append(Heard(at + 1000, (told,)))
    state, pictures = initial(site, Options()), []
    for one in sorted(heard, key=lambda one: one.now):
        state, picture = step(state, [one])
        pictures.append(picture)
    return pictures


def intents(pictures: Sequence[Picture]) -> list[tuple[float, str | None, str | None]]:
    """Of each second: when, intent and kind."""
    found = []
    for table in (picture.predict for picture in pictures):
        for row in np.flatnonzero(table.horizon_s == 60.0).tolist():
            found.append(((int(table.made[row]) - T0) / SECOND, table.intent[row], table.intent_kind[row]))
    return found


def declares(at_s: float, goal: Goal) -> Intent:
    at = T0 + round(at_s * SECOND) + 2000
    said = decode(encode_intent(AIRCRAFT, goal), at, at)
    assert isinstance(said, Intent)
    return said


def test_a_declared_point_beats_the_inferred_one_until_it_is_withdrawn() -> None:
    """NORTH lies ahead and is inferred; Abeam, declared by a person in any case of letters, is told instead; then NORTH again."""
    told = intents(northward(30, SITE, [declares(12, Goal(name="abeam")), declares(15, Goal())]))
    assert [kind for at, _, kind in told if 8 <= at <= 12] == ["inferred"] * 5
    assert [(name, kind) for at, name, kind in told if 13 <= at <= 15] == [("Abeam", "declared")] * 3
    assert (told[-1][1], told[-1][2]) == ("NORTH", "inferred")


def test_a_person_is_believed_before_the_vehicle() -> None:
    """The mission says item 1, a person item 2: it is item 2, until withdrawn."""
    points = tuple(PlanPoint(n, "waypoint", *geodetic(0.0, 30_000.0 + 8_000.0 * n)) for n in (1, 2))
    said: list[Observation] = [FlightPlan(AIRCRAFT, T0, T0, points), Intent(AIRCRAFT, T0, T0, "mission", 1)]
    told = intents(northward(14, SITE, [*said, declares(5, Goal(item=2)), declares(9, Goal())]))
    assert {name for at, name, _ in told if 6 <= at <= 9} == {"waypoint 2"}
    assert {name for at, name, _ in told if at >= 10} == {"waypoint 1"}


def test_a_place_can_be_declared() -> None:
    """Degrees and metres: it is told as the declared point."""
    goal = Goal(latitude_deg=31.5, longitude_deg=104.0, altitude_msl_m=1535.0)
    assert intents(northward(8, SITE, [declares(3, goal)]))[-1][1:] == ("declared point", "declared")


def test_a_name_that_nobody_knows_changes_nothing() -> None:
    """A replay with another site does not have the point: what is inferred stays."""
    assert intents(northward(10, SITE, [declares(3, Goal(name="NOWHERE"))]))[-1][1:] == ("NORTH", "inferred")


def test_the_points_that_are_known_are_named() -> None:
    """Published ones, the runway's, home, and the plan's items by number."""
    points = (PlanPoint(0, "home", 0.5, 1.8), PlanPoint(4, "waypoint", 0.5, 1.8))
    told = Tellings().hearing(FlightPlan(AIRCRAFT, T0, T0, points)).by_aircraft[AIRCRAFT]
    assert known_points(told, SITE) == ("NORTH", "Abeam", "runway", "go-around", "home", "4")


STORM = Weather("CB 1", *geodetic(0.0, 38_000.0), 3000.0)


def test_weather_across_the_way_is_flown_around() -> None:
    """A storm between here and NORTH, told as it goes: NORTH counts less, and ways around it to both sides are candidates."""
    area = WeatherArea("CB 1", T0 + 9 * SECOND + 2000, T0 + 9 * SECOND + 2000, STORM)
    candidates = [picture.predict.candidates for picture in northward(20, SITE, [area])]
    rows = [
        (time, name, weight, place)
        for table in candidates
        for time, name, weight, place in zip(table.time, table.name, table.weight, table.places_m, strict=True)
    ]
    before = {name: weight for time, name, weight, _ in rows if time == T0 + 9 * SECOND}
    after = {name: weight for time, name, weight, _ in rows if time == T0 + 11 * SECOND}
    assert before["NORTH"] > 0.8
    assert after["NORTH"] < 0.8 * before["NORTH"]


def test_ways_around_lead_clear_of_the_area() -> None:
    """Who turns towards one side of a storm is believed to fly around it there, and then on to the point behind it."""
    from gateway.predict.goals import AROUND, goals_of
    from gateway.predict.states import State
    from gateway.predict.weather import areas, around

    site = replace(SITE, weather=(STORM,))
    one = np.ones(1)
    state = State(
        *(np.zeros(1), np.array([[0.0, 30_000.0]]), np.array([[0.0, 30_000.0]]), np.array([[0.0, SPEED]]), SPEED * one),
        *(1000.0 * one, 0.0 * one, one, one, one, one, np.full((1, 3), np.nan), np.array([True])),
    )
    found = areas(Tellings(), site, FRAME, T0, 0.0)
    (goals,) = around([goals_of(None, site, FRAME, 0.0)], state, found)
    assert goals.lowered[12] < 1.0 == goals.lowered[13]  # NORTH lies behind it, Abeam does not
    for slot, side in zip(AROUND, (-1.0, 1.0), strict=True):
        way = np.concatenate([[[0.0, 30_000.0]], goals.route[slot]])
        way = way[~np.isnan(way[:, 0])]
        assert side * way[1, 0] > 3000.0
        assert way[-1] == pytest.approx([0.0, 45_000.0], abs=60.0)
        assert not crosses(way[:-1], way[1:], found[0].hull).any()
    assert goals.names[AROUND[0]] == "round CB 1, left"


def test_weather_holds_between_its_times_and_heights() -> None:
    """Before it begins, after it ended, above its top and once it is gone, an area is none."""
    from gateway.predict.weather import areas

    area = replace(STORM, valid_from="2026-09-21T00:00:00Z", valid_until="2026-09-21T01:00:00+00:00")
    begins = instant_ns("2026-09-21T00:00:00Z")
    assert begins is not None
    site = replace(SITE, weather=(area,))
    held = [len(areas(Tellings(), site, FRAME, begins + s * SECOND, 0.0)) for s in (-1, 0, 3599, 3600)]
    assert held == [0, 1, 1, 0]
    gone = Tellings().hearing(WeatherArea("CB 1", T0, T0, area)).hearing(WeatherArea("CB 1", T0 + 1, T0 + 1, None))
    assert areas(gone, site, FRAME, begins, 0.0) == ()
    (low,) = areas(Tellings(), replace(SITE, weather=(replace(STORM, top_msl_m=3000.0),)), FRAME, T0, -35.0)
    assert low.top_m == pytest.approx(3000.0 - 35.0 - 500.0)


def test_a_hull_is_convex_and_counter_clockwise() -> None:
    """Of a square with points inside and on its edges its four corners stay."""
    found = hull(np.array([[0.0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [1, 0], [0.5, 1.5]]))
    corners = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    begin = found.tolist().index(corners[0])
    assert np.roll(found, -begin, axis=0).tolist() == corners


def test_a_told_line_is_read_as_it_was_written() -> None:
    """Goals and areas come back as they were, to the digits of degrees."""
    polygon = Weather(
        "P", polygon_rad=((0.5, 1.8), (0.51, 1.8), (0.51, 1.81)), valid_from="2026-01-01T00:00", top_msl_m=9e3
    )
    for area in (STORM, polygon):
        said = decode(encode_weather(area.name, area), T0, T0)
        assert isinstance(said, WeatherArea)
        assert said.area is not None
        assert np.allclose(said.area.polygon_rad or 0.0, area.polygon_rad or 0.0, atol=1e-15)
        assert replace(said.area, polygon_rad=(), latitude_rad=None, longitude_rad=None) == replace(
            area, polygon_rad=(), latitude_rad=None, longitude_rad=None
        )
    assert decode(encode_weather("P", None), T0, T0) == WeatherArea("P", T0, T0, None)
    said = decode(encode_intent(AIRCRAFT, Goal(item=7)), T0, T0)
    assert isinstance(said, Intent)
    assert (said.sequence, sentence(said)) == (7, "mavlink:1 is declared to go to item 7 of its plan")


@pytest.mark.parametrize(
    "line",
    [
        b"GET / HTTP/1.1",
        b"[]",
        b'{"told": "intent"}',
        b'{"told": "intent", "aircraft": "a", "to": "X", "item": 1}',
        b'{"told": "intent", "aircraft": "a", "item": true}',
        b'{"told": "intent", "aircraft": "a", "latitude_deg": 91, "longitude_deg": 0}',
        b'{"told": "intent", "aircraft": "a", "latitude_deg": 9}',
        b'{"told": "weather", "name": ""}',
        b'{"told": "weather", "name": "a", "latitude_deg": 9, "longitude_deg": 9}',
        b'{"told": "weather", "name": "a", "polygon_deg": [[1, 2], [3, 4]]}',
        b'{"told": "weather", "name": "a", "polygon_deg": [[1, 2], [1, 2], [1, 2]]}',
        b'{"told": "weather", "name": "a", "polygon_deg": [[1, 2], [2, 3], [3, 4], [2, 3]]}',
        b'{"told": "weather", "name": "a", "from": "soon"}',
    ],
)
def test_what_is_no_declaration_is_none(line: bytes) -> None:
    """Half-told, doubly told and nonsense: nothing is understood, and nothing raised."""
    assert decode(line, T0, T0) is None


@given(st.binary(max_size=200))
def test_no_bytes_raise(line: bytes) -> None:
    """Whatever comes, it is a declaration or none."""
    said = decode(line, T0, T0)
    assert said is None or (isinstance(said, Intent | WeatherArea) and said.valid_at == T0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[[declared]]\nto = 'IAF'\n", "line 1: .* lacks aircraft"),
        ("[[declared]]\naircraft = 'a'\nto = true\n", "line 3: to must be a name in quotes or an item's number"),
        ("[[declared]]\naircraft = 'a'\nlatitude_deg = 95\n", "line 3: latitude_deg must be between -90 and 90"),
        ("[[declared]]\naircraft = 'mavlink:1'\n", "needs either"),
        ("[[declared]]\naircraft = 'a'\nto = 'X'\n[[declared]]\naircraft = 'a'\nto = 'Y'\n", "declared twice"),
        ("[[declared]]\naircraft = 'a'\nwhere = 'X'\n", "unknown key 'where'"),
        ("[declared]\naircraft = 'a'\n", "as a table"),
        ("[[wether]]\n", "unknown table 'wether'"),
        ("[[weather]]\nname = 'a'\n", "needs latitude_deg"),
        (
            "[[weather]]\nname = 'a'\npolygon_deg = [[1, 2], [2, 3], [3, 4]]\n",
            "line 3: polygon_deg must enclose an area",
        ),
        ("to = ", "not TOML"),
    ],
)
def test_a_file_that_is_wrong_says_what(text: str, says: str) -> None:
    """One sentence with the file's name."""
    with pytest.raises(SiteError, match=says) as raised:
        parse_declared(text, "told.toml")
    assert str(raised.value).startswith("told.toml")


def test_instants_are_those_of_the_calendar() -> None:
    """Leap days, zones and fractions; what is no time is none."""
    assert instant_ns("1970-01-01T00:00:00Z") == 0
    assert instant_ns("2024-02-29T12:00:00.5Z") == 1_709_208_000_500_000_000
    assert instant_ns("2026-03-01T12:00+02:00") == instant_ns("2026-03-01T10:00:00Z")
    assert instant_ns("2300-01-01T00:00:00Z") == 10_413_792_000 * SECOND
    for none in ("2026-13-01T12:00Z", "2026-02-30T12:00Z", "2026-03-01T24:00Z", "2026-03-01T12:00:75Z", "soon"):
        assert instant_ns(none) is None


def test_the_angle_of_a_crossing_is_of_no_matter() -> None:
    """Ways through, past, towards and out of a square, one of them along its edge's line."""
    square = np.array([[0.0, 0], [2, 0], [2, 2], [0, 2]])
    start = np.array([[-1.0, 1], [-1, 3], [-1, 1], [1, 1], [-1, -0.5], [math.nan, 0]])
    end = np.array([[3.0, 1.5], [3, 3], [-0.5, 1], [5, 1], [3, -0.5], [1, 1]])
    assert crosses(start, end, square).tolist() == [True, False, False, False, False, False]
