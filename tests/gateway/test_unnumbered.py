"""Plots without a number, or with a bad one, become radar tracks, and go on from there as numbered ones do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway import pipeline
from gateway.observation import Heard, Observation, RadarPlot
from gateway.settings import SiteError, format_site, parse_site, with_radar
from gateway.track import FIRST_OWN
from gateway.track.density import FIRST_DETECTION

Differences = Callable[[dict[Any, dict[str, Any]], dict[Any, dict[str, Any]]], float]


@pytest.fixture(scope="module")
def scanning(world: Any) -> Any:
    """The world with radars that scan every 0.4 s by the site file."""
    return scanned(world.two_radars, period_s=0.4)


def scanned(world: Any, **settings: Any) -> Any:
    """The world with settings for its radars."""
    site = world.site
    for radar in site.radars:
        site = with_radar(site, replace(radar, **settings))
    return world.with_site(site)


def bare(observations: Sequence[Observation], number: int = 0) -> list[Observation]:
    """The same where the radar gives no number."""
    return [replace(one, track_number=number) if isinstance(one, RadarPlot) else one for one in observations]


def scattered(world: Any, seconds: float, per_scan: int, seed: int = 2, period_s: float = 0.4) -> list[Observation]:
    """Clutter all around, in the scans of `World.flight`."""
    random, said = np.random.default_rng(seed), list[Observation]()
    for k in range(int(seconds / period_s)):
        at = world.at(0.05 + period_s * k)
        for polar in random.uniform([500.0, -3.1, 0.0], [40_000.0, 3.1, 0.17], (per_scan, 3)).tolist():
            said.append(RadarPlot(1, 0, at, at + 20_000_000, *polar))
    return said


def test_unnumbered_plots_are_associated_as_numbered_ones_are(scanning: Any) -> None:
    """Among clutter, the plots of an aircraft become one radar track under our number, which is found to be that aircraft."""
    flight = scanning.flight(seconds=60.0)
    ran = scanning.run([*bare(flight), *scattered(scanning, 60.0, 10)])
    numbered = scanning.run(flight)
    assert [event.text for event in ran.said(" is radar track ")] == [f"mavlink:1 is radar track 1/{FIRST_OWN}"]
    assert {row["radar_track"] for row in ran.rows(state="fused")} == {f"1/{FIRST_OWN}"}
    assert ran.state.association.ledger.pairs == {(1, FIRST_OWN, 0): "mavlink:1"}
    assert len(ran.rows(state="fused")) >= 0.9 * len(numbered.rows(state="fused"))


def test_bad_numbers_are_ignored_where_the_site_file_says_so(scanning: Any) -> None:
    """With numbers that change from plot to plot there is no track; ignored, there is one."""
    random = np.random.default_rng(4)
    flight = [
        replace(one, track_number=int(random.integers(1, 60_000))) if isinstance(one, RadarPlot) else one
        for one in scanning.flight(seconds=20.0, aircraft=None)
    ]
    assert not scanning.run(flight).rows()
    ran = scanned(scanning, numbers="ignored").run(flight)
    assert {row["track"] for row in ran.rows()} == {1}


def test_ticks_cannot_change_a_bit(scanning: Any) -> None:
    """Unnumbered plots among clutter, one arrival a tick, 20 ms, or all at once: the same rows to the bit."""
    said = [*bare(scanning.flight(seconds=8.0, radars=(1, 2))), *scattered(scanning, 8.0, 5)]
    one, small, every = (scanning.run(said, ticks=ticks, until_s=9.0).bits() for ticks in ("one", "20 ms", "all"))
    assert one == small == every


def test_plots_that_come_late_go_back_to_their_scans(scanning: Any, differences: Differences) -> None:
    """Shuffled within 3 s, the last row of each track and time is that of plots in order, to 1e-9."""
    flight = [*bare(scanning.flight(seconds=12.0, aircraft=None)), *scattered(scanning, 12.0, 5)]
    random = np.random.default_rng(7)
    late = [replace(one, received_at=one.valid_at + int(random.uniform(0.02, 3.0) * 1e9)) for one in flight]
    in_order, shuffled = scanning.run(flight, until_s=25.0), scanning.run(late, until_s=25.0)
    wanted, got = in_order.last(updated_by="radar"), shuffled.last(updated_by="radar")
    assert len(wanted) > 20
    assert wanted.keys() == got.keys()
    assert differences(wanted, got) < 1e-9


def test_what_a_late_plot_makes_wrong_is_taken_back(scanning: Any) -> None:
    """Clutter at the target's place was told of its track; the target's own plot comes 2 s late, and the clutter is let go."""
    course = scanning.Course()
    plots = [scanning.radar_plot(course, 0.4 * k, number=0) for k in range(30)]
    wrong = scanning.radar_plot(course, 8.0, number=0, off=(35.0, 0.002, 0.0))
    late = replace(plots[20], received_at=plots[20].valid_at + 2_000_000_000)
    said = [*plots[:20], wrong, late, *plots[21:]]
    before = scanning.run([one for one in said if one.received_at < late.received_at], until_s=9.0)
    after = scanning.run(said, until_s=12.0)
    told = [plot.polar[0] for plot in before.state.tracks.plots[(1, FIRST_OWN, 0)] if plot.at == wrong.valid_at]
    assert told == [wrong.range_m]
    told = [plot.polar[0] for plot in after.state.tracks.plots[(1, FIRST_OWN, 0)] if plot.at == wrong.valid_at]
    assert told == [late.range_m]


def test_when_the_radar_begins_to_number_a_target_its_track_keeps_its_number(scanning: Any) -> None:
    """Unnumbered for 15 s, then under number 7: one system track throughout, which says how it goes on."""
    flight = scanning.flight(seconds=30.0, aircraft=None)
    since = scanning.at(15.0)
    ran = scanning.run(
        [
            *bare([one for one in flight if one.valid_at < since]),
            *bare([one for one in flight if one.valid_at >= since], 7),
        ]
    )
    assert {row["track"] for row in ran.rows()} == {1}
    assert [event.text for event in ran.said("goes on as")] == [
        f"track 1 goes on as radar track 1/7, which was 1/{FIRST_OWN}"
    ]


def test_two_radars_without_numbers_see_one_aircraft(scanning: Any) -> None:
    """Each makes its own radar track, both are the aircraft's, and nothing is left over."""
    ran = scanning.run(bare(scanning.flight(seconds=60.0, radars=(1, 2))))
    assert set(ran.state.association.ledger.pairs.values()) == {"mavlink:1"}
    assert {key[:2] for key in ran.state.association.ledger.pairs} == {(1, FIRST_OWN), (2, FIRST_OWN)}


@pytest.mark.parametrize("turning", [False, True])
def test_scans_of_six_seconds(world: Any, turning: bool) -> None:
    """A radar that scans every 6 s and misses one in ten, its plots all at once or as the antenna turns: one track."""
    scanning, course, random = scanned(world, period_s=6.0), world.Course(), np.random.default_rng(3)
    said: list[Observation] = []
    for k in range(24):
        for polar in random.uniform([500.0, -3.1, 0.0], [40_000.0, 3.1, 0.17], (10, 3)).tolist():
            at = world.at(6.0 * k + (6.0 * (polar[1] / 6.2832 + 0.5) if turning else 0.0))
            said.append(RadarPlot(1, 0, at, at + 20_000_000, *polar))
        if random.random() < 0.9:
            azimuth = world.polar(course, 6.0 * k)[1]
            t_s = 6.0 * k + (6.0 * (azimuth / 6.2832 + 0.5) if turning else 0.0)
            said.append(world.radar_plot(course, t_s, number=0, off=random.normal(0.0, [15.0, 1e-3, 1e-3])))
    ran = scanning.run(said)
    confirmed = {row["track"] for row in ran.rows() if row["time"] > world.at(60.0)}
    assert confirmed == {1}
    last = max(row["time"] for row in ran.rows(updated_by="radar"))
    assert last > world.at(125.0)


def test_a_burst_is_survived_and_said(scanning: Any) -> None:
    """10 000 plots in one scan: no more hypotheses than the budget, the track goes on, one sentence, nothing else is told."""
    flight = bare(scanning.flight(seconds=20.0, aircraft=None))
    random, at = np.random.default_rng(1), scanning.at(10.05)
    burst = random.uniform([500.0, -3.1, 0.0], [40_000.0, 3.1, 0.17], (10_000, 3)).tolist()
    plots = [RadarPlot(1, 0, at, at + 20_000_000 + 1000 * (k // 40), *polar) for k, polar in enumerate(burst)]
    heard = scanning.heard(flight)
    chunks = [Heard(at + 21_000_000 + 4000 * k, tuple(plots[40 * k : 40 * k + 40])) for k in range(250)]
    ran = scanning.run(sorted([*heard, *chunks], key=lambda one: one.now), ticks="20 ms", until_s=21.0)
    assert len(ran.said("more plots without a number at once than can all be followed")) == 1
    assert {row["track"] for row in ran.rows()} == {1}
    assert max(row["time"] for row in ran.rows(updated_by="radar")) > scanning.at(19.0)
    assert all(len(one.bank) <= 2000 for one in ran.state.unnumbered.watches[1].slices)


def test_the_site_file_bounds_what_a_scan_may_take(world: Any) -> None:
    """Fifty hypotheses are allowed, and 200 clutter plots a scan begin: there are fifty, that is said, the track goes on."""
    scanning = scanned(world, period_s=0.4, hypotheses_at_most=50)
    clutter = [one for one in scattered(scanning, 9.0, 200) if one.valid_at > scanning.at(6.0)]
    ran = scanning.run([*bare(scanning.flight(seconds=9.0, aircraft=None)), *clutter])
    assert max(len(one.bank) for one in ran.state.unnumbered.watches[1].slices) == 50
    assert len(ran.said("hypotheses_at_most = 50 in its [[radar]] bounds their number")) == 1
    assert max(row["time"] for row in ran.rows(updated_by="radar")) > scanning.at(8.0)


@pytest.mark.parametrize("scans", [200, pytest.param(10_000, marks=pytest.mark.study)])
def test_nothing_grows(scanning: Any, scans: int) -> None:
    """Clutter and an aircraft every 20 s: what is kept after all scans is no more than what was kept in the middle."""
    random, state = np.random.default_rng(5), pipeline.initial(scanning.site)
    held: list[tuple[int, ...]] = []
    for k in range(scans):
        t_s = 0.4 * k
        now = scanning.at(t_s + 0.02)
        plots = (
            [scanning.radar_plot(scanning.Course(along_m=-9000.0), t_s % 20.0, number=0)] if t_s % 20.0 < 8.0 else []
        )
        at = scanning.at(t_s)
        seen = [replace(plot, valid_at=at, received_at=now) for plot in plots]
        seen += [
            RadarPlot(1, 0, at, now, *polar)
            for polar in random.uniform([500.0, -3.1, 0.0], [40_000.0, 3.1, 0.17], (5, 3)).tolist()
        ]
        state, _ = pipeline.step(state, [Heard(now, tuple(seen))])
        watch = state.unnumbered.watches[1]
        kept = (
            len(watch.slices),
            len(watch.numbers),
            len(watch.waiting),
            max((len(one.bank) for one in watch.slices), default=0),
        )
        held.append((*kept, len(state.tracks.plots), len(state.tracks.episode), len(state.lanes.lanes)))
    half = np.array(held).reshape(2, -1, 7).max(axis=1)
    assert (half[1] <= 1.2 * half[0] + 4).all()


def test_of_a_radar_that_does_not_say_how_often_it_scans_nothing_is_tracked(world: Any) -> None:
    """Its plots are counted; after 20 s that is said, once, with what to do."""
    ran = world.run(bare(world.flight(seconds=30.0, aircraft=None)))
    assert not ran.rows()
    said = ran.said("add period_s to its [[radar]]")
    assert len(said) == 1
    assert said[0].at >= world.at(20.0)


def test_clutter_is_learnt_from_the_scans(scanning: Any) -> None:
    """Where nothing is said of it: after 25 scans of twelve clutter plots each, twelve are expected."""
    ran = scanning.run(scattered(scanning, 10.0, 12))
    assert ran.state.unnumbered.watches[1].newest[1].counts.sum() == pytest.approx(12.0, rel=0.25)


def test_detection_is_learnt_from_the_scans(scanning: Any) -> None:
    """A target that is seen in every scan raises what is expected of the next, one that is missed in one of three lowers it."""
    flight, learnt = bare(scanning.flight(seconds=16.0, aircraft=None)), []
    for said in (flight, [one for place, one in enumerate(flight) if place % 3]):
        ran = scanning.run([*said, *scattered(scanning, 16.0, 2)])
        learnt.append(ran.state.unnumbered.watches[1].newest[1].detection)
    assert learnt[0] > FIRST_DETECTION > learnt[1] + 0.02


def test_birds_are_followed_and_not_told(scanning: Any) -> None:
    """What flies 15 m/s is no track; at a site with slowest_mps = 5 it is."""
    slow = scanning.Course(along_m=-3000.0, speed_mps=15.0, sink_mps=0.0, height_m=200.0, swing_m=0.0)
    flight = bare(scanning.flight(slow, seconds=40.0, aircraft=None))
    assert not scanning.run(flight).rows()
    assert {row["track"] for row in scanned(scanning, slowest_mps=5.0).run(flight).rows()} == {1}


def test_a_radar_that_is_back_after_a_silence_begins_anew_under_other_numbers(scanning: Any) -> None:
    """Silent for a minute, then the same flight: the old number is not given again."""
    first = bare(scanning.flight(seconds=10.0, aircraft=None))
    again = [
        replace(one, valid_at=one.valid_at + 70 * 10**9, received_at=one.received_at + 70 * 10**9) for one in first
    ]
    ran = scanning.run([*first, *again])
    assert {row["radar_track"] for row in ran.rows()} == {f"1/{FIRST_OWN}", f"1/{FIRST_OWN + 1}"}


def test_settings_of_unnumbered_plots_are_written_and_read(world: Any) -> None:
    """What is set in the site file stands there when it is written again; what is not set, does not."""
    radar = replace(world.site.radars[0], numbers="ignored", period_s=6.0, clutter_per_scan=40.0, slowest_mps=0.0)
    radar = replace(radar, detection_probability=0.8, hypotheses_at_most=500)
    read = parse_site(format_site(with_radar(world.site, radar))).radars[0]
    assert (read.numbers, read.period_s, read.clutter_per_scan) == ("ignored", 6.0, 40.0)
    assert (read.detection_probability, read.slowest_mps, read.hypotheses_at_most) == (0.8, 0.0, 500)
    assert "slowest_mps" not in format_site(world.site)


def test_a_wrong_setting_is_told_with_its_line(world: Any) -> None:
    """numbers knows two words."""
    text = format_site(with_radar(world.site, replace(world.site.radars[0], numbers="ignored")))
    with pytest.raises(SiteError, match="must be one of used, ignored"):
        parse_site(text.replace('numbers = "ignored"', 'numbers = "maybe"'))
