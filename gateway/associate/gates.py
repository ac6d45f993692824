"""Gates: one GPS report against the radar tracks that are near it (paper 003, eq 6 and 7)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND, Fix, Polar, bracket
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.settings import Options, Site
from gateway.track import GREATEST_SPEED_MPS, Key, RadarTracks

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GATE_SIGMAS = 3.0
IMPOSSIBLE_SIGMAS = 4.0  # a guessed height can forbid a pair beyond this, never support one
SILENT_S = 3.0  # a radar track without plots for this long gives its aircraft free


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """One aircraft's report against one radar track."""

    key: Key
    hit: bool
    distance: float  # mean square of difference / gate over the compared components
    difference: Polar
    gate: Polar

    def differs(self, other: Comparison) -> bool:
        """Whether anything that the counters see is different."""
        return (self.key, self.hit, self.distance) != (other.key, other.hit, other.distance)


@dataclass(frozen=True, slots=True)
class Setting:
    """What a check needs to know of the place."""

    site: Site
    options: Options
    frame: RunwayFrame
    radars: Mapping[int, RadarFrame]


class Nearby:
    """The radar tracks of one moment as columns, for a coarse look at all of them at once. Made when first asked."""

    def __init__(self, tracks: RadarTracks) -> None:
        self.tracks = tracks
        self._alive: dict[bytes, frozenset[Key]] = {}

    @cached_property
    def keys(self) -> list[Key]:
        """Of the columns' rows."""
        return list(self.tracks.plots)

    @cached_property
    def radar(self) -> Ints:
        """Each track's."""
        return np.array([key[0] for key in self.keys], np.int64)

    @cached_property
    def _times(self) -> Ints:
        """When each track's remembered plots begin and end, (2, n)."""
        plots = self.tracks.plots.values()
        return np.array([[some[0].at for some in plots], [some[-1].at for some in plots]], np.int64)

    @cached_property
    def _places(self) -> tuple[Ints, Floats]:
        """When each was where, (n,): range, azimuth and their sigmas, (4, n)."""
        places = [self.tracks.places[key] for key in self.keys]
        known = [(place.range_m, place.azimuth_rad, place.range_sigma_m, place.azimuth_sigma_rad) for place in places]
        return np.array([place.at for place in places], np.int64), np.array(known).reshape(-1, 4).T

    def alive(self, first: int, last: int) -> tuple[Bools, frozenset[Key]]:
        """Which have plots between two instants: by row, and by name."""
        begins, ends = self._times
        living = np.asarray((begins <= last) & (ends >= first))
        mask = living.tobytes()
        if mask not in self._alive:
            self._alive[mask] = frozenset(compress(self.keys, living))
        return living, self._alive[mask]

    def is_far(self, at: int, there: Polar, spread: Polar) -> Bools:
        """Whether each is too far away to be compared."""
        then, places = self._places
        return np.asarray(_is_far(at - then, there, spread, *places))


Compared = tuple[tuple[Comparison, ...], frozenset[Key]]  # with which tracks, and the tracks with plots then


def compare(fix: Fix, nearby: Nearby, setting: Setting) -> Compared:
    """One report against every radar track with plots near its time that is not far away; and which have such plots.

    Source: 003 2.3 eq 6. Deviation: sigma also holds the allowed systematic error of the position source.
    """
    if not nearby.tracks.plots:
        return (), frozenset()
    living, alive = nearby.alive(*_window(fix, setting))
    found = []
    for number, radar in setting.radars.items():
        seen = living & (nearby.radar == number)
        if seen.any():
            there, spread = _seen_from(fix, radar, setting)
            for row in (seen & ~nearby.is_far(fix.at, there, spread)).nonzero()[0].tolist():
                key = nearby.keys[row]
                found.append(_compared(fix, key, nearby.tracks, there, spread, setting))
    return tuple(found), alive


def compare_again(
    fix: Fix, key: Key, before: Sequence[Comparison], alive: frozenset[Key], tracks: RadarTracks, setting: Setting
) -> Compared | None:
    """A report's comparisons after one radar track got another plot, or None where nothing that counts is different."""
    radar = setting.radars.get(key[0])
    if radar is None:
        return None
    first, last = _window(fix, setting)
    plots, place = tracks.plots[key], tracks.places[key]
    lives = plots[0].at <= last and plots[-1].at >= first
    known = next((one for one in before if one.key == key), None)
    there, spread = _seen_from(fix, radar, setting)
    where = (place.range_m, place.azimuth_rad, place.range_sigma_m, place.azimuth_sigma_rad)
    is_near = lives and not _is_far(fix.at - place.at, there, spread, *where)
    now = _compared(fix, key, tracks, there, spread, setting) if is_near else None
    if lives == (key in alive) and (now is known or (now is not None and known is not None and not now.differs(known))):
        return None
    others = tuple(one for one in before if one.key != key)
    return (others if now is None else (*others, now)), (alive | {key} if lives else alive - {key})


def _window(fix: Fix, setting: Setting) -> tuple[int, int]:
    """Between which instants a radar track must have plots to be alive for a report."""
    return fix.at - int(SILENT_S * SECOND), fix.at + int(setting.options.association_wait_s * SECOND)


def _compared(fix: Fix, key: Key, tracks: RadarTracks, there: Polar, spread: Polar, setting: Setting) -> Comparison:
    """One report against one radar track."""
    value, sigma = bracket(tracks.plots[key], fix.at, setting.options.association_wait_s)
    return _judged(key, value, sigma, fix, there, spread, setting.options.association)


def _is_far(
    elapsed: Any,
    there: Polar,
    spread: Polar,
    range_m: Any,
    azimuth_rad: Any,
    range_sigma_m: Any,
    azimuth_sigma_rad: Any,
) -> Any:
    """Whether a track's latest range and azimuth, so many ns ago, leave no chance of a hit; of one track or of columns.

    Then nothing need be interpolated.
    """
    moved_m = GREATEST_SPEED_MPS * (abs(elapsed) / SECOND + 1.0)
    off = abs(azimuth_rad - there[1])
    away = math.pi - abs(math.pi - off)  # both are in (-pi, pi]
    return (abs(range_m - there[0]) > moved_m + 4.0 * (spread[0] + range_sigma_m)) | (
        away > moved_m / max(there[0], 300.0) + 4.0 * (spread[1] + azimuth_sigma_rad)
    )


def _seen_from(fix: Fix, radar: RadarFrame, setting: Setting) -> tuple[Polar, Polar]:
    """A report's place as a radar would measure it, and its sigma there, systematic error included."""
    distance, azimuth, elevation = polar_from_xyz(radar.from_enu(fix.enu_m)).tolist()
    sigma_m = math.hypot(float(fix.sigma_m[0]), setting.site.position.systematic_m)
    upright_m = math.hypot(float(fix.sigma_m[2]), setting.site.position.systematic_m)
    level = max(distance * math.cos(elevation), 1.0)
    there, spread = (distance, azimuth, elevation), (sigma_m, sigma_m / level, upright_m / max(distance, 1.0))
    if fix.local is None or fix.local.has_height:
        return there, spread
    above = fix.local.from_enu[2] * fix.sigma_m[2]
    ends = polar_from_xyz(radar.from_enu(np.array([fix.enu_m - above, fix.enu_m + above]))).tolist()
    # What a wrong guess of the height does is not linear where the line of sight is steep: the worse end of it counts.
    ranges = max(abs(end[0] - distance) for end in ends)
    azimuths = max(abs(math.remainder(end[1] - azimuth, 2.0 * math.pi)) for end in ends)
    elevations = max(abs(end[2] - elevation) for end in ends)
    return there, (math.hypot(spread[0], ranges), math.hypot(spread[1], azimuths), math.hypot(spread[2], elevations))


def _judged(key: Key, value: Polar, sigma: Polar, fix: Fix, there: Polar, spread: Polar, rule: str) -> Comparison:
    """`judge`; a height that is only guessed is not compared, but where it cannot be so far wrong the pair is none."""
    if fix.has_height:
        return judge(key, value, sigma, there, spread, rule)
    found = judge(key, value, sigma, (there[0], there[1], math.nan), spread, rule)
    far_off = abs(value[2] - there[2]) > IMPOSSIBLE_SIGMAS * math.hypot(sigma[2], spread[2])
    return replace(found, hit=False) if far_off and found.hit else found


def judge(key: Key, value: Polar, sigma: Polar, there: Polar, spread: Polar, rule: str) -> Comparison:
    """Hit or miss. `literal`: range and (azimuth or elevation); `default`: all that are present, at least two.

    Source: 003 2.3 eq 7. Deviation: `default`, because eq 7 takes an aircraft 3 degrees abeam for the one on final.
    """
    range_, azimuth, elevation = (value[component] - there[component] for component in range(3))
    if not math.isnan(azimuth):
        azimuth = math.remainder(azimuth, 2.0 * math.pi)
    difference = (range_, azimuth, elevation)
    wide, left, up = (GATE_SIGMAS * math.hypot(sigma[component], spread[component]) for component in range(3))
    gate = (wide, left, up)
    ratios = [abs(off) / limit for off, limit in zip(difference, gate, strict=True)]  # NaN where not compared
    compared = [ratio for ratio in ratios if not math.isnan(ratio)]
    if rule == "literal":
        hit = ratios[0] <= 1.0 and (ratios[1] <= 1.0 or ratios[2] <= 1.0)
    else:
        hit = len(compared) >= 2 and max(compared) <= 1.0
    distance = sum(ratio * ratio for ratio in compared) / len(compared) if compared else math.inf
    return Comparison(key, hit, distance, difference, gate)
