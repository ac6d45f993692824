"""Frames that wait to be read side by side: inertial samples and air data, most of what comes in thick.

They change nothing but what is shown of a vehicle. So they can be read after those that do change something, as long as it is
known what their senders' clocks had told when each came. A wind does not wait: predictions depend on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from adapters import air, air_columns, motion, motion_columns
from adapters.arrivals import Arrivals, Integers, are_first
from adapters.columns import datagram_dtype
from adapters.epoch import SessionEpoch
from adapters.frame_batches import Heads, places_of, wanted
from adapters.framing import EXTRAS
from adapters.listening import Listened
from adapters.meters import SECOND
from adapters.rows import Rows, Shown
from adapters.vehicle import Vehicle
from adapters.vehicles import Component
from gateway.observation import Many

Reader = Callable[[Rows, Sequence[tuple[int, NDArray[Any]]]], Many]
"""What rows say; their fields come message after message, each with its id."""

_FAMILIES: Sequence[tuple[Reader, tuple[int, ...]]] = (
    (motion_columns.scaled_imu, (motion.RAW_IMU, motion.SCALED_IMU, motion.SCALED_IMU2, motion.SCALED_IMU3)),
    (air_columns.hud, (air.VFR_HUD,)),
    (air_columns.pressure, (air.SCALED_PRESSURE,)),
)
_READ = tuple((reader, message) for reader, messages in _FAMILIES for message in messages)
_ORDER = np.zeros(len(EXTRAS), np.int64)  # by message id: its place in _READ
_ORDER[[message for _, message in _READ]] = np.arange(len(_READ))
_WAITING = wanted([message for _, message in _READ])
Number = TypeVar("Number", int, Integers)
_FEW = 32  # for fewer it is quicker to read one after the other


class Waiting:
    """The frames of some arrivals that wait, a stretch after the other.

    `senders`: which of the components sent each arrival, -1: none of them. Only frames of vehicles that nothing else is
    heard of wait: with others it must be found out with each frame whose it is.
    """

    def __init__(
        self,
        arrivals: Arrivals,
        heads: Heads,
        components: Sequence[Component],
        senders: Integers,
        listened: Mapping[int, Listened],
        epoch: SessionEpoch,
    ) -> None:
        self.at = -1  # the place of the frame that is heard
        self._arrivals, self._heads, self._senders, self._epoch = arrivals, heads, senders, epoch
        self._components = components
        self._counters = {number: one.counters for number, one in listened.items()}
        self._may = places_of(heads, _WAITING) & (senders >= 0)
        self._places = np.empty(0, np.int64)
        self._vehicles: list[Vehicle] = []
        self._names = np.empty(0, object)
        self._autopilots: list[int | None] = []
        self._number = np.empty(0, np.int64)  # of each component's vehicle
        self._awaited: set[int] = set()  # components
        self._marks: list[tuple[int, int, int, int, bool]] = []

    def begin(self, places: Integers, *, may_wait: bool) -> Integers:
        """A stretch begins; which of its frames have to be heard now, one after the other: all of them, if none may wait."""
        vehicles = [component.only_of for component in self._components]
        has_one = np.array([vehicle is not None for vehicle in vehicles] + [False])
        wait = self._may[places] & has_one[self._senders[places]]
        if not may_wait or np.count_nonzero(wait) < _FEW:
            wait[:] = False
        self._places = places[wait]
        self._vehicles = [vehicle for vehicle in vehicles if vehicle is not None]
        self._names = np.array([vehicle.name for vehicle in self._vehicles], object)
        self._autopilots = [one.status.autopilot if one.status is not None else None for one in self._vehicles]
        self._number = np.cumsum(has_one) - 1
        self._awaited = set(self._senders[self._places].tolist())
        self._marks = []
        self.at = -1
        for sender in self._awaited:
            self.note(sender)
        now: Integers = places[~wait]
        return now

    def note(self, sender: int) -> None:
        """A frame of a component has been heard, at the place `at`: what its clock says from now on."""
        if sender not in self._awaited:
            return
        clock = self._components[sender].clock
        newest = clock.newest() or (0, 0)
        knows_time = clock.has_been_heard()
        added = self._epoch.added(clock, newest[1]) if knows_time else self._epoch.session_time(0)
        self._marks.append((self._key(sender, self.at), *newest, added, knows_time))

    def _key(self, sender: Number, place: Number) -> Number:
        """What orders frames by their senders, then by their places, which begin at -1."""
        return sender * (len(self._arrivals) + 1) + place + 1

    def catch_up(self) -> None:
        """Let the vehicles know when they were heard last: those of whom something waits from before the frame that is heard."""
        self._mark_heard(self._places[self._places < self.at])

    def _mark_heard(self, places: Integers) -> None:
        numbers = self._number[self._senders[places]].tolist()
        for number, last in dict(zip(numbers, self._arrivals.received_at[places].tolist(), strict=True)).items():
            self._vehicles[number].last_heard = max(self._vehicles[number].last_heard, last)

    def read(self) -> tuple[list[Many], dict[int, int], int]:
        """What those say that came before the place `at`; how many observations by source, and the place of the last one."""
        places = self._places[self._places < self.at]
        shown, found, silent = list[Shown](), list[Many](), list[Integers]()
        if not len(places):
            return found, {}, -1
        self._mark_heard(places)
        kinds = _ORDER[self._heads[places] >> 24]
        order = np.argsort(kinds, kind="stable")
        rows, places, kinds = self._rows(places[order], shown, silent), places[order], kinds[order]
        begins = np.flatnonzero(are_first(kinds)).tolist()
        bounds = list(zip(kinds[begins].tolist(), begins, [*begins[1:], len(kinds)], strict=True))
        for reader, of_family in groupby(bounds, lambda one: _READ[one[0]][0]):
            parts = list(of_family)
            told = [(message := _READ[kind][1], self._fields(message, places[begin:end])) for kind, begin, end in parts]
            one = reader(rows[parts[0][1] : parts[-1][2]], told)
            if len(one):
                found.append(one)
        counts = np.bincount(rows.source)
        for sources in silent:
            counts -= np.bincount(sources, minlength=len(counts))
        said = {number: int(counts[number]) for number in np.flatnonzero(counts).tolist()}
        shown.sort(key=itemgetter(0))
        for _, where, name, value in shown:
            where[name] = value
        return found, said, int(places.max())

    def _rows(self, places: Integers, shown: list[Shown], silent: list[Integers]) -> Rows:
        senders, received_at = self._senders[places], self._arrivals.received_at[places]
        marks = np.array(sorted(self._marks), np.int64)
        mark = marks[np.searchsorted(marks[:, 0], self._key(senders, places), side="right") - 1]
        knows_time = mark[:, 4] == 1
        newest = np.where(knows_time, mark[:, 1] + np.clip(received_at - mark[:, 2], 0, SECOND), received_at)
        return Rows(
            places,
            received_at,
            self._number[senders],
            self._arrivals.source[places],
            newest,
            mark[:, 3],
            knows_time,
            self._vehicles,
            self._names,
            self._autopilots,
            self._counters,
            shown,
            silent,
        )

    def _fields(self, message: int, places: Integers) -> NDArray[Any]:
        """The fields of frames of one message, of whatever length they were sent."""
        dtype = datagram_dtype(message)
        data = [self._arrivals.data[place] for place in places.tolist()]
        if set(map(len, data)) != {dtype.itemsize}:
            whole = dtype.itemsize - 2
            data = [one[:-2].ljust(whole, b"\0")[:whole] + b"\0\0" for one in data]
        return np.frombuffer(b"".join(data), dtype)
