"""Tracks as ADSB_VEHICLE, read back by pymavlink."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import all as dialect

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.mavlink_frames import FrameEncoder, encode
from adapters.published import Traffic, adsb_vehicle, heartbeat, is_made_up, key_of, made_up_address

HERE = Traffic(0x4840D6, math.radians(31.0), math.radians(104.0), 0)


def read(frame: bytes) -> Any:
    """The message of a frame, as pymavlink's own parser reads it."""
    parser = dialect.MAVLink(None)
    (message,) = parser.parse_buffer(frame)
    return message


def told(**known: Any) -> Any:
    parts = {name: getattr(HERE, name) for name in Traffic.__dataclass_fields__}
    return read(adsb_vehicle(FrameEncoder(1, 156), Traffic(**{**parts, **known})))


def test_a_whole_report_says_what_the_definition_of_each_field_says() -> None:
    message = told(
        age_s=3,
        altitude_msl_m=1234.5678,
        velocity_east_mps=-30.0,
        velocity_north_mps=40.0,
        velocity_up_mps=-3.257,
        callsign="KLM1023",
        emitter_type=14,
    )
    assert (message.ICAO_address, message.lat, message.lon) == (0x4840D6, 310000000, 1040000000)
    assert (message.altitude_type, message.altitude) == (1, 1234568)
    assert message.heading == round((360.0 - math.degrees(math.atan2(30.0, 40.0))) * 100.0)
    assert (message.hor_velocity, message.ver_velocity) == (5000, -326)
    assert (message.callsign, message.emitter_type, message.tslc, message.squawk) == ("KLM1023", 14, 3, 0)
    assert message.flags == 1 + 2 + 4 + 8 + 16 + 128


@pytest.mark.parametrize(
    ("known", "flags"),
    [
        ({}, 1),
        ({"altitude_msl_m": -12.0}, 1 + 2),
        ({"velocity_east_mps": 20.0, "velocity_north_mps": 0.0}, 1 + 4 + 8),
        ({"velocity_east_mps": 0.3, "velocity_north_mps": -0.4}, 1 + 8),
        ({"velocity_east_mps": 20.0}, 1),
        ({"velocity_up_mps": 0.0}, 1 + 128),
        ({"callsign": "R1/3"}, 1 + 16),
        ({"callsign": "   "}, 1),
        ({"is_simulated": True}, 1 + 64),
    ],
)
def test_the_flags_are_exactly_what_is_known(known: dict[str, Any], flags: int) -> None:
    assert told(**known).flags == flags


def test_a_pressure_altitude_is_told_as_one_and_only_where_no_other_is_known() -> None:
    pressure = told(pressure_altitude_m=900.0)
    assert (pressure.altitude_type, pressure.altitude, pressure.flags) == (0, 900000, 1 + 2)
    both = told(pressure_altitude_m=900.0, altitude_msl_m=950.0)
    assert (both.altitude_type, both.altitude) == (1, 950000)


def test_what_does_not_fit_a_field_is_held_at_its_end() -> None:
    message = told(
        age_s=1000, altitude_msl_m=9e6, velocity_east_mps=900.0, velocity_north_mps=0.0, velocity_up_mps=-400.0
    )
    assert (message.tslc, message.altitude) == (255, 2**31 - 1)
    assert (message.hor_velocity, message.ver_velocity, message.heading) == (65535, -32768, 9000)


@pytest.mark.parametrize(
    ("callsign", "is_told"),
    [("MAV1", "MAV1"), ("LONGCALLSIGN", "LONGCALL"), ("ÄB 1", "?B 1"), ("A\x00B\n", "A?B"), (" KLM 12 ", "KLM 12")],
)
def test_a_callsign_is_at_most_eight_characters_and_a_zero(callsign: str, is_told: str) -> None:
    assert told(callsign=callsign).callsign == is_told


def test_made_up_addresses_are_of_the_free_block_and_come_back_only_after_a_million_tracks() -> None:
    some = [made_up_address(track) for track in (1, 2, 3, 1_048_575, 1_048_576)]
    assert len(set(some)) == len(some)
    assert all(address >> 20 == 0b1011 and is_made_up(address) for address in some)
    assert not is_made_up(0x4840D6)
    assert not is_made_up(0xC00000)


def test_the_heartbeat_is_that_of_an_ads_b_component() -> None:
    message = read(heartbeat(FrameEncoder(1, 156)))
    assert (message.type, message.autopilot) == (dialect.MAV_TYPE_ADSB, dialect.MAV_AUTOPILOT_INVALID)
    assert (message.get_srcSystem(), message.get_srcComponent()) == (1, dialect.MAV_COMP_ID_ADSB)


def test_a_report_is_known_again_when_another_system_passes_it_on_older() -> None:
    ours = adsb_vehicle(FrameEncoder(1, 156), HERE)
    fields = read(ours).to_dict()
    fields.pop("mavpackettype")
    relayed = {**fields, "callsign": fields["callsign"].encode(), "tslc": 7}
    for version in (1, 2):
        assert key_of(encode("ADSB_VEHICLE", relayed, system=9, sequence=77, version=version)) == key_of(ours)
    elsewhere = encode("ADSB_VEHICLE", {**relayed, "lat": relayed["lat"] + 1}, system=9)
    assert key_of(elsewhere) not in (None, key_of(ours))


def test_other_frames_damage_and_garbage_have_no_key() -> None:
    ours = adsb_vehicle(FrameEncoder(1, 156), HERE)
    others = [heartbeat(FrameEncoder(1, 156)), b"", b"\xfd", ours[:-1], ours[:-1] + bytes([ours[-1] ^ 1]), b"\xfe" * 30]
    assert [key_of(frame) for frame in others] == [None] * len(others)


@given(
    st.floats(-math.pi / 2, math.pi / 2),
    st.floats(-4.0 * math.pi, 4.0 * math.pi),
    st.floats(-1e12, 1e12),
    st.floats(-1e6, 1e6),
    st.floats(-1e6, 1e6),
    st.text(max_size=12),
)
def test_no_state_is_refused_and_every_report_can_be_read(
    latitude: float, longitude: float, altitude: float, east: float, north: float, callsign: str
) -> None:
    traffic = Traffic(1, latitude, longitude, 0, altitude, None, east, north, north, callsign)
    message = read(adsb_vehicle(FrameEncoder(1, 156), traffic))
    assert abs(message.lat) <= 900000000
    assert abs(message.lon) <= 1800000000
    assert message.heading < 36000


def test_what_another_gateway_publishes_under_a_made_up_address_is_no_news_and_counted() -> None:
    decoder = Decoder([Source(1, "mavlink", "station", "a peer")])
    encoder, at = FrameEncoder(1, 156), 1_790_000_000_000_000_000
    for number, address in enumerate((made_up_address(7), 0x4840D6)):
        parts = {name: getattr(HERE, name) for name in Traffic.__dataclass_fields__}
        frame = adsb_vehicle(encoder, Traffic(**{**parts, "address": address, "altitude_msl_m": 500.0}))
        heard = decoder.feed(Arrival(at + number * 4000, 1, frame))
        assert [getattr(one, "aircraft", None) for one in heard.observations] == ["icao:4840d6"] * number
    assert decoder.counters()["station address that a gateway made up"] == 1
