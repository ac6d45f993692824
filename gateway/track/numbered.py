"""Radar tracks: which plots belong together, by their numbers, be they the radar's own or ours.

A number can be used again for another target: a plot that its predecessor cannot have reached begins a new episode of the
number, and so does a long silence. A radar track is a (radar, number, episode).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING

from gateway.align import SECOND, Plot
from gateway.frozen import made_swiftly

if TYPE_CHECKING:
    from gateway.track.looks import Look

GREATEST_SPEED_MPS = 600.0  # beyond any aircraft that a landing radar meets
GREATEST_SILENCE_S = 10.0
FIRST_OWN = 100_001  # radars number with 16 bits; from here on numbers are ours, and each is one target's for ever
PLOTS_AT_MOST = 1024  # of one radar track
TRACKS_AT_MOST = 10_000

Key = tuple[int, int, int]  # radar, number, episode
Number = tuple[int, int]  # radar, number


@dataclass(frozen=True, slots=True)
class Tracked:
    """The radar tracks that are alive, how many plots of this step no track took, and what unnumbered ones may be."""

    active: tuple[str, ...]  # "1/3": radar 1, track 3
    untracked: int
    looks: tuple[Look, ...] = ()  # scans of unnumbered plots that were worked in this step


@made_swiftly
@dataclass(frozen=True, slots=True)
class Place:
    """Where a radar track was lately: the newest range and azimuth that were measured (NaN = never), for a coarse look."""

    at: int
    range_m: float
    azimuth_rad: float
    range_sigma_m: float
    azimuth_sigma_rad: float

    def then(self, plot: Plot) -> Place:
        """The same after one more plot; one that is older changes nothing."""
        if plot.at < self.at:
            return self
        range_m, azimuth_rad, _ = plot.polar
        known = math.isnan(range_m), math.isnan(azimuth_rad)
        # The time is that of the older of the two, so that what may have moved since is never underestimated.
        return Place(
            self.at if any(known) else plot.at,
            self.range_m if known[0] else range_m,
            self.azimuth_rad if known[1] else azimuth_rad,
            plot.sigma[0],
            plot.sigma[1],
        )


@made_swiftly
@dataclass(frozen=True, slots=True)
class RadarTracks:
    """The recent plots of every radar track, in order of time. A (radar, number, episode) never comes twice."""

    plots: Mapping[Key, tuple[Plot, ...]] = field(default_factory=dict)
    places: Mapping[Key, Place] = field(default_factory=dict)
    episode: Mapping[Number, int] = field(default_factory=dict)  # the present one of each number
    closed: Mapping[Key, int] = field(default_factory=dict)  # those that go on under another number, and since when
    silent: Mapping[Number, int] = field(default_factory=dict)  # numbers without recent plots: when the last one was
    first_episode: int = 0  # of a number that is not known, or was forgotten

    def after(self, plot: Plot) -> tuple[RadarTracks, Key]:
        """The same with one more plot, wherever in time it belongs; and the radar track that took it."""
        number = (plot.radar, plot.number)
        present = self.episode.get(number, self.first_episode)
        key = (*number, present)
        known = self.plots.get(key, ())
        episodes, silent = self.episode, self.silent
        if self._is_new(key, known, plot):
            key, known = (*number, present + 1), ()
            episodes = {**episodes, number: present + 1}
        elif known and plot.at < known[0].at and (earlier := self.plots.get((*number, present - 1))):
            if plot.at <= earlier[-1].at or not _is_another_target(earlier, plot):
                key, known = (*number, present - 1), earlier
        elif number not in episodes:
            episodes = {**episodes, number: present}
        if number in silent:
            silent = {other: at for other, at in silent.items() if other != number}
        place = bisect_right(known, (plot.at, plot.serial), key=lambda other: (other.at, other.serial))
        before = self.places.get(key) if known else None
        place_now = (before or Place(plot.at, math.nan, math.nan, *plot.sigma[:2])).then(plot)
        plots = {**self.plots, key: (*known[:place], plot, *known[place:])[-PLOTS_AT_MOST:]}
        places = {**self.places, key: place_now}
        return RadarTracks(plots, places, episodes, self.closed, silent, self.first_episode), key

    def without(self, plot: Plot) -> tuple[RadarTracks, Key | None]:
        """The same without a plot; and the radar track that had it, None if none has."""
        for episode in range(self.episode.get((plot.radar, plot.number), -1), -1, -1):
            key = (plot.radar, plot.number, episode)
            known = self.plots.get(key, ())
            rest = tuple(other for other in known if other.serial != plot.serial)
            if len(rest) < len(known):
                plots = {**self.plots, key: rest}
                if not rest:
                    del plots[key]
                places = {one: place for one, place in self.places.items() if one in plots}
                return replace(self, plots=plots, places=places), key
            if not known:
                break
        return self, None

    def has_room(self, plot: Plot) -> bool:
        """Whether a plot's radar track is known, or one more can be kept."""
        if len(self.plots) < TRACKS_AT_MOST:
            return True
        number = (plot.radar, plot.number)
        return (*number, self.episode.get(number, -1)) in self.plots

    def _is_new(self, key: Key, known: tuple[Plot, ...], plot: Plot) -> bool:
        """Whether a plot with this number begins another radar track than the number's present one."""
        if plot.number >= FIRST_OWN:
            return False
        if not known:
            return plot.at - self.silent.get(key[:2], plot.at) > GREATEST_SILENCE_S * SECOND
        if plot.at <= known[-1].at:
            return False
        return plot.at >= self.closed.get(key, plot.at + 1) or _is_another_target(known, plot)

    def closing(self, key: Key, at: int) -> RadarTracks:
        """The same where plots with a radar track's number, from an instant on, are another target's."""
        return replace(self, closed={**self.closed, key: at})

    def pruned(self, before: int) -> RadarTracks:
        """The same without plots older than an instant; tracks without plots are forgotten, and soon their numbers too."""
        if not self.silent and all(plots[0].at >= before for plots in self.plots.values()):
            return self
        alive = {
            key: plots if plots[0].at >= before else tuple(plot for plot in plots if plot.at >= before)
            for key, plots in self.plots.items()
            if plots[-1].at >= before
        }
        heard = {key[:2] for key in alive}
        silent = {number: at for number, at in self.silent.items() if number not in heard}
        silent |= {key[:2]: plots[-1].at for key, plots in self.plots.items() if key[:2] not in heard}
        longest = before - int(GREATEST_SILENCE_S * SECOND)
        forgotten = {number for number, at in silent.items() if at < longest}
        return RadarTracks(
            alive,
            {key: self.places[key] for key in alive},
            {number: episode for number, episode in self.episode.items() if number not in forgotten},
            {key: at for key, at in self.closed.items() if key in alive},
            {number: at for number, at in silent.items() if number not in forgotten},
            max((self.first_episode, *(self.episode[number] + 1 for number in forgotten))),
        )


def table(tracks: RadarTracks, untracked: int, looks: Sequence[Look] = ()) -> Tracked:
    """The radar tracks alive, by name, and what else the step found."""
    return Tracked(_names(tuple(tracks.plots)), untracked, tuple(looks))


@lru_cache(maxsize=1)  # the same at most steps
def _names(keys: tuple[Key, ...]) -> tuple[str, ...]:
    return tuple(sorted({name_of(key) for key in keys}))


@lru_cache(maxsize=4096)
def name_of(key: Key) -> str:
    """How people write a radar track: "1/3" is radar 1, track 3."""
    return f"{key[0]}/{key[1]}"


def _is_another_target(known: tuple[Plot, ...], plot: Plot) -> bool:
    """Whether no aircraft can have flown from the last plots to this one."""
    elapsed_s = (plot.at - known[-1].at) / SECOND
    if elapsed_s > GREATEST_SILENCE_S:
        return True
    distance_m = next((p.polar[0] for p in (plot, *reversed(known[-5:])) if not math.isnan(p.polar[0])), math.nan)
    for component in range(3):
        if math.isnan(plot.polar[component]):
            continue
        last = next((p for p in reversed(known[-5:]) if not math.isnan(p.polar[component])), None)
        if last is None:
            continue
        moved = plot.polar[component] - last.polar[component]
        if component == 1:
            moved = math.remainder(moved, 2.0 * math.pi)
        possible = GREATEST_SPEED_MPS * (plot.at - last.at) / SECOND
        if component:  # an angle: what that distance subtends, known only with a range
            possible = math.pi if math.isnan(distance_m) else possible / max(distance_m, 100.0)
        if abs(moved) > possible + 8.0 * math.hypot(plot.sigma[component], last.sigma[component]):
            return True
    return False
