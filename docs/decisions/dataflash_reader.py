"""What damage costs: our reader of .BIN logs and pymavlink's DFReader on the same damaged logs.

python docs/decisions/dataflash_reader.py
"""

from __future__ import annotations

import contextlib
import io
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from pymavlink.DFReader import DFReader_binary

from adapters.dataflash_identity import WANTED
from adapters.dataflash_reader import DataflashReader

LOG = Path(__file__).parents[2] / "tests" / "data" / "sitl-landing-excerpt.BIN"
LOGS = 200
DAMAGES = ("37 bytes put in", "up to 40 bytes lost", "a bit flipped")


def damaged(log: bytes, what: str, seed: int) -> bytes:
    """The log with ten damages of a kind, behind its definitions or, for every second seed, anywhere."""
    chance, out = random.Random(seed), bytearray(log)
    for _ in range(10):
        at = chance.randrange(0 if seed % 2 else 16_000, len(out) - 50)
        if what == DAMAGES[0]:
            out[at:at] = chance.randbytes(37)
        elif what == DAMAGES[1]:
            del out[at : at + chance.randrange(1, 41)]
        else:
            out[at] ^= 1 << chance.randrange(8)
    return bytes(out)


def ours(path: Path) -> int:
    """How many wanted entries our reader finds."""
    with path.open("rb") as file:
        return sum(1 for _ in DataflashReader(file, WANTED))


def theirs(path: Path, told: io.StringIO) -> int:
    """How many DFReader finds; what it prints goes to `told`."""
    count = 0
    with contextlib.redirect_stderr(told), contextlib.redirect_stdout(told), DFReader_binary(str(path)) as log:
        while (message := log.recv_msg()) is not None:
            count += message.get_type() in WANTED and "TimeUS" in message.get_fieldnames()
    return count


def main() -> None:
    """Print a line for each kind of damage."""
    log = LOG.read_bytes()
    path = Path(tempfile.mkdtemp()) / "log.BIN"
    path.write_bytes(log)
    whole = ours(path)
    for what in DAMAGES:
        found, failed, lines, spent = Counter[str](), 0, 0, Counter[str]()
        for seed in range(LOGS):
            path.write_bytes(damaged(log, what, seed))
            began = time.perf_counter()
            found["ours"] += ours(path)
            spent["ours"] += time.perf_counter() - began
            told = io.StringIO()
            began = time.perf_counter()
            try:
                found["theirs"] += theirs(path, told)
            except Exception as error:
                print(f"  DFReader: {type(error).__name__}: {error}", file=sys.stderr)
                failed += 1
            spent["theirs"] += time.perf_counter() - began
            lines += told.getvalue().count("\n")
        of = LOGS * whole
        print(f"{what:>20}: ours {found['ours'] / of:.2%} of the entries in {spent['ours']:.1f} s; DFReader "
              f"{found['theirs'] / of:.2%} in {spent['theirs']:.1f} s, {failed} exceptions, {lines} lines printed")  # fmt: skip


if __name__ == "__main__":
    main()
