"""Datagrams onto sockets: what is sent, from whom, in which order, and when it stops."""

import socket
from collections.abc import Iterator

import pytest

from gateway.runtime import pace as paced
from gateway.runtime.pace import Datagram, Pace, send_paced

SECOND = 10**9


class Clock:
    """A clock that only goes on while somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(paced, "time", made)
    return made


@pytest.fixture
def listening() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as made:
        made.bind(("127.0.0.1", 0))
        made.settimeout(5.0)
        yield made


@pytest.mark.parametrize(("speed", "takes_s"), [(1.0, 8.0), (4.0, 2.0), (0.5, 16.0)])
def test_instants_come_at_their_own_intervals_times_the_speed(clock: Clock, speed: float, takes_s: float) -> None:
    pace = Pace(speed)
    assert all(pace.wait(1000 * SECOND + n * SECOND) for n in range(9))
    assert clock.now - 100.0 == pytest.approx(takes_s)


def test_an_instant_that_is_past_is_not_waited_for(clock: Clock) -> None:
    pace = Pace(1.0, first=0, began=90.0)
    assert pace.wait(5 * SECOND)
    assert clock.now == 100.0


def test_a_stop_is_heard_while_waiting(clock: Clock) -> None:
    pace = Pace(1.0, lambda: clock.now > 101.0)
    assert pace.wait(0)
    assert not pace.wait(3600 * SECOND)
    assert clock.now < 101.3


def test_each_speaker_sends_from_a_socket_of_its_own_and_kinds_without_an_address_are_left_out(
    listening: socket.socket,
) -> None:
    given = [Datagram(n, n % 3, "mavlink", b"%d" % n) for n in range(9)] + [Datagram(9, "r", "radar", b"x")]
    told: list[int] = []
    address = (socket.AF_INET, listening.getsockname())
    assert send_paced(given, {"mavlink": address}, Pace(None), told.append) == {"MAVLink frames": 9}
    came = [listening.recvfrom(100) for _ in range(9)]
    assert [data for data, _ in came] == [one.data for one in given[:9]]
    assert len({sender for _, sender in came}) == 3
    assert told == list(range(10))
