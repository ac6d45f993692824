"""What register found: /register.

/register/error/WHAT/RADAR is each error over time, with its sigma and what is taken off; /register/residual/WHAT/RADAR how
far a radar's plots are from what aircraft report, before and after; WHAT is range, azimuth, elevation, time. /register/verdict
says it in words.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.picture import Picture
from gateway.register import Registered
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, in_order, once, rows
from gateway.sinks.scene.lately import BEFORE_ALL, Lately

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SAMPLE_NS = 1_000_000_000  # people read it: once a second
ODD_RAD = math.radians(
    0.5
)  # an angle further than this from the others' is not drawn: near the antenna metres are degrees
VERDICT = "/register/verdict"
LEGEND = (
    "Lines: thin is what was found, dim one σ to both sides of it, broad what is taken off.\n\n"
    "Points, one for each pair: dim as measured, bright with that taken off."
)
WHATS = ("range", "azimuth", "elevation", "time")


@dataclass(frozen=True, slots=True)
class _Quantity:
    """How one error is written: its unit, how many of it are in the SI unit, digits, and from which sigma on it tells nothing."""

    unit: str
    per: float
    digits: int
    vague: float


class RegisterScene:
    """Draws errors once a second, residuals as they come, and the words when they change."""

    def __init__(self, site: Site) -> None:
        units = style.units_of(site)
        angle = _Quantity("°", math.degrees(1.0), 3, math.radians(1.0))
        length = _Quantity(units.length, units.lengths, 1, 400.0)
        self._quantities = (length, angle, angle, _Quantity("ms", 1e3, 0, 0.4))
        self._sampled = BEFORE_ALL
        self._looked: Lately[str] = Lately()
        self._said: str | None = None

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        entries: list[Entry] = []
        told = [picture for picture in pictures if self._is_due(picture)]
        for picture in told:
            entries += self._words(picture)
        entries += self._errors(told)
        entries += self._residuals(pictures)
        return entries

    def _is_due(self, picture: Picture) -> bool:
        due = not 0 <= picture.now - self._sampled < SAMPLE_NS and bool(picture.register.radars)
        if due:
            self._sampled = picture.now
        return due

    def _errors(self, pictures: Sequence[Picture]) -> list[Entry]:
        """Of each radar and kind: what is taken off, what was found, and one sigma to both sides of that."""
        found: dict[tuple[int, int], list[tuple[int, int, tuple[float, ...]]]] = {}
        for picture in pictures:
            one = picture.register
            error = np.where(np.isfinite(one.sigma), one.error, math.nan)
            for row, radar in enumerate(one.radars):
                for place, quantity in enumerate(self._quantities):
                    value, sigma = float(error[row, place]), float(one.sigma[row, place])
                    if not sigma <= quantity.vague:
                        value = sigma = math.nan
                    values = (float(one.correction[row, place]), value, value - sigma, value + sigma)
                    told = tuple(quantity.per * value for value in values)
                    found.setdefault((radar, place), []).append((picture.now, picture.step, told))
        entries: list[Entry] = []
        for (radar, place), samples in found.items():
            path = entity("register", "error", WHATS[place], radar)
            time, step, values = zip(*samples, strict=True)
            if self._looked.is_new(path, time[-1]):
                entries.append(Always(path, (_error_look(radar, self._quantities[place].unit),)))
            entries.append(rows(path, time, step, rr.Scalars.columns(scalars=np.array(values))))
        return entries

    def _residuals(self, pictures: Sequence[Picture]) -> list[Entry]:
        """Of each radar and kind, a point for each pair: as measured, and with what was taken off."""
        parts = [(picture.register.residuals, picture.step) for picture in pictures]
        parts = [(one, step) for one, step in parts if len(one.time)]
        if not parts:
            return []
        radar, time = (np.concatenate([getattr(one, name) for one, _ in parts]) for name in ("radar", "time"))
        step = np.repeat([step for _, step in parts], [len(one.time) for one, _ in parts])
        before, after = (np.concatenate([getattr(one, name) for one, _ in parts]) for name in ("before", "after"))
        order = in_order(time)
        entries: list[Entry] = []
        for number in np.unique(radar).tolist():
            for place, quantity in enumerate(self._quantities[:3]):
                mine = order[(radar[order] == number) & np.isfinite(before[order, place])]
                if place:
                    mine = mine[~_is_odd(time[mine], before[mine, place])]
                if not len(mine):
                    continue
                path = entity("register", "residual", WHATS[place], number)
                if self._looked.is_new(path, int(time[mine[-1]])):
                    entries.append(Always(path, (_residual_look(number, quantity.unit),)))
                both = quantity.per * np.stack([before[mine, place], after[mine, place]], axis=-1)
                entries.append(rows(path, time[mine], step[mine], rr.Scalars.columns(scalars=both)))
        return entries

    def _words(self, picture: Picture) -> list[Entry]:
        """The verdicts, if they are not those that are shown already."""
        text = self._table(picture.register)
        if text == self._said:
            return []
        look = []
        if self._said is None:
            look = [Always(VERDICT, (rr.TextDocument.from_fields(media_type="text/markdown"),))]
        self._said = text
        return [*look, once(VERDICT, picture.now, picture.step, rr.TextDocument.columns(text=[text]))]

    def _table(self, one: Registered) -> str:
        """Each radar's errors as a table with their verdicts, and the position sources' below, in Markdown."""
        parts = ["**The position sources are further off than was assumed: nothing of this is to be trusted.**"]
        parts = parts if one.prior_wrong else []
        for row, radar in enumerate(one.radars):
            lines = [
                f"| **radar {radar}**, {style.radar_colour_name(radar)} | found | σ | taken off |",
                "|---|--:|--:|--:|",
            ]
            for place, quantity in enumerate(self._quantities):
                error, sigma, off = (
                    _number(float(column[row, place]), quantity) for column in (one.error, one.sigma, one.correction)
                )
                lines.append(f"| {WHATS[place]}, {quantity.unit} | {error} | {sigma} | {off} |")
            words = [f"- {_in_signs(verdict)}" for verdict in one.verdict[row] if verdict]
            parts.append("\n".join([*lines, "", *(words or ["No pair has told anything yet."])]))
        length = self._quantities[0]
        if math.isfinite(one.own_sigma_m):
            axes = zip(("east", "north", "up"), one.source_m, one.source_sigma_m, strict=True)
            common = [f"| {axis}, {length.unit} | {_number(m, length)} | {_number(s, length)} |" for axis, m, s in axes]
            own = f"Each by itself is off by {_number(one.own_sigma_m, length)} {length.unit} an axis besides."
            head = ["| **position sources together** | found | σ |", "|---|--:|--:|"]
            parts.append("\n".join([*head, *common, "", own]))
        return "\n\n".join([*parts, LEGEND])


def _is_odd(time: Ints, angle: Floats) -> Bools:
    """Which angles (n,) are far from the middle one of their second."""
    seconds, of = np.unique(time // SAMPLE_NS, return_inverse=True)
    middle = np.array([np.median(angle[of == second]) for second in range(len(seconds))])
    return np.asarray(np.abs(angle - middle[of]) > ODD_RAD)


def _error_look(radar: int, unit: str) -> rr.SeriesLines:
    """What is taken off is the broad line below; sigma is thin and dim."""
    colour = style.radar_colour(radar)
    dim, bright = _mixed(colour, (30, 33, 40), 0.55), _mixed(colour, (255, 255, 255), 0.55)
    return rr.SeriesLines(
        names=[f"radar {radar} {part}, {unit}" for part in ("taken off", "found", "− σ", "+ σ")],
        colors=[bright, colour, dim, dim],
        widths=[3.5, 1.5, 0.8, 0.8],
    )


def _residual_look(radar: int, unit: str) -> rr.SeriesPoints:
    """As measured is dim and small."""
    colour = style.radar_colour(radar)
    return rr.SeriesPoints(
        names=[f"radar {radar} {part}, {unit}" for part in ("before", "after")],
        colors=[_mixed(colour, (60, 63, 70), 0.6), _mixed(colour, (255, 255, 255), 0.25)],
        markers=["cross", "circle"],
        marker_sizes=[1.2, 1.5],
    )


def _mixed(one: style.Colour, other: style.Colour, share: float) -> style.Colour:
    """A colour with a share of another one."""
    red, green, blue = (round((1.0 - share) * a + share * b) for a, b in zip(one[:3], other[:3], strict=True))
    return red, green, blue


def _number(value: float, quantity: _Quantity) -> str:
    """With the digits that people read; a dash where nothing is known."""
    return f"{quantity.per * value:.{quantity.digits}f}" if math.isfinite(value) else "–"


def _in_signs(verdict: str) -> str:
    """A verdict as it is printed elsewhere, with the sign that a screen has."""
    return verdict.replace("+-", "±")
