"""URLs of links, as MAVLink people write them."""

import pytest

from gateway.runtime.urls import LinkError, Url, parse_url


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:0.0.0.0:14550", Url("udpin", "0.0.0.0", 14550)),
        ("udpin:0.0.0.0", Url("udpin", "0.0.0.0", 14550)),
        ("udpin::14560", Url("udpin", "0.0.0.0", 14560)),
        ("udpin:14560", Url("udpin", "0.0.0.0", 14560)),
        ("udpin:127.0.0.1:0", Url("udpin", "127.0.0.1", 0)),
        ("udpin://[::1]:14550", Url("udpin", "::1", 14550)),
        ("udpout:field.example:14550", Url("udpout", "field.example", 14550)),
        ("tcp:127.0.0.1:5760", Url("tcp", "127.0.0.1", 5760)),
        ("serial:/dev/ttyUSB0:115200", Url("serial", device="/dev/ttyUSB0", baud=115200)),
        ("serial:/dev/ttyUSB0", Url("serial", device="/dev/ttyUSB0", baud=57600)),
        ("serial:COM3:57600", Url("serial", device="COM3", baud=57600)),
    ],
)
def test_a_link_is_read_as_it_is_usually_written(text: str, url: Url) -> None:
    assert parse_url(text) == url


@pytest.mark.parametrize(
    ("text", "advice"),
    [
        ("udp:0.0.0.0:14550", "udpin:0.0.0.0:14550 to listen"),
        ("/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:57600"),
        ("tcpin:0.0.0.0:5760", "tcp:HOST:PORT"),
        ("udpin:0.0.0.0:70000", "not a whole number from 0 to 65535"),
        ("udpin:0.0.0.0:radar", "not a whole number"),
        ("udpin:::1:14550", "IPv6 address in brackets"),
        ("udpout:", "does not say where to"),
        ("tcp:127.0.0.1:0", "port 0"),
        ("serial:", "serial:DEVICE:BAUD"),
        ("", "udpin:0.0.0.0:14550"),
    ],
)
def test_a_wrong_link_is_refused_with_what_to_write_instead(text: str, advice: str) -> None:
    with pytest.raises(LinkError) as refused:
        parse_url(text)
    assert advice in str(refused.value)


def test_a_link_prints_as_it_is_written() -> None:
    for text in ("udpin:0.0.0.0:14550", "udpin:[::1]:1", "tcp:a.example:2", "serial:/dev/ttyS0:9600"):
        assert str(parse_url(text)) == text
