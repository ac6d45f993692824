"""A radar's plots as known places of a flight: those of the aircraft tie its path, clutter and other aircraft do not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import polar_from_xyz
from gateway.observation import RadarPlot
from gateway.offline.reconstruction import How, Sortie, reconstructed
from gateway.offline.sightings import Sightings, View, views
from gateway.register import Remembered, RememberedRadar
from gateway.settings import RadarSite, Runway, Site
from sim.studies.reconstruction_wind import LIFT_OFF, START_NS, Windy, windy

Floats = NDArray[np.float64]

RADAR = RadarSite(1, -200.0, 150.0, 3.0, math.radians(90.0))
SITE = Site("field", Runway(*LIFT_OFF, height_m=0.0, landing_compass_rad=math.radians(270.0)), radars=(RADAR,))
AIRBORNE_S = (25.0, 600.0)


@pytest.fixture(scope="module")
def flown() -> Windy:
    """Ten minutes in a wind that wanders."""
    return windy(7)


def _plots(flown: Windy, number: int, seed: int, *, clutter: int = 0, **too_much: float) -> list[RadarPlot]:
    """A plot a second of the aircraft, of which a fifth lack the elevation, and clutter within five kilometres."""
    random = np.random.default_rng(seed)
    (view,) = views(_seen([RadarPlot(1, 0, START_NS, START_NS, 1.0, 0.0, 0.0)]), SITE, None)
    found = []
    for second in np.arange(*AIRBORNE_S):
        at = START_NS + int(second * SECOND)
        place = np.array([np.interp(at, flown.time, axis) for axis in flown.place_m.T])
        others = random.uniform(-5000.0, 5000.0, (clutter, 2))
        for which, level in enumerate([place, *others]):
            polar = polar_from_xyz(view.frame.from_enu(np.append(level, 5.0)))
            polar = polar + random.normal(0.0, 1.0, 3) * [15.0, 0.001, 0.001]
            polar[0] += too_much.get("range_m", 0.0)
            elevation = None if random.uniform() < 0.2 else float(polar[2])
            found.append(RadarPlot(1, 0 if which else number, at, at, float(polar[0]), float(polar[1]), elevation))
    return found


def _seen(plots: list[RadarPlot]) -> Sightings:
    sightings = Sightings()
    for plot in plots:
        sightings.take(plot)
    return sightings


def _rebuilt(flown: Windy, seen: list[View], tracks: tuple[str, ...] = ()) -> tuple[Sortie, float]:
    (sortie,) = reconstructed(flown.told, How(lift_off=LIFT_OFF, close_on="nothing"), seen, tracks)
    place = np.stack([np.interp(sortie.time, flown.time, axis) for axis in flown.place_m.T], axis=-1)
    off = sortie.path_m - (place - place[0])
    return sortie, math.sqrt(float(np.mean(np.sum(off**2, axis=1))))


def test_a_numbered_track_ties_the_path(flown: Windy) -> None:
    """Open it is kilometres off, tied ten metres; the sigma says so."""
    sortie, off_m = _rebuilt(flown, views(_seen(_plots(flown, 3, 1)), SITE, None))
    assert sortie.radar is not None
    assert sortie.radar.tracks == ("1/3",)
    assert sortie.radar.used > 0.95 * sortie.radar.of
    assert off_m < 15.0
    assert 3.0 < sortie.sigma_m.max() < 60.0


def test_unnumbered_plots_in_clutter_are_found_and_the_clutter_is_refused(flown: Windy) -> None:
    """Ten clutter plots to each of the aircraft's: of those used nearly all are its own."""
    sortie, off_m = _rebuilt(flown, views(_seen(_plots(flown, 0, 2, clutter=10)), SITE, None))
    assert sortie.radar is not None
    own = sortie.radar.of / 11
    assert 0.9 * own < sortie.radar.used < 1.05 * own
    assert off_m < 20.0


def test_another_aircraft_s_track_is_refused(flown: Windy) -> None:
    """No wind carries this aircraft along the path of another: nothing is used, and it says why."""
    seen = views(_seen(_plots(windy(8), 3, 3)), SITE, None)
    for tracks in ((), ("1/3",)):
        sortie, _ = _rebuilt(flown, seen, tracks)
        assert sortie.radar is not None
        assert sortie.radar.used == 0
        assert sortie.radar.doubt is not None
        assert np.isnan(sortie.sigma_m).all()


def test_of_two_tracks_the_aircraft_s_own_is_taken(flown: Windy) -> None:
    """Another aircraft in the same sky changes nothing."""
    plots = _plots(flown, 3, 1)
    alone, _ = _rebuilt(flown, views(_seen(plots), SITE, None))
    sortie, off_m = _rebuilt(flown, views(_seen(plots + _plots(windy(8), 4, 3)), SITE, None))
    assert sortie.radar is not None
    assert alone.radar is not None
    assert sortie.radar.tracks == ("1/3",)
    assert sortie.radar.used == alone.radar.used
    assert off_m < 15.0


def test_ranges_alone_tie_with_the_rest(flown: Windy) -> None:
    """Half of the plots without an azimuth: a range is one row of the least squares."""
    plots = [replace(plot, azimuth_rad=None) if row % 2 else plot for row, plot in enumerate(_plots(flown, 3, 1))]
    sortie, off_m = _rebuilt(flown, views(_seen(plots), SITE, None))
    assert sortie.radar is not None
    assert sortie.radar.used > 0.95 * sortie.radar.of
    assert off_m < 15.0


def test_what_a_session_learnt_of_its_radar_is_taken_off(flown: Windy) -> None:
    """200 m too much range: taken off, the plots are those without it."""
    learnt = RememberedRadar(
        1, -200.0, 150.0, 3.0, math.radians(90.0), (200.0, None, None, None), (5.0, None, None, None)
    )
    remembered = Remembered(START_NS, *LIFT_OFF, SITE.runway.landing_compass_rad, (learnt,))
    (straight,) = views(_seen(_plots(flown, 3, 1)), SITE, None)
    (corrected,) = views(_seen(_plots(flown, 3, 1, range_m=200.0)), SITE, remembered)
    np.testing.assert_allclose(corrected.polar, straight.polar, atol=1e-9)
