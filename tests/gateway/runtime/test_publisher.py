"""The link that tracks are published on, over real sockets on the loopback."""

from __future__ import annotations

import os
import socket
import sys
import time
from collections.abc import Iterator

import pytest

from gateway.runtime.publisher import NOT_SENT, SENT, Publisher, open_publisher
from gateway.runtime.urls import LinkError, Url, parse_url


@pytest.fixture
def peer() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind(("127.0.0.1", 0))
        opened.settimeout(20.0)
        yield opened


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as opened:
        opened.settimeout(20.0)
        yield opened


def test_udpout_sends_each_frame_as_a_datagram(peer: socket.socket) -> None:
    publisher = open_publisher(Url("udpout", "127.0.0.1", peer.getsockname()[1]))
    for frame in (b"one", b"two"):
        publisher.send(frame)
    assert [peer.recv(100), peer.recv(100)] == [b"one", b"two"]
    assert publisher.counters == {SENT: 2}
    publisher.close()


def test_what_nobody_takes_is_counted_and_the_link_goes_on_when_somebody_comes() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
        late.bind(("127.0.0.1", 0))
        port = late.getsockname()[1]
    publisher = open_publisher(Url("udpout", "127.0.0.1", port))
    for _ in range(5):
        publisher.send(b"lost")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
        late.bind(("127.0.0.1", port))
        late.settimeout(20.0)
        publisher.send(b"heard")
        assert late.recv(100) == b"heard"
    assert publisher.counters[NOT_SENT] >= 4
    assert publisher.counters[SENT] + publisher.counters[NOT_SENT] == 6
    publisher.close()


def test_udpin_answers_everybody_who_has_spoken_and_nobody_else(peer: socket.socket) -> None:
    publisher = open_publisher(parse_url("udpin:127.0.0.1:0"))
    publisher.send(b"to nobody")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(20.0)
        for speaker in (peer, other):
            speaker.sendto(b"", ("127.0.0.1", publisher.url.port))
        wait_for_two(publisher)
        publisher.send(b"to both")
        assert [peer.recv(100), other.recv(100)] == [b"to both", b"to both"]
    assert publisher.counters[NOT_SENT] == 0
    publisher.close()


def wait_for_two(publisher: Publisher) -> None:
    """Until both datagrams have been delivered; on the loopback that is at once nearly always."""
    give_up = time.monotonic() + 20.0
    while len(publisher._listeners) < 2:  # type: ignore[attr-defined]
        assert time.monotonic() < give_up
        publisher._hear(time.monotonic_ns())  # type: ignore[attr-defined]


def test_a_listener_who_falls_silent_is_told_for_a_minute_more(peer: socket.socket) -> None:
    publisher = open_publisher(parse_url("udpin:127.0.0.1:0"))
    peer.sendto(b"x", ("127.0.0.1", publisher.url.port))
    now = time.monotonic_ns()
    while not publisher._listeners:  # type: ignore[attr-defined]
        publisher._hear(now)  # type: ignore[attr-defined]
    publisher._hear(now + 59_000_000_000)  # type: ignore[attr-defined]
    assert len(publisher._listeners) == 1  # type: ignore[attr-defined]
    publisher._hear(now + 61_000_000_000)  # type: ignore[attr-defined]
    assert not publisher._listeners  # type: ignore[attr-defined]
    publisher.close()


def test_a_tcp_peer_who_reads_nothing_costs_frames_and_no_time_and_gets_whole_frames(server: socket.socket) -> None:
    publisher = open_publisher(Url("tcp", "127.0.0.1", server.getsockname()[1]))
    connection, _ = server.accept()
    frames = [bytes([number % 251]) * 50_000 for number in range(600)]
    for frame in frames:
        publisher.send(frame)
    assert publisher.counters[NOT_SENT] > 0
    connection.settimeout(0.2)
    got = bytearray()
    for _ in range(3000):
        publisher.send(b"")
        try:
            got += connection.recv(1 << 20)
        except TimeoutError:
            break
    connection.close()
    publisher.close()
    whole = [got[start : start + 50_000] for start in range(0, len(got), 50_000)]
    assert len(whole) > 1
    assert all(len(frame) == 50_000 and len(set(frame)) == 1 for frame in whole)


def test_a_tcp_peer_who_comes_back_hears_whole_frames_again(server: socket.socket) -> None:
    publisher = open_publisher(Url("tcp", "127.0.0.1", server.getsockname()[1]))
    connection, _ = server.accept()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
    connection.close()
    give_up = time.monotonic() + 20.0
    while not publisher.counters["publish: connections lost or refused"]:
        assert time.monotonic() < give_up
        publisher.send(b"x")
    publisher._retry_at = 0  # type: ignore[attr-defined]
    publisher.send(b"after")
    again, _ = server.accept()
    again.settimeout(20.0)
    publisher.send(b"wards")
    assert again.recv(5) == b"after"
    again.close()
    publisher.close()


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")
def test_a_serial_port_is_written_to_until_it_takes_no_more_and_never_waited_for() -> None:
    ours, theirs = os.openpty()
    os.set_blocking(ours, False)
    publisher = open_publisher(Url("serial", device=os.ttyname(theirs), baud=57600))
    publisher.send(b"first")
    assert os.read(ours, 5) == b"first"
    for _ in range(2000):
        publisher.send(b"z" * 100)
    assert publisher.counters[NOT_SENT] > 0
    publisher.close()
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("tcp:127.0.0.1:{closed}", "nobody listens there"),
        ("udpin:127.0.0.1:{taken}", "another link has this port already"),
        ("serial:/dev/nothing-here:57600", "correct what follows --publish"),
        ("udpout:no-such-host.invalid:14550", "there is no host"),
    ],
)
def test_a_link_that_cannot_be_opened_says_why_in_one_sentence(text: str, sentence: str, peer: socket.socket) -> None:
    with socket.create_server(("127.0.0.1", 0)) as gone:
        closed = gone.getsockname()[1]
    url = parse_url(text.format(closed=closed, taken=peer.getsockname()[1]))
    with pytest.raises(LinkError, match=sentence):
        open_publisher(url)
