"""Whole files, spoiled: their records one by one, most of them still right by their checksums; then blind damage."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable

import corpus
import mutations
from fastcrc.crc16 import mcrf4xx

from adapters.mavlink_frames import CRC_WORDS, V1, V2
from adapters.tlog import record_end

Records = list[bytes]


def spoil(source: random.Random, seed: corpus.Seed) -> bytes:
    """One more file like this one."""
    kind = seed.name.rpartition(".")[2]
    if kind in ("plan", "waypoints", "json", "jsonl"):
        return mutations.text(source, seed.content)
    if source.random() < 0.15:
        return mutations.damaged_much(source, seed.content, [seed.content], 12)
    split, bend = _FORMATS[kind]
    records = split(seed.content)
    for _ in range(source.choice((1, 3, 10, 40))):
        _change(source, records, bend)
    data = b"".join(records)
    if source.random() < 0.3:
        data = mutations.damaged_much(source, data, [seed.content], 4)
    return data


def _change(source: random.Random, records: Records, bend: Callable[[random.Random, bytes], bytes]) -> None:
    """One record is bent, said again, left out, or moved."""
    if len(records) < 3:
        return
    at = source.randrange(len(records))
    kind = source.random()
    if kind < 0.7:
        records[at] = bend(source, records[at])
    elif kind < 0.8:
        records.insert(source.randrange(1, len(records)), records[at])
    elif kind < 0.9:
        del records[at]
    else:
        records.insert(source.randrange(1, len(records)), records.pop(at))


def in_place(source: random.Random, data: bytes) -> bytes:
    """A datagram whose content changes and whose length and checksum stay right; blind damage in what is neither."""
    bent = bytearray(data)
    if data[:1] in (bytes([V2]), bytes([V1])) and len(data) > 13:
        first, end = (10, 10 + data[1]) if data[0] == V2 else (6, 6 + data[1])
        if end + 2 <= len(data) and end > first:
            _word(source, bent, source.randrange(first, end), end)
            if source.random() < 0.1:
                bent[source.randrange(3 if data[0] == V2 else 2, first)] = source.randrange(256)
            message = int.from_bytes(bent[7:10], "little") if data[0] == V2 else bent[5]
            crc = mcrf4xx(bytes(bent[1:end]))
            bent[end : end + 2] = (CRC_WORDS[crc & 255 ^ corpus.EXTRA.get(message, 0)] ^ crc >> 8).to_bytes(2, "little")
            return bytes(bent)
    if data[:2] == b"LR" and len(data) > 28:
        _word(source, bent, source.randrange(4, len(data) - 4), len(data) - 4)
        return bytes(bent[:-4]) + zlib.crc32(bent[:-4]).to_bytes(4, "big")
    if bent:
        _word(source, bent, source.randrange(len(bent)), len(bent))
    return bytes(bent)


def _word(source: random.Random, bent: bytearray, at: int, end: int) -> None:
    word = source.choice(mutations.WORDS) if source.random() < 0.7 else source.randbytes(source.choice((1, 2, 4)))
    if source.random() < 0.5:
        word = word[::-1]
    word = word[: end - at]
    bent[at : at + len(word)] = word


def _tlog(content: bytes) -> Records:
    records, at = [], 0
    while (end := record_end(content, at)) is not None:
        records.append(content[at:end])
        at = end
    return records


def _bend_tlog(source: random.Random, record: bytes) -> bytes:
    stamp, frame = int.from_bytes(record[:8], "big"), record[8:]
    kind = source.random()
    if kind < 0.25:
        leap = source.choice((-1, 1)) * 10 ** source.randrange(19)
        stamp = max(stamp + leap, 0) if source.random() < 0.8 else source.getrandbits(64)
        return (stamp & (1 << 64) - 1).to_bytes(8, "big") + frame
    return record[:8] + in_place(source, frame)


def _pcap(content: bytes) -> Records:
    records, at = [content[:24]], 24
    while at + 16 <= len(content):
        end = at + 16 + struct.unpack_from(">I", content, at + 8)[0]
        records.append(content[at:end])
        at = end
    return records


def _bend_pcap(source: random.Random, record: bytes) -> bytes:
    if source.random() < 0.8 and len(record) > 44:
        return record[:44] + in_place(source, record[44:])
    bent = bytearray(record)
    _word(source, bent, source.randrange(min(len(bent), 44)), len(bent))
    return bytes(bent)


def _pcapng(content: bytes) -> Records:
    records, at = [], 0
    while at + 12 <= len(content):
        end = at + struct.unpack_from("<I", content, at + 4)[0]
        records.append(content[at:end])
        at = end
    return records


def _bend_pcapng(source: random.Random, record: bytes) -> bytes:
    inner = 28 + 28
    if source.random() < 0.8 and len(record) > inner + 8:
        length = struct.unpack_from("<I", record, 20)[0] - 28
        return record[:inner] + in_place(source, record[inner : inner + length]) + record[inner + length :]
    bent = bytearray(record)
    _word(source, bent, source.randrange(min(len(bent), inner)), len(bent))
    return bytes(bent)


def _dataflash(content: bytes) -> Records:
    return [b"\xa3\x95" + part for part in content.split(b"\xa3\x95")[1:]]


def _ulog(content: bytes) -> Records:
    records, at = [content[:16]], 16
    while at + 3 <= len(content):
        end = at + 3 + struct.unpack_from("<H", content, at)[0]
        records.append(content[at:end])
        at = end
    return records


def _bend_body(first: int) -> Callable[[random.Random, bytes], bytes]:
    """Content behind a header that mostly stays."""

    def bend(source: random.Random, record: bytes) -> bytes:
        bent = bytearray(record)
        begin = first if len(bent) > first and source.random() < 0.95 else 0
        if bent:
            _word(source, bent, source.randrange(begin, len(bent)), len(bent))
        return bytes(bent)

    return bend


_FORMATS: dict[str, tuple[Callable[[bytes], Records], Callable[[random.Random, bytes], bytes]]] = {
    "tlog": (_tlog, _bend_tlog),
    "pcap": (_pcap, _bend_pcap),
    "pcapng": (_pcapng, _bend_pcapng),
    "BIN": (_dataflash, _bend_body(3)),
    "ulg": (_ulog, _bend_body(3)),
}
