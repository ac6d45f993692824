"""Two radars that see the same aircraft, with and without what these say of themselves: one track each, whatever fails."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from gateway.associate import MultiRadar
from gateway.frames import RunwayFrame
from gateway.observation import GpsReport, Heard, Observation, RadarPlot
from gateway.picture import Picture
from gateway.pipeline import initial, step
from sim.events import events
from sim.routes import RoutePath, RoutePoint
from sim.scene import Aircraft, Scene
from sim.scenes import build_scene

START_NS = 1_790_000_000_000_000_000
SECOND = 1_000_000_000
Change = Callable[[Observation], Observation | None]
PAIRED_WITHIN_S = 12.0  # 3 s until a tracklet can be told, five checks a second apart, and some that were not plain


def level(left_m: float, to_left_m: float | None = None, height_m: float = 1200.0) -> RoutePath:
    """Straight over 30 km towards the field at 100 m/s, beginning 32 km out."""
    end_m = left_m if to_left_m is None else to_left_m
    return RoutePath([RoutePoint(-32e3, left_m, height_m, 100.0), RoutePoint(-2e3, end_m, height_m, 100.0)])


def scene_of(paths: Sequence[RoutePath], seconds: float, *changes: str) -> Scene:
    """Aircraft 1, 2, ... on these paths, seen by two radars; radar 1 numbers aircraft n as n, radar 2 as 100 + n."""
    said = [f"duration_s={seconds}", "radars=2", *changes]
    scene = build_scene("traffic", start_ns=START_NS, seed=5, changes=said)
    return replace(scene, aircraft=tuple(Aircraft(k + 1, path) for k, path in enumerate(paths)))


@dataclass(frozen=True)
class Row:
    """One row of a track, `at` in seconds of the scene."""

    at: float
    track: int
    aircraft: str | None
    radar_track: str | None
    state: str

    @property
    def targets(self) -> frozenset[int]:
        """Which aircraft in truth its aircraft and radar tracks are."""
        named = {int(name.split("/")[1]) % 100 for name in (self.radar_track or "").split()}
        return frozenset(named | ({int(self.aircraft.split(":")[1])} if self.aircraft else set()))


@dataclass(frozen=True)
class Flown:
    """What the gateway made of a scene."""

    rows: tuple[Row, ...]
    pictures: tuple[Picture, ...]

    def since(self, at: float) -> list[Row]:
        """The rows from a second on."""
        return [row for row in self.rows if row.at >= at]

    def of(self, target: int, since: float = 0.0, until: float = 1e9) -> list[Row]:
        """Those of an aircraft."""
        return [row for row in self.rows if target in row.targets and since <= row.at < until]

    @property
    def mixed(self) -> list[Row]:
        """Rows in which two aircraft are taken for one."""
        return [row for row in self.rows if len(row.targets) > 1]

    @property
    def said(self) -> list[str]:
        """Everything that the log says."""
        return [event.text for picture in self.pictures for event in picture.events]


def heard(scene: Scene, change: Change = lambda one: one) -> list[Heard]:
    """The scene as it comes from the wires; `change` alters observations, or takes them away."""
    sources: dict[str, Source] = {}
    sent = list(events(scene))
    for event in sent:
        kind = "radar" if event.link.startswith("radar") else "mavlink"
        sources.setdefault(event.link, Source(len(sources), kind, event.link.replace(":", "-"), event.link))
    decoder = Decoder(list(sources.values()))
    told = [decoder.feed(Arrival(event.at, sources[event.link].number, event.data)) for event in sent]
    return [replace(one, observations=tuple(_changed(one.observations, change))) for one in told]


def _changed(observations: Iterable[Observation], change: Change) -> list[Observation]:
    return [new for one in observations if (new := change(one)) is not None]


def fly(scene: Scene, change: Change = lambda one: one, tick: int = SECOND) -> Flown:
    """The scene worked through, a second at a time, or in other ticks (ns)."""
    told, state, pictures = heard(scene, change), initial(scene.site), list[Picture]()
    while told:
        count = next((i for i, one in enumerate(told) if one.now >= told[0].now + tick), len(told))
        state, picture = step(state, told[:count])
        told = told[count:]
        pictures.append(picture)
    rows = [
        Row((at - START_NS) / SECOND, track, aircraft, radar_track, seen)
        for fused in (picture.fuse for picture in pictures)
        for at, track, aircraft, radar_track, seen in zip(
            fused.time.tolist(), fused.track.tolist(), fused.aircraft, fused.radar_track, fused.state, strict=True
        )
    ]
    return Flown(tuple(rows), tuple(pictures))


def without_gps(since: float = 0.0, until: float = 1e9) -> Change:
    """No aircraft says anything for a while."""
    return lambda one: None if isinstance(one, GpsReport) and since <= seconds(one.valid_at) < until else one


def seconds(at: int) -> float:
    """Of the scene."""
    return (at - START_NS) / SECOND


def plots_of(one: Observation, radar: int) -> RadarPlot | None:
    """The observation, if it is a plot of this radar."""
    return one if isinstance(one, RadarPlot) and one.radar == radar else None


def both(one: Change, other: Change) -> Change:
    """First one change, then the other."""
    return lambda observation: None if (kept := one(observation)) is None else other(kept)


def swapped(radar: int, since: float) -> Change:
    """From a second on a radar gives each of two aircraft the other's number."""

    def change(one: Observation) -> Observation:
        plot = plots_of(one, radar)
        if plot is None or seconds(plot.valid_at) < since:
            return one
        first = (radar - 1) * 100
        return replace(plot, track_number=2 * first + 3 - plot.track_number)

    return change


def numbers(rows: Iterable[Row]) -> set[int]:
    """Their track numbers."""
    return {row.track for row in rows}


OPPOSITE = [
    *("radar1.range_error_m=-150", "radar1.azimuth_error_deg=-0.5"),
    *("radar2.range_error_m=150", "radar2.azimuth_error_deg=0.5"),
]
ONE = [level(2000.0)]
FORMATION = [level(2000.0), level(2300.0)]


# no position source ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("paths", "changes"),
    [
        pytest.param(ONE, [], id="one"),
        pytest.param(FORMATION, [], id="300 m apart"),
        pytest.param(FORMATION, OPPOSITE[2:], id="300 m apart, a radar off by 150 m and half a degree"),
        pytest.param([level(2000.0), level(-4000.0)], OPPOSITE, id="both radars off, to opposite sides"),
    ],
)
def test_the_radars_tracks_of_one_target_become_one(paths: Sequence[RoutePath], changes: Sequence[str]) -> None:
    """Within 12 s, under the number that was there first, and never with another aircraft's."""
    flown = fly(scene_of(paths, 30.0, *changes), without_gps())
    assert not flown.mixed
    late = flown.since(PAIRED_WITHIN_S)
    assert {row.radar_track for row in late} == {f"1/{k + 1} 2/{101 + k}" for k in range(len(paths))}
    for target in range(1, len(paths) + 1):
        assert numbers(flown.of(target, PAIRED_WITHIN_S)) == {min(numbers(flown.of(target)))}


def test_aircraft_that_cross_at_one_height_keep_their_tracks() -> None:
    """At 8 degrees, through the same place at the same time: no pair is changed, and none is wrong."""
    paths = [level(400.0, -3800.0), level(-400.0, 3800.0)]
    flown = fly(scene_of(paths, 60.0), without_gps())
    assert not flown.mixed
    for target in (1, 2):
        assert len(numbers(flown.of(target, PAIRED_WITHIN_S))) == 1
        assert {row.radar_track for row in flown.of(target, 40.0)} == {f"1/{target} 2/{100 + target}"}


@pytest.mark.parametrize("radar", [1, 2])
def test_either_radar_may_fail(radar: int) -> None:
    """A radar is silent for 20 s: the track goes on with the other's alone, and with both when it is back."""
    flown = fly(scene_of(ONE, 55.0, f"radar{radar}.dropouts=20:40"), without_gps())
    assert numbers(flown.since(PAIRED_WITHIN_S)) == {1}
    assert {row.radar_track for row in flown.since(44.0)} == {"1/1 2/101"}
    times = [row.at for row in flown.since(PAIRED_WITHIN_S) if row.state != "coasting"]
    assert max(np.diff(sorted(times))) < 0.5


def test_a_radar_that_numbers_a_target_anew_stays_in_the_track() -> None:
    """Radar 2 gives another number while radar 1 goes on: nobody gets a new track."""

    def change(one: Observation) -> Observation:
        plot = plots_of(one, 2)
        return replace(plot, track_number=201) if plot and seconds(plot.valid_at) >= 20.0 else one

    flown = fly(scene_of(ONE, 40.0), both(without_gps(), change))
    assert numbers(flown.since(PAIRED_WITHIN_S)) == {1}
    assert {row.radar_track for row in flown.since(24.0)} == {"1/1 2/201"}


@pytest.mark.parametrize("gps", [False, True])
def test_a_radar_that_swaps_two_numbers_is_found_out(gps: bool) -> None:
    """300 m apart, radar 2 swaps them: the wrong pairs are undone within 7 s, and right ones made within 12."""
    flown = fly(scene_of(FORMATION, 45.0), both(without_gps() if not gps else lambda one: one, swapped(2, 20.0)))
    late = flown.since(27.0)
    assert not {row.radar_track for row in late} & {"1/1 2/101", "1/2 2/102"}
    assert {row.radar_track for row in flown.since(32.5)} == {"1/1 2/102", "1/2 2/101"}


# beside a position source ---------------------------------------------------------------------------------------------


def test_what_both_radars_see_is_one_track_with_the_aircraft_that_says_so() -> None:
    """Figure 1 with everything there: both radars' tracks in the aircraft's, nothing beside it."""
    flown = fly(scene_of(FORMATION, 25.0))
    assert not flown.mixed
    late = {(row.aircraft, row.radar_track) for row in flown.since(PAIRED_WITHIN_S)}
    assert late == {("mavlink:1", "1/1 2/101"), ("mavlink:2", "1/2 2/102")}


def test_a_radar_whose_error_hides_it_from_the_position_source_comes_with_the_other() -> None:
    """Radar 2 is off by 150 m and half a degree, 30 km out: reports do not find it, but radar 1's track does."""
    flown = fly(scene_of(ONE, 40.0, *OPPOSITE[2:]))
    assert not any("mavlink:1 is radar track 2/101" in said for said in flown.said)
    late = {(row.aircraft, row.radar_track) for row in flown.since(PAIRED_WITHIN_S)}
    assert late == {("mavlink:1", "1/1 2/101")}


def test_the_radars_own_track_is_kept_apart_from_the_position_source() -> None:
    """Beside the fused track, each second what both radars alone have of it: to the truth, and the same whatever GPS says."""
    scene, other = (scene_of(ONE, 25.0, f"gps.error_north_m={off_m}") for off_m in (0.0, 30.0))
    radars, same = (MultiRadar.of([one.associate.radars for one in fly(each).pictures]) for each in (scene, other))
    assert len(radars.time) >= 15
    assert set(radars.radar_track) == {"1/1 2/101"}
    late = slice(len(radars.time) - 15, None)
    assert radars.runway_m[late].tobytes() == same.runway_m[late].tobytes()
    flown = scene.flown(scene.aircraft[0], (radars.time - START_NS) / SECOND)
    frame = RunwayFrame(scene.site.runway)
    truth = frame.runway_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
    error_m = np.linalg.norm(radars.runway_m - truth, axis=1)
    # A plot's own error is 15 m along and 32 m across at 32 km; a dozen of each radar are in it.
    assert error_m.max() < 60.0
    assert error_m.max() < 4.0 * np.linalg.norm(radars.sigma_m, axis=1).min()


def test_with_one_radar_there_is_no_multi_radar_track() -> None:
    """Its plots are all that it has."""
    flown = fly(scene_of(ONE, 15.0, "radar2.dropouts=0:15"))
    assert not any(len(picture.associate.radars.time) for picture in flown.pictures)


def test_when_the_position_source_is_lost_the_radars_track_remains() -> None:
    """Under its number, as "radar only", and fused again when it is back."""
    flown = fly(scene_of(ONE, 60.0), without_gps(20.0, 45.0))
    late = flown.since(PAIRED_WITHIN_S)
    assert len(numbers(late)) == 1
    assert {row.state for row in late if 31.0 < row.at < 45.0} == {"radar only"}
    assert {row.state for row in late if row.at > 47.0} == {"fused"}
    assert {row.radar_track for row in late} == {"1/1 2/101"}


def test_a_position_source_that_appears_is_associated_to_the_joined_track() -> None:
    """Both radars' tracks become the aircraft's, which goes on under the number that people have known them by."""
    flown = fly(scene_of(ONE, 60.0), both(without_gps(0.0, 20.0), without_gps(40.0)))
    assert {row.radar_track for row in flown.of(1, PAIRED_WITHIN_S, 20.0)} == {"1/1 2/101"}
    assert any("joined track 1, mavlink:1" in one.reason for picture in flown.pictures for one in picture.fuse.ended)
    late = flown.since(27.0)
    assert numbers(late) == {1}
    assert {(row.aircraft, row.radar_track) for row in late} == {("mavlink:1", "1/1 2/101")}
    assert {row.state for row in late if row.at > 51.0} == {"radar only"}
    predicted = np.concatenate([one.predict.track[one.predict.made > START_NS + 27 * SECOND] for one in flown.pictures])
    assert set(predicted.tolist()) == {1}


def test_ticks_change_nothing_of_it() -> None:
    """A radar that comes and goes, a position source too: the same bits arrival by arrival, in 20 ms, and all at once."""
    scene = scene_of(FORMATION, 35.0, "radar2.dropouts=15:20")
    runs = [fly(scene, without_gps(12.0, 24.0), tick) for tick in (1, 20_000_000, 100 * SECOND)]
    for other in runs[1:]:
        assert runs[0].said == other.said
        for name in ("time", "track", "latitude_rad", "covariance"):
            one, two = (
                np.concatenate([getattr(picture.fuse, name) for picture in run.pictures]) for run in (runs[0], other)
            )
            assert one.tobytes() == two.tobytes()
        assert runs[0].rows == other.rows


# many -----------------------------------------------------------------------------------------------------------------


def test_of_thirty_aircraft_no_two_are_taken_for_one() -> None:
    """Thirty aircraft, two radars, no position source: all that both radars see are joined, none wrongly."""
    scene = build_scene("traffic", start_ns=START_NS, seed=2, changes=["aircraft=30", "radars=2", "duration_s=20"])
    flown = fly(scene, without_gps())
    assert not flown.mixed
    late = [row.radar_track or "" for row in flown.since(17.0)]
    seen = [{name for track in late for name in track.split() if name.startswith(radar)} for radar in ("1/", "2/")]
    joined = {track for track in late if " " in track}
    assert len(joined) == min(map(len, seen)) > 20


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_thirty_aircraft_without_a_position_source_for_ten_minutes(seed: int) -> None:
    """Not a single row in ten minutes holds two aircraft."""
    changes = ["aircraft=30", "radars=2", "duration_s=600"]
    scene = build_scene("traffic", start_ns=START_NS, seed=seed, changes=changes)
    assert not fly(scene, without_gps()).mixed
