"""From chunks of links to stamped arrivals."""

import pytest
from fastcrc.crc16 import mcrf4xx

from adapters.mavlink_frames import encode
from gateway.runtime import intake as intake_module
from gateway.runtime.allowed import Allowed, parse_allowed
from gateway.runtime.intake import PEERS_AT_MOST, Intake
from gateway.runtime.links import Chunks
from gateway.runtime.stamps import Stamper

HEARTBEAT = {"type": 1, "autopilot": 3, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
NOW = 1_800_000_000_000_000_000


def frame(sequence: int) -> bytes:
    return encode("HEARTBEAT", HEARTBEAT, system=1, sequence=sequence)


def intake(mavlink: int = 1, radar: int = 1, allowed: Allowed | None = None) -> Intake:
    """An intake whose clocks stand still at NOW."""
    stamper = Stamper(lambda: NOW, lambda: 0)
    return Intake(stamper, [f"link {n}" for n in range(mavlink)], [f"radar link {n}" for n in range(radar)], allowed)


def said(peer: str, *data: bytes, stream: int | None = None, kernel: tuple[int, ...] = ()) -> Chunks:
    """What one peer said, each piece with the kernel's time where it is told."""
    return Chunks.of([peer] * len(data), list(data), list(kernel) or [0] * len(data), stream)


def test_links_are_merged_by_the_kernels_times_of_arrival() -> None:
    takes = intake()
    _, arrivals = takes.take(
        [
            (0, said("a", frame(0), frame(1), kernel=(NOW - 3_000_000, NOW - 1_000_000))),
            (1, said("r", b"plot", kernel=(NOW - 2_000_000,))),
        ]
    )
    assert [arrival.data for arrival in arrivals] == [frame(0), b"plot", frame(1)]


def test_what_one_link_says_keeps_its_order_whatever_the_kernel_stamped() -> None:
    takes = intake()
    _, arrivals = takes.take([(0, said("a", frame(0), frame(1), kernel=(NOW - 1_000, NOW - 9_000)))])
    assert [arrival.data for arrival in arrivals] == [frame(0), frame(1)]


def test_sources_are_numbered_once_and_named_apart() -> None:
    takes = intake(2, 2)
    first, _ = takes.take([(0, said("a", frame(0))), (1, said("a", frame(0)))])
    again, _ = takes.take([(0, said("a", frame(1)))])
    assert [(source.number, source.name) for source in first] == [
        (0, "radar-1"),
        (1, "radar-2"),
        (2, "mavlink-1"),
        (3, "mavlink-2"),
    ]
    assert again == []


def test_a_connection_that_begins_anew_never_completes_a_frame_of_the_one_before() -> None:
    takes = intake()
    whole = frame(5)
    takes.take([(0, said("a", frame(4) + whole[:9], stream=0))])
    _, arrivals = takes.take([(0, said("a", whole[9:] + frame(6), stream=1))])
    assert [arrival.data for arrival in arrivals] == [frame(6)]


def test_more_peers_than_anyone_has_are_counted_and_not_heard() -> None:
    takes = intake()
    sources, _ = takes.take([(0, said(f"peer {n}", frame(0))) for n in range(PEERS_AT_MOST + 3)])
    assert sum(source.kind == "mavlink" for source in sources) == PEERS_AT_MOST
    assert takes.counters["link 0"]["datagrams of too many peers"] == 3


def test_peers_that_are_not_allowed_never_become_sources_and_are_counted_by_link() -> None:
    takes = intake(allowed=parse_allowed(["10.0.0.0/24"]))
    sources, arrivals = takes.take(
        [
            (0, said("10.0.1.9:5", frame(0), frame(1))),
            (0, said("10.0.0.9:5", frame(2))),
            (1, said("10.0.1.9:6", b"plot")),
            (1, said("10.0.0.9:6", b"plot")),
        ]
    )
    assert [source.origin for source in sources] == ["radar link 0", "link 0 from 10.0.0.9:5"]
    assert [arrival.data for arrival in arrivals] == [frame(2), b"plot"]
    assert takes.counters["link 0"]["peer not allowed"] == 2
    assert takes.counters["radar link 0"]["peer not allowed"] == 1


def test_a_byte_stream_needs_no_leave_because_its_url_named_it() -> None:
    takes = intake(allowed=parse_allowed(["10.0.0.0/24"]))
    _, arrivals = takes.take([(0, said("serial:/dev/ttyUSB0:57600", frame(0) + frame(1), stream=0))])
    assert [arrival.data for arrival in arrivals] == [frame(0), frame(1)]


def test_systems_that_are_not_allowed_are_left_out_frame_by_frame_and_make_no_source() -> None:
    takes = intake(allowed=parse_allowed(systems=["1"]))
    other = encode("HEARTBEAT", HEARTBEAT, system=2)
    sources, arrivals = takes.take([(0, said("a", other + frame(0) + other)), (0, said("b", other))])
    assert [source.origin for source in sources if source.kind == "mavlink"] == ["link 0 from a"]
    assert [arrival.data for arrival in arrivals] == [frame(0)]
    assert takes.counters["link 0"]["system not allowed"] == 3


def test_the_way_back_to_a_source_is_its_link_and_its_peer() -> None:
    takes = intake(2, 1)
    sources, _ = takes.take([(0, said("a", frame(0))), (1, said("a", frame(1)))])
    ways = {source.name: takes.way_to(source.number) for source in sources}
    assert ways == {"radar-1": None, "mavlink-1": (0, "a"), "mavlink-2": (1, "a")}


def test_many_datagrams_at_once_give_what_each_alone_gives() -> None:
    """Whole frames, several in one, damage, noise, an id that nobody knows: whatever else is among the many."""
    unknown = b"\xfd\x01\0\0\x07\x01\x01\xff\xff\x7f\x2a"
    odd = [frame(1) + frame(2), frame(3)[:-1] + b"?", b"noise", unknown + mcrf4xx(unknown[1:]).to_bytes(2, "little")]
    for extra in ([], *([one] for one in odd)):
        data = [*(frame(number & 255) for number in range(300)), *extra, frame(1)]
        peers = ["a", "b"] * (len(data) // 2) + ["b"] * (len(data) % 2)
        at_once, alone = intake(), intake()
        for takes in (at_once, alone):
            takes.take([(0, said("a", frame(0))), (0, said("b", frame(0)))])
        times = [NOW - 1_000_000 + 7 * number for number in range(len(data))]
        together = at_once.take([(0, Chunks.of(peers, data, times))])
        one_by_one = [
            alone.take([(0, Chunks.of([peer], [one], [at]))]) for peer, one, at in zip(peers, data, times, strict=True)
        ]
        assert together == ([], [arrival for _, arrivals in one_by_one for arrival in arrivals])
        assert (together.arrivals.heads is None) == bool(extra)
        assert at_once.counters == alone.counters


def test_many_over_several_links_and_a_radars_are_merged_by_time_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, and by the way that few take; what one link says keeps its order though its times fall back."""
    times = [NOW - 9_000_000 + 1_000 * number - 5_000 * (number % 7 == 3) for number in range(200)]
    told = [
        (0, Chunks.of(["a", "b"] * 100, [frame(number) for number in range(200)], times)),
        (1, Chunks.of(["a"] * 200, [frame(number) for number in range(200)], [0, *times[1:]])),
        (2, Chunks.of(["r", "s"] * 3, [b"plot %d" % number for number in range(6)], times[20:26])),
    ]
    ways = []
    for many in (intake_module.MANY, 10_000):
        monkeypatch.setattr(intake_module, "MANY", many)
        takes = intake(2, 1)
        takes.take([(0, said("a", frame(0))), (0, said("b", frame(0))), (1, said("a", frame(0)))])
        ways.append(takes.take(told))
    assert ways[0] == ways[1]
    assert [one.arrivals.heads is None for one in ways] == [False, True]
    assert {one.peer for one in ways[0].arrivals} == {"", "r", "s"}
