"""The site file: what it says is what is known, and what is wrong with it is said in one sentence with its line."""

import contextlib
import math
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.settings import (
    DEMO_SITE,
    DecisionPoint,
    Estimation,
    PositionSource,
    RadarSite,
    Runway,
    Site,
    SiteError,
    Waypoint,
    Weather,
    format_site,
    parse_site,
    with_radar,
)

EXAMPLE = """\
name = "Demo field"
[display]
units = "si"                 # or "aviation"
[runway]
latitude_deg = 31.0          # centre
longitude_deg = 104.0
height_m = 500.0             # above the ellipsoid
geoid_separation_m = -35.0   # height of the geoid above the ellipsoid here: height_m = altitude_msl_m + this
landing_direction_deg = 90.0 # true, main landing direction
length_m = 3000.0
width_m = 45.0
glide_path_deg = 3.0
threshold_crossing_height_m = 15.0
[position]                   # what a position source is worth when its stream does not say
sigma_m = 15.0
systematic_m = 60.0          # allowed constant error
[[radar]]
number = 1
along_m = 300.0              # antenna in the runway frame: x
left_m = 150.0               # y
antenna_height_m = 3.0       # z: above the runway plane, so z_radar = z_runway - antenna_height
boresight_deg = 270.0        # optional, true; default: against the landing direction
range_sigma_m = 15.0
azimuth_sigma_deg = 0.0573
elevation_sigma_deg = 0.0573
maximum_range_m = 60000.0
key_file = "radar1.key"      # optional
[[decision_point]]           # optional, drawn and reported
name = "DA"
distance_m = 1500.0          # before the threshold
[[waypoint]]                 # optional: published points
name = "IAF"
latitude_deg = 31.0
longitude_deg = 103.6
[[weather]]                  # optional: areas to avoid
name = "cell"
latitude_deg = 31.2
longitude_deg = 103.8
radius_m = 8000.0
from = "2026-03-01T12:00:00Z"
until = 2026-03-01T13:00:00Z
[[weather]]
name = "front"
polygon_deg = [[31.0, 103.0], [31.5, 103.0], [31.5, 103.5]]
"""

LEAST = """\
[runway]
latitude_deg = -33.95
longitude_deg = 151.18
height_m = 28
landing_direction_deg = 155
"""

DEGREE = math.pi / 180.0


def test_the_example_parses_with_units_converted() -> None:
    """Every value of the example arrives in SI and radians."""
    site = parse_site(EXAMPLE)
    assert site.name == "Demo field"
    assert site.units == "si"
    assert site.runway == Runway(31 * DEGREE, 104 * DEGREE, 500.0, 90 * DEGREE, -35.0, 3000.0, 45.0, 3 * DEGREE, 15.0)
    assert site.position == PositionSource(15.0, 60.0)
    sigma = 0.0573 * DEGREE
    assert site.radars == (RadarSite(1, 300.0, 150.0, 3.0, 270 * DEGREE, 15.0, sigma, sigma, 60000.0, "radar1.key"),)
    assert site.decision_points == (DecisionPoint("DA", 1500.0),)
    assert site.waypoints == (Waypoint("IAF", 31 * DEGREE, 103.6 * DEGREE),)
    circle, polygon = site.weather
    assert (circle.latitude_rad, circle.longitude_rad) == (31.2 * DEGREE, 103.8 * DEGREE)
    assert (circle.radius_m, circle.valid_from) == (8000.0, "2026-03-01T12:00:00Z")
    assert circle.valid_until == "2026-03-01T13:00:00+00:00"  # TOML's own time, as ISO 8601
    assert polygon.polygon_rad == tuple((a * DEGREE, b * DEGREE) for a, b in ((31, 103), (31.5, 103), (31.5, 103.5)))


def test_what_is_not_given_has_its_default() -> None:
    """A file of only a runway gives no radar, no geoid separation, and a position source of 15 m and 60 m."""
    site = parse_site(LEAST)
    assert site.runway.geoid_separation_m is None
    assert (site.runway.length_m, site.runway.glide_path_rad) == (3000.0, 3 * DEGREE)
    assert (site.position.sigma_m, site.position.systematic_m) == (15.0, 60.0)
    assert (site.radars, site.decision_points, site.waypoints, site.weather) == ((), (), (), ())
    assert site.units == "si"


def test_a_boresight_not_given_is_against_the_landing_direction() -> None:
    """The radar's default boresight is the landing direction turned by half a turn."""
    site = parse_site(LEAST + "[[radar]]\nnumber = 2\nalong_m = 0\nleft_m = -80\nantenna_height_m = 4\n")
    assert site.radars[0].compass_boresight_rad == pytest.approx(335 * DEGREE, abs=1e-12)
    assert site.radar(2) is site.radars[0]
    assert site.radar(1) is None


def test_the_glide_path_meets_the_runway_where_the_crossing_height_says() -> None:
    """The threshold is half a length before the centre, and 15 m above it a 3 degree path touches 286 m further on."""
    runway = parse_site(EXAMPLE).runway
    assert runway.threshold_x_m == -1500.0
    assert runway.aiming_point_x_m == pytest.approx(-1500.0 + 286.2, abs=0.05)  # 15 m / tan 3 degrees = 286.2 m


def test_with_radar_puts_a_radar_in_place_of_its_number() -> None:
    """A radar replaces the one of its number, or is added; the rest of the site stays."""
    moved, second = replace(DEMO_SITE.radars[0], along_m=1.0), replace(DEMO_SITE.radars[0], number=2)
    assert with_radar(DEMO_SITE, moved).radars == (moved,)
    assert with_radar(DEMO_SITE, second) == replace(DEMO_SITE, radars=(DEMO_SITE.radars[0], second))


def _near(one: Site, other: Site) -> bool:
    """Equal but for the digits that are written: 1e-9 degrees of a place, 1e-4 m, 1e-6 of a sigma."""
    for a, b in zip(_leaves(one), _leaves(other), strict=True):
        if isinstance(a, float) and isinstance(b, float):
            if a != pytest.approx(b, abs=1e-4 if abs(a) > 7.0 else 2e-7, rel=1e-5):
                return False
        elif a != b:
            return False
    return True


def _leaves(value: object) -> list[object]:
    if isinstance(value, tuple):
        return [len(value), *(leaf for part in value for leaf in _leaves(part))]
    if hasattr(value, "__dataclass_fields__"):
        return [leaf for name in value.__dataclass_fields__ for leaf in _leaves(getattr(value, name))]
    return [value]


def test_a_written_site_is_read_as_the_same() -> None:
    """format_site's text parses to the same site, with every table in it."""
    site = parse_site(EXAMPLE)
    again = parse_site(format_site(site))
    assert _near(again, site)
    # places are kept to 1e-9 degrees, 0.1 mm
    assert again.runway.latitude_rad == pytest.approx(site.runway.latitude_rad, abs=1e-9 * DEGREE)
    assert again.weather[0].valid_from == site.weather[0].valid_from
    assert format_site(again) == format_site(site)


@given(
    st.text(st.characters(codec="utf-8", exclude_categories=("Cs",)), min_size=1, max_size=20),
    st.floats(-90.0, 90.0),
    st.floats(-180.0, 180.0),
    st.floats(-500.0, 5000.0),
    st.floats(0.0, 359.9),
    st.none() | st.floats(-110.0, 90.0),
    st.sampled_from(["si", "aviation"]),
)
def test_any_written_site_is_read_as_the_same(
    name: str,
    latitude_deg: float,
    longitude_deg: float,
    height_m: float,
    direction_deg: float,
    separation_m: float | None,
    units: str,
) -> None:
    """Any name and any runway on Earth survive being written and read."""
    runway = Runway(latitude_deg * DEGREE, longitude_deg * DEGREE, height_m, direction_deg * DEGREE, separation_m)
    site = replace(DEMO_SITE, name=name, runway=runway, units=units)
    again = parse_site(format_site(site))
    assert again.runway.latitude_rad == pytest.approx(runway.latitude_rad, abs=2e-9 * DEGREE)
    assert again.runway.longitude_rad == pytest.approx(runway.longitude_rad, abs=2e-9 * DEGREE)
    assert again.runway.landing_compass_rad == pytest.approx(runway.landing_compass_rad, abs=2e-6 * DEGREE)
    assert again.runway.height_m == pytest.approx(height_m, abs=1e-4)
    if separation_m is None:
        assert again.runway.geoid_separation_m is None
    else:
        assert again.runway.geoid_separation_m == pytest.approx(separation_m, abs=1e-4)
    assert again.units == units
    assert again.radars[0].compass_boresight_rad == pytest.approx(270 * DEGREE, abs=2e-6 * DEGREE)
    assert again.name == name


def _swap(old: str, new: str) -> str:
    assert EXAMPLE.count(old) == 1
    return EXAMPLE.replace(old, new)


WRONG = {
    "unknown key": (_swap("width_m = 45.0", "widht_m = 45.0"), 11, ["widht_m", "perhaps width_m is meant"]),
    "unknown key of a radar": (_swap("along_m = 300.0", "distance_m = 300.0"), 19, ["distance_m", "[[radar]]"]),
    "wrong unit": (_swap("glide_path_deg = 3.0", "glide_path_rad = 0.05"), 12, ["glide_path_rad", "glide_path_deg"]),
    "length in feet": (_swap("length_m = 3000.0", "length_ft = 9842"), 10, ["length_ft", "length_m"]),
    "no unit": (_swap("height_m = 500.0", "height = 500.0"), 7, ["'height'", "height_m"]),
    "text for a number": (_swap("width_m = 45.0", 'width_m = "45"'), 11, ["width_m", "number", "'45'"]),
    "truth for a number": (_swap("width_m = 45.0", "width_m = true"), 11, ["width_m", "number"]),
    "not a number": (_swap("width_m = 45.0", "width_m = nan"), 11, ["width_m", "between"]),
    "infinite": (_swap("height_m = 500.0", "height_m = inf"), 7, ["height_m", "between"]),
    "latitude beyond the pole": (_swap("latitude_deg = 31.0          # c", "latitude_deg = 91.0 # c"), 5, ["latitude_deg", "90"]),
    "negative length": (_swap("length_m = 3000.0", "length_m = -3000.0"), 10, ["length_m", "between"]),
    "number for a text": (_swap('name = "DA"', "name = 7"), 29, ["name", "text"]),
    "radar number 0": (_swap("number = 1", "number = 0"), 18, ["number", "whole number"]),
    "radar number of a fraction": (_swap("number = 1", "number = 1.5"), 18, ["number", "whole number"]),
    "units of another kind": (_swap('units = "si"', 'units = "imperial"'), 3, ["units", "si, aviation"]),
    "unknown table": (_swap("[position]", "[postion]"), 14, ["postion", "perhaps position is meant"]),
    "unknown key at the top": ("colour = 1\n" + EXAMPLE, 1, ["colour"]),
    "name of a number": (_swap('name = "Demo field"', "name = 3"), 1, ["name", "text"]),
    "runway as a list": (_swap("[runway]", "[[runway]]"), 4, ["[runway]"]),
    "radar as one table": (_swap("[[radar]]", "[radar]"), 17, ["[[radar]]"]),
    "missing key of the runway": (_swap("longitude_deg = 104.0\n", ""), 4, ["[runway]", "longitude_deg"]),
    "missing key of a radar": (_swap("left_m = 150.0               # y\n", ""), 17, ["[[radar]]", "left_m"]),
    "polygon of two corners": (_swap(", [31.5, 103.0], [31.5, 103.5]]", ", [31.5, 103.0]]"), 44, ["polygon_deg", "three"]),
    "polygon off the Earth": (_swap("[31.5, 103.5]]", "[131.5, 103.5]]"), 44, ["polygon_deg", "90"]),
    "time that is none": (_swap('"2026-03-01T12:00:00Z"', '"noon"'), 40, ["from", "noon"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_what_is_wrong_is_named_with_its_line(kind: str) -> None:
    """A wrong key, unit, value or table is one sentence with the file's name, the line, and what was meant."""
    text, line, words = WRONG[kind]
    with pytest.raises(SiteError) as caught:
        parse_site(text, "field.toml")
    message = str(caught.value)
    assert message.startswith(f"field.toml, line {line}: ")
    for word in words:
        assert word in message
    _is_one_sentence(message)


def _is_one_sentence(message: str) -> None:
    assert "\n" not in message
    assert message.endswith(".")
    assert not re.search(r"\. [A-Z]", message)  # no second one


def test_the_line_is_the_wrong_tables_own() -> None:
    """Of two radars with the same keys, the wrong one's line is named."""
    second = "[[radar]]\nnumber = 2\nalong_m = 0.0\nleft_m = 0.0\nantenna_height_m = 3.0\nrange_sigma_m = -1.0\n"
    with pytest.raises(SiteError, match=rf"line {EXAMPLE.count(chr(10)) + 6}: range_sigma_m"):
        parse_site(EXAMPLE + second)
    third = "[[radar]]\nnumber = 3\nalong_m = 0.0\n"
    with pytest.raises(SiteError, match=rf"line {EXAMPLE.count(chr(10)) + 1}: .*lacks left_m and antenna_height_m"):
        parse_site(EXAMPLE + third)


def test_two_radars_of_one_number_are_refused() -> None:
    """Two radars cannot share a number; the sentence names it."""
    again = "[[radar]]\nnumber = 1\nalong_m = 0.0\nleft_m = 0.0\nantenna_height_m = 3.0\n"
    with pytest.raises(SiteError, match="number 1") as caught:
        parse_site(EXAMPLE + again, "field.toml")
    assert str(caught.value).startswith("field.toml")
    _is_one_sentence(str(caught.value))


def test_a_missing_runway_is_named_with_what_it_needs() -> None:
    """Without a runway there is no site, and the sentence lists the keys that it needs."""
    for text in ("", 'name = "nowhere"\n'):
        with pytest.raises(SiteError) as caught:
            parse_site(text, "field.toml")
        message = str(caught.value)
        assert message.startswith("field.toml")
        for key in ("[runway]", "latitude_deg", "longitude_deg", "height_m", "landing_direction_deg"):
            assert key in message
        _is_one_sentence(message)


@pytest.mark.parametrize("text", ["latitude = = 3", "[runway\n", "\x00", "name = 'a'\nname = 'b'\n"])
def test_what_is_not_toml_is_said_with_its_line(text: str) -> None:
    """A text that is no TOML at all is one sentence that names the file and says where reading stopped."""
    with pytest.raises(SiteError) as caught:
        parse_site(text, "field.toml")
    message = str(caught.value)
    assert message.startswith("field.toml: not TOML")
    assert re.search(r"line \d|end of document", message)
    _is_one_sentence(message)


@pytest.mark.parametrize("wrong", ["", "radius_m = 5.0\nlatitude_deg = 31.0\n", "both"])
def test_weather_is_a_circle_or_a_polygon(wrong: str) -> None:
    """An area that is neither, half of one, or both, is refused by its name."""
    circle = "latitude_deg = 31.0\nlongitude_deg = 104.0\nradius_m = 5000.0\n"
    if wrong == "both":
        wrong = circle + "polygon_deg = [[31.0, 103.0], [31.5, 103.0], [31.5, 103.5]]\n"
    with pytest.raises(SiteError, match="storm") as caught:
        parse_site(LEAST + '[[weather]]\nname = "storm"\n' + wrong, "field.toml")
    _is_one_sentence(str(caught.value))
    parse_site(LEAST + '[[weather]]\nname = "storm"\n' + circle)


@given(st.text(max_size=200))
def test_no_text_raises_anything_but_a_site_error(text: str) -> None:
    """Whatever is in the file, it is a site or a SiteError."""
    for whole in (text, LEAST + text, EXAMPLE.replace("90.0", text, 1)):
        with contextlib.suppress(SiteError):
            assert isinstance(parse_site(whole), Site)


def test_weather_alone_is_a_value() -> None:
    """An area as the program makes it is the one that the file describes."""
    area = Weather("storm", 31.0 * DEGREE, 104.0 * DEGREE, 5000.0)
    assert parse_site(format_site(replace(DEMO_SITE, weather=(area,)))).weather[0].radius_m == 5000.0


def test_how_aircraft_fly_is_read_with_units() -> None:
    """[estimation] is read key by key, degrees become radians, and what is left out stays as it is by default."""
    site = parse_site(format_site(DEMO_SITE).replace("# bank_deg = 25", "bank_deg = 35"))
    assert site.estimation == replace(Estimation(), bank_rad=math.radians(35.0))


def test_how_aircraft_fly_is_written_where_it_is_not_as_by_default() -> None:
    """Defaults are written as comments, so that they stay defaults; what was set is written and read again."""
    assert "\n# mode_lasts_s = " in format_site(DEMO_SITE)
    estimation = replace(Estimation(), mode_lasts_s=7.5, turn_rate_rps=math.radians(2.0))
    text = format_site(replace(DEMO_SITE, estimation=estimation))
    assert "\nmode_lasts_s = 7.5" in text
    assert parse_site(text).estimation.mode_lasts_s == 7.5
    assert parse_site(text).estimation.turn_rate_rps == pytest.approx(math.radians(2.0))


def test_an_acceleration_in_another_unit_is_asked_for_in_metres() -> None:
    """A wrong unit in [estimation] is one sentence that names the right key."""
    text = format_site(DEMO_SITE).replace("[estimation]", "[estimation]\ncalm_acceleration_g = 0.1")
    with pytest.raises(SiteError, match="calm_acceleration_mps2 here"):
        parse_site(text)


@pytest.mark.parametrize("until", ["2026-13-01T12:00:00Z", "2026-03-01T25:00:00Z", "tomorrow"])
def test_weather_ends_at_a_time_that_there_is(until: str) -> None:
    """A thirteenth month is no time: taken for one, the area would hold for ever."""
    circle = "latitude_deg = 31.0\nlongitude_deg = 104.0\nradius_m = 5000.0\n"
    with pytest.raises(SiteError, match="until must be a time such as") as caught:
        parse_site(LEAST + f'[[weather]]\nname = "storm"\nuntil = "{until}"\n' + circle, "field.toml")
    _is_one_sentence(str(caught.value))
