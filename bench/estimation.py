"""An IMM: the gateway's own, a textbook's loop and other libraries', turn by turn.

python -m bench.estimation RUNS       prints, as JSON, track-steps per CPU second of every side, and how they agree

The gateway's five modes of eleven states, a report each second; the same data, matrices and first states on every side, and
all combined states after every report. What is not installed is left out and said.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from typing import Any

from bench.measure import Figure, alone

BATCH_RATIO, ONE_RATIO = 60.0, 1.0
AGREE = 1e-9


def estimation(runs: int, say: Callable[[str], None]) -> list[Figure]:
    """Track-steps a CPU second for one track and for a thousand, the ratios to the textbook, and how far sides differ."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.estimation", str(runs)]))
    for sentence in told["left out"]:
        say(sentence)
    figures = []
    for size, rates in told["rates"].items():
        least = ONE_RATIO if size == "one track" else BATCH_RATIO
        figures += [Figure(f"IMM, {size}: {side}", "1/s", tuple(samples)) for side, samples in rates.items()]
        for side, samples in rates.items():
            if side != "ours":
                ratio = tuple(one / other for one, other in zip(rates["ours"], samples, strict=True))
                figures.append(
                    Figure(f"… ours / {side}", "", ratio, at_least=least if side == "textbook loop" else None)
                )
    for side, off in told["off"].items():
        figures.append(Figure(f"IMM: {side} differs from ours by", "1e-12", (off * 1e12,), AGREE * 1e12))
    return figures


if __name__ == "__main__":
    from bench.estimation_run import measure

    print(json.dumps(measure(int(sys.argv[1]))))
