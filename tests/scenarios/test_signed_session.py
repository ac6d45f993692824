"""A session with a MAVLink key under attack: forged, unsigned and replayed frames change nothing but counters."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from adapters import Arrival, Source
from adapters.mavlink_frames import parse
from adapters.signing import Signer
from adapters.tlog import TlogReader
from gateway.runtime.folder import read_record
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.run import Run
from gateway.runtime.setup import Setup

KEY, OTHER_KEY = (hashlib.sha256(word).digest() for word in (b"ours", b"theirs"))
ATTACKER = Source(7, "mavlink", "mavlink-2", "udpin:0.0.0.0:14550 from 10.0.0.66:4000")
MICROSECONDS_4 = 4000
SECOND = 10**9


@pytest.fixture(scope="module")
def signed(approach: Path) -> tuple[list[Source], list[Arrival]]:
    """The sources and arrivals of half a minute of an approach whose aircraft signs."""
    playback, signer = open_playback([approach]), Signer(KEY)
    kinds = {source.number: source.kind for source in playback.sources}
    arrivals = []
    for arrival in playback.arrivals():
        if arrival.received_at > playback.started_at + 30 * SECOND:
            break
        if kinds[arrival.source] == "mavlink":
            arrival = arrival._replace(data=signer.sign(arrival.data, 0, arrival.received_at))
        arrivals.append(arrival)
    return list(playback.sources), arrivals


def _attacked(arrivals: list[Arrival], vehicle: int) -> Iterator[Arrival]:
    """The same, and after each frame of the vehicle one of an attacker, or one again from the vehicle's own address."""
    theirs, heard = Signer(OTHER_KEY), []
    for arrival in arrivals:
        yield arrival
        if arrival.source != vehicle:
            continue
        heard.append(arrival.data)
        plain = _moved(arrival.data)
        stamp = arrival.received_at + MICROSECONDS_4
        yield (
            Arrival(stamp, ATTACKER.number, plain),
            Arrival(stamp, ATTACKER.number, theirs.sign(plain, 0, stamp)),
            Arrival(stamp, ATTACKER.number, heard[max(len(heard) - 200, 0)] if len(heard) > 200 else plain),
            Arrival(stamp, vehicle, arrival.data),
        )[len(heard) % 4]


def _moved(frame: bytes) -> bytes:
    """Its message without the signature, two bytes of it changed, with a right checksum."""
    from pymavlink.dialects.v20 import all as dialect

    told = parse(frame)
    assert told is not None
    link = dialect.MAVLink(None, srcSystem=told.system, srcComponent=told.component)
    payload = bytes(byte ^ (index in (5, 6)) for index, byte in enumerate(told.payload))
    kind = dialect.mavlink_map[told.message]
    return bytes(dialect.MAVLink_message(told.message, kind.msgname)._pack(link, kind.crc_extra, payload))


def _run(sources: list[Source], arrivals: list[Arrival], archive: Path, place: Path, key: bytes | None = KEY) -> Path:
    setup = Setup(
        place=open_playback([place]).place, archive=archive, live=True, signing_key=key, is_watched=False, name="signed"
    )
    run = Run(setup, arrivals[0].received_at - MICROSECONDS_4)
    for source in sources:
        run.add(source)
    run.work(arrivals, arrivals[-1].received_at)
    summary = run.finish("done")
    assert summary.archive is not None
    return summary.archive


def _frames(path: Path) -> list[bytes]:
    with path.open("rb") as file:
        return [frame for _, frame in TlogReader(file)]


def test_forged_unsigned_and_replayed_frames_change_no_bit_and_are_kept_apart(
    signed: tuple[list[Source], list[Arrival]], approach: Path, tmp_path: Path
) -> None:
    sources, arrivals = signed
    vehicle = next(source.number for source in sources if source.kind == "mavlink")
    attacked = list(_attacked(arrivals, vehicle))
    left_alone = _run(sources, arrivals, tmp_path / "left alone", approach)
    folder = _run([*sources, ATTACKER], attacked, tmp_path / "attacked", approach)
    playback = open_playback([folder])
    setup = Setup(place=playback.place, options=playback.options, archive=tmp_path / "again", is_watched=False)
    again = run_replay(playback, setup).archive
    assert again is not None
    for name in ("tracks.parquet", "predictions.parquet"):
        table = pq.read_table(left_alone / name)
        assert table.num_rows > 20
        assert pq.read_table(folder / name).equals(table)
        assert pq.read_table(again / name).equals(table)

    counters = read_record(folder).counters
    assert counters["mavlink-2 unsigned"] > 100
    assert counters["mavlink-2 wrong signature"] > 100
    assert counters["mavlink-2 replayed"] > 50
    assert counters["mavlink-1 replayed"] > 100
    refused = sum(counters.get(f"mavlink-{number} {reason}", 0) for number in (1, 2) for reason in
                  ("unsigned", "wrong signature", "replayed"))  # fmt: skip
    assert refused == len(attacked) - len(arrivals)


def test_every_frame_is_recorded_byte_for_byte_where_it_belongs(
    signed: tuple[list[Source], list[Arrival]], approach: Path, tmp_path: Path
) -> None:
    sources, arrivals = signed
    vehicle = next(source.number for source in sources if source.kind == "mavlink")
    attacked = list(_attacked(arrivals, vehicle))
    inputs = _run([*sources, ATTACKER], attacked, tmp_path, approach) / "inputs"
    true = [arrival.data for arrival in arrivals if arrival.source == vehicle]
    assert _frames(inputs / "mavlink-1.tlog") == true
    assert _frames(inputs / "mavlink-2.tlog") == []
    assert _frames(inputs / "mavlink-1.refused.tlog") == true[2::4]
    attacks = [arrival.data for arrival in attacked if arrival.source == ATTACKER.number]
    assert _frames(inputs / "mavlink-2.refused.tlog") == attacks


def test_without_the_key_the_same_attack_does_change_the_tracks(
    signed: tuple[list[Source], list[Arrival]], approach: Path, tmp_path: Path
) -> None:
    sources, arrivals = signed
    vehicle = next(source.number for source in sources if source.kind == "mavlink")
    believed = [*sources, ATTACKER], list(_attacked(arrivals, vehicle))
    open_to_all = _run(*believed, tmp_path / "open", approach, None)
    guarded = _run(*believed, tmp_path / "guarded", approach)
    tracks = "tracks.parquet"
    assert not pq.read_table(open_to_all / tracks).equals(pq.read_table(guarded / tracks))
