"""Frames of one message side by side, and what was known of their senders when each came."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, MutableMapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adapters.moments import LEAST_UNIX_USEC, STRAY_NS, WRAP_NS
from adapters.vehicle import Vehicle
from gateway.observation import AirData, ImuSample, Many

Integers = NDArray[np.int64]
Floats = NDArray[np.float64]
Truths = NDArray[np.bool_]


_BY_ROW = ("places", "received_at", "vehicle", "source", "newest", "added", "knows_time")
Shown = tuple[int, MutableMapping[Any, Any], Any, Any]


@dataclass(frozen=True, slots=True)
class Rows:
    """One row a frame, in their order. `places` rise and tell the order of frames of different messages.

    `vehicle` and `source` are each row's in `vehicles` (with their `autopilots` then) and `counters`. `shown` gathers what
    people are to be shown, as (place, where it is kept, by which name, the value), `said` how many observations each source
    made. `newest`: the newest time since boot that the sender had told, and what had passed since, ns; `added`: what brings
    it to the session's time; of a sender that has told no time (`knows_time`) they are the stamp, and what brings that to it.
    """

    places: Integers
    received_at: Integers
    vehicle: Integers
    source: Integers
    newest: Integers
    added: Integers
    knows_time: Truths
    vehicles: Sequence[Vehicle]
    autopilots: Sequence[int | None]
    counters: Mapping[int, Counter[str]]
    shown: list[Shown]
    said: Counter[int]

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, which: Any) -> Rows:
        """Some of them: a mask or a slice."""
        return replace(self, **{name: getattr(self, name)[which] for name in _BY_ROW})

    def count(self, reason: str, which: Truths) -> None:
        """One more of this reason for each of these rows, with their sources."""
        for source, count in self._by_source(which):
            self.counters[source][reason] += count

    def _by_source(self, which: Truths) -> list[tuple[int, int]]:
        counts = np.bincount(self.source[which])
        return [(source, int(counts[source])) for source in np.flatnonzero(counts).tolist()]

    def within(self, values: NDArray[Any], least: float, greatest: float) -> Floats:
        """The values that are numbers in their range; else NaN, counted."""
        told = values.astype(np.float64)
        good = (told >= least) & (told <= greatest)
        if not good.all():
            is_none = np.isnan(told)
            self.count("not a number", is_none)
            self.count("air data out of range", ~good & ~is_none)
            told[~good] = np.nan
        return told

    def at_receipt(self) -> Integers:
        """As `Moments.shown_at_receipt`."""
        return self.newest + self.added

    def near(self, usec: NDArray[Any]) -> Integers:
        """As `Moments.shown_near`."""
        is_boot = (usec < LEAST_UNIX_USEC) & self.knows_time
        boot = np.where(is_boot, usec, 0).astype(np.int64) * 1000
        apart = (boot - self.newest + WRAP_NS // 2) % WRAP_NS - WRAP_NS // 2
        return self.newest + np.where(is_boot & (np.abs(apart) <= STRAY_NS), apart, 0) + self.added

    def show(self, name: str, values: Floats) -> None:
        """Keep for people the last of the values that is a number, of each vehicle."""
        told = ~np.isnan(values)
        last = dict(zip(self.vehicle[told].tolist(), np.flatnonzero(told).tolist(), strict=True))
        for vehicle, row in last.items():
            self.shown.append((int(self.places[row]), self.vehicles[vehicle].readings, name, float(values[row])))

    def many(self, kind: type[ImuSample | AirData], says: Truths, valid_at: Integers, **columns: NDArray[Any]) -> Many:
        """What these rows say."""
        for source, count in self._by_source(says):
            self.said[source] += count
        names = np.array([vehicle.name for vehicle in self.vehicles], object)
        told = {"aircraft": names[self.vehicle], "valid_at": valid_at, "received_at": self.received_at, **columns}
        if not says.all():
            told = {name: column[says] for name, column in told.items()}
        return Many(kind, told)
