"""Scene files: what they may say, what is said of them when they are wrong, and those that come along."""

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adapters.mavlink_frames import message_name, parse
from gateway.settings import DEMO_SITE, SiteError, format_site
from sim.events import events
from sim.scene import Scene
from sim.scenes import build_scene, find_scene, parse_scene, scene_names, scenes_in, stage
from sim.scenes.tables import FAULTS

HEAD = '[scene]\ndescription = "A test."\nduration_s = 20.0\n'
VEHICLE = '[[vehicle]]\nroute = "approach"\n'
SITE = """
[site]
name = "Elsewhere"
[site.runway]
latitude_deg = 47.0
longitude_deg = 8.0
height_m = 400.0
geoid_separation_m = 48.0
landing_direction_deg = 140.0
[[site.radar]]
number = 7
along_m = 0.0
left_m = 100.0
antenna_height_m = 5.0
range_sigma_m = 20.0
"""


def staged(text: str, folder: Path | None = None, **said: object) -> Scene:
    """A scene of a text."""
    return stage(parse_scene(text, "my.toml", folder or Path(), "my"), start_ns=0, **said)


@pytest.mark.parametrize("name", scene_names())
def test_each_scene_that_comes_along_says_what_it_is_and_plays(name: str) -> None:
    """It is staged with a sentence and says something on every link in the first two seconds that somebody is there."""
    script = find_scene(name)
    assert script.description.endswith(".")
    whole = stage(script, start_ns=0)
    assert whole.aircraft
    since = max(min(one.path.start_s for one in whole.aircraft), 0.0)
    heard = {one.link for one in events(replace(whole, duration_s=since + 2.0, aircraft=whole.aircraft[:8]))}
    assert any(link.startswith("mavlink") for link in heard)
    assert all(radar.name in heard for radar in whole.radars)


def test_every_table_arrives_in_its_place() -> None:
    """A site within, sensors with units in their names, a vehicle with its own position source, points of both kinds."""
    text = (
        HEAD
        + 'name = "mine"\nseed = 5\nstart = "2026-03-01T12:00:00Z"\n'
        + SITE
        + "[gps]\nsigma_m = 2.0\n[imu]\nrate_hz = 10\nrate_bias_degps = 0.1\n[say]\ntruth_period_s = 0.0\n"
        + "[[radar]]\nazimuth_error_deg = 0.5\ndropouts = [[1, 2]]\n"
        + '[[vehicle]]\nsystem = 9\nkind = "copter"\nspeed_mps = 10.0\nheight_m = 50.0\nbegin_s = 3.0\n'
        + "route = [\n  { along_m = -1000.0, left_m = 0.0 },\n"
        + "  { latitude_deg = 47.0, longitude_deg = 8.0, altitude_msl_m = 452.0, speed_mps = 5.0 },\n]\n"
        + "[vehicle.gps]\nperiod_s = 0.5\n"
        + VEHICLE
    )
    script = parse_scene(text, "my.toml", Path(), "my")
    scene = stage(script, start_ns=script.start_ns or 0)
    assert (scene.name, scene.seed, scene.start_ns) == ("mine", 5, 1_772_366_400_000_000_000)
    assert scene.site.runway.landing_compass_rad == pytest.approx(math.radians(140.0))
    radar = scene.radars[0]
    assert (radar.site.number, radar.parameters.range_sigma_m, radar.parameters.dropouts) == (7, 20.0, ((1.0, 2.0),))
    assert radar.parameters.azimuth_error_rad == pytest.approx(math.radians(0.5))
    assert (scene.imu.rate_hz, scene.say.truth_period_s) == (10.0, 0.0)
    assert scene.imu.rate_bias_radps == pytest.approx(math.radians(0.1))
    copter, aeroplane = scene.aircraft
    assert (copter.system, aeroplane.system, copter.craft, copter.path.start_s) == (9, 1, "copter", 3.0)
    assert copter.gps is not None
    assert (copter.gps.period_s, copter.gps.sigma_m, aeroplane.gps) == (0.5, 2.0, None)
    end = scene.flown(copter, copter.path.end_s)
    assert np.degrees([end.latitude_rad, end.longitude_rad]) == pytest.approx([47.0, 8.0], abs=1e-9)
    # 452 m above a sea level that is 48 m above the ellipsoid; the climb is rounded out at its end
    assert end.height_m == pytest.approx(500.0, abs=4.0)


def test_the_command_line_goes_before_the_file() -> None:
    """A seed, a site and --set win over what is written; a radar that is written wins over what the site says."""
    text = HEAD + "seed = 5\n" + SITE + "[gps]\nsigma_m = 2.0\n[[radar]]\nrange_sigma_m = 3.0\n" + VEHICLE
    scene = staged(text, seed=6, changes=["gps.sigma_m=4", "aircraft=3"])
    assert (scene.seed, scene.gps.sigma_m, len(scene.aircraft)) == (6, 4.0, 3)
    assert scene.radars[0].parameters.range_sigma_m == 3.0
    assert [one.path.start_s for one in scene.aircraft] == [0.0, 90.0, 180.0]
    elsewhere = build_scene("approach", start_ns=0).site
    assert staged(text, site=elsewhere).site == elsewhere


def test_a_mission_file_and_a_site_file_are_read_beside_the_scene(tmp_path: Path) -> None:
    """A route is a QGC WPL file, heights above home; the site a file of its own; both are named from the scene's folder."""
    items = [(0, 0, 16, 47.0, 8.0, 352.0), (1, 3, 16, 47.02, 8.0, 100.0), (2, 3, 16, 47.04, 8.0, 200.0)]
    lines = [f"{n}\t0\t{frame}\t{command}\t0\t0\t0\t0\t{a}\t{b}\t{c}\t1" for n, frame, command, a, b, c in items]
    (tmp_path / "round.waypoints").write_text("\n".join(["QGC WPL 110", *lines]) + "\n")
    (tmp_path / "field.toml").write_text(SITE.replace("[site]\n", "").replace("site.", ""))
    text = HEAD + 'site = "field.toml"\n[[vehicle]]\nroute = "round.waypoints"\nspeed_mps = 40.0\n'
    (tmp_path / "mine.toml").write_text(text)
    assert [path.name for path in scenes_in(tmp_path)] == ["mine.toml"]
    scene = build_scene(str(tmp_path / "mine.toml"), start_ns=0)
    one = scene.aircraft[0]
    begin, end = (scene.flown(one, at) for at in (one.path.start_s, one.path.end_s))
    assert (scene.site.name, scene.name) == ("Elsewhere", "mine")
    assert np.degrees([begin.latitude_rad, end.latitude_rad]) == pytest.approx([47.02, 47.04], abs=1e-9)
    assert [begin.height_m, end.height_m] == pytest.approx([500.0, 600.0], abs=4.0)  # rounded out at its ends


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (VEHICLE, "my.toml: the table [scene] is missing"),
        ("[scene]\nduration_s = 3\n", "my.toml, line 1: [scene] lacks description"),
        (HEAD + "[vehicles]\n", "my.toml, line 4: unknown table 'vehicles'; perhaps vehicle is meant"),
        (HEAD + "lenght_s = 3\n", "my.toml, line 4: unknown key 'lenght_s' in [scene]"),
        (HEAD + "[gps]\nsigma_km = 3\n", "my.toml, line 5: unknown key 'sigma_km' in [gps]; it is sigma_m here"),
        (HEAD + "[gps]\nperiod_s = 0\n", "my.toml, line 5: period_s must be above 0, not 0"),
        (HEAD + "[[vehicle]]\nspeed_mps = 3\n", "my.toml, line 4: [[vehicle]] lacks route"),
        (
            HEAD + '[[vehicle]]\nroute = "aproach"\n',
            "line 5: route 'aproach' is no file in ., and no word; perhaps approach",
        ),
        (
            HEAD + VEHICLE + "[vehicle.gps]\nperiods_s = 1\n",
            "my.toml, line 7: unknown key 'periods_s' in [vehicle.gps]",
        ),
        (
            HEAD + "[[vehicle]]\nroute = [\n{ along_m = 1, left_m = 2 },\n{ along_m = 1 },\n]\n",
            "my.toml, line 7: point 2: a point needs along_m and left_m",
        ),
        (HEAD + '[[fault]]\nkind = "gps los"\nat_s = 1\n', "my.toml, line 5: unknown kind 'gps los'; perhaps gps lost"),
        (HEAD + "[[fault]]\nat_s = 1\n", "my.toml, line 4: [[fault]] lacks kind"),
        (HEAD + '[[fault]]\nkind = "link cut"\n', 'line 4: [[fault]] of kind "link cut" lacks at_s'),
        (
            HEAD + '[[fault]]\nkind = "radar off"\nat_s = 1\nvehicle = 1\n',
            "line 7: unknown key 'vehicle' in [[fault]] of kind \"radar off\"",
        ),
        (
            HEAD + '[[fault]]\nkind = "gps spoofed"\nat_s = 1\n',
            "line 4: 'gps spoofed' needs at least one of step_m, walks_mps",
        ),
        (HEAD + '[[fault]]\nkind = "link cut"\nat_s = 9\nuntil_s = 8\n', "line 7: until_s must be later than at_s"),
        (HEAD + SITE.replace("longitude_deg", "longitude"), "unknown key 'longitude' in [site.runway]"),
        (
            HEAD + "[traffic]\naircraft = 3\n[conflicts]\naircraft = 4\n",
            "[traffic] and [conflicts] cannot be in one scene",
        ),
    ],
)
def test_what_is_wrong_in_a_file_is_said_with_its_line(text: str, said: str) -> None:
    """One sentence with the file, the line and what would be right."""
    with pytest.raises(SiteError) as caught:
        parse_scene(text, "my.toml", Path(), "my")
    assert said in str(caught.value)
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            HEAD + VEHICLE + '[[fault]]\nkind = "link cut"\nat_s = 1\nvehicle = 4\n',
            "[[fault]] 1 befalls vehicle 4; there are: 1.",
        ),
        (HEAD.replace("duration_s = 20.0\n", "") + '[[vehicle]]\nroute = "landing"\n', "[scene] lacks duration_s"),
        (
            HEAD
            + "[[vehicle]]\nroute = [{along_m = 0, left_m = 0}, {along_m = 50, left_m = 0}, {along_m = 50, left_m = 50}]\n",
            "[[vehicle]] 1: points 0 and 1 of the route are too near",
        ),
    ],
)
def test_what_cannot_be_staged_is_said(text: str, said: str) -> None:
    """A fault of nobody, a scene without an end, a route that cannot be flown."""
    with pytest.raises(SiteError) as caught:
        staged(text)
    assert said in str(caught.value)


def test_an_inertial_unit_tells_what_is_felt() -> None:
    """At 50 Hz, of a level flight eastwards: gravity less 0.02 m/s2 of Eötvös, hardly any rate; the airspeed of thin air."""
    scene = staged(HEAD + "[imu]\nrate_hz = 50.0\nforce_bias_mps2 = 0.0\nrate_bias_degps = 0.0\n" + VEHICLE)
    found = [frame for one in events(scene) if (frame := parse(one.data)) is not None]
    samples = [frame.payload for frame in found if message_name(frame.message) == "HIGHRES_IMU"]
    felt = np.array([np.frombuffer(one[8:32], "<f4") for one in samples])
    assert len(felt) == 999
    assert np.mean(felt, axis=0) == pytest.approx([0.0, 0.0, -9.77, 0.0, 0.0, 0.0], abs=0.01)
    huds = [np.frombuffer(frame.payload[:4], "<f4")[0] for frame in found if message_name(frame.message) == "VFR_HUD"]
    assert np.mean(huds) == pytest.approx(130.0 * (1.0 - 2.2558e-5 * 1700.0) ** 2.128, abs=0.3)


def test_the_examples_of_the_documentation_can_be_staged(tmp_path: Path) -> None:
    """The whole file of docs/scenes.md, and its faults, of which there is one of each kind."""
    text = (Path(__file__).parents[2] / "docs" / "scenes.md").read_text("utf-8")
    whole, flown, faults = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "field.toml").write_text(format_site(DEMO_SITE))
    assert len(staged(whole, tmp_path).aircraft) == 2
    (tmp_path / "round.plan").write_text("{}")
    assert parse_scene(HEAD + flown, "docs", tmp_path, "docs").vehicles[0].goes_around == 1
    many = parse_scene(HEAD + VEHICLE + faults, "docs", tmp_path, "docs").faults
    assert {type(one) for one in many} == {known.make for known in FAULTS.values()}
