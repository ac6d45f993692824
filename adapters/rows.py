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

    `vehicle` and `source` are each row's in `vehicles` (with their `names`, and their `autopilots` then) and `counters`.
    `shown` gathers what people are to be shown, as (place, where it is kept, by which name, the value), `silent` the sources
    of rows that say nothing. `newest`: the newest time since boot that the sender had told, and what had passed since, ns;
    `added`: what brings it to the session's time; of a sender that has told no time (`knows_time`) they are the stamp, and
    what brings that to it.
    """

    places: Integers
    received_at: Integers
    vehicle: Integers
    source: Integers
    newest: Integers
    added: Integers
    knows_time: Truths
    vehicles: Sequence[Vehicle]
    names: NDArray[np.object_]
    autopilots: Sequence[int | None]
    counters: Mapping[int, Counter[str]]
    shown: list[Shown]
    silent: list[Integers]

    def __len__(self) -> int:
        return len(self.places)

    def __getitem__(self, which: Any) -> Rows:
        """Some of them: a mask or a slice."""
        return replace(self, **{name: getattr(self, name)[which] for name in _BY_ROW})

    def saying(self, which: Truths) -> Rows:
        """Those that say something; the others are noted in `silent`."""
        self.silent.append(self.source[~which])
        return self[which]

    def count(self, reason: str, which: Truths) -> None:
        """One more of this reason for each of these rows, with their sources."""
        for source in self.source[which].tolist():
            self.counters[source][reason] += 1

    def within(self, values: Floats, least: Floats | float, greatest: Floats | float) -> Floats:
        """The values that are numbers in their range, else NaN, counted: of each row, or several lines of such."""
        good = (values >= least) & (values <= greatest)
        if good.all():
            return values
        is_none = np.isnan(values)
        for none, bad in zip(np.atleast_2d(is_none), np.atleast_2d(~good & ~is_none), strict=True):
            self.count("not a number", none)
            self.count("air data out of range", bad)
        return np.where(good, values, np.nan)

    def at_receipt(self) -> Integers:
        """As `Moments.shown_at_receipt`."""
        return self.newest + self.added

    def near(self, usec: Integers) -> Integers:
        """As `Moments.shown_near`; a time that is UTC is LEAST_UNIX_USEC, or more."""
        is_boot = (usec < LEAST_UNIX_USEC) & self.knows_time
        boot = usec * 1000
        if is_boot.all() and (np.abs(boot - self.newest) <= STRAY_NS).all():
            return boot + self.added
        apart = (boot - self.newest + WRAP_NS // 2) % WRAP_NS - WRAP_NS // 2
        return self.newest + np.where(is_boot & (np.abs(apart) <= STRAY_NS), apart, 0) + self.added

    def show(self, names: Sequence[str], values: Floats) -> None:
        """Keep for people of each name the last value that is a number, of each vehicle; `values`: (names, rows)."""
        vehicles, told = self.vehicle.tolist(), ~np.isnan(values)
        everywhere = dict(zip(vehicles, range(len(self)), strict=True))
        for name, of_name, has in zip(names, values, told, strict=True):
            last = everywhere
            if not has.all():
                last = {vehicles[row]: row for row in np.flatnonzero(has).tolist()}
            for vehicle, row in last.items():
                self.shown.append((int(self.places[row]), self.vehicles[vehicle].readings, name, float(of_name[row])))

    def many(self, kind: type[ImuSample | AirData], says: Truths, valid_at: Integers, **columns: NDArray[Any]) -> Many:
        """What these rows say."""
        told = {"aircraft": self.names[self.vehicle], "valid_at": valid_at, "received_at": self.received_at, **columns}
        if not says.all():
            self.silent.append(self.source[~says])
            told = {name: column[says] for name, column in told.items()}
        return Many(kind, told)
