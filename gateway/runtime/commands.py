"""commands.jsonl: what people told the gateway while it ran. One JSON object a line, its first key the stamp:

    {"stamp": 1767225600000004000, "kind": "plan", ...}

The rest of a line is the told line, byte for byte: reading gives back what was written.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO

from adapters.tlog import STEP_NS, RecordSink

_LINE = re.compile(rb'\{"stamp": (\d{1,19})(?:, (?=.*\}))?(.*)', re.DOTALL)


class CommandsWriter:
    """Writes told lines, each a JSON object."""

    def __init__(self, sink: RecordSink) -> None:
        self._sink = sink

    def write(self, received_at: int, data: bytes, peer: str = "") -> None:
        """Add one line; `received_at` in ns since 1970 UTC. Nobody's name is kept."""
        between = b"" if data[1:2] == b"}" else b", "
        self._sink.write(b'{"stamp": %d%s%s\n' % (received_at, between, data[1:]))


def read_commands(file: BinaryIO, counters: Counter[str]) -> Iterator[tuple[int, bytes]]:
    """Stamp and told line. Counts "lines not understood"; a last line that was cut is one."""
    last = -1
    for line in file:
        found = _LINE.fullmatch(line.rstrip(b"\r\n"))
        if found is None or not line.endswith(b"\n") or (stamp := int(found[1])) % STEP_NS or stamp <= last:
            counters["lines not understood"] += 1
            continue
        last = stamp
        yield stamp, b"{" + found[2]
