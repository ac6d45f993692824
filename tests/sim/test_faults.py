"""What each fault of a scene file puts on the wire, from its second until its end, and on whose wire."""

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from adapters.landing_radar import Datagram, Plot, Status, decode
from adapters.mavlink_frames import message_name, parse
from gateway.geodesy import geodetic_to_ecef
from sim.airborne import reports
from sim.events import events
from sim.radars import sightings
from sim.scene import Scene, Sent
from sim.scenes import parse_scene, stage
from sim.sensors import GpsMeasured

START_NS = 1_800_000_000_000_000_000
WORLD = """
[scene]
description = "Two aircraft under one radar."
duration_s = 24.0
[gps]
period_s = 0.5
latency_low_s = 0.0
latency_high_s = 0.0
[[vehicle]]
route = "approach"
[[vehicle]]
route = "approach"
begin_s = -30.0
"""


def scene(kind: str = "", **said: object) -> Scene:
    """The world with one fault from 8 s until 16 s."""
    lines = [f"{key} = {repr(value).replace(chr(39), chr(34))}" for key, value in said.items()]
    fault = "\n".join(["[[fault]]", f'kind = "{kind}"', "at_s = 8.0", "until_s = 16.0", *lines]) if kind else ""
    return stage(parse_scene(WORLD + fault, "test", Path(), "test"), start_ns=START_NS, seed=3)


def seconds(sent: Sent) -> float:
    """When it arrives, seconds of the scene."""
    return (sent.at - START_NS) / 1e9


def on(link: str, given: Scene) -> list[Sent]:
    """What arrives on one link."""
    return [one for one in events(given) if one.link == link]


def frames(given: Scene, name: str, system: int = 1) -> list[tuple[float, bytes]]:
    """Arrival and payload of the messages of one name."""
    found = []
    for sent in on(f"mavlink:{system}", given):
        frame = parse(sent.data)
        assert frame is not None
        if message_name(frame.message) == name:
            found.append((seconds(sent), frame.payload))
    return found


def scans(given: Scene) -> list[tuple[float, Datagram]]:
    """Arrival and content of the radar's datagrams."""
    read = [(seconds(sent), decode(sent.data)) for sent in on("radar:1", given)]
    return [(at, one) for at, one in read if isinstance(one, Datagram)]


def off_m(given: Scene, measured: GpsMeasured) -> np.ndarray:
    """Of the first aircraft's reports: east, north, up from what they were without a fault (n, 3)."""
    usual = reports(scene(), given.aircraft[0])
    here, there = (
        np.asarray(geodetic_to_ecef(one.latitude_rad, one.longitude_rad, one.height_m)) for one in (measured, usual)
    )
    longitude, latitude = usual.longitude_rad, usual.latitude_rad
    d = here - there
    east = -np.sin(longitude) * d[:, 0] + np.cos(longitude) * d[:, 1]
    outwards = np.cos(longitude) * d[:, 0] + np.sin(longitude) * d[:, 1]
    north = -np.sin(latitude) * outwards + np.cos(latitude) * d[:, 2]
    return np.stack([east, north, np.cos(latitude) * outwards + np.sin(latitude) * d[:, 2]], axis=-1)


def during(times: np.ndarray) -> np.ndarray:
    """Whether the fault lasts."""
    return (times >= 8.0) & (times < 16.0)


def test_a_receiver_without_a_fix_says_so() -> None:
    """GPS_RAW_INT goes on with fix type 1, there is no GLOBAL_POSITION_INT, and the other aircraft has its fix."""
    lost = scene("gps lost", vehicle=1)
    fixes = [(at, payload[28]) for at, payload in frames(lost, "GPS_RAW_INT")]
    assert {fix for at, fix in fixes if 8.0 < at < 16.0} == {1}
    assert {fix for at, fix in fixes if not 8.0 <= at <= 16.0} == {3}
    assert not [at for at, _ in frames(lost, "GLOBAL_POSITION_INT") if 8.01 < at < 16.0]
    assert {payload[28] for _, payload in frames(lost, "GPS_RAW_INT", 2)} == {3}


def test_a_silent_source_says_nothing() -> None:
    """No report arrives, while heartbeats go on."""
    lost = scene("gps lost", shows="silence")
    for system in (1, 2):
        assert not [at for at, _ in frames(lost, "GPS_RAW_INT", system) if 8.01 < at < 16.0]
        assert len([at for at, _ in frames(lost, "HEARTBEAT", system) if 8.0 <= at < 16.0]) == 8


def test_a_frozen_source_repeats_its_last_report() -> None:
    """Position and velocity are those of the last report before, and its times go on."""
    given = scene("gps frozen", vehicle=1)
    measured = reports(given, given.aircraft[0])
    frozen = during(measured.valid_s)
    last = int(np.argmax(frozen)) - 1
    assert frozen.sum() == 16
    assert np.all(measured.latitude_rad[frozen] == measured.latitude_rad[last])
    assert np.all(measured.velocity_mps[frozen] == measured.velocity_mps[last])
    assert np.all(np.diff(measured.valid_s) > 0.4)
    assert len(np.unique(measured.longitude_rad)) == len(frozen) - 16


def test_a_spoofed_source_jumps_and_walks_away() -> None:
    """50 m to the east at once, 4 m/s further, and 2 m/s up; velocities tell of the walk; nothing else is changed."""
    given = scene("gps spoofed", vehicle=1, step_m=50.0, walks_mps=4.0, direction_deg=90.0, climbs_mps=2.0)
    measured, usual = (reports(one, one.aircraft[0]) for one in (given, scene()))
    lasts = during(measured.valid_s)
    since = np.where(lasts, measured.valid_s - 8.0, 0.0)
    wanted = np.stack([np.where(lasts, 50.0 + 4.0 * since, 0.0), 0.0 * since, 2.0 * since], axis=-1)
    assert off_m(given, measured) == pytest.approx(wanted, abs=0.02)
    moved = measured.velocity_mps - usual.velocity_mps
    assert moved[lasts] == pytest.approx(np.tile([4.0, 0.0, 2.0], (lasts.sum(), 1)), abs=1e-9)
    assert not moved[~lasts].any()


def test_a_source_gets_noisier() -> None:
    """Four times the noise is four times the same errors, and only while it lasts."""
    usual, noisy = (reports(one, one.aircraft[0]) for one in (scene(), scene("gps noise", sigma_m=60.0)))
    flown = scene().flown(scene().aircraft[0], usual.valid_s)
    more, less = noisy.height_m - flown.height_m - 28.0, usual.height_m - flown.height_m - 28.0
    assert more == pytest.approx(np.where(during(usual.valid_s), 4.0, 1.0) * less, abs=1e-6)


def test_velocities_are_of_another_unit() -> None:
    """Twice as fast while it lasts, of one aircraft; positions are as they were."""
    given = scene("gps velocity", vehicle=1, times=2.0)
    for number, times in ((0, 2.0), (1, 1.0)):
        told, usual = (reports(one, one.aircraft[number]) for one in (given, scene()))
        wanted = np.where(during(usual.valid_s), times, 1.0)[:, None] * usual.velocity_mps
        assert told.velocity_mps == pytest.approx(wanted)
        assert np.array_equal(told.latitude_rad, usual.latitude_rad)


def test_a_radar_that_is_off_sends_nothing() -> None:
    """Neither scans nor status, and both again afterwards."""
    times = [at for at, _ in scans(scene("radar off"))]
    assert not [at for at in times if 8.03 < at < 16.0]
    assert [at for at in times if at > 16.0]
    assert {one.header.kind for at, one in scans(scene("radar off")) if at > 16.0} == {"plots", "status"}


def test_a_radar_loses_components() -> None:
    """Every plot lacks them while it lasts and has them otherwise, for the most part."""
    given = scene("radar component lost", component=["azimuth", "elevation"])
    plots = [(at - 0.02, plot) for at, one in scans(given) for plot in one.records if isinstance(plot, Plot)]
    blind = [plot for at, plot in plots if 8.0 <= at < 15.99]
    assert blind
    assert all(plot.azimuth_deg is None and plot.elevation_deg is None for plot in blind)
    assert all(plot.range_m is not None for plot in blind)
    assert (
        Counter(plot.azimuth_deg is None for at, plot in plots if not 8.0 <= at < 15.99).most_common(1)[0][0] is False
    )


def test_a_radar_measures_too_much() -> None:
    """100 m and a degree to the left, of every plot while it lasts."""
    usual, wrong = (
        sightings(one, one.radars[0])[0][2].polar
        for one in (scene(), scene("radar error", range_error_m=100.0, azimuth_error_deg=1.0))
    )
    lasts = during(np.arange(len(usual)) * 0.4)
    known = np.isfinite(usual).all(axis=-1)
    assert wrong[known & lasts] - usual[known & lasts] == pytest.approx(
        np.tile([100.0, math.radians(1.0), 0.0], ((known & lasts).sum(), 1)), abs=1e-9
    )
    assert np.array_equal(wrong[~lasts], usual[~lasts], equal_nan=True)


@pytest.mark.parametrize(("status", "turned_deg"), [("stale", 0.0), ("new", 2.0)])
def test_a_moved_radar_sees_from_elsewhere(status: str, turned_deg: float) -> None:
    """Plots are those of a radar 500 m nearer that is turned by 2 degrees; its status tells so, or does not."""
    given = scene("radar moved", along_m=-500.0, turned_deg=2.0, status=status)
    usual, moved = (sightings(one, one.radars[0])[0][2].polar for one in (scene(), given))
    lasts = during(np.arange(len(usual)) * 0.4)
    by = np.nanmedian((moved - usual)[lasts], axis=0)
    assert by[0] == pytest.approx(-500.0, abs=10.0)
    # turned clockwise, everything is further to the left; 500 m nearer, what is 6 km aside is further aside
    assert math.degrees(by[1]) == pytest.approx(2.0 - math.degrees(6000 / 49500 - 6000 / 50000), abs=0.03)
    assert np.array_equal(moved[~lasts], usual[~lasts], equal_nan=True)
    told = {
        round(record.boresight_deg, 2)
        for at, one in scans(given)
        for record in one.records
        if isinstance(record, Status) and 8.1 < at < 16.0
    }
    assert told == {270.0 + turned_deg}


def test_a_radars_clock_jumps() -> None:
    """Stamps are 2 s late while it lasts; arrivals stay."""
    errors = [
        (at, (one.header.time - START_NS) / 1e9 - (at - 0.02))
        for at, one in scans(scene("clock jump", radar=1, by_s=2.0))
    ]
    assert {round(error, 2) for at, error in errors if 8.03 < at < 16.0} == {2.0}
    assert {round(error, 2) for at, error in errors if not 8.0 <= at <= 16.03} == {0.0}


def test_a_vehicles_clock_jumps() -> None:
    """SYSTEM_TIME's UTC is an hour back, its time since boot goes on; the radar's stamps stay."""
    given = scene("clock jump", vehicle=1, by_s=-3600.0)
    times = [(at, *np.frombuffer(payload[:12], "<u8,<u4")[0].tolist()) for at, payload in frames(given, "SYSTEM_TIME")]
    ahead = {(8.0 <= at < 16.0, round(usec / 1e6 - START_NS / 1e9 - at)) for at, usec, _ in times}
    assert ahead == {(True, -3600), (False, 0)}
    assert all(later[2] - before[2] == 1000 for before, later in pairwise(times))
    assert [one.data for one in on("radar:1", given)] == [one.data for one in on("radar:1", scene())]


def test_a_cut_link_is_silent() -> None:
    """Nothing arrives from aircraft 1; aircraft 2 and the radar are heard as without the fault."""
    given = scene("link cut", vehicle=1)
    assert not [one for one in on("mavlink:1", given) if 8.001 < seconds(one) < 16.0]
    for other in ("mavlink:2", "radar:1"):
        assert [one.data for one in on(other, given)] == [one.data for one in on(other, scene())]


def test_a_lossy_link_loses_its_share() -> None:
    """About 40 % of the frames, which are missing in the sequence; all other frames are the same bytes."""
    kept, usual = (
        {one.data: seconds(one) for one in on("mavlink:1", given)}
        for given in (scene("link lossy", vehicle=1, share=0.4), scene())
    )
    lost = [at for data, at in usual.items() if data not in kept]
    assert set(kept) <= set(usual)
    assert all(8.0 <= at < 16.001 for at in lost)
    sent = sum(8.0 <= at < 16.0 for at in usual.values())
    assert len(lost) / sent == pytest.approx(0.4, abs=4.0 * math.sqrt(0.24 / sent))


def test_a_late_link_delays_and_mixes() -> None:
    """The same frames, half a second to one and a half later and out of order; but SIM_STATE, which has no time of its own."""
    late, usual = (on("mavlink:1", given) for given in (scene("link late", vehicle=1, by_s=0.5, spread_s=1.0), scene()))
    when = {one.data: seconds(one) for one in usual}
    delays = [(one.data, seconds(one) - when[one.data]) for one in late if 8.0 <= when[one.data] < 16.0]
    assert Counter(one.data for one in late) == Counter(one.data for one in usual)
    truths = {data for data, _ in delays if message_name(parse(data).message) == "SIM_STATE"}
    assert all(abs(delay) < 1e-3 for data, delay in delays if data in truths)
    others = [delay for data, delay in delays if data not in truths]
    assert min(others) > 0.499
    assert max(others) < 1.501
    numbers = [one.data[4] for one in late if one.data not in truths]
    assert any((later - before) % 256 > 128 for before, later in pairwise(numbers))


def test_a_doubled_link_says_things_twice() -> None:
    """Every datagram of the radar comes again after 0.3 s while it lasts."""
    twice = on("radar:1", scene("link doubled", radar=1, share=1.0, after_s=0.3))
    times: dict[bytes, list[float]] = {}
    for one in twice:
        times.setdefault(one.data, []).append(seconds(one))
    assert {len(at) for at in times.values() if 8.03 < at[0] < 15.99} == {2}
    assert all(at[1] - at[0] == pytest.approx(0.3, abs=1e-4) for at in times.values() if len(at) == 2)
    assert {len(at) for at in times.values() if not 8.0 <= at[0] <= 16.03} == {1}
