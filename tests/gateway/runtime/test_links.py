"""Links over real sockets on the loopback: datagrams in batches, streams that break, and sending when told to."""

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from gateway.runtime import udp as udp_module
from gateway.runtime.batches import batches_of
from gateway.runtime.links import Link, open_link
from gateway.runtime.streams import SerialLink, TcpLink
from gateway.runtime.udp import UdpLink
from gateway.runtime.urls import LinkError, Url, parse_url

linux_only = pytest.mark.skipif(
    sys.platform != "linux", reason="Only Linux tells when a datagram came, and what it dropped."
)
posix_only = pytest.mark.skipif(os.name != "posix", reason="Pseudo-terminals, which stand in for a radio, are POSIX.")


@pytest.fixture(params=["in batches", "one by one"])
def link(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[UdpLink]:
    """A listening link, with the batch call where the system has one, and as it is elsewhere."""
    if request.param == "one by one":
        monkeypatch.setattr(udp_module, "batches_of", lambda receiving: None)
    opened = UdpLink(Url("udpin", "127.0.0.1", 0))
    yield opened
    opened.close()


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def everything(link: Link, count: int) -> tuple[list[str], list[bytes], list[int]]:
    """Peers, contents and kernel times, as soon as so many have come."""
    peers: list[str] = []
    data: list[bytes] = []
    times: list[int] = []
    give_up = time.monotonic() + 20.0
    while len(data) < count:
        assert time.monotonic() < give_up, f"{len(data)} of {count} came"
        chunks = link.receive()
        peers += chunks.peers
        data += chunks.data
        times += chunks.kernel_utc_ns.tolist()
    return peers, data, times


def test_every_datagram_comes_whole_and_in_order_with_its_sender(link: UdpLink, sender: socket.socket) -> None:
    """Empty ones, small ones, more than one batch of them, and the largest that there can be."""
    sent = [b"", b"x", *(bytes([number % 251]) * (number % 300) for number in range(400)), os.urandom(65_507)]
    for one in sent:
        sender.sendto(one, ("127.0.0.1", link.url.port))
    peers, data, _ = everything(link, len(sent))
    assert data == sent
    assert set(peers) == {f"127.0.0.1:{sender.getsockname()[1]}"}
    assert link.receive().data == []


def test_senders_are_told_apart(link: UdpLink, sender: socket.socket) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for one, text in ((sender, b"a"), (other, b"b"), (sender, b"c")):
            one.sendto(text, ("127.0.0.1", link.url.port))
        peers, data, _ = everything(link, 3)
        ports = [sender.getsockname()[1], other.getsockname()[1], sender.getsockname()[1]]
    assert data == [b"a", b"b", b"c"]
    assert peers == [f"127.0.0.1:{port}" for port in ports]


def _wait_for_stamps(link: UdpLink, sender: socket.socket) -> None:
    """Linux begins to stamp a moment after it was asked to; until then it tells when a datagram was read."""
    give_up = time.monotonic() + 5.0
    while time.monotonic() < give_up:
        sender.sendto(b"", ("127.0.0.1", link.url.port))
        sent = time.time_ns()
        time.sleep(0.001)
        _, _, (at,) = everything(link, 1)
        if at is not None and at <= sent:
            return


@linux_only
def test_the_kernel_tells_when_each_datagram_came(link: UdpLink, sender: socket.socket) -> None:
    _wait_for_stamps(link, sender)
    before = time.time_ns()
    for number in range(5):
        sender.sendto(bytes([number]), ("127.0.0.1", link.url.port))
    after = time.time_ns()
    _, _, times = everything(link, 5)
    assert times == sorted(times)
    assert all(before <= at <= after for at in times)


@linux_only
@pytest.mark.parametrize("is_followed", [True, False])
def test_what_the_kernel_dropped_is_counted_to_the_last_one(
    link: UdpLink, sender: socket.socket, is_followed: bool
) -> None:
    """By the next datagram, and where none comes any more by asking the socket. It is said once."""
    small = UdpLink(Url("udpin", "127.0.0.1", 0), 4096)
    sent = 3000
    for _ in range(sent):
        sender.sendto(b"x" * 50, ("127.0.0.1", small.url.port))
    heard = 0
    while chunks := small.receive().data:
        heard += len(chunks)
    if is_followed:
        sender.sendto(b"the next one", ("127.0.0.1", small.url.port))
        sent += 1
        heard += len(everything(small, 1)[1])
    small.tend(time.monotonic_ns())
    small.close()
    assert 0 < heard < sent
    assert small.counters["dropped by the kernel"] == sent - heard
    assert [level for level, text in small.news if "lost before we could read them" in text] == ["error"]


def test_the_systems_own_receive_buffer_is_left_alone_when_asked_to(sender: socket.socket) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as plain:
        untouched = plain.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    link = open_link(parse_url("udpin:127.0.0.1:0"), None)
    assert isinstance(link, UdpLink)
    assert link.granted_bytes == (untouched // 2 if sys.platform == "linux" else untouched)
    assert link.news == []
    link.close()


@linux_only
def test_a_batch_reads_ipv6_peers_with_their_zone() -> None:
    with (
        socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as receiving,
        socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as one,
    ):
        try:
            receiving.bind(("::1", 0))
        except OSError:
            pytest.skip("This machine has no IPv6.")
        one.sendto(b"six", receiving.getsockname())
        batches = batches_of(receiving)
        assert batches is not None
        batch = batches.receive()
        assert batch is not None
        assert (batch.chunks.data, batch.chunks.peers) == ([b"six"], [f"[::1]:{one.getsockname()[1]}"])
        assert batch.chunks.kernel_utc_ns.tolist() == [0]  # nobody asked for them on this socket
        assert batches.receive() is None


def test_a_listening_link_sends_to_a_peer_by_its_name_and_to_nobody_else(link: UdpLink, sender: socket.socket) -> None:
    sender.settimeout(20.0)
    sender.sendto(b"hello", ("127.0.0.1", link.url.port))
    (peer,), _, _ = everything(link, 1)
    assert link.send(b"answer", peer)
    assert sender.recv(100) == b"answer"
    assert not link.send(b"to whom?", None)
    assert link.counters["not sent"] == 1


def test_a_calling_link_sends_to_its_peer() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(20.0)
        link = open_link(parse_url(f"udpout:127.0.0.1:{station.getsockname()[1]}"))
        assert link.send(b"frame", None)
        assert station.recv(100) == b"frame"
        link.close()


def test_a_peer_that_is_gone_is_counted_and_the_link_goes_on() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        port = station.getsockname()[1]
    link = open_link(parse_url(f"udpout:127.0.0.1:{port}"))
    for _ in range(3):
        link.send(b"anybody?", None)
        link.receive()
    assert any("socket error" in reason for reason in link.counters)
    assert link.fileno() is not None
    link.close()


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as opened:
        opened.settimeout(20.0)
        yield opened


def test_a_tcp_link_that_cannot_send_drops_whole_frames_and_breaks_none(server: socket.socket) -> None:
    """The other side reads nothing for a while: what it gets in the end is whole frames, the others are counted."""
    link = TcpLink(parse_url(f"tcp:127.0.0.1:{server.getsockname()[1]}"))
    other, _ = server.accept()
    other.settimeout(20.0)
    frames = [number.to_bytes(4, "big") * 2500 for number in range(2000)]
    taken = [frame for frame in frames if link.send(frame, None)]
    assert len(taken) + link.counters["not sent"] == len(frames)
    assert link.counters["not sent"] > 0
    got = bytearray()
    while len(got) < sum(map(len, taken)):
        link.tend(time.monotonic_ns())
        got += other.recv(1 << 20)
    assert bytes(got) == b"".join(taken)
    link.close()
    other.close()


def test_a_tcp_link_asks_whether_a_silent_server_is_still_there(server: socket.socket) -> None:
    link = TcpLink(parse_url(f"tcp:127.0.0.1:{server.getsockname()[1]}"))
    descriptor = link.fileno()
    assert descriptor is not None
    with socket.socket(fileno=os.dup(descriptor)) as connection:
        assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        if hasattr(socket, "TCP_KEEPIDLE"):
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 10
    link.close()


def test_a_tcp_link_tries_every_address_of_a_host(server: socket.socket) -> None:
    """localhost can be ::1 first, where a server that knows only IPv4 does not answer."""
    link = TcpLink(parse_url(f"tcp:localhost:{server.getsockname()[1]}"))
    assert link.fileno() is not None
    link.close()


def test_a_host_that_does_not_exist_is_refused_with_what_to_do() -> None:
    with pytest.raises(LinkError, match="write its address in numbers"):
        open_link(Url("tcp", "no-such-host.invalid", 5760))


@posix_only
def test_a_serial_link_hears_sends_and_comes_back_after_it_was_unplugged() -> None:
    pytest.importorskip("serial")
    radio, port = os.openpty()
    link = SerialLink(Url("serial", device=os.ttyname(port), baud=57600))
    os.write(radio, b"\xfd telemetry")
    assert b"".join(everything(link, 1)[1])[:1] == b"\xfd"
    assert link.send(b"\xfd command", None)
    assert os.read(radio, 100) == b"\xfd command"
    os.close(radio)
    os.close(port)
    give_up = time.monotonic() + 20.0
    while link.fileno() is not None:
        assert time.monotonic() < give_up
        link.receive()
    assert link.counters["connections lost"] == 1
    assert not link.send(b"\xfd command", None)
    now_ns = time.monotonic_ns()
    for later in range(4):
        link.tend(now_ns + later * 10**10)
    assert link.counters["connections refused"] == 2  # each try waits its time first
    link.close()


@posix_only
def test_a_serial_port_that_takes_nothing_holds_nobody_up() -> None:
    pytest.importorskip("serial")
    radio, port = os.openpty()
    link = SerialLink(Url("serial", device=os.ttyname(port), baud=57600))
    sent = [link.send(b"\xfd" * 1000, None) for _ in range(200)]
    assert sent[0]
    assert not sent[-1]
    assert link.counters["not sent"] == sent.count(False)
    link.close()
    os.close(radio)
    os.close(port)


@pytest.fixture
def opened() -> Iterator[Callable[[str], Link]]:
    made: list[Link] = []

    def make(text: str) -> Link:
        made.append(open_link(parse_url(text)))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_an_ipv6_link_hears_and_answers(opened: Callable[[str], Link]) -> None:
    try:
        link = opened("udpin:[::1]:0")
    except LinkError:
        pytest.skip("This machine has no IPv6.")
    with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as one:
        one.settimeout(20.0)
        one.sendto(b"six", ("::1", link.url.port))
        (peer,), data, _ = everything(link, 1)
        assert (peer, data) == (f"[::1]:{one.getsockname()[1]}", [b"six"])
        assert link.send(b"answer", peer)
        assert one.recv(100) == b"answer"
