"""A process of its own empties the socket: nothing is lost while we cannot read, and it ends when we do."""

import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator

import pytest

from gateway.runtime import drain as drain_module
from gateway.runtime.links import Chunks, open_link
from gateway.runtime.receiver import Receiver
from gateway.runtime.udp import UdpLink
from gateway.runtime.urls import Url, parse_url

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Only with Linux another process empties the socket.")
PATIENCE_S = 20.0


@pytest.fixture
def link() -> Iterator[UdpLink]:
    """A listening link with the receive buffer that the system gives by itself."""
    opened = UdpLink(Url("udpin", "127.0.0.1", 0), None, is_drained=True)
    assert opened.drained_by is not None
    yield opened
    opened.close()


@pytest.fixture
def sender() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        yield opened


def until(happened: Callable[[], bool]) -> None:
    give_up = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < give_up
        time.sleep(0.002)


def everything(link: UdpLink, count: int) -> Chunks:
    """What has come, as soon as there is so much."""
    heard: list[Chunks] = []

    def are_there() -> bool:
        heard.append(link.receive())
        return sum(len(chunks.data) for chunks in heard) >= count

    until(are_there)
    return Chunks.joined(heard)


def is_running(process: int) -> bool:
    """Whether it is, and not only waiting for somebody to take note of its end."""
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def send(sender: socket.socket, link: UdpLink, datagrams: list[bytes]) -> None:
    """As fast as somebody empties the socket, however slow this machine is at the moment."""
    for number, one in enumerate(datagrams):
        sender.sendto(one, ("127.0.0.1", link.url.port))
        if number % 50 == 49:
            until(lambda: not select.select([link._socket], [], [], 0)[0])


def test_every_datagram_comes_whole_in_order_with_its_sender_and_its_time(link: UdpLink, sender: socket.socket) -> None:
    """Of two senders: empty ones, small ones, and the largest that there can be."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        sent = [b"", b"x", *(bytes([number % 251]) * (number % 300) for number in range(400)), os.urandom(65_507)]
        before = time.time_ns()
        other.sendto(b"other", ("127.0.0.1", link.url.port))
        send(sender, link, sent)
        after = time.time_ns()
        heard = everything(link, len(sent) + 1)
        ports = [one.getsockname()[1] for one in (other, sender)]
    assert heard.data == [b"other", *sent]
    assert heard.peers == [f"127.0.0.1:{ports[0]}"] + [f"127.0.0.1:{ports[1]}"] * len(sent)
    times = heard.kernel_utc_ns.tolist()
    assert times == sorted(times)
    assert before <= times[0] <= times[-1] <= after
    assert not link.counters


def test_what_comes_while_we_do_not_read_is_kept(link: UdpLink, sender: socket.socket) -> None:
    """Many times what the receive buffer holds, and the pipe as well; without the other process it would be lost."""
    sent = [f"{number:0300}".encode() for number in range(5000)]
    send(sender, link, sent)
    time.sleep(0.2)
    assert everything(link, len(sent)).data == sent
    link.tend(time.monotonic_ns())
    assert not link.counters


def test_what_is_too_much_even_so_is_left_to_the_kernel_which_counts_it(sender: socket.socket) -> None:
    """While the other process is stopped, as a stand-in for one that does not get its turn."""
    link = UdpLink(Url("udpin", "127.0.0.1", 0), 4096, is_drained=True)
    assert link.drained_by is not None
    os.kill(link.drained_by, signal.SIGSTOP)
    for _ in range(1000):
        sender.sendto(b"x" * 50, ("127.0.0.1", link.url.port))
    os.kill(link.drained_by, signal.SIGCONT)
    link.tend(time.monotonic_ns())
    dropped = link.counters["dropped by the kernel"]
    assert 0 < dropped < 1000
    everything(link, 1000 - dropped)
    link.close()
    assert link.counters["dropped by the kernel"] == dropped


def test_a_link_sends_and_answers_while_another_process_reads(link: UdpLink, sender: socket.socket) -> None:
    sender.settimeout(PATIENCE_S)
    sender.sendto(b"hello", ("127.0.0.1", link.url.port))
    (peer,) = everything(link, 1).peers
    assert link.send(b"answer", peer)
    assert sender.recv(100) == b"answer"


def test_a_peer_that_is_gone_is_counted_and_the_link_goes_on() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        url = parse_url(f"udpout:127.0.0.1:{station.getsockname()[1]}")
    link = open_link(url, is_drained=True)
    assert isinstance(link, UdpLink)

    def is_counted() -> bool:
        link.send(b"anybody?", None)
        link.receive()
        return "socket error ECONNREFUSED" in link.counters

    until(is_counted)
    assert link.drained_by is not None
    link.close()


def test_a_link_goes_on_when_the_other_process_is_killed(link: UdpLink, sender: socket.socket) -> None:
    """What that one had handed over comes first; it is said once, and counted."""
    send(sender, link, [b"before"])
    assert link.drained_by is not None
    assert everything(link, 1).data == [b"before"]
    os.kill(link.drained_by, signal.SIGKILL)
    until(lambda: not is_running(link.drained_by or 0))
    send(sender, link, [b"after", b"that"])
    assert everything(link, 2).data == [b"after", b"that"]
    assert link.drained_by is None
    assert link.counters == {"draining processes lost": 1}
    assert [level for level, text in link.news if "going on without it" in text] == ["warning"]


def test_a_link_works_where_the_other_process_cannot_start(
    monkeypatch: pytest.MonkeyPatch, sender: socket.socket
) -> None:
    monkeypatch.setattr(drain_module, "_PROGRAM", drain_module._PROGRAM.with_name("no_such_program.py"))
    link = UdpLink(Url("udpin", "127.0.0.1", 0), is_drained=True)
    assert link.drained_by is None
    send(sender, link, [b"all the same"])
    assert everything(link, 1).data == [b"all the same"]
    assert link.counters["draining processes lost"] == 1
    link.close()


def test_the_end_loses_nothing_and_leaves_no_process(link: UdpLink, sender: socket.socket) -> None:
    """Everything was sent before the end, and nothing was read: it is in the pipe, in the other process, in the socket."""
    sent = [f"{number:050}".encode() for number in range(3000)]
    send(sender, link, sent)
    process = link.drained_by
    assert process is not None
    link.finish()
    heard: list[bytes] = []
    while more := link.receive().data:
        heard += more
    assert heard == sent
    assert link.drained_by is None
    assert not is_running(process)
    assert not link.counters


def test_a_receiver_takes_in_at_its_end_what_the_other_process_still_holds(
    link: UdpLink, sender: socket.socket
) -> None:
    receiver = Receiver([], [link])
    receiver.start()
    send(sender, link, [b"radar"] * 2000)
    receiver.close()
    assert len(receiver.drain().arrivals) == 2000
    assert link.drained_by is None


def test_the_other_process_ends_when_ours_is_killed_and_not_by_ctrl_c() -> None:
    program = (
        "import time; from gateway.runtime.udp import UdpLink; from gateway.runtime.urls import Url;"
        "link = UdpLink(Url('udpin', '127.0.0.1', 0), is_drained=True);"
        "print(link.drained_by, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) as ours:
        assert ours.stdout is not None
        other = int(ours.stdout.readline())
        os.kill(other, signal.SIGINT)
        os.kill(other, signal.SIGTERM)
        time.sleep(0.1)
        assert is_running(other)
        ours.kill()
    until(lambda: not is_running(other))


def test_a_link_with_a_large_buffer_reads_for_itself_and_one_with_a_small_one_does_not() -> None:
    small = UdpLink(Url("udpin", "127.0.0.1", 0), None)
    assert small.drained_by is not None
    small.close()
    as_asked = UdpLink(Url("udpin", "127.0.0.1", 0), 65_536)
    assert as_asked.drained_by is None
    as_asked.close()
