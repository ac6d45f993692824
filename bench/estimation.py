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
OURS = ("ours", "ours, compiled")


def estimation(runs: int, say: Callable[[str], None]) -> list[Figure]:
    """Track-steps a CPU second for one track and for a thousand, the ratios to the textbook, and how far sides differ."""
    told: dict[str, Any] = json.loads(alone([sys.executable, "-m", "bench.estimation", str(runs)]))
    for sentence in told["left out"]:
        say(sentence)
    figures = []
    for size, rates in told["rates"].items():
        figures += [Figure(f"IMM, {size}: {side}", "1/s", tuple(samples)) for side, samples in rates.items()]
        for mine in OURS:
            for side in [name for name in rates if name not in OURS and mine in rates]:
                ratio = tuple(one / other for one, other in zip(rates[mine], rates[side], strict=True))
                figures.append(Figure(f"… {mine} / {side}", "", ratio, at_least=_asked(mine, side, size, rates)))
    for side, off in told["off"].items():
        figures.append(Figure(f"IMM: {side} differs from ours by", "1e-12", (off * 1e12,), AGREE * 1e12))
    return figures


def _asked(mine: str, side: str, size: str, rates: dict[str, Any]) -> float | None:
    """The least ratio that is asked for, of the way that goes with a size: in batches the compiled one, where it is there."""
    if side != "textbook loop" or (mine != OURS[-1] and size != "one track" and OURS[-1] in rates):
        return None
    return ONE_RATIO if size == "one track" else BATCH_RATIO


if __name__ == "__main__":
    from bench.estimation_run import measure

    print(json.dumps(measure(int(sys.argv[1]))))
