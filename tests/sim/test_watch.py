"""The radar that watches: what it says of aircraft whose positions it hears."""

import math
from dataclasses import replace

import numpy as np
import pytest

from adapters.landing_radar import Datagram, Plot, decode
from gateway.frames import polar_from_xyz
from gateway.observation import GpsReport, Heard, Observation, Timing, Truth
from gateway.settings import DEMO_SITE, RadarSite
from sim.radars import RadarSight
from sim.scenes import build_scene
from sim.scenes.placement import usual_radar
from sim.sensors import RadarParameters
from sim.watch import WatchingRadar, watch

START_NS = 1_800_000_000_000_000_000
SCENE = build_scene("landing", start_ns=START_NS)
RADAR = usual_radar(DEMO_SITE, 3)
EXACT = RadarParameters(
    range_sigma_m=0.0, azimuth_sigma_rad=0.0, elevation_sigma_rad=0.0, missing_range=0.0, missing_azimuth=0.0,
    missing_elevation=0.0,
)  # fmt: skip


def _truths(times: np.ndarray, aircraft: str = "mavlink:1", **changes: object) -> list[Truth]:
    flown = SCENE.flown(SCENE.aircraft[0], times)
    rows = []
    for index, time_s in enumerate(times):
        at = START_NS + round(time_s * 1e9)
        east, north, up = flown.velocity_mps[index]
        place = (float(flown.latitude_rad[index]), float(flown.longitude_rad[index]))
        row = Truth(aircraft, at, at + 30_000_000, *place, None, float(flown.height_m[index]), east, north, up)
        rows.append(replace(row, **changes))
    return rows


def _reports(times: np.ndarray, off_m: float = 0.0) -> list[GpsReport]:
    return [
        GpsReport(
            row.aircraft,
            row.valid_at,
            row.received_at,
            row.latitude_rad,
            row.longitude_rad,
            height_m=(row.height_m or 0.0) + off_m,
        )
        for row in _truths(times)
    ]


def _plots(observations: list, parameters: RadarParameters = EXACT, radar: RadarSite = RADAR) -> list[Plot]:
    watching = WatchingRadar(DEMO_SITE, radar, parameters)
    datagrams = [decode(data) for _, data in watch([Heard(0, (one,)) for one in observations], watching)]
    assert all(isinstance(one, Datagram) and one.header.radar == radar.number for one in datagrams)
    return [record for one in datagrams for record in one.records if isinstance(record, Plot)]


def _expected(plots: list[Plot]) -> np.ndarray:
    times = np.array([(plot.time - START_NS) / 1e9 for plot in plots])
    position, _ = RadarSight(DEMO_SITE, RADAR).see(SCENE.flown(SCENE.aircraft[0], times))
    return polar_from_xyz(position)


def test_it_sees_the_aircraft_where_it_is() -> None:
    """Between truths 0.1 s apart an exact radar is right to the wire's step."""
    plots = _plots(_truths(np.arange(100.0, 130.0, 0.1)))
    expected = _expected(plots)
    assert len(plots) == 75
    assert [plot.range_m for plot in plots] == pytest.approx(expected[:, 0], abs=0.02)
    assert np.radians([plot.azimuth_deg for plot in plots]) == pytest.approx(expected[:, 1], abs=1e-6)
    assert np.radians([plot.elevation_deg for plot in plots]) == pytest.approx(expected[:, 2], abs=1e-6)


def test_it_interpolates_with_velocities() -> None:
    """Between truths 2 s apart in a turn it is right to 0.2 m, by the velocities on both sides."""
    plots = _plots(_truths(np.arange(60.0, 160.0, 2.0)))
    assert [plot.range_m for plot in plots] == pytest.approx(_expected(plots)[:, 0], abs=0.2)


def test_it_lives_in_the_aircrafts_time() -> None:
    """Scans are at multiples of the period of the aircraft's clock, whatever the receiver's clock says."""
    shifted = [replace(row, received_at=row.received_at + 10**18) for row in _truths(np.arange(100.0, 110.0, 0.1))]
    plots = _plots(shifted)
    assert [plot.time % 400_000_000 for plot in plots] == [0] * 25


def test_datagrams_go_out_when_their_news_has_come() -> None:
    """Each datagram is stamped with the arrival of the position that made it due, in order, in steps of 4 us."""
    rows = _truths(np.arange(100.0, 110.0, 0.1))
    sent = list(watch([Heard(0, (row,)) for row in rows], WatchingRadar(DEMO_SITE, RADAR, EXACT)))
    stamps = [at for at, _ in sent]
    assert stamps == sorted(set(stamps))
    assert all(at % 4000 == 0 for at in stamps)
    due = [row.received_at for row in rows]
    assert all(min(abs(at - one) for one in due) < 50_000 for at in stamps)


def test_truth_wins_over_reports() -> None:
    """Where an aircraft says the truth, its reports, 50 m higher, are not looked at."""
    times = np.arange(100.0, 120.0, 0.2)
    mixed: list[Observation] = [
        one for pair in zip(_truths(times), _reports(times + 0.05, off_m=50.0), strict=True) for one in pair
    ]
    plots = _plots(mixed)
    assert np.radians([plot.elevation_deg for plot in plots]) == pytest.approx(_expected(plots)[:, 2], abs=1e-6)


def test_reports_serve_where_there_is_no_truth() -> None:
    """An aircraft that says no truth is seen where it says it is; one report a second and no velocity is enough."""
    plots = _plots(_reports(np.arange(100.0, 160.0, 1.0)))
    assert len(plots) > 140
    assert [plot.range_m for plot in plots] == pytest.approx(_expected(plots)[:, 0], abs=0.5)


def test_reports_of_an_unknown_time_are_not_looked_at() -> None:
    """A report whose clock is not set yet tells no place at a time."""
    early = [replace(row, timing=Timing.PROVISIONAL) for row in _reports(np.arange(100.0, 110.0, 1.0))]
    assert _plots(early) == []


def test_a_silent_aircraft_is_lost() -> None:
    """An aircraft that falls silent flies on straight for 2 s and is then not seen any more."""
    other = _truths(np.arange(100.0, 130.0, 0.1), aircraft="mavlink:2")
    silent = [row for row in _truths(np.arange(100.0, 110.0, 0.1)) if row.valid_at <= START_NS + 110 * 10**9]
    plots = _plots(sorted([*silent, *other], key=lambda row: row.valid_at))
    by_number = {number: [plot.time for plot in plots if plot.track_number == number] for number in (1, 2)}
    assert max(by_number[1]) <= START_NS + 112 * 10**9
    assert max(by_number[2]) > START_NS + 129 * 10**9


def test_a_clock_that_jumps_begins_anew() -> None:
    """A jump of the aircraft's clock by months makes no scans in between, and the radar goes on after it."""
    before = _truths(np.arange(100.0, 105.0, 0.1))
    jump = 90 * 86_400 * 10**9
    for sign in (-1, 1):
        after = [replace(row, valid_at=row.valid_at + sign * jump) for row in _truths(np.arange(105.0, 110.0, 0.1))]
        plots = _plots([*before, *after])
        assert 20 <= len(plots) <= 26
        assert len({plot.time // jump for plot in plots}) >= 2


def test_an_altitude_is_lifted_by_the_sites_geoid() -> None:
    """Truth that is known above mean sea level only is brought to the ellipsoid by the site's separation."""
    times = np.arange(100.0, 110.0, 0.1)
    lowered = [replace(row, altitude_msl_m=(row.height_m or 0.0) + 35.0, height_m=None) for row in _truths(times)]
    assert _plots(lowered) == _plots(_truths(times))


def test_the_same_recording_gives_the_same_bytes() -> None:
    """Seed and recording decide every byte; another seed gives other noise."""
    heard = [Heard(0, (row,)) for row in _truths(np.arange(100.0, 110.0, 0.1))]
    first, again, other = (list(watch(heard, WatchingRadar(DEMO_SITE, RADAR, seed=seed))) for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_its_noise_is_the_sites() -> None:
    """Unless told otherwise the radar is as noisy as its site says."""
    radar = replace(RADAR, range_sigma_m=50.0, azimuth_sigma_rad=0.01)
    watching = WatchingRadar(DEMO_SITE, radar, seed=5)
    heard = [Heard(0, (row,)) for row in _truths(np.arange(0.0, 400.0, 0.4))]
    plots = [
        record for _, data in watch(heard, watching) if isinstance(one := decode(data), Datagram)
        for record in one.records if isinstance(record, Plot) and record.range_m and record.azimuth_deg is not None
    ]  # fmt: skip
    expected = _expected(plots)
    errors = np.array([plot.range_m for plot in plots]) - expected[:, 0]
    turns = np.radians([plot.azimuth_deg for plot in plots]) - expected[:, 1]
    assert np.std(errors) == pytest.approx(50.0, abs=4 * 50.0 / math.sqrt(2 * len(plots)))
    assert np.std(turns) == pytest.approx(0.01, abs=4 * 0.01 / math.sqrt(2 * len(plots)))
