"""A link that is cut, loses, delays or doubles what it carries."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from adapters.mavlink_frames import message_name, parse
from sim.faults import Fault, LinkCut, LinkDoubled, LinkLate, LinkLossy
from sim.sensors import stream

Floats = NDArray[np.float64]

LINK_FAULTS = (LinkCut, LinkLossy, LinkLate, LinkDoubled)


def carried(
    faults: Sequence[Fault], seed: int, link: str, said: Iterable[tuple[float, bytes]], until_s: float
) -> Iterator[tuple[float, bytes]]:
    """What arrives of what is said on a link: seconds of the scene (never falling, before `until_s`) and bytes.

    Each fault is judged by when a message would arrive without it, in the order of the faults; each draws from a
    stream of its own. The truth (SIM_STATE) has no time but its arrival: it is cut and lost, and never late.
    """
    own = [(index, one) for index, one in enumerate(faults) if isinstance(one, LINK_FAULTS) and one.befalls(link)]
    if not own:
        yield from said
        return
    messages = list(said)
    arrives = np.array([at for at, _ in messages], dtype=np.float64)
    which = np.arange(len(messages))
    is_truth = np.array([link.startswith("mavlink") and _is_truth(data) for _, data in messages], dtype=np.bool_)
    for index, fault in own:
        arrives, which = _through(fault, arrives, which, is_truth[which], stream(seed, "link", index, link))
    for place in np.argsort(arrives, kind="stable"):
        if arrives[place] < until_s:
            yield float(arrives[place]), messages[which[place]][1]


def _is_truth(data: bytes) -> bool:
    frame = parse(data)
    return frame is not None and message_name(frame.message) == "SIM_STATE"


def _through(
    fault: Fault,
    arrives: Floats,
    which: NDArray[np.int64],
    is_truth: NDArray[np.bool_],
    generator: np.random.Generator,
) -> tuple[Floats, NDArray[np.int64]]:
    """Arrivals (n,) and which message each is, after one fault."""
    drawn, lasts = generator.uniform(size=len(arrives)), fault.lasts(arrives)
    if isinstance(fault, LinkLate):
        return arrives + np.where(lasts & ~is_truth, fault.by_s + fault.spread_s * drawn, 0.0), which
    if isinstance(fault, LinkDoubled):
        again = lasts & ~is_truth & (drawn < fault.share)
        return np.concatenate([arrives, arrives[again] + fault.after_s]), np.concatenate([which, which[again]])
    share = fault.share if isinstance(fault, LinkLossy) else 1.0
    kept = ~(lasts & (drawn < share))
    return arrives[kept], which[kept]
