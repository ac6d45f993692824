"""Associate: gates, counters, one to one, lost and changed numbers; and late data that repeat what they touch."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from gateway.associate import Association, Change, Nearby, Setting, await_plots, check_due
from gateway.observation import GpsReport, RadarPlot
from gateway.settings import Options
from gateway.track import RadarTracks

ONE = "mavlink:1"
TWO = "mavlink:2"


@dataclass(frozen=True)
class _Told:
    """What a sequence of checks led to."""

    state: Association

    @property
    def pairs(self) -> dict[str, str]:
        """Radar track -> aircraft."""
        return {f"{key[0]}/{key[1]}": aircraft for key, aircraft in self.state.ledger.pairs.items()}

    @property
    def changes(self) -> list[Change]:
        return [change for check in self.state.checks for change in check.changes]

    def counters(self, number: int = 3, aircraft: str = ONE) -> list[int]:
        """A pair's counter after each check of the aircraft."""
        checks = [check for check in self.state.checks if check.fix.aircraft == aircraft]
        found = [
            {key[1]: count.value for key, count in check.after.counts.get(aircraft, {}).items()} for check in checks
        ]
        return [one.get(number, 0) for one in found]


def _checked(world: Any, fixes: Iterable[Any], plots: Iterable[Any], **options: Any) -> _Told:
    """Each fix checked in turn against the plots."""
    tracks = RadarTracks()
    for plot in sorted(plots, key=lambda plot: plot.at):
        tracks, _ = tracks.after(plot)
    setting, state = Setting(world.site, Options(**options), world.frame, world.radars), Association()
    for fix in sorted(fixes, key=lambda fix: fix.at):
        state = await_plots(state, fix)
        if state.due is not None:
            state, _ = check_due(state, fix.at, Nearby(tracks), setting)
    return _Told(state)


def _plots(world: Any, course: Any, until_s: float = 60.0, from_s: float = 0.0, **extra: Any) -> list[Any]:
    return [world.plot(course, t, serial=i, **extra) for i, t in enumerate(np.arange(from_s, until_s, 0.4).tolist())]


def _fixes(world: Any, course: Any, times: Sequence[float], **extra: Any) -> list[Any]:
    return [world.fix(course, t, serial=i, **extra) for i, t in enumerate(times)]


FIVE_SECONDS = [0.9 + 5.0 * k for k in range(10)]


# equation 8 -----------------------------------------------------------------------------------------------------------


def test_the_counter_counts_up_on_hits_and_down_on_misses_and_never_below_zero(world: Any) -> None:
    """One more for a hit up to three, one less for a miss, and 0 is the least."""
    course, far_m = world.Course(), (0.0, 1500.0, 0.0)
    hits = [True, True, False, True, False, False, False, True, True, True]
    fixes = [
        world.fix(course, t, off_m=(0.0, 0.0, 0.0) if hit else far_m) for t, hit in zip(FIVE_SECONDS, hits, strict=True)
    ]
    told = _checked(world, fixes, _plots(world, course))
    assert told.counters() == [1, 2, 1, 2, 1, 0, 0, 1, 2, 3]
    assert [(c.kind, c.at) for c in told.changes] == [("associated", world.at(FIVE_SECONDS[9]))]


def test_the_third_hit_associates(world: Any) -> None:
    """Two hits are not enough, three are; the place of association is the report's."""
    course = world.Course()
    assert _checked(world, _fixes(world, course, FIVE_SECONDS[:2]), _plots(world, course)).pairs == {}
    told = _checked(world, _fixes(world, course, FIVE_SECONDS[:3]), _plots(world, course))
    assert told.pairs == {"1/3": ONE}
    assert told.changes[0].runway_m == pytest.approx(course.at(FIVE_SECONDS[2]).tolist(), abs=1e-6)
    assert told.changes[0].at == world.at(FIVE_SECONDS[2])


def test_how_many_hits_can_be_asked_for(world: Any) -> None:
    """`associate_at` = 5 needs five."""
    course = world.Course()
    fixes = _fixes(world, course, FIVE_SECONDS)
    told = _checked(world, fixes, _plots(world, course), associate_at=5)
    assert [change.at for change in told.changes] == [world.at(FIVE_SECONDS[4])]
    assert max(told.counters()) == 5


def test_a_fast_source_needs_more_hits(world: Any) -> None:
    """Reports 1 s apart have errors alike: five hits, not three."""
    course = world.Course()
    told = _checked(world, _fixes(world, course, [0.9 + k for k in range(8)]), _plots(world, course))
    assert told.counters()[:4] == [1, 2, 3, 4]
    assert [change.at for change in told.changes] == [world.at(4.9)]


def test_one_report_of_each_second_is_checked(world: Any) -> None:
    """Of a source of 5 Hz the earliest report of each second is."""
    course = world.Course()
    told = _checked(world, _fixes(world, course, [1.1 + 0.2 * k for k in range(20)]), _plots(world, course))
    assert [check.fix.at for check in told.state.checks] == [world.at(t) for t in (1.1, 2.1, 3.1, 4.1)]


def test_a_pair_is_lost_when_its_counter_is_empty(world: Any) -> None:
    """Associated at three, an aircraft that is elsewhere from then on keeps its radar track for two misses, not three."""
    course = world.Course()
    fixes = _fixes(world, course, FIVE_SECONDS[:4])
    fixes += _fixes(world, course, FIVE_SECONDS[4:], off_m=(0.0, 2000.0, 0.0))
    told = _checked(world, fixes, _plots(world, course))
    assert told.counters()[:7] == [1, 2, 3, 3, 2, 1, 0]
    assert [(c.kind, c.at) for c in told.changes] == [
        ("associated", world.at(FIVE_SECONDS[2])),
        ("lost", world.at(FIVE_SECONDS[6])),
    ]
    assert told.pairs == {}
    (span,) = told.state.ledger.spans
    assert (span.since, span.until) == (world.at(FIVE_SECONDS[2]), world.at(FIVE_SECONDS[6]))


# gates: equations 6 and 7 ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("off_m", [(200.0, 0.0, 0.0), (0.0, 200.0, 0.0), (0.0, 0.0, 200.0)])
def test_each_component_has_its_gate(world: Any, off_m: tuple[float, float, float]) -> None:
    """Beyond three sigma in range, azimuth or elevation alone is a miss for the default rule, within is a hit."""
    course = world.Course()
    # 3 sigma of 60 m allowed error, 15 m of the report and 15 to 25 m of the radar at 25 km is 190 to 205 m
    for scale, hit in ((0.8, True), (1.2, False)):
        fixes = _fixes(world, course, FIVE_SECONDS[:3], off_m=tuple(scale * part for part in off_m))
        told = _checked(world, fixes, _plots(world, course))
        assert [check.comparisons[0].hit for check in told.state.checks] == [hit] * 3


def test_the_allowed_error_of_the_position_source_is_in_the_gate(world: Any) -> None:
    """A source that is constantly 120 m off is associated: a gate of the noises alone would miss it."""
    course = world.Course()
    told = _checked(world, _fixes(world, course, FIVE_SECONDS, off_m=(70.0, 70.0, 70.0)), _plots(world, course))
    assert told.pairs == {"1/3": ONE}
    (comparison,) = told.state.checks[0].comparisons
    # range: 15 m noise of the report, 60 m error, and 15 m of the radar interpolated
    low, high = 3.0 * math.hypot(60.0, 15.0), 3.0 * math.sqrt(60.0**2 + 15.0**2 + 15.0**2)
    assert low < comparison.gate[0] < high


def test_azimuth_differences_wrap(world: Any) -> None:
    """An aircraft behind the radar, where azimuth passes half a turn, is compared the short way round."""
    behind = world.Course(along_m=6000.0, left_m=150.0, speed_mps=40.0, sink_mps=0.0, swing_m=0.0, height_m=800.0)
    told = _checked(world, _fixes(world, behind, FIVE_SECONDS[:3], off_m=(0.0, 30.0, 0.0)), _plots(world, behind))
    off = [check.comparisons[0].difference[1] for check in told.state.checks]
    assert np.abs(off).max() < 0.01
    assert told.pairs == {"1/3": ONE}


@pytest.mark.parametrize(
    ("missing", "default", "literal"),
    [("r", True, False), ("a", True, True), ("e", True, True), ("ra", False, False), ("ae", False, False)],
)
def test_which_components_each_rule_needs(world: Any, missing: str, default: bool, literal: bool) -> None:
    """The default rule needs any two; equation 7 needs range and an angle, so that it never associates without range."""
    course = world.Course()
    for rule, wanted in (("default", default), ("literal", literal)):
        plots = _plots(world, course, missing=missing)
        told = _checked(world, _fixes(world, course, FIVE_SECONDS), plots, association=rule)
        assert (told.pairs == {"1/3": ONE}) is wanted


def test_equation_7_takes_an_aircraft_abeam_and_the_default_does_not(world: Any) -> None:
    """Beside the aircraft by 3 degrees, at its range and height: eq 7 is content with range and elevation."""
    course = world.Course(swing_m=0.0, left_m=0.0)
    abeam = world.Course(swing_m=0.0, left_m=1300.0)
    fixes, plots = _fixes(world, course, FIVE_SECONDS[:6]), _plots(world, abeam, off=(-34.0, 0.0, 0.0))
    assert _checked(world, fixes, plots).pairs == {}
    assert _checked(world, fixes, plots, association="literal").pairs == {"1/3": ONE}


# one to one -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("swapped", [False, True])
def test_two_aircraft_and_two_radar_tracks_pair_one_to_one(world: Any, swapped: bool) -> None:
    """Within each other's gates, each aircraft gets the track that is nearer, whichever was heard first."""
    right, left = world.Course(left_m=0.0), world.Course(left_m=160.0)
    numbers = (4, 3) if swapped else (3, 4)
    plots = _plots(world, right, number=numbers[0]) + _plots(world, left, number=numbers[1])
    times = [t + (0.01 if swapped else 0.0) for t in FIVE_SECONDS]
    fixes = _fixes(world, right, FIVE_SECONDS) + _fixes(world, left, [t + 0.005 for t in times], aircraft=TWO)
    told = _checked(world, fixes, plots)
    hits = [comparison.hit for check in told.state.checks for comparison in check.comparisons]
    assert all(hits)  # so the gates alone would not tell them apart
    assert len(hits) == 4 * len(FIVE_SECONDS)
    assert told.pairs == {f"1/{numbers[0]}": ONE, f"1/{numbers[1]}": TWO}
    assert [change.kind for change in told.changes] == ["associated"] * 2


def test_one_aircraft_and_two_radars_have_a_track_of_each(world: Any) -> None:
    """One to one holds within a radar: an aircraft seen by two radars is a track of both."""
    there, course = world.two_radars, world.Course()
    plots = _plots(there, course) + _plots(there, course, radar=2, number=8)
    assert _checked(there, _fixes(there, course, FIVE_SECONDS), plots).pairs == {"1/3": ONE, "2/8": ONE}


def test_what_cannot_be_told_apart_waits(world: Any) -> None:
    """Two tracks as near as each other are nobody's; when one of them has gone away the other is taken."""
    course = world.Course(swing_m=0.0, left_m=0.0)
    beside = world.Course(swing_m=0.0, left_m=0.0, height_m=1300.0)
    plots = _plots(world, course, off=(0.0, 1e-3, 0.0)) + _plots(world, beside, number=4, off=(0.0, -1e-3, 0.0))
    fixes = _fixes(world, course, FIVE_SECONDS)
    assert _checked(world, fixes, plots).pairs == {}
    leaving = [p for p in plots if p.number == 3 or p.at < world.at(20.0)]
    told = _checked(world, fixes, leaving)
    assert told.pairs == {"1/3": ONE}
    assert told.changes[0].at > world.at(20.0)


def test_an_aircraft_without_a_radar_track_takes_nobody_elses(world: Any) -> None:
    """A second aircraft close by, unseen by the radar, does not take the track that is another's already."""
    course = world.Course(left_m=0.0)
    fixes = _fixes(world, course, FIVE_SECONDS)
    fixes += _fixes(world, world.Course(left_m=100.0), [t + 1.0 for t in FIVE_SECONDS[3:]], aircraft=TWO)
    told = _checked(world, fixes, _plots(world, course))
    assert max(told.counters(aircraft=TWO)) >= 3
    assert told.pairs == {"1/3": ONE}
    assert len(told.changes) == 1


# changed and reused numbers -------------------------------------------------------------------------------------------


def test_a_changed_number_is_followed(world: Any) -> None:
    """The radar gives the aircraft another number: the old pair ends and the new one begins, at the same check."""
    course = world.Course()
    plots = _plots(world, course, 20.0) + _plots(world, course, 60.0, from_s=20.0, number=9)
    told = _checked(world, _fixes(world, course, FIVE_SECONDS), plots)
    assert told.pairs == {"1/9": ONE}
    assert [(c.kind, c.radar_track) for c in told.changes] == [
        ("associated", "1/3"),
        ("lost", "1/3"),
        ("associated", "1/9"),
    ]
    assert told.changes[1].at == told.changes[2].at


def test_an_aircraft_keeps_its_track_while_that_has_plots(world: Any) -> None:
    """A second track on the same aircraft, later and nearer, does not displace the first."""
    course = world.Course()
    plots = _plots(world, course, off=(60.0, 0.0, 0.0)) + _plots(world, course, from_s=20.0, number=9)
    told = _checked(world, _fixes(world, course, FIVE_SECONDS), plots)
    assert told.pairs == {"1/3": ONE}
    assert len(told.changes) == 1


def test_a_number_reused_for_another_aircraft_is_associated_anew(world: Any) -> None:
    """The number's new target is not the old aircraft: its pair begins after three hits of its own."""
    course, other = world.Course(), world.Course(left_m=-3500.0)
    plots = _plots(world, course, 19.0) + _plots(world, other, 60.0, from_s=19.4)
    fixes = _fixes(world, course, FIVE_SECONDS) + _fixes(world, other, [t + 0.1 for t in FIVE_SECONDS], aircraft=TWO)
    told = _checked(world, fixes, plots)
    pairs = told.state.ledger.pairs
    assert pairs[1, 3, 1] == TWO
    begun = next(change.at for change in told.changes if change.aircraft == TWO)
    assert begun == world.at(FIVE_SECONDS[6] + 0.1)  # checks 20.9 + 0.1, 25.9, 30.9 are its first three


def test_a_report_whose_clock_is_not_settled_is_not_compared(world: Any) -> None:
    """Reports that are not comparable are never checked."""
    course = world.Course()
    told = _checked(world, _fixes(world, course, FIVE_SECONDS, comparable=False), _plots(world, course))
    assert told.state.checks == ()


# late data, through the pipeline --------------------------------------------------------------------------------------


def _late(observations: list[Any], kind: type, from_s: float, until_s: float, late_s: float, world: Any) -> list[Any]:
    return [
        replace(one, received_at=one.valid_at + round(late_s * world.SECOND))
        if isinstance(one, kind) and world.at(from_s) <= one.valid_at < world.at(until_s)
        else one
        for one in observations
    ]


def test_a_check_waits_for_the_plots_about_it(world: Any) -> None:
    """A report is checked a second after its validity, not when it arrives, and by whatever the stream does then."""
    flight = world.flight(seconds=12.0, missing=False)
    ran = world.run(flight, ticks="one")
    for arrived, picture in zip(world.heard(flight), ran.pictures, strict=False):
        for at in picture.associate.check_time:
            assert arrived.now > at + world.SECOND
    assert ran.checks == 3


def test_plots_that_come_late_repeat_the_checks_that_they_touch(world: Any) -> None:
    """When the plots come 4 s after the reports, the pair is made all the same, and as of the same report."""
    flight = world.flight(seconds=30.0, missing=False)
    prompt = world.run(flight)
    late = world.run(_late(flight, RadarPlot, 0.0, 30.0, 4.0, world))
    for ran in (prompt, late):
        (change,) = [change for picture in ran.pictures for change in picture.associate.changes]
        assert (change.kind, change.at, change.radar_track) == ("associated", world.at(10.13), "1/3")


def test_a_report_that_comes_late_is_checked_in_its_place(world: Any) -> None:
    """The third report arrives after the fourth: the pair is made as of the third."""
    flight = _late(world.flight(seconds=30.0, missing=False), GpsReport, 10.0, 14.0, 8.0, world)
    ran = world.run(flight)
    changes = [change for picture in ran.pictures for change in picture.associate.changes]
    assert changes[-1].at == world.at(10.13)
    assert changes[-1].kind == "associated"
    assert ran.state.association.ledger.pairs == {(1, 3, 0): ONE}


# who is a rival -------------------------------------------------------------------------------------------------------


def test_an_aircraft_that_is_gone_is_nobodys_rival(world: Any) -> None:
    """One that was nearer for two checks and was never heard again does not keep the track from the one that stays."""
    course = world.Course()
    gone = _fixes(world, course, [0.9, 5.9], aircraft="mavlink:9")
    stays = _fixes(world, course, [40.9, 45.9, 50.9, 55.9], off_m=(0.0, 60.0, 0.0))
    assert _checked(world, [*gone, *stays], _plots(world, course)).pairs == {"1/3": ONE}


def test_a_miss_against_anothers_track_leaves_no_counter(world: Any) -> None:
    """An aircraft 800 m beside one that has its radar track never counts for that track, so it is no rival later."""
    course = world.Course()
    mine = _fixes(world, course, FIVE_SECONDS)
    other = _fixes(world, course, [t + 1.5 for t in FIVE_SECONDS], aircraft="mavlink:9", off_m=(0.0, 800.0, 0.0))
    told = _checked(world, [*mine, *other], _plots(world, course))
    assert told.pairs == {"1/3": ONE}
    assert {*told.state.ledger.counts} == {ONE}
