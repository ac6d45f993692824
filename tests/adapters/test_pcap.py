"""Capture files."""

import io
import struct

import pytest

from adapters.pcap import Captured, PcapReader, PcapWriter

T0 = 1_790_000_000 * 10**9
PAYLOADS = [b"", b"x", b"LR" + bytes(100), bytes(range(256)) * 4]


class Records(list[bytes]):
    """Takes records as a file does."""

    def write(self, record: bytes) -> int:
        self.append(record)
        return len(record)


def _read(data: bytes) -> tuple[list[Captured], PcapReader]:
    reader = PcapReader(io.BytesIO(data))
    return list(reader), reader


def _ipv4(payload: bytes = b"hello", *, fragment: int = 0, protocol: int = 17) -> bytes:
    udp = struct.pack(">HHHH", 5000, 30070, len(payload) + 8, 0) + payload
    ip = struct.pack(
        ">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 7, fragment, 64, protocol, 0, b"\x0a\0\0\1", b"\x0a\0\0\2"
    )
    return ip + udp


def _ipv6(payload: bytes = b"hello") -> bytes:
    udp = struct.pack(">HHHH", 5000, 30070, len(payload) + 8, 0) + payload
    hop_by_hop = bytes([17, 0, 1, 4, 0, 0, 0, 0])
    header = struct.pack(">IHBB", 6 << 28, len(hop_by_hop) + len(udp), 0, 64)
    return header + bytes(15) + b"\1" + bytes(15) + b"\2" + hop_by_hop + udp


def _pcap(link_type: int, *packets: bytes, order: str = "<", nano: bool = False) -> bytes:
    head = struct.pack(f"{order}IHHiIII", 0xA1B23C4D if nano else 0xA1B2C3D4, 2, 4, 0, 0, 65535, link_type)
    fraction = 123_456_000 if nano else 123_456
    records = [struct.pack(f"{order}IIII", T0 // 10**9, fraction, len(one), len(one)) + one for one in packets]
    return head + b"".join(records)


def test_what_was_written_reads_back_with_stamp_sender_and_bytes() -> None:
    sink = Records()
    writer = PcapWriter(sink)
    for number, payload in enumerate(PAYLOADS):
        writer.write(T0 + number * 4000, payload, f"10.1.2.{number}:{40_000 + number}")
    assert len(sink) == 1 + len(PAYLOADS)  # the header, then one write a record
    found, reader = _read(b"".join(sink))
    assert [(one.received_at, one.data, one.sender) for one in found] == [
        (T0 + number * 4000, payload, f"10.1.2.{number}:{40_000 + number}") for number, payload in enumerate(PAYLOADS)
    ]
    assert not +reader.counters


def test_our_headers_have_a_right_checksum() -> None:
    """The ones' complement sum over an IPv4 header is 0xFFFF."""
    sink = Records()
    PcapWriter(sink).write(T0, b"payload", "192.168.7.9:1234")
    words = struct.unpack(">10H", sink[1][16:36])
    total = sum(words)
    assert (total & 0xFFFF) + (total >> 16) == 0xFFFF


@pytest.mark.parametrize("payload", [b"", b"odd", b"even"])
def test_an_ipv6_peer_is_written_as_one_with_the_checksum_that_its_udp_must_have(payload: bytes) -> None:
    sink = Records()
    PcapWriter(sink).write(T0, payload, "[2001:db8::7%3]:4567")
    ((one,), reader) = _read(b"".join(sink))
    assert (one.sender, one.data, +reader.counters) == ("[2001:db8::7]:4567", payload, {})
    packet = sink[1][16:]
    summed = packet[8:40] + struct.pack(">II", len(packet) - 40, 17) + packet[40:] + b"\0" * (len(payload) % 2)
    total = sum(struct.unpack(f">{len(summed) // 2}H", summed))
    assert total % 0xFFFF == 0  # in ones' complement 0xFFFF is 0


@pytest.mark.parametrize("peer", ["udpin:0.0.0.0:14550", "serial:/dev/ttyUSB0:57600", ""])
def test_a_peer_without_an_address_is_written_as_this_machine(peer: str) -> None:
    sink = Records()
    PcapWriter(sink).write(T0, b"payload", peer)
    ((one,), _) = _read(b"".join(sink))
    assert one.sender.startswith("127.0.0.1:")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("nano", [False, True])
def test_both_byte_orders_and_both_resolutions_are_read(order: str, nano: bool) -> None:
    found, _ = _read(_pcap(101, _ipv4(), order=order, nano=nano))
    assert found == [Captured(T0 + 123_456_000, b"hello", "10.0.0.1:5000", "10.0.0.2:30070")]


@pytest.mark.parametrize(
    ("link_type", "before"),
    [
        (101, b""),
        (1, bytes(12) + b"\x08\x00"),
        (1, bytes(12) + b"\x81\x00\x00\x05\x08\x00"),
        (113, bytes(14) + b"\x08\x00"),
        (276, b"\x08\x00" + bytes(18)),
        (0, b"\x02\0\0\0"),
        (228, b""),
    ],
    ids=["RAW", "Ethernet", "VLAN", "SLL", "SLL2", "NULL", "IPv4"],
)
def test_every_link_type_gives_the_same_datagram(link_type: int, before: bytes) -> None:
    found, _ = _read(_pcap(link_type, before + _ipv4()))
    assert [one.data for one in found] == [b"hello"]


def test_ipv6_with_extension_headers_is_read() -> None:
    found, _ = _read(_pcap(101, _ipv6()) + b"")
    assert found == [Captured(T0 + 123_456_000, b"hello", "[::1]:5000", "[::2]:30070")]


def test_the_padding_of_short_ethernet_frames_is_no_payload() -> None:
    found, _ = _read(_pcap(1, bytes(12) + b"\x08\x00" + _ipv4() + bytes(13)))
    assert found[0].data == b"hello"


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (_ipv4(protocol=6), "not UDP"),
        (b"", "not UDP"),
        (_ipv4(fragment=0x2000), "fragments"),
        (_ipv4(fragment=5), "fragments"),
        (_ipv4()[:-2], "cut by the capture"),
        (_ipv4()[:24], "cut by the capture"),
    ],
)
def test_what_is_no_whole_datagram_is_left_out_and_counted(packet: bytes, reason: str) -> None:
    found, reader = _read(_pcap(101, packet, _ipv4(b"next")))
    assert [one.data for one in found] == [b"next"]
    assert dict(reader.counters) == {reason: 1}


def test_an_unknown_link_type_is_counted() -> None:
    found, reader = _read(_pcap(147, _ipv4()))
    assert not found
    assert reader.counters["unknown link type"] == 1


def test_a_file_cut_anywhere_keeps_every_whole_datagram_and_never_raises() -> None:
    data = _pcap(101, _ipv4(b"a"), _ipv4(b"b"))
    record = (len(data) - 24) // 2
    for end in range(4, len(data)):
        found, _ = _read(data[:end])
        assert len(found) == max(end - 24, 0) // record


def _block(kind: int, body: bytes, order: str) -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack(f"{order}II", kind, len(body) + 12) + body + struct.pack(f"{order}I", len(body) + 12)


def _section(order: str) -> bytes:
    return _block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1), order)


def _enhanced(order: str, ticks: int, packet: bytes, interface: int = 0) -> bytes:
    head = struct.pack(f"{order}IIIII", interface, ticks >> 32, ticks & 0xFFFFFFFF, len(packet), len(packet))
    return _block(6, head + packet, order)


@pytest.mark.parametrize("order", ["<", ">"])
def test_pcapng_is_read_with_each_interfaces_resolution_and_offset(order: str) -> None:
    """Microseconds by default, 10^-9 by option, 2^-10 by option with an offset in seconds; unknown blocks are passed."""
    nano = struct.pack(f"{order}HHB3x", 9, 1, 9) + struct.pack(f"{order}HH", 0, 0)
    binary = struct.pack(f"{order}HHB3x", 9, 1, 0x80 | 10) + struct.pack(f"{order}HHq", 14, 8, T0 // 10**9)
    interfaces = [_block(1, struct.pack(f"{order}HHI", 101, 0, 0) + options, order) for options in (b"", nano, binary)]
    packets = [
        _enhanced(order, T0 // 1000 + 7, _ipv4(b"one"), 0),
        _block(5, bytes(12), order),
        _enhanced(order, T0 + 9, _ipv4(b"two"), 1),
        _enhanced(order, 512, _ipv4(b"three"), 2),
    ]
    found, reader = _read(_section(order) + b"".join(interfaces + packets))
    assert [(one.received_at - T0, one.data) for one in found] == [(7000, b"one"), (9, b"two"), (5 * 10**8, b"three")]
    assert not +reader.counters


def test_a_pcapng_cut_anywhere_never_raises() -> None:
    data = _section("<") + _block(1, struct.pack("<HHI", 101, 0, 0), "<") + _enhanced("<", 1, _ipv4(b"one"))
    for end in range(4, len(data)):
        assert len(_read(data[:end])[0]) == 0
    assert len(_read(data)[0]) == 1
