"""Many arrivals in columns: tens of thousands come in a second, and most of what is done with them is done to all at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import chain, pairwise, repeat
from typing import overload

import numpy as np
from numpy.typing import NDArray

from adapters import Arrival

Integers = NDArray[np.int64]

_made: Callable[[tuple[int, int, bytes, str]], Arrival] = partial(tuple.__new__, Arrival)


def are_first(ordered: Integers) -> NDArray[np.bool_]:
    """Which elements differ from the one before; the first of all does."""
    first = np.ones(len(ordered), np.bool_)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return first


class Arrivals(Sequence[Arrival]):
    """Arrivals in the order of their stamps; read one by one they are what they are: `Arrival`.

    `received_at` and `source` are arrays with an element for each, `data` a list. `peers`: who sent each, None where nobody
    is named. `heads`: of each, as `heads_of` has them; None where nobody has asked yet.
    """

    __slots__ = ("data", "heads", "peers", "received_at", "source")

    def __init__(
        self,
        received_at: Integers,
        source: Integers,
        data: list[bytes],
        peers: list[str] | None = None,
        heads: Integers | None = None,
    ) -> None:
        self.received_at, self.source, self.data, self.peers, self.heads = received_at, source, data, peers, heads

    @classmethod
    def of(cls, arrivals: Sequence[Arrival]) -> Arrivals:
        """The same in columns."""
        if isinstance(arrivals, Arrivals):
            return arrivals
        count = len(arrivals)
        received_at = np.fromiter((one[0] for one in arrivals), np.int64, count)
        source = np.fromiter((one[1] for one in arrivals), np.int64, count)
        peers = [one[3] for one in arrivals]
        return cls(received_at, source, [one[2] for one in arrivals], peers if any(peers) else None)

    @classmethod
    def joined(cls, parts: Sequence[Arrivals]) -> Arrivals:
        """Some after the others, in one."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            return cls.of(())
        heads = [one.heads for one in parts if one.heads is not None]
        named = any(one.peers is not None for one in parts)
        return cls(
            np.concatenate([one.received_at for one in parts]),
            np.concatenate([one.source for one in parts]),
            list(chain.from_iterable(one.data for one in parts)),
            list(chain.from_iterable(one.peers or repeat("", len(one)) for one in parts)) if named else None,
            np.concatenate(heads) if len(heads) == len(parts) else None,
        )

    def by_source(self) -> Iterator[tuple[int, list[int]]]:
        """Each source, and the places of what came from it."""
        order = np.argsort(self.source, kind="stable")
        ordered = self.source[order]
        begins, places = np.flatnonzero(are_first(ordered)).tolist(), order.tolist()
        for begin, end in pairwise((*begins, len(places))):
            yield int(ordered[begin]), places[begin:end]

    def last_of_each(self) -> list[tuple[int, int]]:
        """Each source, and the stamp of what came last from it."""
        last = np.full(int(self.source.max(initial=-1)) + 1, -1)
        last[self.source] = np.arange(len(self))
        return [(number, int(self.received_at[last[number]])) for number in np.flatnonzero(last >= 0).tolist()]

    def at(self, places: Integers) -> Iterator[Arrival]:
        """Those at some places."""
        chosen = places.tolist()
        peers = repeat("") if self.peers is None else map(self.peers.__getitem__, chosen)
        stamps, sources = self.received_at[places].tolist(), self.source[places].tolist()
        return map(_made, zip(stamps, sources, map(self.data.__getitem__, chosen), peers, strict=False))

    def __len__(self) -> int:
        return len(self.data)

    def __iter__(self) -> Iterator[Arrival]:
        peers = repeat("") if self.peers is None else self.peers
        columns = zip(self.received_at.tolist(), self.source.tolist(), self.data, peers, strict=False)
        return map(_made, columns)

    @overload
    def __getitem__(self, place: int) -> Arrival: ...

    @overload
    def __getitem__(self, place: slice) -> Arrivals: ...

    def __getitem__(self, place: int | slice) -> Arrival | Arrivals:
        if isinstance(place, slice):
            return Arrivals(
                self.received_at[place],
                self.source[place],
                self.data[place],
                None if self.peers is None else self.peers[place],
                None if self.heads is None else self.heads[place],
            )
        peer = "" if self.peers is None else self.peers[place]
        return Arrival(int(self.received_at[place]), int(self.source[place]), self.data[place], peer)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]
