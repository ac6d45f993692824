"""What is told of the picture's tracks, and when."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import all as dialect

from adapters.mavlink_frames import encode
from gateway.fuse import Ended, Fused
from gateway.geodesy import geodetic_to_ecef
from gateway.observation import RadarPlot
from gateway.picture import Health, Picture
from gateway.sinks.publish import PublishSink, address_of

SECOND = 1_000_000_000
START = 1_772_366_400 * SECOND
LATITUDE, LONGITUDE = math.radians(31.0), math.radians(104.0)


def row(track: int, at_s: float, **known: Any) -> dict[str, Any]:
    """One measured row, as it is unless something else is said."""
    return {
        "track": track,
        "time": START + round(at_s * SECOND),
        "received": START + round(at_s * SECOND),
        "aircraft": f"mavlink:{track}",
        "radar_track": None,
        "updated_by": "gps",
        "state": "fused",
        "latitude_rad": LATITUDE,
        "longitude_rad": LONGITUDE,
        "height_m": 500.0,
        "altitude_msl_m": 535.0,
        "velocity_mps": (60.0, -80.0, 2.0),
        "pressure_altitude_m": math.nan,
        "callsign": None,
        "life": "confirmed",
        **known,
    }


def fused(rows: Sequence[dict[str, Any]], ended: Sequence[int] = ()) -> Fused:
    n = len(rows)
    made: dict[str, Any] = {
        name: tuple(one[name] for one in rows) for name in Fused.__dataclass_fields__ if n and name in rows[0]
    }
    for name, kind in (("time", np.int64), ("received", np.int64), ("track", np.int64)):
        made[name] = np.array(made.get(name, ()), dtype=kind)
    for name in ("latitude_rad", "longitude_rad", "height_m", "altitude_msl_m", "pressure_altitude_m"):
        made[name] = np.array(made.get(name, ()), dtype=np.float64)
    for name in ("aircraft", "radar_track", "updated_by", "state", "callsign", "life"):
        made.setdefault(name, ())
    made["velocity_mps"] = np.array(made.get("velocity_mps", ()), dtype=np.float64).reshape(n, 3)
    nothing = {
        "covariance": np.zeros((n, 36)),
        "modes": np.zeros((n, 3)),
        "runway_m": np.zeros((n, 3)),
        "bias_m": np.zeros((n, 3)),
        "wind_mps": np.full((n, 2), math.nan),
    }
    return Fused(**made, **nothing, ended=tuple(Ended(START, track, "no data for 30 s") for track in ended))


class Told:
    """A sink on a made-up session, and what it sent."""

    def __init__(self, **options: Any) -> None:
        self.frames: list[tuple[float, bytes]] = []
        self.now_s = 0.0
        self.sink = PublishSink(lambda frame: self.frames.append((self.now_s, frame)), **options)

    def at(self, now_s: float, *rows: dict[str, Any], ended: Sequence[int] = (), saw: Sequence[RadarPlot] = ()) -> None:
        """One picture."""
        self.now_s = now_s
        now = START + round(now_s * SECOND)
        empty: Any = None
        self.sink.write(
            Picture(
                step=0,
                now=now,
                observations=tuple(saw),
                align=empty,
                track=empty,
                associate=empty,
                register=empty,
                fuse=fused(rows, ended),
                predict=empty,
                truth=(),
                health=Health(),
                events=(),
            )
        )

    def until(self, until_s: float, tick_s: float = 0.01) -> None:
        """Pictures in which nothing is new."""
        for _ in range(round((until_s - self.now_s) / tick_s)):
            self.at(self.now_s + tick_s)

    def messages(self, name: str) -> list[tuple[float, Any]]:
        parser = dialect.MAVLink(None)
        read = [(at_s, parser.parse_buffer(frame)[0]) for at_s, frame in self.frames]
        return [(at_s, message) for at_s, message in read if message.get_type() == name]

    def reports(self) -> list[tuple[float, Any]]:
        return self.messages("ADSB_VEHICLE")


def place(message: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    return geodetic_to_ecef(math.radians(message.lat / 1e7), math.radians(message.lon / 1e7), 500.0)


@pytest.mark.parametrize("tick_s", [0.01, 0.03, 0.1, 0.25])
def test_each_track_and_the_heartbeat_are_told_once_in_every_second_whatever_the_ticks(tick_s: float) -> None:
    told = Told()
    told.at(0.0, row(1, 0.0), row(2, 0.0), row(3, 0.0))
    told.until(12.0, tick_s)
    for number in (1, 2, 3):
        times = [at_s for at_s, message in told.reports() if message.callsign == f"MAV{number}"]
        assert 11 <= len(times) <= 12
        assert all(0.7 < later - earlier < 1.3 for earlier, later in itertools.pairwise(times))
    assert 12 <= len(told.messages("HEARTBEAT")) <= 13


def test_many_tracks_are_spread_over_the_second() -> None:
    told = Told()
    told.at(0.0, *(row(track, 0.0) for track in range(1, 101)))
    told.until(3.0)
    inside = [at_s for at_s, _ in told.reports() if 1.0 <= at_s < 2.0]
    assert 99 <= len(inside) <= 101
    in_each_tenth = np.histogram(inside, bins=10, range=(1.0, 2.0))[0]
    assert in_each_tenth.max() <= 12


def test_a_fast_aircraft_is_told_where_it_was_a_whole_number_of_seconds_ago() -> None:
    told = Told()
    told.at(0.0, row(1, -2.4))
    told.until(1.0)
    ((at_s, message),) = told.reports()
    age_s = at_s + 2.4
    assert message.tslc == math.floor(age_s) == 3
    moved_m = np.linalg.norm(place(message) - geodetic_to_ecef(LATITUDE, LONGITUDE, 500.0))
    assert moved_m == pytest.approx(100.0 * (age_s - 3), abs=0.02)
    assert message.lat < 310000000  # southwards
    assert message.lon > 1040000000
    assert message.altitude == round((535.0 + 2.0 * (age_s - 3)) * 1000.0)


def test_a_silent_track_grows_old_where_it_was_last_measured_and_ends_with_its_track() -> None:
    told = Told()
    told.at(0.0, row(1, 0.0))
    told.until(0.95)
    for second in range(1, 9):
        far = LATITUDE + 0.01 * second
        told.at(second + 0.05, row(1, second, received=-1, updated_by="coast", state="coasting", latitude_rad=far))
        told.until(second + 0.95)
    said = [(message.tslc, message.lat) for _, message in told.reports()]
    assert [tslc for tslc, _ in said] == list(range(9))
    assert all(abs(latitude - 310000000) < 10_000 for _, latitude in said)
    told.at(9.0, ended=[1])
    told.until(12.0)
    assert len(told.reports()) == len(said)


def test_a_newer_row_is_told_from_then_on_and_a_late_one_of_before_is_not() -> None:
    told = Told()
    told.at(0.0, row(1, 0.0))
    told.at(0.5, row(1, 0.4, altitude_msl_m=600.0, velocity_mps=(0.0, 0.0, 0.0)))
    told.at(0.55, row(1, 0.2, altitude_msl_m=700.0))
    told.until(1.0)
    ((_, message),) = told.reports()
    assert message.altitude == 600000


def test_of_a_state_only_what_is_known_is_told() -> None:
    told = Told()
    unknown = {"height_m": math.nan, "altitude_msl_m": math.nan, "velocity_mps": (60.0, 0.0, math.nan)}
    told.at(0.0, row(1, 0.0, **unknown), row(2, 0.0, **unknown, pressure_altitude_m=1500.0))
    told.until(1.0)
    plain, pressure = sorted((message for _, message in told.reports()), key=lambda one: str(one.callsign))
    assert (plain.flags, plain.altitude) == (1 + 4 + 8 + 16, 0)
    assert (pressure.flags, pressure.altitude_type, pressure.altitude) == (1 + 2 + 4 + 8 + 16, 0, 1500000)


def test_aircraft_have_their_own_address_and_name_where_they_have_one() -> None:
    told = Told()
    told.at(
        0.0,
        row(1, 0.0, aircraft="mavlink:1@2"),
        row(2, 0.0, aircraft="icao:4840d6", callsign="KLM1023"),
        row(3, 0.0, aircraft="icao:4840d7"),
        row(4, 0.0, aircraft=None, radar_track="1/3 2/7"),
    )
    told.until(1.0)
    said = {(one.ICAO_address, one.callsign, one.emitter_type) for _, one in told.reports()}
    assert said == {(0xB00001, "MAV1@2", 14), (0x4840D6, "KLM1023", 0), (0x4840D7, "", 0), (0xB00004, "R1/3", 0)}


def test_a_second_aircraft_of_one_address_does_not_take_it() -> None:
    assert address_of("icao:4840D6", 7) == 0x4840D6
    assert address_of("icao:4840d6@2", 7) == 0xB00007


def test_simulated_is_said_of_the_radar_tracks_that_say_so() -> None:
    told = Told()
    plot = RadarPlot(1, 3, START, START, range_m=1000.0, simulated=True)
    rows = [row(1, 0.0, aircraft=None, radar_track="1/3"), row(2, 0.0, aircraft=None, radar_track="1/4")]
    told.at(0.0, *rows, saw=[plot])
    told.until(1.0)
    assert {one.callsign: one.flags & 64 for _, one in told.reports()} == {"R1/3": 64, "R1/4": 0}


def test_frames_are_those_of_the_ads_b_component_of_the_chosen_system_in_sequence() -> None:
    told = Told(system=42)
    told.at(0.0, row(1, 0.0))
    told.until(3.0)
    parser = dialect.MAVLink(None)
    read = [parser.parse_buffer(frame)[0] for _, frame in told.frames]
    assert {(one.get_srcSystem(), one.get_srcComponent()) for one in read} == {(42, 156)}
    assert [one.get_seq() for one in read] == list(range(len(read)))


def test_an_aircraft_that_is_left_out_is_not_told_of() -> None:
    told = Told(leave_out=frozenset({"mavlink:1"}))
    told.at(0.0, row(1, 0.0), row(2, 0.0))
    told.until(3.0)
    assert {one.callsign for _, one in told.reports()} == {"MAV2"}


@pytest.mark.parametrize("jump_s", [-3600.0, 3600.0])
def test_a_session_whose_time_is_set_goes_on_telling(jump_s: float) -> None:
    told = Told()
    told.at(0.0, row(1, 0.0))
    told.until(2.0)
    before = len(told.reports())
    told.at(2.0 + jump_s, row(1, 3600.0))
    told.until(4.0 + jump_s)
    assert 2 <= len(told.reports()) - before <= 3


def test_our_own_reports_are_known_again_for_two_minutes_and_others_are_news() -> None:
    told = Told()
    told.at(0.0, row(1, 0.0))
    told.until(1.0)
    (ours,) = [frame for _, frame in told.frames if len(frame) > 25]
    others = encode("ADSB_VEHICLE", _fields_of(ours) | {"altitude": 1}, system=1, component=156)
    relayed = encode("ADSB_VEHICLE", _fields_of(ours) | {"tslc": 9}, system=3, component=1)
    assert [told.sink.is_our_own(frame) for frame in (ours, relayed, others, b"")] == [True, True, False, False]
    assert told.sink.counters["publish: our own heard again"] == 2
    told.at(200.0, row(1, 199.0, latitude_rad=LATITUDE + 0.01))
    told.until(202.0)
    assert not told.sink.is_our_own(ours)


def _fields_of(frame: bytes) -> dict[str, Any]:
    fields = dialect.MAVLink(None).parse_buffer(frame)[0].to_dict()
    fields.pop("mavpackettype")
    return {**fields, "callsign": fields["callsign"].encode()}


def test_a_tentative_track_is_not_told_until_it_is_confirmed() -> None:
    """To whoever hears us it would be an aircraft like any other; once it was confirmed it stays told."""
    told = Told()
    told.at(0.0, row(1, 0.0, life="tentative"))
    told.until(3.0)
    assert not told.reports()
    told.at(3.1, row(1, 3.1))
    told.until(6.0)
    assert len(told.reports()) >= 2


def test_which_radar_tracks_are_simulated_is_remembered_of_the_latest() -> None:
    """Of thousands of numbers that a simulated radar gives, in an hour, those of the last ten seconds stay."""
    told = Told()
    for number in range(3000):
        at = START + number * SECOND
        told.at(float(number), saw=[RadarPlot(1, number, at, at, 1000.0, 0.0, 0.0, simulated=True)])
    assert len(told.sink._simulated) <= 1001
