"""The fuzzer: mutated datagrams and files through every door from bytes. `make fuzz`, or:

    python tests/fuzz/run.py [--datagrams N] [--files N] [--seed N] [--minutes M]

An exception, a number that is none, a batch that takes longer than a minute, and memory that grows end it with exit code 1
and what is needed to see it again. Everything follows from the seed.
"""

from __future__ import annotations

import argparse
import gc
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import corpus
import mutations
import spoiled
from doors import MAVLINK, RADAR, STREAM, Live, Unsound, check_file
from session import session_seeds, spoil_session

BATCH = 64  # datagrams of one peer at once
EPISODE = 50_000  # datagrams of a session that is then forgotten
PICTURED = 1_500  # datagrams of a session that the pipeline works in
HANG_S = 60
GROWTH_MB = 64  # that the memory of one endless session may grow after the first fifth of the datagrams
TICK_NS = 16_000_000  # that the clock goes on with each batch
_PEERS = 6


def rss_mb() -> float:
    """The memory that this process has now."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:  # not Linux: the most it had so far
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20 if sys.platform == "darwin" else 1 << 10)
    return pages * resource.getpagesize() / (1 << 20)


class Episode:
    """A session that is received for a while, and heard twice: many datagrams together, and each by itself."""

    def __init__(self, now: int = corpus.BEGIN, *, signed: bool = False, pictured: bool = False) -> None:
        self.twins = (
            Live(signed=signed, pictured=pictured, now=now),
            Live(signed=signed, one_by_one=True, now=now),
        )

    def take(self, now: int, link: int, peer: str, data: Sequence[bytes], lines: Sequence[bytes]) -> None:
        """What a peer sends at once; what people tell."""
        together, single = self.twins
        sources, arrivals = together.receive(now, link, peer, data, lines)
        together.hear(now, sources, arrivals)
        single.hear(now, sources, arrivals)

    def ended(self) -> Counter[str]:
        """What was observed. Raises Unsound where the two differ."""
        together, single = self.twins
        counted = together.decoder.counters()
        if counted != single.decoder.counters() or together.observed != single.observed:
            raise Unsound(f"taken together {counted}, each by itself {single.decoder.counters()}")
        return together.observed


@dataclass
class Fuzzer:
    """A run. `endless`: a session that takes in every datagram from the first to the last, to see whether it grows."""

    seed: int
    began: float = field(default_factory=time.monotonic)
    done: int = 0
    observed: Counter[str] = field(default_factory=Counter)
    outcomes: Counter[str] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        self.source = random.Random(self.seed)
        self.telemetry = mutations.Telemetry(self.source, corpus.frames(self.source))
        self.radar = mutations.Radar(self.source, corpus.radar_datagrams(self.source))
        self.told = corpus.told_lines()
        self.endless = (Live(), Live(one_by_one=True), Live(signed=True))

    def datagrams(self, number: int, until: float) -> None:
        """So many datagrams through live sessions."""
        warm, level, self.began = number // 5, 0.0, time.monotonic()
        session, left = Episode(), EPISODE
        while self.done < number and time.monotonic() < until:
            if left <= 0:
                self.observed += session.ended()
                pictured = self.source.random() < 0.9
                session = Episode(self.telemetry.now, signed=self.source.random() < 0.2, pictured=pictured)
                left = PICTURED if pictured else EPISODE
            self.telemetry.now += TICK_NS
            link, peer, batch, lines = self._batch()
            try:
                signal.alarm(HANG_S)
                for one in (session, self.source.choice(self.endless)):
                    one.take(self.telemetry.now, link, peer, batch, lines)
            except Exception:
                print(f"link {link}, peer {peer!r}, batch: {[data.hex() for data in batch]}, told: {lines}")
                raise
            self.done, left = self.done + len(batch) + len(lines), left - len(batch)
            if self.done % 500_000 < BATCH:
                gc.collect()
                self._report(number)
            if not level and self.done >= warm:
                gc.collect()
                level = rss_mb()
        signal.alarm(0)
        self.observed += session.ended()
        gc.collect()
        self._report(number)
        if rss_mb() > level + GROWTH_MB:
            raise MemoryError(f"from {level:.0f} MB after {warm} datagrams to {rss_mb():.0f} MB at the end")

    def _batch(self) -> tuple[int, str, list[bytes], list[bytes]]:
        source = self.source
        lines = []
        if source.random() < 0.02:
            lines = [mutations.text(source, source.choice(self.told))]
        kind = source.random()
        number = source.randrange(_PEERS) if kind < 0.98 else source.randrange(1 << 20)
        if kind < 0.25 or 0.98 < kind < 0.99:
            return RADAR, f"10.0.{number >> 8}.{number & 255}:5000", [self.radar.next() for _ in range(16)], lines
        link = STREAM if source.random() < 0.2 else MAVLINK
        peer = "tcp" if link == STREAM else f"10.0.{number >> 8}.{number & 255}:14550"
        if source.random() < 0.1:  # many at once take a way of their own
            return link, peer, [self.telemetry.next_plain() for _ in range(3 * BATCH)], lines
        return link, peer, [self.telemetry.next() for _ in range(BATCH)], lines

    def files(self, number: int, until: float) -> None:
        """So many files, replayed and checked."""
        with tempfile.TemporaryDirectory(prefix="talkdown-fuzz-") as made:
            folder = Path(made)
            seeds = [*corpus.files(self.source), *session_seeds(folder / "session", self.source)]
            for count in range(number):
                if time.monotonic() > until:
                    break
                seed = seeds[count % len(seeds)]
                signal.alarm(HANG_S)
                path = self._spoiled(folder, seed, count)
                try:
                    outcome = check_file(path)
                except Exception:
                    kept = Path(tempfile.mkdtemp(prefix="talkdown-fuzz-kept-")) / path.name
                    path.rename(kept)
                    print(f"file {count}, of {seed.name}, is kept as {kept}")
                    raise
                self.outcomes[f"{seed.name}: {outcome.partition('(')[0][:60]}"] += 1
                if (count + 1) % 100 == 0:
                    gc.collect()
                    print(f"{count + 1} files, {time.monotonic() - self.began:.0f} s, {rss_mb():.0f} MB", flush=True)
        signal.alarm(0)

    def _spoiled(self, folder: Path, seed: corpus.Seed, count: int) -> Path:
        if seed.name.startswith("session/"):
            return spoil_session(self.source, folder / "session", seed, folder / "spoiled")
        path = folder / f"file-{count % 8}"
        path.write_bytes(spoiled.spoil(self.source, seed))
        return path

    def _report(self, number: int) -> None:
        elapsed = time.monotonic() - self.began
        rate = self.done / max(elapsed, 1e-9)
        print(
            f"{self.done} of {number} datagrams, {elapsed:.0f} s, {rate:.0f}/s, "
            f"{sum(one.heard for one in self.endless)} arrivals of {len(self.endless)} endless sessions, {rss_mb():.0f} MB",
            flush=True,
        )


def _hangs(number: int, frame: object) -> None:
    raise TimeoutError(f"this has taken {HANG_S} s")


def main() -> int:
    """Run as the command line says; the exit code."""
    told = argparse.ArgumentParser(description="Mutated datagrams and files through every door from bytes.")
    told.add_argument("--datagrams", type=int, default=500_000)
    told.add_argument("--files", type=int, default=100)
    told.add_argument("--seed", type=int, default=1)
    told.add_argument("--minutes", type=float, default=1e6, help="stop after so long")
    given = told.parse_args()
    signal.signal(signal.SIGALRM, _hangs)
    fuzzer = Fuzzer(given.seed)
    until = fuzzer.began + 60 * given.minutes
    print(f"seed {given.seed}, {rss_mb():.0f} MB", flush=True)
    try:
        if given.files:
            fuzzer.files(given.files, until)
        if given.datagrams:
            fuzzer.datagrams(given.datagrams, until)
    except Exception:
        traceback.print_exc()
        print(f"after {fuzzer.done} datagrams and {sum(fuzzer.outcomes.values())} files of seed {given.seed}")
        return 1
    for name, total in sorted((fuzzer.observed + fuzzer.outcomes).items()):
        print(f"{total:9d}  {name}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"nothing found: {fuzzer.done} datagrams, {sum(fuzzer.outcomes.values())} files, peak {peak:.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
