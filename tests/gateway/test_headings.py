"""Where an aircraft says it goes, told to the filter of several modes: it is sooner sure of straight flight; replays agree."""

import math

import numpy as np
import pytest

from gateway.fuse.headings import NOWHERE, Headings, goal_at
from gateway.observation import FlightPlan, GpsReport, Heard, Intent, Observation, PlanPoint
from gateway.picture import Picture
from gateway.pipeline import initial, step
from gateway.settings import DEMO_SITE, Options

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
LATITUDE, LONGITUDE = math.radians(31.3), math.radians(104.3)
NORTH_RAD, EAST_RAD = 1.0 / 6_362_000.0, 1.0 / (6_386_000.0 * math.cos(LATITUDE))
SPEED, RATE = 118.0, math.radians(3.0)
TURNS_S, ROLLS_OUT_S, ENDS_S = 30, 60, 75
AIRCRAFT = 4


def flight() -> list[tuple[float, float]]:
    """East, a turn of 90 degrees to the left, north: a place each second."""
    places, course, east, north = [], 0.0, 0.0, 0.0
    for second in range(ENDS_S):
        places.append((east, north))
        course += RATE if TURNS_S <= second < ROLLS_OUT_S else 0.0
        east, north = east + SPEED * math.cos(course), north + SPEED * math.sin(course)
    return places


def reports(sigma_m: float) -> list[GpsReport]:
    """Positions without velocities, of some aircraft that fly alike, each with noise of its own."""
    draws, found = np.random.default_rng(2), []
    for second, (east, north) in enumerate(flight()):
        at = T0 + second * SECOND
        for number in range(AIRCRAFT):
            off = draws.normal(0.0, sigma_m, 2)
            latitude, longitude = LATITUDE + (north + off[0]) * NORTH_RAD, LONGITUDE + (east + off[1]) * EAST_RAD
            far = longitude + number * 30_000.0 * EAST_RAD
            name = f"mavlink:{number + 1}"
            found.append(GpsReport(name, at, at, latitude, far, None, 1000.0, None, None, None, sigma_m, 10.0, None))
    return found


def plans() -> list[Observation]:
    """Each aircraft says that it goes to a point north of where its turn ends."""
    east, north = flight()[-1]
    said: list[Observation] = []
    for number in range(AIRCRAFT):
        name = f"mavlink:{number + 1}"
        there = LATITUDE + (north + 20_000.0) * NORTH_RAD, LONGITUDE + (east + number * 30_000.0) * EAST_RAD
        point = PlanPoint(1, "waypoint", *there, altitude_msl_m=1000.0)
        said += [FlightPlan(name, T0, T0, (point,)), Intent(name, T0, T0, "mission", 1)]
    return said


def run(said: list[Observation], together: int = 1) -> list[Picture]:
    """What was said, some arrivals a tick."""
    heard = [
        Heard(one.received_at + place, (one,))
        for place, one in enumerate(sorted(said, key=lambda one: one.received_at))
    ]
    state, pictures = initial(DEMO_SITE, Options(estimator="rmimm")), []
    for first in range(0, len(heard), together):
        state, picture = step(state, heard[first : first + together])
        pictures.append(picture)
    return pictures


def rolled_out_after_s(pictures: list[Picture]) -> float:
    """How long after the turns ended straight flight was the likeliest, on average."""
    late = []
    time = np.concatenate([picture.fuse.time for picture in pictures])
    track = np.concatenate([picture.fuse.track for picture in pictures])
    modes = np.concatenate([picture.fuse.modes for picture in pictures])
    for number in np.unique(track):
        rows = (track == number) & (time >= T0 + ROLLS_OUT_S * SECOND)
        sure = time[rows][modes[rows, 0] > 0.5]
        late.append((sure[0] - T0) / SECOND - ROLLS_OUT_S if len(sure) else ENDS_S - ROLLS_OUT_S)
    return float(np.mean(late))


def test_who_says_where_it_goes_is_sooner_known_to_have_rolled_out() -> None:
    """Position reports of 50 m: with the point told the end of the turn is found at least a second sooner."""
    alone, told = (rolled_out_after_s(run(said, 1000)) for said in (reports(50.0), [*plans(), *reports(50.0)]))
    assert told <= alone - 1.0


def test_how_arrivals_fall_into_ticks_changes_no_bit_of_a_track_that_is_told_where_it_goes() -> None:
    """Ticks of one arrival and one of everything leave the same states."""
    said: list[Observation] = [*plans(), *reports(20.0)[: AIRCRAFT * 40]]
    one, whole = (
        np.concatenate([picture.fuse.covariance.reshape(-1, 36) for picture in run(said, together)])
        for together in (1, 10_000)
    )
    assert len(one) == AIRCRAFT * 40
    assert one.tobytes() == whole.tobytes()


def test_the_goal_that_was_known_before_an_instant_counts() -> None:
    """A report goes by what was known when it was valid, however late it is heard; nowhere is a goal too."""
    told = {"a": ()}
    first = Headings().known(100, {"a": (1.0, 2.0)}, told, 0).known(200, {"a": (1.0, 2.0)}, told, 0)
    second = first.known(300, {"a": (5.0, 6.0)}, told, 0).known(400, {"a": NOWHERE}, told, 0)
    history = second.of("a")
    assert [goal_at(history, at) for at in (150, 350)] == [(1.0, 2.0), (5.0, 6.0)]
    assert all(math.isnan(goal_at(history, at)[0]) for at in (50, 100, 450))
    assert len(second.known(500, {"a": (7.0, 8.0)}, told, 350).of("a")) == 2


def test_aircraft_that_nobody_tells_of_any_more_are_forgotten() -> None:
    """What is remembered is bounded by what is told."""
    known = Headings().known(100, {"a": (1.0, 2.0), "b": (3.0, 4.0)}, {"a", "b"}, 0)
    assert known.known(200, {}, {"b"}, 0).of("a") == ()


@pytest.mark.parametrize("aircraft", [None, "mavlink:9"])
def test_who_said_nothing_has_no_heading(aircraft: str | None) -> None:
    """Neither a radar's track nor a stranger."""
    assert Headings().of(aircraft) == ()
