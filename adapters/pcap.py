"""Capture files: UDP datagrams out of .pcap and .pcapng, and our own .pcap written.

    pcap    magic A1B2C3D4 (microseconds) or A1B23C4D (nanoseconds), either byte order; version, zone, digits, snapshot length,
            link type (24 bytes); then repeated {seconds u32, fraction u32, kept u32, original u32, packet}
    pcapng  blocks {type u32, length u32, body, length u32}: section header 0A0D0D0A (byte-order magic 1A2B3C4D),
            interface 1 (link type, options: if_tsresol 9, if_tsoffset 14), enhanced packet 6, simple packet 3

Link types: NULL (0), Ethernet (1), RAW (101), LOOP (108), Linux SLL (113), IPv4 (228), IPv6 (229), SLL2 (276).
Datagrams that were cut by the capture or fragmented by IP are left out and counted.

Ours is LINKTYPE_RAW with microseconds: each datagram behind an IP and UDP header that we make up, of the version that
the peer's address has, so that every tool opens it. A peer without an address (a serial port) is written as 127.0.0.1.
"""

from __future__ import annotations

import ipaddress
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import BinaryIO

from adapters.tlog import RecordSink

LINKTYPE_RAW = 101
RADAR_PORT = 30070
_PCAP_MAGICS = {
    b"\xa1\xb2\xc3\xd4": (">", 1000), b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\x3c\x4d": (">", 1), b"\x4d\x3c\xb2\xa1": ("<", 1),
}  # fmt: skip
PCAPNG_MAGIC = b"\x0a\x0d\x0d\x0a"
_UDP = 17
_LARGEST_PACKET = 1 << 18
_SNAPSHOT = 65535


@dataclass(frozen=True, slots=True)
class Captured:
    """One UDP datagram: the capture's stamp (ns since 1970 UTC) and who sent it to whom ("address:port")."""

    received_at: int
    data: bytes
    sender: str
    receiver: str


def is_capture(beginning: bytes) -> bool:
    """Whether these first bytes of a file are those of a .pcap or .pcapng."""
    return beginning[:4] in _PCAP_MAGICS or beginning[:4] == PCAPNG_MAGIC


@dataclass(slots=True)
class PcapReader:
    """The UDP datagrams of a .pcap or .pcapng, in the file's order.

    Counters: "not UDP", "cut by the capture", "fragments", "unknown link type", "cut at the end".
    """

    file: BinaryIO
    counters: Counter[str] = field(default_factory=Counter)

    def __iter__(self) -> Iterator[Captured]:
        """Every datagram. A damaged end ends the iteration. Raises ValueError for a file that is no capture."""
        magic = self.file.read(4)
        if magic == PCAPNG_MAGIC:
            packets = self._pcapng()
        elif magic in _PCAP_MAGICS:
            packets = self._pcap(*_PCAP_MAGICS[magic])
        else:
            raise ValueError("not a capture file")
        for link_type, stamp, packet, is_whole in packets:
            network = _NETWORK_OF_LINK.get(link_type)
            if network is None:
                self.counters["unknown link type"] += 1
                continue
            found = self._datagram(network(packet))
            if found is None:
                continue
            data, sender, receiver, length = found
            if not is_whole or len(data) < length:
                self.counters["cut by the capture"] += 1
                continue
            yield Captured(stamp, data, sender, receiver)

    def _pcap(self, order: str, unit_ns: int) -> Iterator[tuple[int, int, bytes, bool]]:
        """Link type, stamp, packet, and whether it was captured whole."""
        rest = self.file.read(20)
        if len(rest) < 20:
            self.counters["cut at the end"] += 1
            return
        link_type = struct.unpack(f"{order}HHiIII", rest)[5] & 0xFFFF
        header = struct.Struct(f"{order}IIII")
        while True:
            beginning = self.file.read(16)
            if not beginning:
                return
            if len(beginning) < 16:
                break
            seconds, fraction, kept, original = header.unpack(beginning)
            packet = self.file.read(kept) if kept <= _LARGEST_PACKET else b""
            if len(packet) < kept or kept > _LARGEST_PACKET:
                break
            yield link_type, seconds * 10**9 + fraction * unit_ns, packet, kept >= original
        self.counters["cut at the end"] += 1

    def _pcapng(self) -> Iterator[tuple[int, int, bytes, bool]]:
        order = "<"
        interfaces: list[tuple[int, Callable[[int], int]]] = []
        beginning = PCAPNG_MAGIC + self.file.read(8)
        while beginning:
            if len(beginning) < 12:
                break
            if beginning[:4] == PCAPNG_MAGIC:  # a new section: its own byte order and interfaces
                order, interfaces = (">" if beginning[8:12] == b"\x1a\x2b\x3c\x4d" else "<"), []
            kind, length = struct.unpack(f"{order}II", beginning[:8])
            if not 12 <= length <= _LARGEST_PACKET * 2 or length % 4:
                break
            body = beginning[8:12] + self.file.read(length - 12)
            if len(body) < length - 8:
                break
            body = body[:-4]
            if kind == 1 and len(body) >= 8:
                interfaces.append((struct.unpack_from(f"{order}H", body)[0], _resolution(body[8:], order)))
            elif kind == 6 and len(body) >= 20:
                number, high, low, kept, original = struct.unpack_from(f"{order}IIIII", body)
                if number < len(interfaces):
                    link_type, nanoseconds = interfaces[number]
                    yield link_type, nanoseconds(high << 32 | low), body[20 : 20 + kept], kept >= original
            elif kind == 3:
                self.counters["without a time"] += 1
            beginning = self.file.read(12)
        if beginning:
            self.counters["cut at the end"] += 1

    def _datagram(self, packet: bytes | None) -> tuple[bytes, str, str, int] | None:
        """Payload, sender, receiver and the payload's length as its header says; None where this is no UDP."""
        found = None if packet is None else _ipv4(packet) if packet[:1] and packet[0] >> 4 == 4 else _ipv6(packet)
        if found == "fragment":
            self.counters["fragments"] += 1
            return None
        if found is None or isinstance(found, str):
            self.counters["not UDP"] += 1
            return None
        source, destination, segment = found
        if len(segment) < 8:
            self.counters["cut by the capture"] += 1
            return None
        source_port, destination_port, length = struct.unpack_from(">HHH", segment)
        data = segment[8:length]
        return data, _name(source, source_port), _name(destination, destination_port), max(length - 8, 0)


class PcapWriter:
    """Writes a capture of its own: the header at once, then a record for each datagram."""

    def __init__(self, sink: RecordSink) -> None:
        self._sink = sink
        sink.write(struct.pack(">IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, _SNAPSHOT, LINKTYPE_RAW))

    def write(self, received_at: int, data: bytes, peer: str = "") -> None:
        """Add one datagram. `received_at` in ns since 1970 UTC, kept to the microsecond; `peer` is "host:port"."""
        address, port = _address(peer)
        packet = _ipv4_packet(address, port, data) if len(address) == 4 else _ipv6_packet(address, port, data)
        seconds, nanoseconds = divmod(received_at, 10**9)
        record = struct.pack(">IIII", seconds, nanoseconds // 1000, len(packet), len(packet))
        self._sink.write(record + packet)


def _ipv4_packet(sender: bytes, port: int, data: bytes) -> bytes:
    udp = struct.pack(">HHHH", port, RADAR_PORT, len(data) + 8, 0)
    ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, len(data) + 28, 0, 0x4000, 64, _UDP, 0, sender, b"\x7f\0\0\1")
    return ip[:10] + _checksum(ip).to_bytes(2, "big") + ip[12:] + udp + data


def _ipv6_packet(sender: bytes, port: int, data: bytes) -> bytes:
    """Its UDP must have a checksum, which covers the addresses as well."""
    receiver, length = ipaddress.IPv6Address("::1").packed, len(data) + 8
    udp = struct.pack(">HHHH", port, RADAR_PORT, length, 0)
    summed = sender + receiver + struct.pack(">II", length, _UDP) + udp + data
    checksum = _checksum(summed + b"\0" * (len(summed) % 2)) or 0xFFFF
    ip = struct.pack(">IHBB16s16s", 6 << 28, length, _UDP, 64, sender, receiver)
    return ip + udp[:6] + checksum.to_bytes(2, "big") + data


@lru_cache(maxsize=64)
def _address(peer: str) -> tuple[bytes, int]:
    host, _, port = peer.rpartition(":")
    number = int(port) if port.isdecimal() and int(port) < 65536 else 0
    try:
        return ipaddress.ip_address(host.strip("[]").partition("%")[0]).packed, number
    except ValueError:
        return b"\x7f\0\0\1", number


def _checksum(header: bytes) -> int:
    total: int = sum(struct.unpack(f">{len(header) // 2}H", header))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def _name(address: bytes, port: int) -> str:
    host = ipaddress.ip_address(address)
    return f"{host}:{port}" if host.version == 4 else f"[{host}]:{port}"


def _ipv4(packet: bytes) -> tuple[bytes, bytes, bytes] | str | None:
    if len(packet) < 20:
        return None
    header, length = (packet[0] & 15) * 4, int.from_bytes(packet[2:4], "big")
    if packet[9] != _UDP or header < 20:
        return None
    if int.from_bytes(packet[6:8], "big") & 0x3FFF:  # more fragments, or not the first one
        return "fragment"
    return packet[12:16], packet[16:20], packet[header : length or None]  # 0: left to the network card


def _ipv6(packet: bytes) -> tuple[bytes, bytes, bytes] | str | None:
    if len(packet) < 40 or packet[0] >> 4 != 6:
        return None
    following, at = packet[6], 40
    while following in (0, 43, 60) and len(packet) >= at + 8:  # hop-by-hop, routing, destination options
        following, at = packet[at], at + 8 + packet[at + 1] * 8
    if following == 44:
        return "fragment"
    return (packet[8:24], packet[24:40], packet[at:]) if following == _UDP else None


def _resolution(options: bytes, order: str) -> Callable[[int], int]:
    """From an interface's ticks to ns: microseconds unless its options say otherwise."""
    numerator, denominator, offset_s, at = 1000, 1, 0, 0
    while at + 4 <= len(options):
        code, length = struct.unpack_from(f"{order}HH", options, at)
        value = options[at + 4 : at + 4 + length]
        if code == 9 and length == 1 and value:
            denominator = 1 << (value[0] & 127) if value[0] & 128 else 10 ** value[0]
            numerator = 10**9
        elif code == 14 and len(value) == 8:
            offset_s = struct.unpack(f"{order}q", value)[0]
        elif code == 0:
            break
        at += 4 + (length + 3) // 4 * 4
    return lambda ticks: ticks * numerator // denominator + offset_s * 10**9


def _raw(packet: bytes) -> bytes | None:
    return packet


def _loopback(packet: bytes) -> bytes | None:
    return packet[4:]  # the address family differs between systems; the IP version tells as well


def _after(at: int, kinds: tuple[bytes, ...]) -> Callable[[bytes], bytes | None]:
    """The network packet behind a header whose last two bytes before `at` name the protocol."""

    def network(packet: bytes) -> bytes | None:
        return packet[at:] if packet[at - 2 : at] in kinds else None

    return network


_IP = (b"\x08\x00", b"\x86\xdd")


def _ethernet(packet: bytes) -> bytes | None:
    at = 14
    while packet[at - 2 : at] in (b"\x81\x00", b"\x88\xa8"):  # VLAN tags
        at += 4
    return packet[at:] if packet[at - 2 : at] in _IP else None


def _sll2(packet: bytes) -> bytes | None:
    return packet[20:] if packet[:2] in _IP else None


_NETWORK_OF_LINK: dict[int, Callable[[bytes], bytes | None]] = {
    0: _loopback,
    1: _ethernet,
    LINKTYPE_RAW: _raw,
    108: _loopback,
    113: _after(16, _IP),
    228: _raw,
    229: _raw,
    276: _sll2,
}
