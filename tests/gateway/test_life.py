"""The life of tracks: tentative, confirmed, coasting, ended; and who is the same again after gaps and changes of source."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.fuse.agreement import CONFIRMED
from gateway.fuse.continuing import chi_square_gate
from gateway.fuse.filtering import Job, run
from gateway.fuse.weighting import Model
from gateway.observation import GpsReport, Observation, RadarPlot
from gateway.settings import Options, PositionSource, Weighting

ONE, TWO = "mavlink:1", "mavlink:2"
WEIGHTINGS: tuple[Weighting, ...] = ("bias", "covariance", "innovation", "literal")


def reports(world: Any, until_s: float, since_s: float = 0.0, period_s: float = 1.0, **extra: Any) -> list[GpsReport]:
    """Exact reports of a course, heard 0.3 s later."""
    course = extra.pop("course", world.Course())
    times = np.arange(since_s + 0.13, until_s, period_s).tolist()
    return [world.report(course, t_s, late_s=0.3, **extra) for t_s in times]


def plots(
    world: Any, since_s: float, until_s: float, number: int = 3, course: Any = None, seed: int = 1, radar: int = 1
) -> list[RadarPlot]:
    """Noisy plots of a course, one each 0.4 s."""
    random = np.random.default_rng(seed)
    return [
        world.radar_plot(
            course or world.Course(),
            0.05 + 0.4 * k,
            radar=radar,
            number=number,
            off=random.normal(0.0, [15.0, 1e-3, 1e-3]),
        )
        for k in range(math.ceil(since_s / 0.4), math.floor(until_s / 0.4))
    ]


def numbers(ran: Any) -> list[int]:
    """The tracks that have rows."""
    return sorted({row["track"] for row in ran.rows()})


def lives(ran: Any, track: int) -> list[tuple[str, str]]:
    """What was told of a track's life, in order."""
    told = [one for picture in ran.pictures for one in picture.fuse.lived]
    return [(one.life, one.reason) for one in told if one.track == track]


def life(ran: Any) -> list[tuple[int, str, str]]:
    """Time, how it was updated, and life of each row."""
    return list(zip(ran.column("time"), ran.column("updated_by"), ran.column("life"), strict=True))


# tentative and confirmed ----------------------------------------------------------------------------------------------


def test_an_aircraft_is_confirmed_by_its_second_report_if_that_agrees(world: Any) -> None:
    """With a velocity two reports are enough, without one three; the rows say so, and the log and the table why."""
    moving = {"velocity_east_mps": 80.0, "velocity_north_mps": 6.7, "velocity_up_mps": -3.0}
    for extra, tentative in ((moving, 1), ({}, 2)):
        ran = world.run(reports(world, 6.0, **extra), until_s=7.0)
        found = [life for _, by, life in life(ran) if by == "gps"]
        assert found == ["tentative"] * tentative + ["confirmed"] * (6 - tentative)
        assert lives(ran, 1) == [
            ("tentative", "mavlink:1, heard for the first time"),
            ("confirmed", "its measurements agree"),
        ]
        assert [event.text for event in ran.events] == ["track 1, mavlink:1, is confirmed: its measurements agree"]


def test_a_radar_track_is_confirmed_within_three_seconds(world: Any) -> None:
    """It begins with its third plot, tentative, and three more that agree confirm it."""
    ran = world.run(plots(world, 0.0, 8.0))
    found = [(at - world.START) / 1e9 for at, _, life in life(ran) if life == "confirmed"]
    assert min(found) < 3.0
    assert life(ran)[0][2] == "tentative"
    assert ran.said("track 1, radar track 1/3, is confirmed")


def test_plots_that_have_nothing_to_do_with_each_other_confirm_nothing(world: Any) -> None:
    """Plots strewn over all that the track stage lets pass, 30 of them in each of 40 tracks, stay tentative."""
    model, random = Model.of(Options(), PositionSource(), world.radars), np.random.default_rng(7)
    jobs = []
    for track in range(40):
        course = world.Course(along_m=-8000.0 - 400.0 * track)
        some = [world.plot(course, 0.4 * k, serial=k) for k in range(30)]
        strewn = [
            replace(plot, polar=tuple(np.add(plot.polar, random.uniform(-1.0, 1.0, 3) * [240.0, 240 / 8e3, 240 / 8e3])))
            for plot in some
        ]
        jobs.append(Job(track, None, strewn, lambda fix: None))
    confirmed = [any(event.score == CONFIRMED for event in events) for events in run(jobs, model)]
    # each is wrongly confirmed with odds of 1 to 10 000 a plot at most: 1200 plots, so 0.12 of them are expected
    assert sum(confirmed) <= 1


@pytest.mark.parametrize("period_s", [0.1, 1.0, 5.0])
def test_how_often_a_source_reports_does_not_decide_whether_it_is_confirmed(world: Any, period_s: float) -> None:
    """Ten reports a second, one, or one in five seconds: each aircraft is confirmed by its fourth report."""
    ran = world.run(reports(world, 4.5 * period_s, period_s=period_s))
    assert [life for _, by, life in life(ran) if by == "gps"][3] == "confirmed"


def test_confirming_can_be_made_harder(world: Any) -> None:
    """With odds of 1e12 asked for, more measurements are needed than with 1e4."""
    said = plots(world, 0.0, 12.0)
    waits = [
        sum(life == "tentative" for _, _, life in life(world.run(said, options=Options(confirm_odds=odds))))
        for odds in (1e4, 1e6)
    ]
    hard = sum(one == "tentative" for _, _, one in life(world.run(said, options=Options(confirm_odds=1e12))))
    assert waits[0] <= waits[1] < hard


def test_a_tentative_track_ends_sooner_and_quietly(world: Any) -> None:
    """One report and no more: after 15 s the track is ended, in the table and not in the log."""
    ran = world.run(reports(world, 1.0), until_s=60.0)
    (ended,) = ran.ended
    assert ended.quiet
    assert ended.reason == "no data for 15 s, and it was never confirmed"
    assert (ended.at - world.at(0.13)) // world.SECOND == 15
    assert not ran.events
    assert {life for _, _, life in life(ran)} == {"tentative"}


@pytest.mark.parametrize("weighting", WEIGHTINGS)
def test_late_data_confirm_as_in_order(world: Any, weighting: Weighting) -> None:
    """Shuffled within 5 s, the last row of each time has the same part of life as in order."""
    random = np.random.default_rng(4)
    said = [replace(one, received_at=one.valid_at) for one in world.flight(seconds=20.0, gps_period_s=2.0)]
    late = [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in said]
    found = []
    for given in (said, late):
        ran = world.run(given, options=Options(weighting=weighting), until_s=27.0)
        who = zip(ran.column("aircraft"), ran.column("time"), ran.column("updated_by"), ran.column("life"), strict=True)
        found.append({(name, at): life for name, at, by, life in who if name == ONE and by != "coast"})
    assert found[0].items() <= found[1].items()
    assert set(found[0].values()) == {"tentative", "confirmed"}


# coasting and ended ---------------------------------------------------------------------------------------------------


def test_coasting_and_coming_back_are_told_with_their_reasons(world: Any) -> None:
    """Ten seconds of silence: it coasts, said once; heard again, said once; then silence, and it ends, said once."""
    said = [*reports(world, 10.0), *reports(world, 30.0, since_s=20.0)]
    ran = world.run(said, until_s=70.0)
    told = [text for event in ran.events if (text := event.text).startswith("track 1")]
    assert [text.partition(": ")[0] for text in told] == [
        *("track 1, mavlink:1, is confirmed", "track 1, mavlink:1, is coasting", "track 1, mavlink:1, is confirmed"),
        *("track 1, mavlink:1, is coasting", "track 1 ended"),
    ]
    assert told[1].endswith("nothing for 3 s")
    assert told[2].endswith("heard again after 11 s")
    assert told[4].endswith("no data for 30 s")
    assert {life for _, by, life in life(ran) if by == "coast"} == {"coasting"}
    assert numbers(ran) == [1]


# an aircraft that comes back ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gap_s", "sentence"),
    [(20.0, "heard again after 21 s"), (40.0, "again, after 41 s"), (280.0, "again, after 281 s")],
)
def test_an_aircraft_whose_link_dropped_is_its_old_track(world: Any, gap_s: float, sentence: str) -> None:
    """Before its track ended, or after: the number is the same, and it is said."""
    said = [*reports(world, 20.0), *reports(world, 40.0 + gap_s, since_s=20.0 + gap_s)]
    ran = world.run(said)
    assert numbers(ran) == [1]
    assert len(ran.said(sentence)) == 1
    assert len(ran.ended) == (gap_s > 30.0)


def test_an_aircraft_that_was_gone_for_long_gets_a_new_number_and_that_is_said(world: Any) -> None:
    """After more than five minutes the number is another one, and the log says which it was."""
    ran = world.run([*reports(world, 20.0), *reports(world, 340.0, since_s=330.0)])
    assert numbers(ran) == [1, 2]
    assert len(ran.said("track 2 is mavlink:1 again, which was track 1")) == 1


def test_an_aircraft_that_cannot_have_flown_there_gets_a_new_number(world: Any) -> None:
    """Back after 40 s, 60 km away: what has this name now is another aircraft, and the log says which track it was."""
    there = world.Course(along_m=-90_000.0)
    ran = world.run([*reports(world, 20.0), *reports(world, 80.0, since_s=60.0, course=there)])
    assert numbers(ran) == [1, 2]
    assert ran.said("track 2 is mavlink:1 again, which was track 1")


def test_a_report_that_came_late_revives_what_would_not_have_ended(
    world: Any, differences: Callable[..., float]
) -> None:
    """A report valid within 30 s of the last one, heard when the track had ended: the rows are those of in order."""
    said = [*reports(world, 20.0), *reports(world, 60.0, since_s=48.0)]
    late = [replace(one, received_at=max(one.received_at, world.at(52.0))) for one in said[20:]]
    wanted, found = world.run(said), world.run([*said[:20], *late])
    assert len(found.ended) == 1
    assert not wanted.ended
    rows, others = (
        {key: row for key, row in ran.last().items() if row["updated_by"] == "gps"} for ran in (wanted, found)
    )
    assert rows.keys() == others.keys()
    assert differences(rows, others) < 1e-9
    assert numbers(found) == [1]


# sources come and go --------------------------------------------------------------------------------------------------


def test_one_number_through_every_loss_of_a_source(world: Any) -> None:
    """Both, radar alone, none, GPS back, both again, with the radar's number changed meanwhile: one track, and its state."""
    said: list[Observation] = [*reports(world, 30.0), *plots(world, 0.0, 60.0)]
    said += [*reports(world, 120.0, since_s=75.0), *plots(world, 90.0, 120.0, number=8)]
    ran = world.run(said)
    state = {}
    for row in ran.last(aircraft=ONE).values():
        state[(row["time"] - world.START) // world.SECOND] = row["state"]
    assert [state[second] for second in (20, 50, 70, 80, 118)] == [
        *("fused", "radar only", "coasting", "gps only", "fused")
    ]
    assert {row["track"] for row in ran.rows(aircraft=ONE)} == {1}


def test_a_radar_that_numbers_an_aircraft_anew_stays_in_its_track_at_once(world: Any) -> None:
    """With GPS there: the new number is the aircraft's from its first plot on, and there never is a second track."""
    said: list[Observation] = [*reports(world, 60.0), *plots(world, 0.0, 30.0), *plots(world, 30.0, 60.0, number=7)]
    ran = world.run(said)
    began = min(one.valid_at for one in said if isinstance(one, RadarPlot) and one.track_number == 7)
    before = {row["track"] for row in ran.rows() if row["time"] > world.at(15.0)}
    assert before == {row["track"] for row in ran.rows(aircraft=ONE)}
    rows = ran.last(aircraft=ONE, updated_by="radar")
    assert rows[ONE, began]["radar_track"] == "1/7"
    assert {row["state"] for (_, at), row in rows.items() if at >= began} == {"fused"}
    assert len(ran.said("goes on as radar track 1/7, which was 1/3")) == 1
    assert len(ran.said("mavlink:1 is radar track 1/7")) == 1  # and association finds the same
    assert not ran.state.lanes.adopted  # so that nothing of it is needed any more
    assert rows[max(rows)]["radar_track"] == "1/7"


@pytest.mark.parametrize("gap_s", [0.4, 5.0, 12.0, 20.0])
def test_the_radar_alone_finds_an_aircraft_again_under_another_number(world: Any, gap_s: float) -> None:
    """GPS is lost; so is the radar's track, which comes back with another number: still the aircraft's track."""
    again = plots(world, 30.0 + gap_s, 60.0 + gap_s, number=7)
    ran = world.run([*reports(world, 20.0), *plots(world, 0.0, 30.0), *again], until_s=60.0 + gap_s)
    last = ran.rows()[-1]
    assert (last["aircraft"], last["radar_track"], last["state"]) == (ONE, "1/7", "radar only")
    assert last["track"] == ran.rows(aircraft=ONE)[0]["track"]
    assert not [row for row in ran.rows(radar_track="1/7") if row["aircraft"] is None]


@pytest.mark.parametrize(("number", "gap_s"), [(3, 0.4), (3, 20.0), (7, 0.4), (7, 12.0)])
def test_a_track_that_only_the_radar_knows_keeps_its_number(world: Any, number: int, gap_s: float) -> None:
    """Renumbered, or the same number after so long that it may be another target: found by where it flies."""
    ran = world.run([*plots(world, 0.0, 30.0), *plots(world, 30.0 + gap_s, 60.0 + gap_s, number=number)])
    assert numbers(ran) == [1]
    assert {row["radar_track"] for row in ran.rows()} == {"1/3", f"1/{number}"}
    told = ran.said("track 1 goes on as radar track")
    assert len(told) == (number == 7 or gap_s > 10.0)
    assert not ran.ended


def test_a_radar_track_elsewhere_is_another_one(world: Any) -> None:
    """A new number 1.5 km beside where the silent track would be gets its own track."""
    beside = world.Course(left_m=1800.0)
    ran = world.run([*plots(world, 0.0, 30.0), *plots(world, 33.0, 50.0, number=7, course=beside)])
    assert numbers(ran) == [1, 2]
    assert not ran.said("goes on")


def test_two_that_could_be_meant_get_numbers_of_their_own(world: Any) -> None:
    """Two targets side by side, 40 m apart, both numbered anew: which is which is not plain, and nobody guesses."""
    left, right = world.Course(left_m=280.0), world.Course(left_m=320.0)
    said = [*plots(world, 0.0, 30.0, 3, left), *plots(world, 0.0, 30.0, 4, right, seed=2)]
    said += [*plots(world, 36.0, 60.0, 7, right, seed=3), *plots(world, 36.0, 60.0, 8, left, seed=4)]
    ran = world.run(said)
    assert numbers(ran) == [1, 2, 3, 4]
    assert not ran.said("goes on")


def test_two_far_apart_are_both_found_again(world: Any) -> None:
    """Two targets 3 km apart, both numbered anew, keep their tracks."""
    far = world.Course(left_m=3300.0)
    said = [*plots(world, 0.0, 30.0, 3), *plots(world, 0.0, 30.0, 4, far, seed=2)]
    said += [*plots(world, 33.0, 60.0, 7, far, seed=3), *plots(world, 33.0, 60.0, 8, seed=4)]
    ran = world.run(said)
    assert numbers(ran) == [1, 2]
    assert ran.said("goes on as radar track 1/7, which was 1/4")
    assert ran.said("goes on as radar track 1/8, which was 1/3")


def test_a_number_that_was_given_up_and_is_used_again_is_another_target(world: Any) -> None:
    """Track 3 goes on as 7, and the radar's 3 is soon a target elsewhere: its plots are not the old track's."""
    beside = world.Course(left_m=700.0)
    said = [*plots(world, 0.0, 30.0), *plots(world, 30.0, 50.0, number=7), *plots(world, 33.0, 50.0, 3, beside)]
    ran = world.run(said)
    assert numbers(ran) == [1, 2]
    late = {(row["radar_track"], row["track"]) for row in ran.rows() if row["time"] > world.at(35.0)}
    assert late == {("1/7", 1), ("1/3", 2)}


def test_what_gps_speaks_against_is_given_up(world: Any) -> None:
    """A target that appears where the aircraft's radar track faded, and then flies elsewhere, is not kept for long."""

    class Leaving(type(world.Course())):  # type: ignore[misc]
        def at(self, t_s: float) -> Any:
            return np.add(super().at(t_s), [0.0, 40.0 * max(t_s - 33.0, 0.0), 0.0])

    said = [*reports(world, 90.0), *plots(world, 0.0, 30.0), *plots(world, 30.8, 90.0, 7, Leaving())]
    ran = world.run(said)
    assert ran.said("goes on as radar track 1/7")
    assert ran.said("radar track 1/7 is mavlink:1 no more: its reports do not find it there")
    late = [row for row in ran.rows() if row["time"] > world.at(60.0) and row["updated_by"] == "radar"]
    assert {row["aircraft"] for row in late} == {None}


# however it arrives ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def renumbered(world: Any) -> Sequence[Observation]:
    """GPS comes late, goes and comes back; the radar loses the target and numbers it anew, twice."""
    said = [one for one in world.flight(seconds=75.0, radars=()) if not world.at(22.0) < one.valid_at < world.at(60.0)]
    said += [*plots(world, 0.0, 26.0), *plots(world, 31.0, 45.0, number=7), *plots(world, 45.0, 75.0, number=9)]
    return said


def test_ticks_change_no_life(world: Any, renumbered: Sequence[Observation]) -> None:
    """What is told of tracks, and every row, is the same in ticks of one arrival, of 20 ms, and of everything."""
    runs = [world.run(renumbered, ticks=ticks, until_s=120.0) for ticks in ("one", "20 ms", "all")]
    assert runs[0].said("goes on as radar track 1/9, which was 1/7")
    for other in runs[1:]:
        assert runs[0].bits() == other.bits()
        assert runs[0].column("life") == other.column("life")
        assert [(e.at, e.text) for e in runs[0].events] == [(e.at, e.text) for e in other.events]
        told = [[one for picture in ran.pictures for one in picture.fuse.lived] for ran in (runs[0], other)]
        assert told[0] == told[1]


@pytest.mark.parametrize("seed", [1, 2])
def test_shuffled_renumbering_is_in_order(
    world: Any, differences: Callable[..., float], renumbered: Sequence[Observation], seed: int
) -> None:
    """Heard up to 5 s late and out of order, the aircraft's last rows are those of in-order processing to 1e-9."""
    random = np.random.default_rng(seed)
    said = [replace(one, received_at=one.valid_at) for one in renumbered]
    late = [replace(one, received_at=one.valid_at + round(random.uniform(0.0, 5e9))) for one in said]
    wanted, found = (
        {key: row for key, row in world.run(given, until_s=82.0).last(aircraft=ONE).items() if row["received"] >= 0}
        for given in (said, late)
    )
    assert wanted.keys() == found.keys()
    assert differences(wanted, found) < 1e-9


def test_the_gate_is_the_chi_square_quantile() -> None:
    """99.9 % of chi-square lie within it, for the degrees that plots have."""
    random = np.random.default_rng(1)
    for degrees in (2, 6, 9, 15):
        drawn = (random.normal(size=(200_000, degrees)) ** 2).sum(axis=1)
        # 200 expected outside; 4 standard deviations, and 1 % of the gate for the approximation
        assert (drawn > chi_square_gate(degrees)).mean() == pytest.approx(1e-3, abs=3.5e-4)
