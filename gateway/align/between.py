"""A radar track at an instant between its plots, each component on its own (paper 003, 2.1)."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from gateway.align.plots import SECOND, Plot, Polar


def bracket(plots: Sequence[Plot], at: int, wait_s: float, back_s: float = 3.0) -> tuple[Polar, Polar]:
    """One radar track's range, azimuth, elevation at an instant, and their sigmas; NaN where nothing is near.

    `plots` in order of time. Each component is interpolated between the plots on both sides that have it (no later than
    `wait_s` after the instant, no earlier than `back_s` before); extrapolated from the two before it if none follows.
    Sigmas are those of the weights used, so an extrapolation says how bad it is (2.2 to 2.6 times an interpolation).
    Source: 003 2.1.
    """
    middle = bisect_right(plots, at, key=_at)
    first, last = at - int(back_s * SECOND), at + int(wait_s * SECOND)
    range_, azimuth, elevation = (_component(plots, middle, at, first, last, component) for component in range(3))
    return (range_[0], azimuth[0], elevation[0]), (range_[1], azimuth[1], elevation[1])


def _component(
    plots: Sequence[Plot], middle: int, at: int, first: int, last: int, component: int
) -> tuple[float, float]:
    """One component at an instant and its sigma; `middle` is the first plot after the instant."""
    before: list[Plot] = []
    for place in range(middle - 1, -1, -1):
        if plots[place].at < first or len(before) == 2:
            break
        if not math.isnan(plots[place].polar[component]):
            before.append(plots[place])
    if not before:
        return math.nan, math.nan
    newest = before[0]
    after = None
    for place in range(middle, len(plots)):
        if plots[place].at > last:
            break
        if not math.isnan(plots[place].polar[component]):
            after = plots[place]
            break
    if newest.at == at:
        return newest.polar[component], newest.sigma[component]
    one, other = (newest, after) if after is not None else (before[-1], newest)
    if one.at == other.at:  # one old plot alone says where the target is only for a moment
        near = at - newest.at <= SECOND // 2
        return (newest.polar[component], newest.sigma[component]) if near else (math.nan, math.nan)
    weight = (at - one.at) / (other.at - one.at)
    change = other.polar[component] - one.polar[component]
    if component == 1:
        change = math.remainder(change, 2.0 * math.pi)
    sigma = math.hypot((1.0 - weight) * one.sigma[component], weight * other.sigma[component])
    return one.polar[component] + weight * change, sigma


def _at(plot: Plot) -> int:
    return plot.at
