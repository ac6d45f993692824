"""Whether sources scatter as much as the settings say, and what the program says where they do not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gateway.align import SECOND, Fix
from gateway.fuse import consistency
from gateway.fuse.consistency import NOISES_AT_MOST, Consistency
from gateway.fuse.events import Event, Job, Measure
from gateway.fuse.evidence import PLOT, Finding, factors, summed
from gateway.fuse.filtering import run
from gateway.fuse.scatter import RADARS, Rows, left_of_plots, left_of_reports, rows_of
from gateway.fuse.weighting import Model
from gateway.settings import Options, PositionSource, Site

NAN = math.nan


def _events(world: Any, measures: list[Measure], **options: Any) -> list[Event]:
    """The events of one track."""
    return run(
        [Job(1, None, measures, lambda fix: None)], Model.of(Options(**options), PositionSource(), world.radars)
    )[0]


def _rows(events: Sequence[Event]) -> Rows:
    """Measurements of one track in order."""
    return rows_of([(0, event) for event in events]).merged(None)


def _judged(
    world: Any, tracks: list[list[Measure]], position: PositionSource = PositionSource(), **options: Any
) -> tuple[Consistency, dict[str, Finding]]:
    """What is found of some tracks, heard second by second, each finding when it is sure for the first time."""
    told = [(1 + place, event) for place, one in enumerate(tracks) for event in _events(world, one, **options)]
    told.sort(key=lambda one: one[1].at)
    found: dict[str, Finding] = {}
    known, radars = Consistency(), {radar.number: radar for radar in world.site.radars}
    for second in range(told[0][1].at // SECOND, told[-1][1].at // SECOND + 1):
        known = known.hearing(one for one in told if one[1].at // SECOND == second)
        known, new = known.planning((second + 1) * SECOND).judged(position, radars, (second + 2) * SECOND - 1)
        for one in new:
            found.setdefault(one.topic, one)
    return known, found


def _reports(
    world: Any,
    seconds: float,
    period_s: float = 1.0,
    *,
    noise_m: float = 15.0,
    noise_mps: float = 1.0,
    course: Any = None,
    seed: int = 1,
    aircraft: str = "mavlink:1",
) -> list[Measure]:
    """Reports with velocity, stated to have 15 m and 1 m/s."""
    random, course = np.random.default_rng(seed), course or world.Course()
    to_enu = world.frame.enu_from_runway
    made: list[Measure] = []
    for k in range(int(seconds / period_s)):
        velocity = to_enu @ course.velocity(k * period_s) + random.normal(0.0, noise_mps, 3)
        off = random.normal(0.0, noise_m, 3)
        made.append(world.fix(course, k * period_s, serial=k, off_m=off, velocity_mps=velocity, aircraft=aircraft))
    return made


# what is left over -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("period_s", [0.2, 1.0, 5.0])
def test_reports_of_right_noise_leave_over_squares_of_one(world: Any, period_s: float) -> None:
    """Position and velocity, by what their stated noise alone would leave over, to 10 % of 3000; a slow source's velocity
    is disturbed by any manoeuvre, and known to be."""
    rows = _rows(_events(world, _reports(world, 1000 * period_s, period_s)[:1000]))
    left = left_of_reports(rows)
    assert np.nanmean(left.by_noise[:, :3] ** 2) == pytest.approx(1.0, rel=0.1)
    assert np.nanmax(left.disturbed[3:, :3]) < 0.3
    if period_s < 2.0:
        assert np.nanmean(left.by_noise[:, 3:] ** 2) == pytest.approx(1.0, rel=0.1)
        assert np.nanmax(left.disturbed[3:, 3:5]) < 0.3
        assert np.isinf(left.disturbed[:, 5]).all()  # gusts
    else:
        assert (left.disturbed[4:, 3:] > 1.0).all()


def test_plots_of_right_noise_leave_over_squares_of_one_also_close_by(world: Any) -> None:
    """However fast the azimuth of a target that passes the radar turns; components that are missing are left out."""
    random = np.random.default_rng(5)
    course = world.Course(along_m=-3000.0, height_m=900.0, sink_mps=0.0, speed_mps=120.0)
    plots: list[Measure] = []
    for k in range(400):
        gone = "".join(letter for letter in "ae" if random.uniform() < 0.2)
        off = random.normal(0.0, (15.0, 1e-3, 1e-3))
        plots.append(world.plot(course, 0.1 * k, serial=k, off=off, missing=gone))
    left = left_of_plots(_rows(_events(world, plots)))
    for component in range(3):
        kept = left.by_noise[20:, component]
        assert np.nanmean(kept**2) == pytest.approx(1.0, abs=0.2)
        assert np.isnan(kept).sum() == np.isnan([plot.polar[component] for plot in plots[20:]]).sum()  # type: ignore[union-attr]


def test_only_neighbours_of_one_track_and_source_are_compared(world: Any) -> None:
    """Two tracks in one array: the first measurements of each have nothing to be held against; what was kept is not new."""
    one, other = (_events(world, _reports(world, 10.0, seed=seed)) for seed in (1, 2))
    before = _rows(other[:5]).latest(3, 0)
    rows = rows_of([*((0, event) for event in one), *((1, event) for event in other[5:])]).merged(
        replace(before, group=before.group + RADARS)
    )
    assert rows.group.tolist() == [0] * 10 + [RADARS] * 8
    left = left_of_reports(rows)
    assert np.isnan(left.by_noise[[0, 10, 11, 12], 0]).all()
    assert not np.isnan(left.by_noise[[1, 2, 13], 0]).any()


def test_what_comes_late_or_twice_is_left_out(world: Any) -> None:
    """Out of order within a second measurements are put in order; before what was kept they are not taken any more."""
    events = _events(world, _reports(world, 12.0))
    kept = _rows(events[:6]).latest(3, 0)
    assert kept.at.tolist() == [event.at for event in events[3:6]]
    rows = _rows([events[8], events[4], events[6], events[6], events[2], events[5]]).merged(kept)
    assert rows.at.tolist() == [event.at for event in (*events[3:6], events[6], events[8])]
    assert rows.event.tolist() == [-1, -1, -1, 2, 0]
    assert not len(kept.latest(3, events[6].at).at)


# evidence --------------------------------------------------------------------------------------------------------------


def test_a_sum_of_evidence_that_falls_below_nothing_begins_anew() -> None:
    """It keeps no memory of how long all was well; the factor is that of the squares since then."""
    log = math.log(2.25) - 1.2704
    sums = summed(
        np.array([[2.0, 10.0, 3.0] * 3]), np.array([[-2.5, 4.0, 1.0, 3.0, 190.0, 200.0 * log - 3.0, 0.0, 0.0, 0.0]])
    )
    assert sums.tolist() == [[0.0, 0.0, 0.0, 5.0, 200.0, pytest.approx(200.0 * log), 2.0, 10.0, 3.0]]
    assert factors(sums, 4.0).tolist() == [pytest.approx(1.5, rel=1e-4)]
    assert np.isnan(factors(sums, 6.0)).all()
    assert np.isnan(factors(sums, 4.0, enough=300.0)).all()


@pytest.mark.parametrize("estimator", ["kalman", "imm", "rmimm", "alpha-beta-gamma"])
@pytest.mark.parametrize(
    ("noise_m", "noise_mps", "key"),
    [
        (22.5, 1.0, "sigma_m"),
        (10.0, 1.0, "sigma_m"),
        (15.0, 1.5, "velocity_sigma_mps"),
        (15.0, 0.667, "velocity_sigma_mps"),
    ],
)
def test_a_report_noise_wrong_by_a_half_is_found_by_every_estimator(
    world: Any, estimator: str, noise_m: float, noise_mps: float, key: str
) -> None:
    """In 200 reports, position or velocity, more or less; and what to set is right to a third."""
    reports = _reports(world, 200.0, noise_m=noise_m, noise_mps=noise_mps)
    _, found = _judged(world, [reports], estimator=estimator)
    (finding,) = found.values()
    right = noise_m if key == "sigma_m" else noise_mps
    assert float(finding.text.split(f"set {key} = ")[1].split()[0]) == pytest.approx(right, rel=0.33)


@pytest.mark.parametrize("noise_m", [22.5, 10.0])
def test_a_report_each_5_s_is_enough(world: Any, noise_m: float) -> None:
    """200 reports with velocity, the constant-velocity model: whatever it fears of manoeuvres, the noise is found."""
    _, found = _judged(world, [_reports(world, 1000.0, 5.0, noise_m=noise_m)])
    assert list(found) == ["scatter of position, GPS of mavlink:1"]


@pytest.mark.parametrize("period_s", [0.2, 1.0, 5.0])
def test_right_noise_is_never_near_being_said(world: Any, period_s: float) -> None:
    """Over 600 reports no sum comes within half of the level at which something is said."""
    known, found = _judged(world, [_reports(world, 600.0 * period_s, period_s, seed=7)])
    assert not found
    assert known.levels.max() < 0.5 * known.sure


def test_turns_are_no_noise(world: Any) -> None:
    """Two minutes of turns of 20 degrees that begin at once, each 20 s: that is not said to be noise."""

    class Zigzag(world.Course):  # type: ignore[name-defined,misc]
        def velocity(self, t_s: float) -> Any:
            angle = 0.35 * (abs((t_s / 20.0) % 2.0 - 1.0) * 2.0 - 1.0)
            return 80.0 * np.array([math.cos(angle), math.sin(angle), 0.0])

        def at(self, t_s: float) -> Any:
            times = np.arange(0.0, t_s, 0.25) + 0.125
            return np.array([-25_000.0, 300.0, 1300.0]) + sum((0.25 * self.velocity(t) for t in times), np.zeros(3))

    for noise_m in (2.0, 15.0):
        reports = [
            replace(one, sigma_m=np.full(3, noise_m))
            for one in _reports(world, 120.0, course=Zigzag(), noise_m=noise_m)
            if isinstance(one, Fix)
        ]
        assert not _judged(world, [[*reports]], PositionSource(noise_m))[1]


def test_far_outliers_are_no_noise(world: Any) -> None:
    """One report in ten lies 300 m off: that is counted elsewhere, and the others scatter as stated."""
    reports = _reports(world, 300.0)
    off = np.array([0.0, 300.0, 0.0])
    wild = [
        replace(one, enu_m=one.enu_m + off * (k % 10 == 5)) for k, one in enumerate(reports) if isinstance(one, Fix)
    ]
    assert not _judged(world, [[*wild]])[1]


def test_aircraft_are_judged_together(world: Any) -> None:
    """Ten whose noise is 1.5 times the site file's: one sentence that names none, in a third of the time of one alone; one
    among ten is named, and the others are not."""
    noisy = [_reports(world, 40.0, noise_m=22.5, seed=k, aircraft=f"mavlink:{k}") for k in range(10)]
    _, found = _judged(world, noisy)
    assert list(found) == ["scatter of position, GPS"]
    assert "set sigma_m = 2" in found["scatter of position, GPS"].text
    right = [_reports(world, 150.0, seed=k, aircraft=f"mavlink:{k}") for k in range(1, 10)]
    _, found = _judged(world, [_reports(world, 150.0, noise_m=30.0, aircraft="mavlink:0"), *right])
    assert list(found) == ["scatter of position, GPS of mavlink:0"]


def test_many_are_judged_in_shares_within_the_second(world: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each share holds whole tracks and has its own instant; every measurement is in one, and each aircraft's sums are those
    of all judged at once, to the bit."""
    tracks = [_events(world, _reports(world, 20.0, seed=k, aircraft=f"mavlink:{k}")) for k in range(24)]
    told = [(1 + place, event) for place, one in enumerate(tracks) for event in one]
    at = told[-1][1].at // SECOND * SECOND + SECOND // 2
    ends = []
    for share in (100, 1000):
        monkeypatch.setattr(consistency, "SHARE", share)
        known = Consistency().hearing(told).planning(at)
        instants, shares = zip(*known.planned, strict=True)
        assert all(earlier < later for earlier, later in pairwise(instants))
        assert at < instants[0]
        assert instants[-1] < at + SECOND
        assert sorted((track, event.at) for some in shares for track, event in some) == sorted(
            (track, event.at) for track, event in told
        )
        assert len({track for some in shares for track in {track for track, _ in some}}) == len(tracks)
        assert sum(len({track for track, _ in some}) for some in shares) == len(tracks)
        assert known.judged(PositionSource(), {}, instants[0] - 1)[0].due == instants[0]
        ends.append((len(shares), known.judged(PositionSource(), {}, instants[-1])[0]))
    assert [count for count, _ in ends] == [3, 1]
    (_, parted), (_, whole) = ends
    own = [key for key in whole.noises if key[0] != "GPS"]
    assert len(own) == 2 * len(tracks)
    for key in own:
        assert parted.sums[parted.noises[key]].tobytes() == whole.sums[whole.noises[key]].tobytes()


def test_how_arrivals_fall_into_ticks_does_not_change_what_is_judged(
    world: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in shares: sentences and sums are equal, to the bit, for ticks of one arrival, of 20 ms and of everything."""
    monkeypatch.setattr(consistency, "SHARE", 8)
    monkeypatch.setattr(consistency, "TRACKS_AT_LEAST", 2)
    monkeypatch.setattr(consistency, "MANY", 8)
    random = np.random.default_rng(1)
    reports = [
        world.report(course, 0.5 * k, aircraft=f"mavlink:{number}", off_m=tuple(random.normal(0.0, 60.0, 3)))
        for number, course in enumerate(world.Course(-9000.0 - 4000.0 * j) for j in range(6))
        for k in range(40)
    ]
    runs = [world.run(reports, ticks=ticks) for ticks in ("one", "20 ms", "all")]
    assert runs[0].said("scatters")
    for other in runs[1:]:
        assert [(one.at, one.text) for one in other.events] == [(one.at, one.text) for one in runs[0].events]
        assert other.state.consistency.noises == runs[0].state.consistency.noises
        assert other.state.consistency.sums.tobytes() == runs[0].state.consistency.sums.tobytes()


def _known(names: Sequence[str], heard: Sequence[int]) -> Consistency:
    """What is known of the positions of some aircraft that were heard at some times."""
    noises = {(f"GPS of {name}", "position", True): row for row, name in enumerate(names)}
    return Consistency(noises, np.ones((len(names), 9)), np.array(heard, dtype=np.int64))


def test_noises_are_bounded() -> None:
    """Those least lately heard are forgotten."""
    names = [str(number) for number in range(NOISES_AT_MOST + 10)]
    kept = _known(names, range(len(names))).planning(0)
    assert len(kept.noises) == len(kept.sums) == len(kept.heard) == NOISES_AT_MOST
    assert ("GPS of 9", "position", True) not in kept.noises
    assert kept.noises["GPS of 10", "position", True] == 0


def test_what_is_kept_of_a_track_is_bounded_and_forgotten(world: Any) -> None:
    """A few measurements each, for half a minute after the last."""
    known, _ = _judged(world, [_reports(world, 20.0)])
    assert known.reports is not None
    assert len(known.reports.at) == 3
    later = known.planning(world.at(60.0))
    assert later.reports is None


# what is said ----------------------------------------------------------------------------------------------------------


def _said(world: Any, site: Site, seconds: float = 100.0, **options: Any) -> list[str]:
    ran = world.with_site(site).run(world.flight(seconds=seconds, gps_period_s=1.0), options=Options(**options))
    return [event.text for event in ran.events if "scatters" in event.text]


def _stated(world: Any, **sigmas: float) -> Site:
    radar = world.site.radars[0]
    return replace(world.site, radars=(replace(radar, **sigmas),))


@pytest.mark.parametrize("estimator", ["kalman", "rmimm"])
def test_an_honest_session_says_nothing(world: Any, estimator: str) -> None:
    """With noise as stated, and a constant error of 60 m as the site allows, nothing is said of any source."""
    assert _said(world, world.site, estimator=estimator) == []


@pytest.mark.parametrize(("stated_m", "estimator"), [(10.0, "kalman"), (22.5, "kalman"), (10.0, "rmimm")])
def test_a_radars_range_stated_wrongly_is_said_once_with_what_to_set(
    world: Any, estimator: str, stated_m: float
) -> None:
    """15 m stated as 10 or as 22.5 is one sentence that names the radar, the key and about 15 m; others are not named."""
    (text,) = _said(world, _stated(world, range_sigma_m=stated_m), seconds=160.0, estimator=estimator)
    assert text.startswith("radar 1: its range scatters")
    assert "set range_sigma_m = " in text
    assert float(text.split("range_sigma_m = ")[1].split()[0]) == pytest.approx(15.0, rel=0.2)


def test_a_position_source_stated_wrongly_is_said_with_its_aircraft(world: Any) -> None:
    """Reports of 15 m that are stated as 10 m: the sentence names the vehicle and sigma_m."""
    site = replace(world.site, position=replace(world.site.position, sigma_m=10.0))
    (text,) = _said(world, site, seconds=200.0)
    assert text.startswith("GPS of mavlink:1: its position scatters")
    assert "set sigma_m = 1" in text


def test_what_a_stream_says_of_itself_is_never_too_careful(world: Any) -> None:
    """A receiver that says 40 m and scatters by 15 is believed: its error may last; one that says 6 m is not."""
    for said_m, expected in ((40.0, 0), (6.0, 1)):
        ran = world.run(world.flight(seconds=150.0, gps_period_s=1.0, radars=(), horizontal_sigma_m=said_m))
        assert len(ran.said("scatters")) == expected
    assert "its stream says (6 m)" in ran.said("scatters")[0].text


def test_a_receiver_whose_errors_last_is_believed(world: Any) -> None:
    """Reports that are all off by the same few metres change by nothing: that says nothing of 15 m, which they may be off by."""
    reports = [world.report(world.Course(), 0.5 * k, off_m=(6.0, -5.0, 4.0)) for k in range(300)]
    assert world.run(reports).said("scatters") == []


def test_the_parts_of_a_plot_are_keys_of_the_site_file(world: Any) -> None:
    """What is said to be set can be set: each key is one that a radar's table has."""
    assert {part.key for part in PLOT} == {"range_sigma_m", "azimuth_sigma_deg", "elevation_sigma_deg"}


def test_sources_that_are_gone_for_an_hour_are_forgotten() -> None:
    """What is known of a source stays while it is heard, and an hour longer."""
    hour = 3600 * SECOND
    kept = _known("ab", [0, hour]).planning(hour + 5 * SECOND)
    assert list(kept.noises) == [("GPS of b", "position", True)]
    assert kept.heard.tolist() == [hour]
