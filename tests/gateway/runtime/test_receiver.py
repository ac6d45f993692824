"""The receiving thread over real sockets on the loopback."""

import socket
import time
from collections.abc import Callable, Iterator

import pytest

from adapters import Arrival, Source
from adapters.mavlink_frames import encode
from gateway.runtime.links import Link, open_link
from gateway.runtime.receiver import Delivery, Receiver
from gateway.runtime.urls import LinkError, parse_url

HEARTBEAT = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}


def heartbeat(system: int = 1, sequence: int = 0) -> bytes:
    return encode("HEARTBEAT", HEARTBEAT, system=system, sequence=sequence)


def address(link: Link) -> tuple[str, int]:
    return ("127.0.0.1", link.url.port)


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


class Heard:
    """Everything a receiver delivered, gathered until it is enough."""

    def __init__(self, receiver: Receiver) -> None:
        self.receiver = receiver
        self.sources: list[Source] = []
        self.arrivals: list[Arrival] = []
        self.deliveries: list[Delivery] = []

    def gather(self) -> None:
        delivery = self.receiver.drain()
        self.sources += delivery.sources
        self.arrivals += delivery.arrivals
        self.deliveries.append(delivery)

    def until(self, enough: Callable[[], bool]) -> None:
        give_up = time.monotonic() + 20.0
        while not enough():
            assert time.monotonic() < give_up, "the receiver did not deliver what was sent"
            self.gather()
            time.sleep(0.002)


@pytest.fixture
def links() -> Iterator[Callable[[str], Link]]:
    opened: list[Link] = []

    def make(text: str) -> Link:
        opened.append(open_link(parse_url(text)))
        return opened[-1]

    yield make
    for link in opened:
        link.close()


def test_every_peer_of_a_listening_link_is_a_source_of_its_own(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    receiver.start()
    heard = Heard(receiver)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        sender.sendto(heartbeat(1), address(link))
        other.sendto(heartbeat(2), address(link))
        heard.until(lambda: len(heard.arrivals) == 2)
    receiver.close()
    assert [source.name for source in heard.sources] == ["mavlink-1", "mavlink-2"]
    assert {arrival.source for arrival in heard.arrivals} == {source.number for source in heard.sources}


def test_each_frame_of_a_datagram_is_an_arrival_with_a_stamp_of_its_own(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    receiver.start()
    heard = Heard(receiver)
    frames = [heartbeat(1, number) for number in range(3)]
    sender.sendto(b"".join(frames), address(link))
    heard.until(lambda: len(heard.arrivals) == 3)
    receiver.close()
    assert [arrival.data for arrival in heard.arrivals] == frames
    stamps = [arrival.received_at for arrival in heard.arrivals]
    assert len(set(stamps)) == 3
    assert all(stamp % 4000 == 0 for stamp in stamps)


def test_nothing_is_stamped_at_or_before_a_watermark_that_was_delivered_earlier(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    receiver.start()
    heard = Heard(receiver)
    for number in range(200):
        sender.sendto(heartbeat(1, number), address(link))
        heard.gather()
    heard.until(lambda: len(heard.arrivals) == 200)
    receiver.close()
    before = 0
    for delivery in heard.deliveries:
        assert all(arrival.received_at > before for arrival in delivery.arrivals)
        assert all(arrival.received_at <= delivery.watermark for arrival in delivery.arrivals)
        before = delivery.watermark


def test_a_peer_that_sends_only_noise_never_becomes_a_source(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    receiver.start()
    heard = Heard(receiver)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as noisy:
        noisy.sendto(b"GET / HTTP/1.1\r\n", address(link))
        sender.sendto(heartbeat(), address(link))
        heard.until(lambda: bool(heard.arrivals))
    receiver.close()
    heard.gather()
    assert len(heard.sources) == 1
    assert any("leftover" in reason or "resynced" in reason for reason in receiver.counters())


def test_the_rest_of_a_datagram_never_completes_the_next_one(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    receiver.start()
    heard = Heard(receiver)
    cut = heartbeat(1, 7)
    for datagram in (heartbeat(1, 6), cut[:9], cut[9:], heartbeat(1, 8)):
        sender.sendto(datagram, address(link))
    heard.until(lambda: len(heard.arrivals) >= 2)
    receiver.close()
    heard.gather()
    assert [arrival.data for arrival in heard.arrivals] == [heartbeat(1, 6), heartbeat(1, 8)]


def test_what_does_not_fit_into_the_queue_is_counted_and_said(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([], [link], capacity=5)
    for number in range(20):
        sender.sendto(bytes([number]), address(link))
    receiver.start()
    receiver.close()
    delivery = receiver.drain()
    assert len(delivery.arrivals) == 5
    assert receiver.counters()["queue overflow"] == 15
    assert any(level == "error" for level, _ in delivery.notes)


def test_a_radar_link_is_one_source_and_each_datagram_one_arrival(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([], [link])
    sender.sendto(b"abc", address(link))
    sender.sendto(b"", address(link))
    receiver.start()
    receiver.close()
    delivery = receiver.drain()
    assert [source.name for source in delivery.sources] == ["radar-1"]
    assert [arrival.data for arrival in delivery.arrivals] == [b"abc", b""]
    assert delivery.arrivals[0].peer == f"127.0.0.1:{sender.getsockname()[1]}"


def test_a_tcp_link_hears_frames_that_are_cut_anywhere_and_comes_back_after_a_loss(
    links: Callable[[str], Link],
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = links(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        receiver = Receiver([link], [])
        receiver.start()
        heard = Heard(receiver)
        first, _ = server.accept()
        frame = heartbeat(1, 1)
        first.sendall(frame[:5])
        time.sleep(0.01)
        first.sendall(frame[5:] + frame[:7])
        heard.until(lambda: len(heard.arrivals) == 1)
        first.close()
        second, _ = server.accept()
        second.sendall(heartbeat(1, 2))
        heard.until(lambda: len(heard.arrivals) == 2)
        second.close()
    receiver.close()
    assert [arrival.data for arrival in heard.arrivals] == [frame, heartbeat(1, 2)]
    assert len(heard.sources) == 1
    assert any("connections lost" in reason for reason in receiver.counters())


def test_a_calling_link_sends_one_empty_datagram_and_hears_the_answer(links: Callable[[str], Link]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(20.0)
        link = links(f"udpout:127.0.0.1:{station.getsockname()[1]}")
        receiver = Receiver([link], [])
        receiver.start()
        hello, caller = station.recvfrom(100)
        assert hello == b""
        station.sendto(heartbeat(), caller)
        heard = Heard(receiver)
        heard.until(lambda: len(heard.arrivals) == 1)
        receiver.close()


def test_a_listening_link_sends_nothing(links: Callable[[str], Link], sender: socket.socket) -> None:
    link = links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [])
    sender.bind(("127.0.0.1", 0))
    sender.setblocking(False)
    sender.sendto(heartbeat(), address(link))
    receiver.start()
    heard = Heard(receiver)
    heard.until(lambda: len(heard.arrivals) == 1)
    receiver.close()
    with pytest.raises(BlockingIOError):
        sender.recv(100)


def test_what_is_sent_to_a_source_reaches_its_peer_and_only_it(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    link, radar = links("udpin:127.0.0.1:0"), links("udpin:127.0.0.1:0")
    receiver = Receiver([link], [radar])
    receiver.start()
    heard = Heard(receiver)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.settimeout(20.0)
        sender.sendto(heartbeat(1), address(link))
        heard.until(lambda: len(heard.arrivals) == 1)
        other.sendto(heartbeat(2), address(link))
        heard.until(lambda: len(heard.arrivals) == 2)
        assert receiver.send(heard.arrivals[1].source, b"to the second")
        assert other.recv(100) == b"to the second"
    assert not receiver.send(heard.sources[0].number, b"to a radar")
    assert not receiver.send(99, b"to nobody")
    receiver.close()
    sender.setblocking(False)
    with pytest.raises(BlockingIOError):
        sender.recv(100)
    assert receiver.counters()["not sent"] == 2


def test_several_links_and_thousands_of_frames_arrive_whole_and_each_in_its_order(
    links: Callable[[str], Link], sender: socket.socket
) -> None:
    both = [links("udpin:127.0.0.1:0"), links("udpin:127.0.0.1:0")]
    receiver = Receiver(both, [])
    receiver.start()
    heard = Heard(receiver)
    sent: dict[int, list[bytes]] = {1: [], 2: []}
    for number in range(2500):
        for system, link in enumerate(both, start=1):
            sent[system].append(heartbeat(system, number & 255))
            sender.sendto(sent[system][-1], address(link))
        if number % 50 == 49:  # never more than a small receive buffer holds
            heard.until(lambda wanted=2 * (number + 1): len(heard.arrivals) == wanted)  # type: ignore[misc]
    receiver.close()
    by_source = {
        source.number: [one.data for one in heard.arrivals if one.source == source.number] for source in heard.sources
    }
    assert sorted(by_source.values()) == sorted(sent.values())
    assert receiver.counters() == {}


def test_a_port_in_use_is_refused_with_what_to_do(links: Callable[[str], Link]) -> None:
    link = links("udpin:127.0.0.1:0")
    with pytest.raises(LinkError, match="another program has this port already; close it"):
        open_link(parse_url(f"udpin:127.0.0.1:{link.url.port}"))


def test_nobody_at_a_tcp_address_is_refused_with_what_to_do() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        with pytest.raises(LinkError, match="nobody listens there; start what should answer"):
            open_link(parse_url(f"tcp:127.0.0.1:{probe.getsockname()[1]}"))


def test_a_serial_port_that_is_not_there_is_refused_with_what_to_do() -> None:
    with pytest.raises(LinkError, match="is the radio plugged in"):
        open_link(parse_url("serial:/dev/no-such-port:57600"))


def test_an_error_in_the_receiving_thread_reaches_the_one_who_drains(links: Callable[[str], Link]) -> None:
    class Broken:
        url = parse_url("udpin:127.0.0.1:1")
        patience_s = 0.01

        def fileno(self) -> None:
            pass

        def tend(self, now_ns: int) -> None:
            raise MemoryError("no more")

        def close(self) -> None:
            pass

    receiver = Receiver([Broken()], [])  # type: ignore[list-item]
    receiver.start()
    with pytest.raises(MemoryError):
        Heard(receiver).until(lambda: False)
    receiver.close()
