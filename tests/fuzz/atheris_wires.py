"""Coverage-guided: libFuzzer (atheris) chooses the bytes, by which branches of ours they reach. Linux, `pip install atheris`.

    python tests/fuzz/atheris_wires.py DOOR [libFuzzer's options, such as -max_total_time=60]

DOOR: live (a byte a part says what it is, then a length and the part), or a kind of file: tlog, pcap, pcapng, BIN, ulg, plan,
waypoints. An exception ends it, and so does what takes longer than a minute; the input is kept in build/fuzz/.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["adapters", "gateway"]):
    import corpus
    import doors

_LONGEST = 4096


def _parts(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The parts of an input: kind, length, content."""
    at = 0
    while at + 2 <= len(data):
        yield data[at], data[at + 2 : at + 2 + data[at + 1]]
        at += 2 + data[at + 1]


def live(data: bytes) -> None:
    """Parts: a message with a right checksum (its number in the corpus, then its payload), or bytes as they are."""
    session, now = doors.Live(pictured=True), corpus.BEGIN
    for kind, content in _parts(data):
        now += 100_000_000
        lines: list[bytes] = []
        link, told = doors.MAVLINK, content
        if kind & 3 == 0:
            link = doors.RADAR
        elif kind & 3 == 1 and content:
            message = corpus.WANTED[content[0] % len(corpus.WANTED)]
            told = corpus.frame_bytes(message, content[1:], system=1 + (kind >> 4 & 1), sequence=kind)
        elif kind & 3 == 2:
            link = doors.STREAM
        elif kind & 4:
            lines = [content]
        session.take(now, link, f"10.0.0.{kind >> 5}:5", [told], lines)


def of_file(path: Path, data: bytes) -> None:
    """A file of one kind."""
    path.write_bytes(data)
    doors.check_file(path)


def main() -> None:
    """Fuzz one door."""
    door, kept = sys.argv[1], Path("build/fuzz")
    kept.mkdir(parents=True, exist_ok=True)
    longest = _LONGEST if door == "live" else 1 << 16
    options = [sys.argv[0], f"-max_len={longest}", "-timeout=60", f"-artifact_prefix={kept}/", *sys.argv[2:]]
    with tempfile.TemporaryDirectory(prefix="talkdown-atheris-") as made:
        seeds = Path(made) / "seeds"
        seeds.mkdir()
        source = random.Random(1)
        if door == "live":
            for number, data in enumerate(corpus.radar_datagrams(source)[:20] + corpus.told_lines()):
                (seeds / f"radar-{number}").write_bytes(bytes((4 * (number % 8), min(len(data), 255))) + data[:255])
            for number, frame in enumerate(source.sample(corpus.frames(source), 400)):
                if frame.message in corpus.WANTED:
                    content = bytes((corpus.WANTED.index(frame.message),)) + frame.payload[:200]
                    (seeds / f"message-{number}").write_bytes(bytes((1, len(content))) + content)
            atheris.Setup([*options, str(seeds)], live)
        else:
            path = Path(made) / "file"
            for seed in corpus.files(source):
                if seed.name.endswith(f".{door}"):
                    (seeds / seed.name).write_bytes(seed.content[: 1 << 16])
            atheris.Setup([*options, str(seeds)], lambda data: of_file(path, data))
        atheris.Fuzz()


if __name__ == "__main__":
    main()
