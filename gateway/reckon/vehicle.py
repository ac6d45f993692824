"""One vehicle's dead reckoning: what it told lately, and the tips of its last seconds.

What comes late goes back to its place: it goes on from the last tip that the late thing does not touch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gateway.reckon.cells import BLOCK, CELL_NS, SECOND, SECOND_CELLS, covered_until, first_covered
from gateway.reckon.kinds import By
from gateway.reckon.running import begun
from gateway.reckon.tip import Tip
from gateway.reckon.told import ATTITUDE, HEADING, INERTIAL, Series, Told
from gateway.reckon.walking import acquainted
from gateway.settings import DeadReckoning

NEAR_ATTITUDE_NS = 500_000_000
MARGIN_NS = 4 * SECOND  # what is told is kept so much longer than tips
SILENT_NS = 3 * SECOND  # an inertial unit that says nothing for so long: nobody knows how the vehicle moves


@dataclass(frozen=True, slots=True, eq=False)
class Reckoner:
    """One vehicle. `tips`: at whole seconds, oldest first, and the newest; `former`: the last one, while there is none."""

    told: Told = Told()
    tips: tuple[Tip, ...] = ()
    by: By = By.UNIT
    former: Tip | None = None

    @property
    def tip(self) -> Tip | None:
        """The newest."""
        return self.tips[-1] if self.tips else None


def with_portion(one: Reckoner, portion: Mapping[int, Series]) -> tuple[Told, int]:
    """What was told with what came since, and from when on that changes anything."""
    told, since = one.told.with_more(portion), 1 << 62
    lines = (INERTIAL,) if one.by == By.UNIT else (INERTIAL, ATTITUDE, HEADING)
    for kind, series in portion.items():
        first = int(series.at[0])
        if kind in lines:  # the line to it begins at the sample before
            at = told.series[kind].at
            first = int(at[max(int(np.searchsorted(at, first)) - 1, 0)])
        since = min(since, first)
    return told, since


def untouched(tips: tuple[Tip, ...], since: int) -> tuple[Tip, ...]:
    """The tips that what was so at an instant, or later, does not change; the oldest in any case."""
    return tips[:1] + tuple(tip for tip in tips[1:] if int(tip.cell[0]) * CELL_NS <= since)


def begun_or_kept(one: Reckoner, moves: Told, since: int, at: int, settings: DeadReckoning) -> Reckoner:
    """A vehicle's tips as far as they still hold; the first one, where dead reckoning can begin. `moves`: what it told, what
    a unit would have told included where it has none.
    """
    former = one.former if one.tip is None else one.tip
    tips = untouched(one.tips, since) if moves.by == one.by else ()
    if tips:
        end = covered_until(moves, int(tips[-1].cell[0]))
        if at - end * CELL_NS > SILENT_NS:  # for so long what is missing may still come
            tips = ()
    if not tips:
        first = first_tip(moves, settings)
        tips = () if first is None else (first if former is None else acquainted(first, former),)
    return replace(one, tips=tips, by=moves.by, former=None if tips else former)


def first_tip(told: Told, settings: DeadReckoning) -> Tip | None:
    """The first tip, at the newest position with a velocity that an attitude is near to, if the unit goes on from there."""
    places, attitudes = told.places, told.series[ATTITUDE]
    if not len(places.at) or not len(attitudes.at) or not len(told.inertial.at):
        return None
    since = first_covered(told, 0)
    until = covered_until(told, since)
    at = places.at // CELL_NS // BLOCK * BLOCK
    usable = np.flatnonzero(~np.isnan(places.values[:, 3]) & (at >= since) & (at < until))
    for row in usable[::-1].tolist():
        nearest = int(np.argmin(np.abs(attitudes.at - places.at[row])))
        if abs(int(attitudes.at[nearest] - places.at[row])) <= NEAR_ATTITUDE_NS:
            return begun(int(places.at[row]), places.values[row], attitudes.values[nearest], settings, told.by)
    return None


def pruned(one: Reckoner, oldest: int, settings: DeadReckoning) -> Reckoner:
    """A vehicle without what is too old, and without a dead reckoning that knows nothing any more."""
    tips = one.tips
    if tips:
        kept = [tip for tip in tips[:-1] if int(tip.cell[0]) % SECOND_CELLS == 0]
        recent = [tip for tip in kept if int(tip.cell[0]) * CELL_NS > oldest]
        older = kept[: len(kept) - len(recent)]
        tips = (*older[-1:], *recent, tips[-1])
        variance = tips[-1].state.covariance[0, 0, (0, 1), (0, 1)]
        if not variance.max() <= settings.ends_at_sigma_m**2:  # also what is no number
            tips = ()
    return replace(one, told=one.told.since(oldest - MARGIN_NS), tips=tips)
