"""Unnumbered plots in the viewer: hypotheses fade with their likelihood, confirmed tracks stand out, taken plots are marked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import rerun as rr

from gateway.picture import Picture
from gateway.settings import DEMO_SITE
from gateway.sinks.scene import style
from gateway.sinks.scene.clutter import FAINTEST, STRONGEST, ClutterScene
from gateway.sinks.scene.entry import Always, Rows
from gateway.sinks.scene.flown import Flights
from gateway.sinks.scene.scope import ScopeScene
from gateway.sinks.scene.sheaf import Sheaf
from gateway.sinks.scene.sources import Positions, SourceScene
from gateway.track import Look, Tracked


def looked(picture: Picture, *looks: Look) -> Picture:
    """The picture with scans of unnumbered plots."""
    return replace(picture, track=Tracked((), 0, looks))


def look(at: int, likelihood: list[float], track: tuple[str, ...]) -> Look:
    """A scan of hypotheses in a row, and one plot that was taken, one that has no place."""
    place = np.arange(3.0 * len(likelihood)).reshape(-1, 3)
    return Look(1, at, place, np.array(likelihood), track, np.array([[1.0, 2.0, 3.0], [np.nan, 0.0, 0.0]]))


def column(rows: Rows, name: str) -> list[Any]:
    """A component's values, row by row."""
    return next(one.as_arrow_array().to_pylist() for one in rows.columns if name in str(one.component_descriptor()))


@pytest.fixture
def picture(pictures: Callable[[float], list[Picture]]) -> Picture:
    """Any."""
    return pictures(1.0)[0]


def drawn(picture: Picture) -> dict[str, Rows]:
    """Rows by the last part of their path."""
    scene = ClutterScene(DEMO_SITE)
    scans = [
        looked(picture, look(picture.now - 10, [0.9, 1.0, 0.0], ("1/100001", "", ""))),
        looked(picture, look(picture.now, [0.5], ("",))),
    ]
    return {
        one.path.removeprefix("/track/1/").removeprefix("/approach/"): one
        for one in scene.entries(scans)
        if not isinstance(one, Always)
    }


def test_hypotheses_fade_with_their_likelihood(picture: Picture) -> None:
    """The alpha of what is certain is the strongest, of what is impossible the faintest; confirmed tracks are not among them."""
    colours = column(drawn(picture)["hypotheses"], "colors")
    alphas = [[colour & 0xFF for colour in row] for row in colours]
    assert alphas == [[int(STRONGEST), int(FAINTEST)], [int((STRONGEST + FAINTEST) / 2)]]


def test_confirmed_tracks_have_their_names(picture: Picture) -> None:
    """Each with its radar track beside it; in a scan without any, none."""
    assert column(drawn(picture)["confirmed"], "labels") == [["1/100001"], []]


def test_plots_that_were_taken_and_have_a_place_are_drawn(picture: Picture) -> None:
    """One a scan here: the other has no place."""
    assert [len(row) for row in column(drawn(picture)["taken"], "positions")] == [1, 1]


def test_taken_plots_are_on_the_controller_s_screen(picture: Picture) -> None:
    """A plot that a track took stands in both of its diagrams, one that has no place in none."""
    assert [len(row) for row in column(drawn(picture)["scope/radar/1/taken"], "positions")] == [2, 2]


@pytest.mark.parametrize(("name", "colour", "segments"), [("1/0", style.UNNUMBERED, 3), ("1/3", style.RADAR, 1)])
def test_plots_without_a_number_are_dim_and_soon_gone(
    picture: Picture, name: str, colour: style.Colour, segments: int
) -> None:
    """In scene and screen they are darker than a numbered track's, and their trail is of segments of 5 s, not of a minute."""
    time = picture.now + 10**9 * np.arange(30)
    place = np.tile([-9000.0, 10.0, 400.0], (30, 1))
    heard = [Positions(True, Sheaf.of([name], [30], time, np.arange(30)), place, np.ones(30, np.bool_))]
    flights = Flights(DEMO_SITE).gather([picture])
    found = [*SourceScene(DEMO_SITE).entries([], heard), *ScopeScene(DEMO_SITE).entries(heard, flights)]
    looks = [one for one in found if isinstance(one, Always) and f"radar/{name}" in one.path]
    shades = [part.colors for one in looks for part in one.archetypes if isinstance(part, rr.Points3D | rr.Points2D)]
    red, green, blue = colour[:3]
    assert {one.as_arrow_array().to_pylist()[0] >> 8 for one in shades} == {red << 16 | green << 8 | blue}
    assert len({one.path for one in looks if "/trail/" in one.path}) == segments


def test_of_a_silent_radar_nothing_is_left(picture: Picture) -> None:
    """Fifteen seconds after its last scan what was drawn of it is cleared, once."""
    scene = ClutterScene(DEMO_SITE)
    scene.entries([replace(looked(picture, look(picture.now, [0.5], ("",))), now=picture.now)])
    later = [replace(picture, now=picture.now + seconds * 10**9) for seconds in (10, 16, 30)]
    assert [len(scene.entries([one])) for one in later] == [0, 4, 0]
