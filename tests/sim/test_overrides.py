"""Changes to a scene, as people write them, and what they are told when one cannot be made."""

import math
from dataclasses import replace

import pytest

from gateway.settings import DEMO_SITE, PositionSource, SiteError, parse_site
from sim.overrides import OverrideError, SceneParameters, override
from sim.scenes import build_scene


def test_every_group_can_be_set() -> None:
    """Numbers, whole numbers, truth values, intervals and angles arrive in their fields."""
    changed = override(
        SceneParameters(),
        [
            "aircraft=12",
            "duration_s=90.5",
            "gps.period_s=1",
            "gps.error_east_m=-5",
            "gps.velocity=no",
            "gps.dropouts=60:90,200:230.5",
            "radar.missing_azimuth=0.3",
            "radar.azimuth_error_deg=-0.5",
            "radar.elevation_sigma_rad=0.002",
            "say.truth_period_s=0",
        ],
    )
    assert (changed.aircraft, changed.duration_s) == (12, 90.5)
    assert (changed.gps.period_s, changed.gps.error_east_m, changed.gps.velocity) == (1.0, -5.0, False)
    assert changed.gps.dropouts == ((60.0, 90.0), (200.0, 230.5))
    assert changed.radars[0].missing_azimuth == 0.3
    assert changed.radars[0].azimuth_error_rad == pytest.approx(math.radians(-0.5))
    assert changed.radars[0].elevation_sigma_rad == 0.002
    assert changed.say.truth_period_s == 0.0


def test_one_radar_or_all_of_them() -> None:
    """`radar.` sets every radar, `radar2.` the second alone, and counts come first wherever they stand."""
    changed = override(SceneParameters(), ["radar.range_sigma_m=9", "radar2.range_sigma_m=30", "radars=3"])
    assert [radar.range_sigma_m for radar in changed.radars] == [9.0, 30.0, 9.0]
    assert len({radar.first_number for radar in changed.radars}) == 3


def test_a_latency_bound_moved_past_the_other_takes_it_along() -> None:
    """Setting one bound of the latency beyond the other sets both."""
    assert override(SceneParameters(), ["gps.latency_high_s=0.1"]).gps.latency_low_s == 0.1
    assert override(SceneParameters(), ["gps.latency_low_s=3"]).gps.latency_high_s == 3.0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("gps.period_s", "write KEY=VALUE"),
        ("gps.period_s=", "write KEY=VALUE"),
        ("gps.periods_s=1", "perhaps period_s is meant"),
        ("gsp.period_s=1", "unknown group 'gsp'"),
        ("aircrafts=3", "perhaps aircraft is meant"),
        ("radar7.period_s=1", "add radars=7"),
        ("gps.period_s=fast", "must be a number"),
        ("gps.period_s=0", "must be above 0"),
        ("gps.sigma_m=-1", "must be at least 0"),
        ("gps.sigma_m=nan", "must be at least 0"),
        ("gps.sigma_m=inf", "must be at least 0"),
        ("gps.error_up_m=inf", "must be finite"),
        ("aircraft=2.5", "must be a whole number"),
        ("aircraft=900", "must be from 0 to 250"),
        ("radar.missing_range=1.5", "must be from 0 to 1"),
        ("gps.velocity=maybe", "must be true or false"),
        ("gps.dropouts=90:60", "FROM:UNTIL"),
        ("gps.dropouts=60-90", "FROM:UNTIL"),
        ("radar.range_sigma_deg=1", "range_sigma_deg"),
    ],
)
def test_what_cannot_be_set_is_said(change: str, said: str) -> None:
    """Each wrong change gives one sentence that names the setting and says how to write it."""
    with pytest.raises(OverrideError) as caught:
        override(SceneParameters(), [change])
    text = str(caught.value)
    assert said in text
    assert text.endswith(".")
    assert "\n" not in text
    assert change.partition("=")[0].partition(".")[0] in text


def test_an_unknown_scene_is_said() -> None:
    """Of a scene that does not exist it is said which one may be meant."""
    with pytest.raises(SiteError, match="perhaps approach is meant"):
        build_scene("aproach", start_ns=0)


def test_the_approach_is_the_papers_case() -> None:
    """Unchanged, the scene has 003's sensors to the digit and its duration."""
    scene = build_scene("approach", start_ns=0)
    gps, radar = scene.gps, scene.radars[0].parameters
    assert (gps.period_s, gps.phase_s, gps.sigma_m) == (5.0, 0.13, 15.0)
    assert (gps.error_east_m, gps.error_north_m, gps.error_up_m) == (35.0, 40.0, 28.0)
    assert (gps.latency_low_s, gps.latency_high_s) == (0.8, 2.0)
    assert (radar.period_s, radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad) == (
        0.4,
        15.0,
        1e-3,
        1e-3,
    )
    assert (radar.missing_range, radar.missing_azimuth, radar.missing_elevation) == (0.05, 0.2, 0.2)
    assert scene.duration_s == pytest.approx(457.14, abs=0.01)
    assert scene.site == DEMO_SITE


SITE = parse_site(
    """
name = "two radars"
[runway]
latitude_deg = -35.0
longitude_deg = 149.0
height_m = 600.0
landing_direction_deg = 353.0
[[radar]]
number = 4
along_m = 0.0
left_m = 200.0
antenna_height_m = 5.0
range_sigma_m = 30.0
azimuth_sigma_deg = 0.1
elevation_sigma_deg = 0.1
maximum_range_m = 20000.0
[[radar]]
number = 1
along_m = 100.0
left_m = -200.0
antenna_height_m = 5.0
range_sigma_m = 10.0
azimuth_sigma_deg = 0.05
elevation_sigma_deg = 0.05
maximum_range_m = 40000.0
"""
)


def test_a_sites_radars_are_the_scenes() -> None:
    """At a site every radar of the site is there, as noisy and far-reaching as the site says; changes win."""
    scene = build_scene("approach", start_ns=0, site=SITE, changes=["radar1.range_sigma_m=1"])
    assert [radar.site.number for radar in scene.radars] == [4, 1]
    assert [radar.parameters.range_sigma_m for radar in scene.radars] == [1.0, 10.0]
    assert [radar.parameters.maximum_range_m for radar in scene.radars] == [20000.0, 40000.0]
    assert scene.site == SITE


def test_more_radars_than_the_site_has_get_places_and_numbers_of_their_own() -> None:
    """Further radars stand beside the runway, with free numbers, and are in the scene's site."""
    scene = build_scene("approach", start_ns=0, site=SITE, changes=["radars=4"])
    numbers = [radar.site.number for radar in scene.radars]
    assert len(set(numbers)) == 4
    assert {radar.number for radar in scene.site.radars} == set(numbers)
    assert len({(radar.site.along_m, radar.site.left_m) for radar in scene.radars}) == 4


def test_the_site_that_goes_with_a_scene_states_what_is_simulated() -> None:
    """Noise of position and velocity as simulated, never nothing; a site that states them itself is left as it is."""
    stated = build_scene("traffic", start_ns=0).stated_site.position
    assert (stated.sigma_m, stated.velocity_sigma_mps) == (8.0, 0.5)
    silent = build_scene("approach", start_ns=0, changes=["gps.sigma_m=0", "gps.velocity_sigma_mps=0"]).stated_site
    assert min(silent.position.sigma_m, silent.position.velocity_sigma_mps) > 0.0
    own = replace(DEMO_SITE, position=PositionSource(3.0, 10.0, 2.0))
    assert build_scene("traffic", start_ns=0, site=own).stated_site.position == own.position
