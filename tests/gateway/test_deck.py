"""A runway that follows a ship: who flies down the moving glide path is on it, and what is lost is carried on and said."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

from gateway.frames import RunwayFrame, level_axes
from gateway.observation import Attitude, GpsReport, Observation
from gateway.predict.approach import Deviations, deviations
from gateway.runtime.approaches import approaches_of
from gateway.runtime.folder import Record, write_record
from gateway.settings import DEMO_SITE, Options, Separation, Site, SiteError, format_site, parse_site
from gateway.sinks.arrow import ArrowSink
from gateway.sinks.parquet import finish
from gateway.sinks.scene.deck import STANDING, DeckScene
from gateway.sinks.scene.entry import Rows
from gateway.sinks.scene.flown import Flights

Floats = NDArray[np.float64]
LIGHT = Options(estimator="kalman")  # the deck is the same with any
Run = Any  # tests.gateway.conftest's

SHIP, PLANE, HOVERS = "mavlink:7", "mavlink:1", "mavlink:2"
RUNWAY = replace(
    DEMO_SITE.runway,
    landing_compass_rad=math.radians(350.0),  # a deck at ten degrees to the left of the bow
    length_m=200.0,
    width_m=30.0,
    threshold_crossing_height_m=8.0,
    follows=SHIP,
)
SITE = Site("carrier", RUNWAY, separation=Separation(least_height_m=-50.0))  # who is on the sea would be probed too
CLOSING_MPS, BEGINS_M, SECONDS = 60.0, 4000.0, 60.0
HALF = 160  # what is said in the first 40 s, where more tells no more


def _sailed(turn_degps: float) -> Callable[[float], tuple[Floats, Floats, float]]:
    """Place and velocity east, north, up and heading of a ship at times, that turns steadily and is set by a current."""

    def at(t_s: float) -> tuple[Floats, Floats, float]:
        heading, speed, rate = math.radians(50.0 + turn_degps * t_s), 8.0, math.radians(turn_degps)
        start = math.radians(50.0)
        east = speed * t_s * math.sin(start) if rate == 0.0 else speed / rate * (math.cos(start) - math.cos(heading))
        north = speed * t_s * math.cos(start) if rate == 0.0 else speed / rate * (math.sin(heading) - math.sin(start))
        through = np.array([speed * math.sin(heading), speed * math.cos(heading), 0.0])
        current = np.array([0.6, -0.8, 0.0])
        return np.array([east, north, 0.0]) + current * t_s, through + current, heading

    return at


def _flown(turn_degps: float, t_s: float) -> Floats:
    """Where who flies down the glide path of that ship is, east, north, up."""
    place, _, heading = _sailed(turn_degps)(t_s)
    before_m = BEGINS_M - CLOSING_MPS * t_s
    relative = np.array([RUNWAY.aiming_point_x_m - before_m, 0.0, before_m * math.tan(RUNWAY.glide_path_rad)])
    return place + level_axes(heading + RUNWAY.landing_compass_rad).T @ relative


def _aboard(
    world: Any,
    turn_degps: float = 0.0,
    silent_from_s: float = math.inf,
    yaws_deg: float = 0.0,
    hovers_at_s: float | None = None,
) -> list[Observation]:
    """A ship, and an aircraft down her glide path: positions once a second, velocities by differences, attitudes of the ship.

    With a second aircraft, if wanted, that stands still in the air where the first one is at a time.
    """
    frame, sailed, flown = RunwayFrame(RUNWAY), _sailed(turn_degps), partial(_flown, turn_degps)

    def report(who: str, t_s: float, place: Floats, velocity: Floats) -> GpsReport:
        latitude, longitude, height = (float(one) for one in frame.geodetic_from_enu(place))
        east, north, up = (float(one) for one in velocity)
        at = world.at(t_s)
        said = {
            "velocity_east_mps": east,
            "velocity_north_mps": north,
            "velocity_up_mps": up,
            "velocity_sigma_mps": 0.2,
        }
        return GpsReport(
            who,
            at,
            at + 100_000_000,
            latitude,
            longitude,
            height_m=height,
            horizontal_sigma_m=1.5,
            vertical_sigma_m=1.5,
            **said,
        )

    found: list[Observation] = []
    for k in range(round(2.0 * SECONDS)):
        t_s = 0.5 * k
        if k % 2:
            found.append(report(PLANE, t_s, flown(t_s), (flown(t_s + 0.01) - flown(t_s - 0.01)) / 0.02))
            if hovers_at_s is not None:
                found.append(report(HOVERS, t_s, flown(hovers_at_s), np.zeros(3)))
        if t_s < silent_from_s:
            place, velocity, heading = sailed(t_s)
            if k % 2 == 0:
                found.append(report(SHIP, t_s, place, velocity))
            yaw = heading + math.radians(yaws_deg) * math.sin(0.8 * t_s)
            found.append(Attitude(SHIP, world.at(t_s), world.at(t_s + 0.02), 0.0, 0.0, yaw))
    return found


def _off(pictures: Any, site: Site = SITE) -> tuple[Floats, Deviations]:
    """When, and how far the aircraft was off, as it is drawn in /approach."""
    deck = DeckScene(site)
    deck.entries(pictures)
    flights = Flights(site, deck).gather(pictures)
    number, columns = next(n for n, one in enumerate(flights) if PLANE in one.aircraft), flights.columns
    (_, start, end) = (
        flights.sheaf.cuts()[number] if isinstance(flights.sheaf.cuts(), list) else list(flights.sheaf.cuts())[number]
    )
    off = deviations(site.runway, columns.runway_m[start:end], columns.along_mps[start:end])
    return flights[number].time, off


@pytest.fixture(scope="module")
def straight(world: Any) -> Run:
    """A ship that sails straight on, the aircraft that lands on her, and one that is in its way."""
    run: Run = world.with_site(SITE).run(_aboard(world, hovers_at_s=45.0), options=LIGHT)
    return run


@pytest.mark.parametrize(("turn_degps", "within_m"), [(0.0, 0.5), (0.3, 8.0)])
def test_who_flies_down_the_moving_glide_path_is_on_it(
    world: Any, straight: Run, turn_degps: float, within_m: float
) -> None:
    """Once the heading is known: less than half a metre off, straight on; in a turn what the filter of a track lags."""
    run = world.with_site(SITE).run(_aboard(world, turn_degps)[:HALF], options=LIGHT) if turn_degps else straight
    time, off = _off(run.pictures)
    late = time > world.at(18.0)
    assert np.abs(off.vertical_m[late]).max() < within_m
    assert np.abs(off.lateral_m[late]).max() < within_m
    assert off.distance_m[-1] == pytest.approx(
        off.distance_m[late][0] - CLOSING_MPS * (time[-1] - time[late][0]) / 1e9, abs=5.0
    )


def test_without_following_the_same_aircraft_is_far_off(straight: Run) -> None:
    """Seen from where the runway is written it is on no approach, but for the moments in which it crosses one."""
    _, off = _off(straight.pictures, replace(SITE, runway=replace(RUNWAY, follows=None)))
    assert np.isfinite(off.lateral_m).mean() < 0.2


def test_waves_hardly_move_the_deck(world: Any) -> None:
    """Two degrees of yawing, which would be 140 m at 4 km, leave a tenth of that."""
    time, off = _off(world.with_site(SITE).run(_aboard(world, yaws_deg=2.0)[:HALF], options=LIGHT).pictures)
    assert np.nanmax(np.abs(off.lateral_rad[time > world.at(32.0)])) < math.radians(2.0) / 10.0


def test_ticks_do_not_move_the_deck(world: Any) -> None:
    """One arrival at a time and all at once: the same rows, poses and sentences, bit for bit."""
    told, here = _aboard(world, 0.3, silent_from_s=10.0, yaws_deg=2.0)[:90], world.with_site(SITE)
    runs = [here.run(told, ticks=ticks, until_s=36.0, options=LIGHT) for ticks in ("one", "all")]
    poses = [
        [(pose.at, pose.enu_m.tobytes(), pose.deck_from_enu.tobytes()) for one in run.pictures for pose in one.deck]
        for run in runs
    ]
    assert len(poses[0]) > 30
    assert poses[0] == poses[1]
    assert runs[0].bits() == runs[1].bits()
    assert [(e.at, e.text) for e in runs[0].events] == [(e.at, e.text) for e in runs[1].events]


def test_a_ship_that_is_lost_is_carried_on_and_that_is_said(world: Any) -> None:
    """Silent from 30 s on, straight: the aircraft is still less than three metres off 25 s later; both are said once."""
    run = world.with_site(SITE).run(_aboard(world, silent_from_s=30.0), until_s=90.0, options=LIGHT)
    time, off = _off(run.pictures)
    late = (time > world.at(18.0)) & (time < world.at(58.0))
    assert np.abs(off.lateral_m[late]).max() < 3.0
    for words in ("is heard: the runway is where she is", "is silent: the runway is carried on", "is lost"):
        assert len(run.said(words)) == 1, words


def test_the_aircraft_passes_its_gate_stabilised(straight: Run) -> None:
    """The gates are judged from the deck: it passes the lower one, stabilised, and no alert is said."""
    run = straight
    assert run.said("passes the gate")
    assert not run.said("not stabilised")
    assert not run.said("on final")


def test_the_ship_that_is_the_runway_is_no_conflict(straight: Run) -> None:
    """The aircraft and the one in its way are told; neither is with the ship, who comes nearer than any of them."""
    names = {row["track"]: row["aircraft"] for row in straight.rows()}
    pairs = {
        frozenset(names[one] for one in pair) for each in straight.pictures for pair in each.predict.conflicts.pair
    }
    assert pairs == {frozenset((PLANE, HOVERS))}


def test_predictions_lead_to_where_the_deck_will_be(world: Any, straight: Run) -> None:
    """On final the aircraft is foretold 30 s ahead within 15 m, and aboard the ship, where she is then, after it has landed."""
    frame = RunwayFrame(RUNWAY)
    (number,) = {row["track"] for row in straight.rows(aircraft=PLANE)}
    checked = 0
    for told in (picture.predict for picture in straight.pictures):
        enu = frame.enu_from_geodetic(told.latitude_rad, told.longitude_rad, told.height_m)
        for row in np.flatnonzero((told.track == number) & (told.made >= world.at(25.0))):
            ahead_s, then_s = told.horizon_s[row], (told.valid[row] - world.at(0.0)) / 1e9
            if ahead_s == 30.0 and then_s < SECONDS:
                assert told.intent[row] == "runway"
                assert np.linalg.norm(enu[row] - _flown(0.0, then_s)) < 15.0
                checked += 1
            if ahead_s == 60.0:
                assert np.linalg.norm(enu[row, :2] - _sailed(0.0)(then_s)[0][:2]) < 0.5 * RUNWAY.length_m + 10.0
                checked += 1
    assert checked > 30


def test_an_approach_to_the_deck_is_reported_as_it_was_seen_from_her(world: Any, straight: Run, tmp_path: Path) -> None:
    """From the archive alone: on her glide path within metres, 60 m/s nearer to her, its gate passed."""
    with ArrowSink(tmp_path) as sink:
        for picture in straight.pictures:
            sink.write(picture)
    finish(tmp_path)
    write_record(tmp_path, Record("0", (), LIGHT, world.at(0.0), format_site(SITE)))
    table = pq.read_table(tmp_path / "deck.parquet")
    poses = [pose for picture in straight.pictures for pose in picture.deck]
    np.testing.assert_allclose(table["east_m"].to_numpy(), [pose.enu_m[0] for pose in poses], atol=1e-6)
    (found,) = approaches_of(tmp_path).approaches
    late = found.course.time > world.at(18.0)
    assert found.aircraft == PLANE
    assert any(gate.which == "lower" and not gate.wrong for gate in found.gates)
    assert np.abs(found.course.above_m[late]).max() < 3.0
    assert np.abs(found.course.left_m[late]).max() < 3.0
    np.testing.assert_allclose(found.course.speed_mps[late], CLOSING_MPS, atol=2.0)
    np.testing.assert_allclose(found.course.sink_mps[late], CLOSING_MPS * math.tan(RUNWAY.glide_path_rad), atol=1.0)


def test_a_site_that_follows_is_written_and_read_again() -> None:
    """What format_site writes, parse_site reads; with a radar it is refused, and told why."""
    assert parse_site(format_site(SITE)).runway.follows == SHIP
    with pytest.raises(SiteError, match="radars on a deck that moves are not understood"):
        parse_site(format_site(replace(SITE, radars=DEMO_SITE.radars)))


def test_what_stands_still_is_drawn_where_it_is_from_the_deck(straight: Run) -> None:
    """The transform of a whole second brings a point that stands still to where `place` has it, within the viewer's float32."""
    deck, point = DeckScene(SITE), np.array([[1500.0, -700.0, 40.0]])
    drawn = [one for one in deck.entries(straight.pictures) if isinstance(one, Rows)]
    assert {one.path for one in drawn} >= set(STANDING)
    translation, quaternion = (
        np.array(column.as_arrow_array().flatten().flatten().to_pylist()).reshape(len(drawn[0].time), -1)[-1]
        for column in drawn[0].columns[:2]
    )
    turned = point[0] + 2.0 * np.cross(quaternion[:3], np.cross(quaternion[:3], point[0]) + quaternion[3] * point[0])
    np.testing.assert_allclose(turned + translation, deck.place(drawn[0].time[-1:], point)[0], atol=2e-3)
