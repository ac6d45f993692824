"""The data path as a whole: the same numbers however arrivals fall into ticks, late data in their place, sources apart."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway import pipeline
from gateway.observation import GpsReport, Heard, Observation, RadarPlot, Timing, Truth
from gateway.settings import DEMO_SITE, Options, Weighting

WEIGHTINGS: tuple[Weighting, ...] = ("bias", "covariance", "innovation", "literal")
ONE, TWO = "mavlink:1", "mavlink:2"


@pytest.fixture(scope="module")
def busy(world: Any) -> tuple[Any, list[Observation]]:
    """Two radars, a slow and a fast aircraft, late reports, a silence of 8 s, and no geoid but the streams' own."""
    there = world.two_radars
    site = replace(there.site, runway=replace(there.site.runway, geoid_separation_m=None))
    there = world.with_site(site)
    beside = world.Course(left_m=-2500.0, along_m=-22_000.0)
    said = there.flight(seconds=30.0, radars=(1, 2), gps_phase_s=0.5)
    said += there.flight(beside, 30.0, aircraft=TWO, radars=(1, 2), number=4, gps_period_s=0.7, seed=2)
    said = [one for one in said if not world.at(20.0) < one.valid_at < world.at(28.0)]
    random = np.random.default_rng(3)
    late = random.uniform(size=len(said)) < 0.1
    said = [
        replace(one, received_at=one.received_at + round(random.uniform(0.0, 4e9))) if is_late else one
        for one, is_late in zip(said, late, strict=True)
    ]
    return there, [
        replace(one, height_m=one.altitude_msl_m - 30.0 + float(random.normal(0.0, 1.0)))
        if isinstance(one, GpsReport)
        else one
        for one in said
    ]


def _in_order(observations: list[Observation]) -> list[Observation]:
    """The same, each heard when it was valid."""
    return [replace(one, received_at=one.valid_at) for one in observations]


def _shuffled(observations: list[Observation], seed: int) -> list[Observation]:
    """The same, each heard up to 5 s after it was valid."""
    random = np.random.default_rng(seed)
    return [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in observations]


def _measured(rows: dict[Any, dict[str, Any]]) -> dict[Any, dict[str, Any]]:
    return {key: row for key, row in rows.items() if row["updated_by"] != "coast"}


# ticks ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("weighting", ["bias", "literal"])
def test_how_arrivals_fall_into_ticks_changes_no_bit(busy: tuple[Any, list[Observation]], weighting: Weighting) -> None:
    """Ticks of one arrival, of 20 ms with watermarks, and one of everything give equal rows and predictions, to the bit."""
    there, said = busy
    runs = [
        there.run(said, ticks=t, options=Options(weighting=weighting), until_s=75.0) for t in ("one", "20 ms", "all")
    ]
    first = runs[0]
    assert {"fused", "gps only", "radar only", "coasting"} <= set(first.column("state"))
    assert len(first.ended) >= 4
    for other in runs[1:]:
        assert first.bits() == other.bits()
        assert [(e.at, e.text) for e in first.events] == [(e.at, e.text) for e in other.events]
        assert first.ended == other.ended
        assert first.state.counters == other.state.counters


def test_rows_written_while_a_pair_is_made_do_not_depend_on_ticks(world: Any) -> None:
    """A report that waits in its tick when a pair is made is written as it was known when it was heard."""
    flight = [
        replace(one, received_at=one.valid_at + 700_000_000) if isinstance(one, GpsReport) else one
        for one in world.flight(seconds=15.0, gps_phase_s=0.5)
    ]
    runs = [world.run(flight, ticks=t) for t in ("one", "20 ms", "all")]
    assert runs[0].said("is radar track")
    assert runs[0].bits() == runs[1].bits() == runs[2].bits()


def test_a_replay_is_the_run(busy: tuple[Any, list[Observation]]) -> None:
    """Running the same arrivals again gives the same bits."""
    there, said = busy
    assert there.run(said).bits() == there.run(said).bits()


def test_the_receivers_clock_changes_no_number(world: Any) -> None:
    """Watermarks, however many, and how long before the first arrival they begin, change nothing that is written."""
    flight = world.flight(seconds=12.0)
    plain = world.run(flight, until_s=50.0)
    heard = world.heard(flight)
    clock = [Heard(world.at(-30.0 + 0.1 * k) // 4000 * 4000 + 4) for k in range(790)]
    ticking = world.run(sorted([*heard, *clock], key=lambda one: one.now), until_s=50.0)
    assert plain.bits() == ticking.bits()
    assert [(e.at, e.text) for e in plain.events] == [(e.at, e.text) for e in ticking.events]


@pytest.mark.parametrize("before_s", [0.3, 30.0])
def test_an_arrival_on_a_whole_second_ends_a_silence_the_same_way(world: Any, before_s: float) -> None:
    """When the first report comes at a whole second, the predictions of that second are made, watermarks or not."""
    report = world.report(world.Course(), 99.0, late_s=1.0)
    assert report.received_at % world.SECOND == 0
    plain = world.run([report], until_s=104.5)
    ticking = world.run(
        [Heard(report.received_at - round(before_s * world.SECOND)), *world.heard([report])], until_s=104.5
    )
    assert plain.bits() == ticking.bits()
    # the instants 100, 101, 102, 103 and 104
    assert sum(len(picture.predict.made) for picture in plain.pictures) == 5 * len(Options().horizons_s)


# late and shuffled ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("weighting", "seed"), [("bias", 1), ("covariance", 1), ("innovation", 2), ("literal", 2)])
def test_shuffled_within_5_s_is_in_order(
    world: Any, differences: Callable[..., float], weighting: Weighting, seed: int
) -> None:
    """Whatever comes up to 5 s late, the last row of each aircraft and time is that of in-order processing to 1e-9.

    Radar-only tracks are compared until they became an aircraft: what they write until that is known depends on when it is.
    For the same reason an aircraft may have rows of plots that for a moment, with half of the data there, seemed its own.
    """
    there, beside = world.two_radars, world.Course(left_m=-2500.0, along_m=-22_000.0)
    said = there.flight(seconds=30.0, radars=(1, 2))
    said += there.flight(beside, 30.0, aircraft=TWO, radars=(1, 2), number=4, gps_period_s=0.5, seed=2)
    options = Options(weighting=weighting)
    wanted = there.run(_in_order(said), options=options, until_s=40.0)
    found = there.run(_shuffled(said, seed), options=options, until_s=40.0)
    assert wanted.state.association.ledger.pairs == found.state.association.ledger.pairs
    assert len(wanted.state.association.ledger.pairs) == 4
    since = {f"{s.key[0]}/{s.key[1]}": s.since for s in wanted.state.association.ledger.spans}

    def compared(ran: Any) -> dict[Any, dict[str, Any]]:
        rows = _measured(ran.last())
        return {(who, at): row for (who, at), row in rows.items() if who not in since or at < since[who]}

    rows, others = compared(wanted), compared(found)
    aircraft = {key for key in rows if key[0].startswith("mavlink")}
    assert len(aircraft) > 150
    assert aircraft <= others.keys()
    for who, at in others.keys() - rows.keys():
        begun = [
            s.since for s in wanted.state.association.ledger.spans if who in (s.aircraft, f"{s.key[0]}/{s.key[1]}")
        ]
        assert min(abs(at - since) for since in begun) < 5 * world.SECOND
    both = rows.keys() & others.keys()
    assert differences({key: rows[key] for key in both}, others) < 1e-9
    for key in both:
        for name in ("state", "radar_track", "updated_by"):
            assert rows[key][name] == others[key][name]


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_plots_from_just_before_the_pair_that_come_after_it_are_in_order(
    world: Any, differences: Callable[..., float], weighting: Weighting
) -> None:
    """Plots valid just before the report that made the pair, heard after the pair was made, leave the aircraft in order."""
    said = _in_order(world.flight(seconds=20.0, missing=False))
    late = [
        replace(one, received_at=one.valid_at + 3 * world.SECOND)
        if isinstance(one, RadarPlot) and world.at(9.0) < one.valid_at < world.at(10.13)
        else one
        for one in said
    ]
    options = Options(weighting=weighting)
    wanted, found = (_measured(world.run(given, options=options).last(aircraft=ONE)) for given in (said, late))
    assert wanted.keys() == found.keys()
    assert differences(wanted, found) < 1e-9


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_reused_number_is_told_apart_in_shuffled_data_too(
    world: Any, differences: Callable[..., float], seed: int
) -> None:
    """The number of one aircraft is given to another, 4 km away, while data come up to 5 s late: no plot goes astray."""
    course, other = world.Course(), world.Course(left_m=4000.0, along_m=-18_000.0)
    reused = world.at(26.0)
    first = [one for one in world.flight(course, 45.0) if isinstance(one, GpsReport) or one.valid_at < world.at(25.0)]
    second = world.flight(other, 45.0, aircraft=TWO, seed=5)
    second = [one for one in second if isinstance(one, GpsReport) or one.valid_at > reused]
    said = first + second
    wanted, found = (
        {key: row for key, row in _measured(world.run(given, until_s=52.0).last()).items() if key[0] in (ONE, TWO)}
        for given in (_in_order(said), _shuffled(said, seed))
    )
    assert wanted.keys() == found.keys()
    assert {row["aircraft"] for row in wanted.values() if row["updated_by"] == "radar"} == {ONE, TWO}
    assert differences(wanted, found) < 1e-9


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_a_report_2_s_late_changes_the_picture_in_the_step_of_its_arrival(
    world: Any, differences: Callable[..., float], weighting: Weighting
) -> None:
    """The step in which a late report arrives writes its row and every later one of its track again, and no earlier one."""
    flight = world.flight(seconds=22.0)
    late = next(one for one in flight if isinstance(one, GpsReport) and one.valid_at == world.at(15.13))
    moved = replace(late, received_at=late.valid_at + 2 * world.SECOND)
    flight = [moved if one is late else one for one in flight]
    heard, options = world.heard(flight), Options(weighting=weighting)
    ran = world.run(heard, ticks="one", options=options)
    step = next(i for i, one in enumerate(heard) if one.now >= world.at(17.13))
    assert isinstance(heard[step].observations[0], GpsReport)
    times = ran.pictures[step].fuse.time.tolist()
    behind = sorted({row["time"] for row in ran.rows(aircraft=ONE) if late.valid_at <= row["time"] < heard[step].now})
    # the literal weighting also works a report again that was interpolated with what came after it
    assert times[-len(behind) :] == behind
    assert times[0] == late.valid_at
    assert len(behind) >= 5
    assert ran.pictures[step].fuse.updated_by[0] == "gps"
    assert int(ran.pictures[step].fuse.received[0]) == moved.received_at
    # and it is a change: the newest state is not what it was
    before, after = ran.pictures[step - 1].fuse.runway_m[-1], ran.pictures[step].fuse.runway_m[-1]
    assert ran.pictures[step - 1].fuse.time[-1] == times[-1]
    assert float(np.abs(before - after).max()) > 1e-3


def test_later_than_the_history_is_counted_and_changes_nothing(world: Any) -> None:
    """A report or plot of more than 10 s ago is counted and said once for each source; no bit changes by it."""
    flight, course = world.flight(seconds=25.0), world.Course()
    late = [world.report(course, 9.0 + 0.1 * k, late_s=10.5, off_m=(500.0, 0.0, 0.0)) for k in range(3)]
    late += [world.radar_plot(course, 9.0 + 0.1 * k, late_s=10.6) for k in range(2)]
    ran, plain = world.run([*flight, *late], until_s=30.0), world.run(flight, until_s=30.0)
    assert ran.state.counters["too late"] == 5
    assert len(ran.said("10 s late")) == 2
    assert ran.bits() == plain.bits()


def test_a_report_just_within_the_history_is_used(world: Any) -> None:
    """A report of 9.5 s ago still gets its row."""
    flight = world.flight(seconds=25.0)
    ran = world.run([*flight, world.report(world.Course(), 12.0, late_s=9.5)], until_s=26.0)
    assert "too late" not in ran.state.counters
    assert len(ran.rows(time=world.at(12.0), updated_by="gps")) == 1


def test_from_the_future_is_counted_and_changes_nothing(world: Any) -> None:
    """A report that claims to be of more than 10 s from now is counted and said once, and not used."""
    flight, course = world.flight(seconds=25.0), world.Course()
    early = [replace(world.report(course, 40.0 + k), received_at=world.at(15.5 + k)) for k in range(3)]
    ran, plain = world.run([*flight, *early], until_s=30.0), world.run(flight, until_s=30.0)
    assert ran.state.counters["from the future"] == 3
    assert len(ran.said("ahead of the session's time")) == 1
    assert ran.bits() == plain.bits()


def test_a_session_whose_time_goes_back_starts_again_and_says_so(world: Any) -> None:
    """When arrivals jump back by more than the history, tracks begin anew with fresh states; nothing is mixed."""
    first = world.flight(seconds=12.0, gps_period_s=0.5)
    back = 1000 * world.SECOND
    again = [replace(one, valid_at=one.valid_at - back, received_at=one.received_at - back) for one in first]
    arrivals = [*world.heard(first), *world.heard(again)]
    ran = world.run(arrivals, until_s=-980.0)
    assert len(ran.said("time went back by")) == 1
    assert ran.state.counters["session's time set back"] == 1
    fresh, whole = world.run(first, until_s=15.0).rows(aircraft=ONE), ran.rows(aircraft=ONE)
    assert len(whole) >= 2 * len(fresh) - 10  # coasting rows at the ends may differ
    wanted = {row["time"] - back: row["runway_m"] for row in fresh if row["updated_by"] == "gps"}
    found = {row["time"]: row["runway_m"] for row in whole if row["updated_by"] == "gps"}
    for at, position in wanted.items():
        assert found[at].tobytes() == position.tobytes()


def test_an_aircraft_keeps_its_number_when_the_session_time_goes_back(world: Any) -> None:
    """Also one that reports each 5 s, so that whole seconds pass before it is heard again."""
    first = world.flight(seconds=22.0, gps_period_s=5.0)
    back = 1000 * world.SECOND
    again = [replace(one, valid_at=one.valid_at - back, received_at=one.received_at - back) for one in first]
    ran = world.run([*world.heard(first), *world.heard(again)], until_s=-975.0)
    assert len({row["track"] for row in ran.rows(aircraft=ONE)}) == 1


# what must not be fused -----------------------------------------------------------------------------------------------


def test_truth_changes_no_bit(world: Any) -> None:
    """A truth beside the stream, right or absurd, of the same or another aircraft, changes no row and no prediction."""
    flight = world.flight(seconds=25.0)
    plain = world.run(flight, until_s=60.0)
    truths = [
        Truth(who, world.at(t), world.at(t + 0.01), 0.3, -1.0, 50_000.0, 40_000.0, 900.0, 900.0, 900.0)
        for who in (ONE, "mavlink:9")
        for t in np.arange(0.0, 25.0, 0.2).tolist()
    ]
    ran = world.run([*truths, *flight], until_s=60.0)
    assert ran.bits() == plain.bits()
    assert sum(len(picture.truth) for picture in ran.pictures) == len(truths)


def test_a_foreign_clock_is_shown_and_not_fused(world: Any) -> None:
    """Reports and plots of a foreign clock are in align's columns, write no row, and are never paired."""
    flight = [replace(one, timing=Timing.FOREIGN) for one in world.flight(seconds=20.0)]
    ran = world.run(flight)
    shown = sum(len(p.align.report_time) + len(p.align.plot_time) for p in ran.pictures)
    assert shown == len(flight)
    assert ran.rows() == []
    assert ran.checks == 0


def test_a_provisional_clock_is_a_track_of_its_own(world: Any) -> None:
    """Reports whose clock is not settled yet are a track, "gps only", and are not paired with the radar's."""
    flight = [
        replace(one, timing=Timing.PROVISIONAL) if isinstance(one, GpsReport) else one
        for one in world.flight(seconds=30.0)
    ]
    ran = world.run(flight)
    assert {row["state"] for row in ran.rows(aircraft=ONE, updated_by="gps")} == {"gps only"}
    assert {row["state"] for row in ran.rows(radar_track="1/3")} == {"radar only"}
    assert not ran.rows(aircraft=ONE, updated_by="radar")
    assert ran.checks == 0
    assert world.run(world.flight(seconds=30.0)).rows(state="fused")  # which with settled clocks are


def test_plots_that_the_radar_did_not_number_are_counted_and_drawn(world: Any) -> None:
    """Plots of track number 0 belong to no track yet: they are in align's columns and counted as untracked."""
    flight = world.flight(seconds=10.0, aircraft=None, number=0)
    ran = world.run(flight)
    assert sum(picture.track.untracked for picture in ran.pictures) == len(flight)
    assert ran.rows() == []


# states, coasting, ends -----------------------------------------------------------------------------------------------


def test_the_state_says_who_saw_it_lately(world: Any) -> None:
    """GPS alone, then both, then GPS alone again when the radar has been silent for ten seconds, then radar alone."""
    flight = world.flight(seconds=60.0)
    flight = [one for one in flight if isinstance(one, GpsReport) or not world.at(20.0) < one.valid_at < world.at(36.0)]
    ran = world.run(flight)
    state = {(row["time"] - world.START) / 1e9: row["state"] for row in ran.last(aircraft=ONE).values()}
    assert state[0.13] == "gps only"
    assert state[15.13] == "fused"
    assert state[25.13] == "fused"  # 5 s after the last plot
    assert state[35.13] == "gps only"  # 15 s after it
    silent = [one for one in world.flight(seconds=60.0) if isinstance(one, RadarPlot) or one.valid_at < world.at(26.0)]
    last = world.run(silent).rows(aircraft=ONE)[-1]
    assert (last["state"], last["updated_by"]) == ("radar only", "radar")


def test_a_silent_track_coasts_each_second_and_ends_after_30(world: Any) -> None:
    """Without data a track is carried on at whole seconds, ever less certain, and ends once, said, after 30 s."""
    flight = [one for one in world.flight(seconds=20.0) if one.valid_at < world.at(19.0)]
    ran = world.run(flight, until_s=70.0)
    last = max(row["time"] for row in ran.rows(aircraft=ONE) if row["updated_by"] != "coast")
    coasting = [row for row in ran.rows(aircraft=ONE, updated_by="coast") if row["time"] > last]
    times = [row["time"] for row in coasting]
    assert times == list(range(times[0], times[0] + len(times) * world.SECOND, world.SECOND))
    assert times[0] % world.SECOND == 0
    assert last + 2 * world.SECOND < times[0]
    assert last + 29 * world.SECOND < times[-1] <= last + 30 * world.SECOND
    assert {row["state"] for row in coasting} == {"coasting"}
    assert {row["received"] for row in coasting} == {-1}
    spread = [np.trace(row["covariance"].reshape(6, 6)[:3, :3]) for row in coasting]
    assert (np.diff(spread) > 0.0).all()
    (ended,) = [one for one in ran.ended if one.track == coasting[0]["track"]]
    assert ended.at == times[-1] + world.SECOND
    assert len(ran.said(f"track {ended.track} ended")) == 1
    # carried on at constant velocity: on the course but for what half a minute of its curve is
    assert coasting[4]["runway_m"] == pytest.approx(world.Course().at((times[4] - world.START) / 1e9), abs=60.0)


def test_a_slow_source_does_not_coast_between_its_reports(world: Any) -> None:
    """Once its rhythm is known, five seconds between reports are no silence; twice that after the last one is."""
    flight = [one for one in world.flight(seconds=40.0) if isinstance(one, GpsReport)]
    ran = world.run(flight, until_s=55.0)
    second = flight[1].received_at
    coasting = [row for row in ran.rows(updated_by="coast") if row["time"] > second]
    assert min(row["time"] for row in coasting) > world.at(35.13 + 10.0)


def test_an_ended_tracks_number_is_not_used_again(world: Any) -> None:
    """An aircraft that comes back long after its track ended gets a new one, with the next number."""
    flight = world.flight(seconds=420.0, radars=())
    flight = [one for one in flight if not world.at(12.0) < one.valid_at < world.at(400.0)]
    ran = world.run(flight)
    assert sorted({row["track"] for row in ran.rows()}) == [1, 2]
    assert {row["aircraft"] for row in ran.rows()} == {ONE}


def test_a_radar_track_alone_is_a_track_and_becomes_the_aircrafts(world: Any) -> None:
    """Radar first, GPS later: the aircraft's track, with the plots in it, goes on under the number that was there first."""
    flight = [one for one in world.flight(seconds=50.0) if isinstance(one, RadarPlot) or one.valid_at > world.at(20.0)]
    ran = world.run(flight)
    alone, theirs = ran.rows(radar_track="1/3", aircraft=None), ran.rows(aircraft=ONE)
    joined_at = world.at(30.13)
    assert {row["track"] for row in alone} == {1}
    assert {row["track"] for row in theirs if row["time"] < joined_at} == {2}
    joined = [row for row in theirs if row["track"] == 1]
    assert min(row["time"] for row in joined) == joined_at
    assert {row["state"] for row in alone} == {"radar only"}
    assert alone[0]["time"] < world.at(3.0)
    (ended,) = ran.ended
    assert (ended.track, ended.at, ended.into) == (2, joined_at, 1)
    assert "joined track 1" in ended.reason
    assert max(row["time"] for row in alone) <= world.at(31.13)  # what was written until the check was done
    later = [row for row in joined if row["updated_by"] == "radar"]
    assert {row["radar_track"] for row in later} == {"1/3"}
    assert {row["state"] for row in later} == {"fused"}
    # a number that joined coasts no more and is ended once
    assert max(row["time"] for row in world.run(flight, until_s=90.0).rows(track=2)) < joined_at


def test_two_radars_behind_one_aircraft_are_both_named(world: Any) -> None:
    """A row of an aircraft that two radars see names both tracks, with a space between."""
    there = world.two_radars
    ran = there.run(there.flight(seconds=30.0, radars=(1, 2)))
    assert ran.rows(aircraft=ONE)[-1]["radar_track"] == "1/3 2/3"


# numbers of a row -----------------------------------------------------------------------------------------------------


def test_a_fused_track_is_nearer_the_truth_than_its_sources(world: Any) -> None:
    """With both sources the track lies within 25 m of the course, although the GPS is 60 m off."""
    ran = world.run(world.flight(seconds=120.0))
    rows = [row for row in ran.last(aircraft=ONE, state="fused").values() if row["time"] > world.at(60.0)]
    off = [row["runway_m"] - world.Course().at((row["time"] - world.START) / 1e9) for row in rows]
    # 20 km away with 1 mrad and 15 m every 0.4 s: about 10 m an axis and row at most; 25 in 3-D leaves room for the draw
    assert float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean())) < 25.0
    reported = world.run([one for one in world.flight(seconds=120.0) if isinstance(one, GpsReport)])
    alone = [row["runway_m"] - world.Course().at((row["time"] - world.START) / 1e9) for row in reported.rows()[12:]]
    assert float(np.sqrt((np.array(alone) ** 2).sum(axis=1).mean())) > 45.0


def test_a_rows_coordinates_are_one_place(world: Any) -> None:
    """Latitude, longitude and height are the runway position; altitude is height less the geoid; velocity is local."""
    ran = world.run(world.flight(world.Course(along_m=-60_000.0, height_m=3000.0), 30.0))
    row = ran.rows()[-1]
    place = world.frame.runway_from_geodetic(row["latitude_rad"], row["longitude_rad"], row["height_m"])
    assert place == pytest.approx(row["runway_m"], abs=1e-6)
    assert row["altitude_msl_m"] == row["height_m"] + 35.0
    state = ran.state.lanes.lanes[row["track"]].last
    local = world.frame.local_from_enu(row["latitude_rad"], row["longitude_rad"])
    assert row["velocity_mps"] == pytest.approx(local @ state.mean[3:6], abs=1e-9)
    covariance = row["covariance"].reshape(6, 6)
    assert covariance[:3, :3] == pytest.approx(local @ state.covariance[:3, :3] @ local.T, rel=1e-9, abs=1e-9)
    assert covariance[3:, :3] == pytest.approx(local @ state.covariance[3:6, :3] @ local.T, rel=1e-9, abs=1e-9)


def test_predictions_are_made_each_second_for_every_track(world: Any) -> None:
    """At whole seconds each living track is carried on to 10, 30, 60 and 120 s, less and less certain."""
    ran = world.run(world.flight(seconds=20.0))
    made = [int(at) for picture in ran.pictures for at in picture.predict.made]
    assert all(at % world.SECOND == 0 for at in made)
    assert sorted(set(made)) == list(range(made[0], made[-1] + 1, world.SECOND))
    (picture,) = ran.pictures
    table = picture.predict
    assert ((table.valid - table.made) / 1e9).tolist() == table.horizon_s.tolist()
    assert table.horizon_s[:4].tolist() == [10.0, 30.0, 60.0, 120.0]
    assert (table.sigma_m[2::4] > table.sigma_m[::4]).all()
    last = len(table.made) - 4
    course = world.Course()
    there = course.at((int(table.valid[last]) - world.START) / 1e9)
    assert math.dist(table.runway_m[last].tolist(), there.tolist()) < 100.0  # 10 s on: 5 m/s and the curve


def test_the_state_before_is_not_touched(world: Any) -> None:
    """A step is a function: the same state stepped twice gives the same bits, so the first step did not change it."""
    heard = world.heard(world.flight(seconds=24.0))
    state, _ = pipeline.step(pipeline.initial(DEMO_SITE), heard[:25])  # before the pair is made
    pictures = [pipeline.step(state, heard[25:])[1] for _ in range(2)]
    assert pictures[0].fuse.covariance.tobytes() == pictures[1].fuse.covariance.tobytes()
    assert pictures[0].fuse.track.tolist() == pictures[1].fuse.track.tolist()
    assert len(pictures[0].fuse.track) > 20
