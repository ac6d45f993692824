"""Scenes on the wires: in order, reproducible, valid by the gateway's own decoders, and true."""

import math
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.landing_radar import Datagram, Plot, decode
from adapters.mavlink_frames import message_name, parse
from gateway.geodesy import geodetic_to_ecef
from gateway.observation import Attitude, GpsReport, RadarPlot, RadarStatus, Timing, Truth
from gateway.settings import DEMO_SITE
from sim.airborne import reports
from sim.events import events, truth
from sim.radars import sightings
from sim.scene import Scene, Sent
from sim.scenes import build_scene

START_NS = 1_800_000_000_123_000_000
SHORT = ("duration_s=40",)


def _scene(name: str = "approach", *changes: str, seed: int = 1) -> Scene:
    return build_scene(name, start_ns=START_NS, seed=seed, changes=[*SHORT, *changes])


def _heard(scene: Scene) -> list:
    """Every observation of a scene, decoded as the gateway does."""
    sources = [
        Source(number, "radar" if name.startswith("radar") else "mavlink", name.replace(":", "-"), name)
        for number, name in enumerate(scene.links)
    ]
    decoder = Decoder(sources)
    numbers = {source.origin: source.number for source in sources}
    found = []
    for event in events(scene):
        heard = decoder.feed(Arrival(event.at, numbers[event.link], event.data))
        assert decoder.refused is None
        found += heard.observations
    bad = [reason for reason in decoder.counters() if not reason.endswith((" frames", " datagrams"))]
    assert not bad
    return found


def _names(sent: list[Sent]) -> Counter[str]:
    frames = [parse(event.data) for event in sent if event.link.startswith("mavlink")]
    return Counter(message_name(frame.message) for frame in frames if frame is not None)


@pytest.mark.parametrize("name", ["approach", "traffic", "links"])
def test_events_arrive_in_order(name: str) -> None:
    """Stamps are strictly increasing multiples of 4 us over all links, within the scene's duration."""
    scene = _scene(name, "radars=2")
    stamps = [event.at for event in events(scene)]
    assert all(before < after for before, after in pairwise(stamps))
    assert all(stamp % 4000 == 0 for stamp in stamps)
    assert stamps[0] >= START_NS
    assert stamps[-1] <= START_NS + 40 * 10**9 + 10**6


def test_a_seed_decides_every_byte() -> None:
    """The same scene gives the same bytes; another seed gives others of the same kinds."""
    first, again, other = (list(events(_scene("traffic", "duration_s=8", seed=seed))) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert set(_names(first)) == set(_names(other))


def test_a_change_of_one_sensor_leaves_the_others_bytes() -> None:
    """Another GPS noise changes no datagram of the radar; another radar changes no frame of the aircraft."""

    def bytes_of(kind: str, *changes: str) -> list[bytes]:
        return [event.data for event in events(_scene("approach", *changes)) if event.link.startswith(kind)]

    assert bytes_of("radar") == bytes_of("radar", "gps.sigma_m=3", "gps.period_s=1")
    assert bytes_of("mavlink") == bytes_of("mavlink", "radar.range_sigma_m=3", "radar.clutter_per_scan=4")
    assert bytes_of("radar") != bytes_of("radar", "radar.range_sigma_m=3")


def test_aircraft_say_everything_at_their_rates() -> None:
    """In 40 s: 40 heartbeats and times, 160 attitudes and truths, 8 positions of which 8 have arrived."""
    assert _names(list(events(_scene()))) == {
        "HEARTBEAT": 40,
        "SYSTEM_TIME": 40,
        "ATTITUDE": 160,
        "SIM_STATE": 160,
        "GPS_RAW_INT": 8,
        "GLOBAL_POSITION_INT": 8,
    }


def test_sequence_numbers_have_no_gap() -> None:
    """Each aircraft's frames are numbered in their order of arrival."""
    numbers = [event.data[4] for event in events(_scene()) if event.link == "mavlink:1"]
    assert all(after == (before + 1) % 256 for before, after in pairwise(numbers))


def test_positions_decode_to_what_the_source_measured() -> None:
    """Reports keep their time of validity, arrive at their latency, and are the measured positions to the wire's step."""
    scene = _scene("approach", "gps.period_s=1")
    measured = reports(scene, scene.aircraft[0])
    heard = sorted((one for one in _heard(scene) if isinstance(one, GpsReport)), key=lambda one: one.valid_at)
    settled = [one for one in heard if one.timing is Timing.UTC]
    assert len(settled) >= 37
    for one in settled:
        index = round((one.valid_at - START_NS) / 1e9 - 0.13)
        assert one.valid_at == START_NS + round(measured.valid_s[index] * 1e9)
        assert one.received_at == pytest.approx(START_NS + measured.received_s[index] * 1e9, abs=50_000)
        assert one.latitude_rad == pytest.approx(measured.latitude_rad[index], abs=1e-9)
        assert one.longitude_rad == pytest.approx(measured.longitude_rad[index], abs=1e-9)
        assert one.altitude_msl_m == pytest.approx(measured.height_m[index] + 35.0, abs=1e-3)
        assert one.velocity_north_mps == pytest.approx(measured.velocity_mps[index, 1], abs=0.006)
        assert one.velocity_up_mps == pytest.approx(measured.velocity_mps[index, 2], abs=0.006)


def test_truth_on_the_wire_is_the_truth() -> None:
    """SIM_STATE decodes to the true position of its instant within 2 cm, and its velocity."""
    scene = _scene()
    rows = [one for one in _heard(scene) if isinstance(one, Truth)]
    assert len(rows) == 160
    flown = scene.flown(scene.aircraft[0], np.array([(one.valid_at - START_NS) / 1e9 for one in rows]))
    said = geodetic_to_ecef(
        [one.latitude_rad for one in rows],
        [one.longitude_rad for one in rows],
        [one.altitude_msl_m - 35.0 for one in rows],
    )
    real = geodetic_to_ecef(flown.latitude_rad, flown.longitude_rad, flown.height_m)
    assert np.max(np.linalg.norm(said - real, axis=-1)) < 0.02
    assert [one.velocity_east_mps for one in rows] == pytest.approx(flown.velocity_mps[:, 0], abs=1e-4)


def test_attitude_on_the_wire_is_the_truths() -> None:
    """ATTITUDE decodes to roll, pitch and yaw of its instant."""
    scene = _scene("landing", "duration_s=100")
    rows = [one for one in _heard(scene) if isinstance(one, Attitude)][200:]
    flown = scene.flown(scene.aircraft[0], np.array([(one.valid_at - START_NS) / 1e9 for one in rows]))
    assert [one.roll_rad for one in rows] == pytest.approx(flown.roll_rad, abs=1e-5)
    assert np.max(np.abs(flown.roll_rad)) > 0.05
    assert np.cos([one.yaw_rad for one in rows] - flown.yaw_rad) == pytest.approx(np.ones(len(rows)))


def test_truth_of_the_scene_has_every_aircraft_and_mode() -> None:
    """The truth's rows cover each aircraft's presence, with velocities that are its differences."""
    scene = build_scene("traffic", start_ns=START_NS, changes=["duration_s=200"])
    rows = list(truth(scene))
    assert {row.aircraft for row in rows} == {
        one.name for one in scene.aircraft if scene.present(one)[1] > scene.present(one)[0]
    }
    assert {row.mode for row in rows} == {"straight", "left", "right"}
    first = [row for row in rows if row.aircraft == "mavlink:1"][:200]
    height = np.array([row.height_m for row in first])
    climb = np.array([row.velocity_up_mps for row in first])
    assert (height[2:] - height[:-2]) / 0.5 == pytest.approx(climb[1:-1], abs=0.02)


def test_plots_decode_to_what_the_radar_measured() -> None:
    """Each scan's plot has the scan's time, the aircraft's number, and the measured components to the wire's step."""
    scene = _scene()
    [(number, _, measured)] = sightings(scene, scene.radars[0])
    plots = [one for one in _heard(scene) if isinstance(one, RadarPlot)]
    assert len(plots) == np.sum(measured.seen)
    for plot, polar in zip(plots, measured.polar[measured.seen], strict=True):
        said = (plot.range_m, plot.azimuth_rad, plot.elevation_rad)
        assert plot.track_number == number == 1
        assert (plot.valid_at - START_NS) % 400_000_000 == 0
        assert 0 <= plot.received_at - plot.valid_at - 20_000_000 < 100_000
        assert plot.simulated
        assert [math.nan if part is None else part for part in said] == pytest.approx(polar, abs=6e-3, nan_ok=True)
    azimuths = [plot.azimuth_rad for plot in plots if plot.azimuth_rad is not None]
    assert max(azimuths) < 0.0  # 6 km to the left of the landing pilot is to the right of the radar's boresight


def test_status_tells_where_the_radar_stands() -> None:
    """Each 5 s the radar says its place, boresight and period, as the site has them."""
    found = [one for one in _heard(_scene()) if isinstance(one, RadarStatus)]
    assert [round((one.valid_at - START_NS) / 1e9, 1) for one in found] == pytest.approx(
        [0.0, 5.2, 10.4, 15.6, 20.8, 26.0, 31.2, 36.4]
    )  # the scans at or after each fifth second
    assert found[0].compass_boresight_rad == pytest.approx(math.radians(270.0))
    assert found[0].height_m == pytest.approx(503.0, abs=0.02)
    assert found[0].update_period_s == 0.4
    # antenna 300 m along 090 and 150 m left (north) of the runway's centre
    assert (found[0].latitude_rad - DEMO_SITE.runway.latitude_rad) * 6.357e6 == pytest.approx(150.0, abs=1.0)


def test_many_plots_make_several_datagrams() -> None:
    """A scan of more than 40 plots comes in datagrams of at most 40, all with the scan's time and running numbers."""
    scene = _scene("approach", "duration_s=4", "radar.clutter_per_scan=130")
    datagrams = [decode(event.data) for event in events(scene) if event.link == "radar:1"]
    assert all(isinstance(one, Datagram) for one in datagrams)
    plots = [one for one in datagrams if one.header.kind == "plots"]
    assert max(len(one.records) for one in plots) == 40
    per_scan = Counter(one.header.time for one in plots for _ in one.records)
    assert len(per_scan) == 10
    assert np.mean(list(per_scan.values())) == pytest.approx(131.0, abs=4 * math.sqrt(130 / 10))
    assert [one.header.sequence for one in datagrams] == list(range(len(datagrams)))
    numbers = Counter(record.track_number for one in plots for record in one.records)
    assert numbers[0] > 1000
    assert numbers[1] == 10


def test_a_radar_with_a_key_signs() -> None:
    """With a key every datagram carries a tag that only this key passes."""
    keys = {1: b"0123456789abcdef"}
    scene = build_scene("approach", start_ns=START_NS, changes=["duration_s=4"], keys=keys)
    for event in events(scene):
        if event.link == "radar:1":
            signed = decode(event.data, keys[1])
            assert isinstance(signed, Datagram)
            assert signed.header.authenticated
            assert decode(event.data, b"another key") == "tag"


def test_an_empty_sky_is_not_a_silent_radar() -> None:
    """Without aircraft a radar still sends a datagram a scan, without plots; in a dropout it sends none."""
    scene = _scene("approach", "aircraft=0", "duration_s=10", "radar.dropouts=4:6")
    headers = [decode(event.data) for event in events(scene)]
    assert all(isinstance(one, Datagram) for one in headers)
    times = [(one.header.time - START_NS) / 1e9 for one in headers if one.header.kind == "plots"]
    assert len(times) == 20
    assert not any(4.0 <= time < 6.0 for time in times)
    assert not any(isinstance(record, Plot) for one in headers for record in one.records)


def test_a_late_radar_clock_moves_stamps_and_nothing_else() -> None:
    """A time error shifts the time that datagrams carry, not the plots or their arrival."""
    exact, late = (
        [event for event in events(_scene("approach", change)) if event.link == "radar:1"]
        for change in ("radar.time_error_s=0", "radar.time_error_s=0.05")
    )
    for one, other in zip(exact, late, strict=True):
        mine, shifted = decode(one.data), decode(other.data)
        assert isinstance(mine, Datagram)
        assert isinstance(shifted, Datagram)
        assert shifted.header.time - mine.header.time == 50_000_000
        assert other.at == one.at


def test_a_position_only_source_says_no_velocity() -> None:
    """Then there is no GLOBAL_POSITION_INT; GPS_RAW_INT says when it was so, and that speed and course are unknown."""
    sent = list(events(_scene("approach", "gps.velocity=false")))
    assert _names(sent)["GLOBAL_POSITION_INT"] == 0
    assert _names(sent)["GPS_RAW_INT"] == 8
    rows = [
        one for one in _heard(_scene("approach", "gps.velocity=false", "gps.period_s=1")) if isinstance(one, GpsReport)
    ]
    assert rows
    assert all(one.velocity_east_mps is None and one.velocity_up_mps is None for one in rows)
    assert {round((one.valid_at - START_NS) / 1e6) % 1000 for one in rows} == {130}  # 0.13 s, 1.13 s, ..., as measured


def test_accuracy_is_said_only_when_asked_for() -> None:
    """By default no accuracy is given; asked to, the stream says the sigmas that hold."""
    fast = ("gps.period_s=1", "gps.latency_low_s=0", "gps.latency_high_s=0.1")
    silent = [one for one in _heard(_scene("approach", *fast)) if isinstance(one, GpsReport)]
    given = [one for one in _heard(_scene("approach", *fast, "gps.accuracy_given=true")) if isinstance(one, GpsReport)]
    assert all(one.horizontal_sigma_m is None for one in silent)
    assert {(one.horizontal_sigma_m, one.velocity_sigma_mps) for one in given[1:]} == {(15.0, 0.5)}


def test_the_wire_says_altitudes_above_mean_sea_level() -> None:
    """Height and altitude differ by the site's geoid separation."""
    heard = [one for one in _heard(_scene("approach", "gps.period_s=1")) if isinstance(one, GpsReport)]
    assert heard[-1].height_m is not None
    assert heard[-1].altitude_msl_m is not None
    assert heard[-1].altitude_msl_m - heard[-1].height_m == pytest.approx(35.0)
