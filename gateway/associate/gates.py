"""Gates: one GPS report against the radar tracks that are near it (paper 003, eq 6 and 7)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gateway.align import SECOND, Fix, Polar, bracket
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz
from gateway.settings import Options, Site
from gateway.track import GREATEST_SPEED_MPS, Key, Place, RadarTracks

GATE_SIGMAS = 3.0
IMPOSSIBLE_SIGMAS = 4.0  # a guessed height can forbid a pair beyond this, never support one
SILENT_S = 3.0  # a radar track without plots for this long gives its aircraft free
NOWHERE: Polar = (math.nan, math.nan, math.nan)


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


def compare(fix: Fix, tracks: RadarTracks, setting: Setting) -> tuple[tuple[Comparison, ...], frozenset[Key]]:
    """One report against every radar track with plots near its time that is not far away; and which have such plots.

    Source: 003 2.3 eq 6. Deviation: sigma also holds the allowed systematic error of the position source.
    """
    wait = int(setting.options.association_wait_s * SECOND)
    first, last = fix.at - int(SILENT_S * SECOND), fix.at + wait
    alive, found = set(), []
    seen = {number: _seen_from(fix, radar, setting) for number, radar in setting.radars.items()}
    for key, plots in tracks.plots.items():
        if plots[0].at > last or plots[-1].at < first or key[0] not in seen:
            continue
        alive.add(key)
        there, spread = seen[key[0]]
        if not _is_far(fix.at, there, spread, tracks.places[key]):
            value, sigma = bracket(plots, fix.at, setting.options.association_wait_s)
            found.append(_judged(key, value, sigma, fix, there, spread, setting.options.association))
    return tuple(found), frozenset(alive)


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


def _is_far(at: int, there: Polar, spread: Polar, place: Place) -> bool:
    """Whether a radar track's latest range and azimuth leave no chance of a hit, so that nothing need be interpolated."""
    moved_m = GREATEST_SPEED_MPS * (abs(at - place.at) / SECOND + 1.0)
    away_m = abs(place.range_m - there[0])
    if away_m > moved_m + 4.0 * (spread[0] + place.range_sigma_m):
        return True
    away = (
        abs(math.remainder(place.azimuth_rad - there[1], 2.0 * math.pi))
        if place.azimuth_rad == place.azimuth_rad
        else 0.0
    )
    return away > moved_m / max(there[0], 300.0) + 4.0 * (spread[1] + place.azimuth_sigma_rad)


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
