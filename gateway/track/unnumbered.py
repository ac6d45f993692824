"""Plots that carry no number, or one that is not to be believed, become radar tracks by track splitting, each radar by itself.

Plots wait a tenth of a second for the others of their scan, then the slice of time that they fall into is worked: a quarter of
the radar's period, so that a scan may come at once, in pieces or turning. The slices of the history are kept, each with the
families after it. A plot that comes late goes into its slice, and all slices from there on are worked again; what they then
tell otherwise is told and taken back.

What is told are the plots of confirmed families under numbers of our own, from `FIRST_OWN` on; for everything behind they are
the radar's numbered plots.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, field, replace

from gateway.align import SECOND, Plot
from gateway.estimators.track_splitting import Bank
from gateway.settings import Options, RadarSite
from gateway.track.density import Density
from gateway.track.numbered import FIRST_OWN
from gateway.track.slices import Slice, forgotten_s, order_of, worked_slice

SLICES = 4  # of a period
WAIT_NS = SECOND // 10  # for the other plots of a scan
PLOTS_AT_MOST = 10_000  # of a slice
WAITING_AT_MOST = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Watch:
    """One radar's unnumbered plots: slices of the history in order, what was before them, and plots that wait."""

    period_s: float
    base: tuple[Bank, Density]
    slices: tuple[Slice, ...] = ()
    waiting: tuple[Plot, ...] = ()
    due: int | None = None  # when what waits is worked
    numbers: Mapping[int, int] = field(default_factory=dict)  # family -> the number that we gave it
    next_number: int = FIRST_OWN

    @property
    def newest(self) -> tuple[Bank, Density]:
        """What is known now."""
        return (self.slices[-1].bank, self.slices[-1].density) if self.slices else self.base


@dataclass(frozen=True, slots=True)
class Taken:
    """What working came to: plots under our numbers, plots that are taken back from them, and those that nobody has."""

    told: tuple[Plot, ...] = ()
    back: tuple[Plot, ...] = ()
    untold: int = 0
    crowded: tuple[int, ...] = ()  # radars with so many plots at once that not all of them can be followed


@dataclass(frozen=True, slots=True, eq=False)
class Unnumbered:
    """The stage's state for unnumbered plots: each radar's watch, and how often radars scan, by their own word."""

    watches: Mapping[int, Watch] = field(default_factory=dict)
    periods_s: Mapping[int, float] = field(default_factory=dict)
    next_numbers: Mapping[int, int] = field(default_factory=dict)  # of radars whose watch was given up
    unknown_since: Mapping[int, int] = field(default_factory=dict)  # radars that do not say how often they scan

    @property
    def due(self) -> int | None:
        """When the next waiting plots are to be worked."""
        return min((watch.due for watch in self.watches.values() if watch.due is not None), default=None)

    def scanning(self, radar: int, period_s: float) -> Unnumbered:
        """The same after a radar's word on how long a scan takes."""
        if self.periods_s.get(radar) == period_s or not 0.02 <= period_s <= 60.0:
            return self
        return replace(self, periods_s={**self.periods_s, radar: period_s})

    def hearing(
        self, plots: Sequence[Plot], radars: Mapping[int, RadarSite], now: int
    ) -> tuple[Unnumbered, list[Plot]]:
        """The same with an arrival's plots, which wait; and those that cannot: too many do, or no period is known."""
        watches = dict(self.watches)
        unused, unknown = list[Plot](), self.unknown_since
        by_radar: dict[int, list[Plot]] = {}
        for plot in plots:
            by_radar.setdefault(plot.radar, []).append(plot)
        for radar, some in by_radar.items():
            watch = self._watch(radar, radars[radar], some[0].at)
            if watch is None:
                unused += some
                unknown = {radar: now, **unknown}
                continue
            room = max(WAITING_AT_MOST - len(watch.waiting), 0)
            unused += some[room:]
            due = now + WAIT_NS if watch.due is None else watch.due
            watches[radar] = replace(watch, waiting=(*watch.waiting, *some[:room]), due=due)
        return replace(self, watches=watches, unknown_since=unknown), unused

    def _watch(self, radar: int, site: RadarSite, at: int) -> Watch | None:
        """A radar's watch, begun anew where there is none or the radar's period has changed."""
        watch, period_s = self.watches.get(radar), site.period_s or self.periods_s.get(radar)
        if period_s is None or (watch is not None and watch.period_s == period_s):
            return watch
        density = Density.at_first(site.maximum_range_m, site.clutter_per_scan, site.detection_probability)
        base = Bank.empty(at, 3), density
        if watch is not None:
            return Watch(period_s, base, (), watch.waiting, watch.due, next_number=watch.next_number)
        return Watch(period_s, base, next_number=self.next_numbers.get(radar, FIRST_OWN))

    def worked(self, now: int, radars: Mapping[int, RadarSite], options: Options) -> tuple[Unnumbered, Taken]:
        """The same with what was due at an instant, and what came of it."""
        watches, all_taken = dict(self.watches), []
        for radar, watch in self.watches.items():
            if watch.due is not None and watch.due <= now:
                watches[radar], taken = _worked(watch, radars[radar], options)
                all_taken.append(taken)
        return replace(self, watches=watches), Taken(
            tuple(plot for taken in all_taken for plot in taken.told),
            tuple(plot for taken in all_taken for plot in taken.back),
            sum(taken.untold for taken in all_taken),
            tuple(radar for taken in all_taken for radar in taken.crowded),
        )

    def pruned(self, before: int) -> Unnumbered:
        """The same without slices older than an instant; a radar that has been silent for long is forgotten, its numbers not."""
        watches, next_numbers = {}, dict(self.next_numbers)
        for radar, watch in self.watches.items():
            width = _width(watch)
            old = bisect_left(watch.slices, before // width, key=lambda one: one.index)
            if old == len(watch.slices) and not watch.waiting:
                silent_s = (before - watch.newest[0].at) / SECOND
                if silent_s > forgotten_s(watch.period_s):
                    next_numbers[radar] = watch.next_number
                    continue
            if old:
                last = watch.slices[old - 1]
                kept = watch.slices[old:]
                named = {number for one in (last, *kept) for number in one.bank.number.tolist()}
                numbers = {family: number for family, number in watch.numbers.items() if family in named}
                watch = replace(watch, base=(last.bank, last.density), slices=kept, numbers=numbers)
            watches[radar] = watch
        return replace(self, watches=watches, next_numbers=next_numbers)

    def emptied(self) -> Unnumbered:
        """The same when the session begins anew: nothing is remembered but which numbers were given."""
        numbers = {radar: watch.next_number for radar, watch in self.watches.items()}
        return Unnumbered({}, self.periods_s, {**self.next_numbers, **numbers})


def _width(watch: Watch) -> int:
    return max(int(watch.period_s * SECOND) // SLICES, 1)


def _worked(watch: Watch, site: RadarSite, options: Options) -> tuple[Watch, Taken]:
    """All slices from the first one on that a waiting plot falls into."""
    by_slice: dict[int, list[Plot]] = {}
    for plot in watch.waiting:
        by_slice.setdefault(plot.at // _width(watch), []).append(plot)
    place = bisect_left(watch.slices, min(by_slice), key=lambda one: one.index)
    again = watch.slices[place:]
    for old in again:
        by_slice.setdefault(old.index, []).extend(old.plots)
    slices = list(watch.slices[:place])
    bank, density = (slices[-1].bank, slices[-1].density) if slices else watch.base
    told = {serial: family for one in slices for serial, family in one.told.items()}
    known = len(slices)
    for index in sorted(by_slice):
        plots = tuple(sorted(by_slice[index], key=order_of)[:PLOTS_AT_MOST])
        one = worked_slice(index, plots, bank, density, told, watch.period_s, site, options)
        bank, density = one.bank, one.density
        told |= one.told
        slices.append(one)
    grown = replace(watch, slices=tuple(slices), waiting=(), due=None)
    return _difference(grown, again, slices[known:], watch.waiting)


def _difference(
    watch: Watch, before: Sequence[Slice], after: Sequence[Slice], heard: Sequence[Plot]
) -> tuple[Watch, Taken]:
    """What is told now and was not, and the other way round; families that are told get a number."""
    was = {serial: family for one in before for serial, family in one.told.items()}
    told = {serial: family for one in after for serial, family in one.told.items()}
    numbers, following = dict(watch.numbers), watch.next_number
    for family in told.values():
        if family not in numbers:
            numbers[family] = following
            following += 1
    new = {serial for serial, family in told.items() if was.get(serial) != family}
    gone = {serial for serial, family in was.items() if told.get(serial) != family}
    by_serial = _plots_of(watch.slices, new | gone)
    some = sorted((replace(by_serial[one], number=numbers[told[one]]) for one in new & by_serial.keys()), key=order_of)
    back = sorted((replace(by_serial[one], number=numbers[was[one]]) for one in gone & by_serial.keys()), key=order_of)
    untold = sum(plot.serial not in told for plot in heard)
    crowded = (heard[0].radar,) if any(one.crowded for one in after) else ()
    return replace(watch, numbers=numbers, next_number=following), Taken(tuple(some), tuple(back), untold, crowded)


def _plots_of(slices: Sequence[Slice], serials: Set[int]) -> dict[int, Plot]:
    """These plots by their serials, those that are remembered: mostly they are of the last slices."""
    found: dict[int, Plot] = {}
    for one in reversed(slices):
        if len(found) == len(serials):
            break
        found |= {plot.serial: plot for plot in one.plots if plot.serial in serials}
    return found
