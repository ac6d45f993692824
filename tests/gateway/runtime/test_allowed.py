"""Who may be heard, and how that is written."""

import pytest

from adapters.mavlink_frames import encode
from gateway.runtime.allowed import Allowed, AllowError, parse_allowed

HEARTBEAT = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}


def test_without_a_list_everybody_may_be_heard() -> None:
    assert parse_allowed() == Allowed()
    assert Allowed().hears_peer("203.0.113.9:1")
    assert Allowed().hears_frame(encode("HEARTBEAT", HEARTBEAT, system=255))


@pytest.mark.parametrize(
    ("text", "peer", "is_heard"),
    [
        ("10.0.0.5", "10.0.0.5:14550", True),
        ("10.0.0.5", "10.0.0.6:14550", False),
        ("192.168.1.0/24", "192.168.1.77:5", True),
        ("192.168.1.7/24", "192.168.1.77:5", True),
        ("192.168.1.0/24", "192.168.2.1:5", False),
        ("10.0.0.5, 10.0.0.6", "10.0.0.6:1", True),
        ("::1", "[::1]:14550", True),
        ("[::1]", "[::1]:14550", True),
        ("::1", "127.0.0.1:14550", False),
        ("fe80::/10", "[fe80::12%3]:14550", True),
        ("10.0.0.5", "[::ffff:10.0.0.5]:14550", True),
        ("10.0.0.5", "serial:/dev/ttyUSB0:57600", False),
    ],
)
def test_a_peer_is_heard_by_its_address_in_a_list_or_network(text: str, peer: str, is_heard: bool) -> None:
    assert parse_allowed([text]).hears_peer(peer) is is_heard


@pytest.mark.parametrize("version", [1, 2])
def test_a_frame_is_heard_by_its_system_in_either_version(version: int) -> None:
    allowed = parse_allowed(systems=["1,3", "10-12"])
    assert allowed.systems == {1, 3, 10, 11, 12}
    heard = [
        system
        for system in range(1, 256)
        if allowed.hears_frame(encode("HEARTBEAT", HEARTBEAT, system=system, version=version))
    ]
    assert heard == [1, 3, 10, 11, 12]


@pytest.mark.parametrize("text", ["", "drone", "10.0.0.5:14550", "10.0.0.0/33", "10.0.0"])
def test_what_is_no_peer_is_refused_with_how_to_write_one(text: str) -> None:
    with pytest.raises(AllowError, match=r"not a peer that can be allowed; write an address such as 10\.0\.0\.5"):
        parse_allowed([text])


@pytest.mark.parametrize("text", ["", "0", "256", "5-3", "1-", "-4", "one", "1.5", "²"])
def test_what_is_no_system_is_refused_with_how_to_write_one(text: str) -> None:
    with pytest.raises(AllowError, match="not a MAVLink system that can be allowed; write numbers from 1 to 255"):
        parse_allowed(systems=[text])
