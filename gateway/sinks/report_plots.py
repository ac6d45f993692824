"""Plots as SVG text, for pages that stand on their own and print: lines, bands and marks over one axis."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 760, 200
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 12, 26, 36
_TICKS = 6
_LETTER = 7.0  # of a name, as wide as most


@dataclass(frozen=True, slots=True)
class Line:
    """Values over places (n,); broken where one is NaN."""

    name: str
    x: Floats
    y: Floats
    colour: str
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Band:
    """An area between two lines (n,)."""

    name: str
    x: Floats
    low: Floats
    high: Floats
    colour: str


@dataclass(frozen=True, slots=True)
class Mark:
    """A place on the x axis that has a name."""

    name: str
    x: float


def plot(
    title: str,
    x_name: str,
    lines: Sequence[Line],
    bands: Sequence[Band] = (),
    marks: Sequence[Mark] = (),
) -> str:
    """One plot as an <svg> element. The x axis is what there is to go: it falls from left to right, as flights come."""
    x_axis = _Axis.of([one.x for one in lines], WIDTH - _RIGHT, _LEFT)
    values = [one.y for one in lines] + [side for one in bands for side in (one.low, one.high)]
    y_axis = _Axis.of(values, HEIGHT - _BOTTOM, _TOP)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(title, True)}">',
        f'<text x="{_LEFT}" y="16" class="title">{escape(title)}</text>',
        *(_grid(x_axis, y_axis, x_name)),
        *(_band(one, x_axis, y_axis) for one in bands),
        *_marks([one for one in marks if x_axis.low <= one.x <= x_axis.high], x_axis),
        *(_line(one, x_axis, y_axis) for one in lines),
        *_legend([(one.name, one.colour) for one in lines] + [(one.name, one.colour) for one in bands]),
        "</svg>",
    ]
    return "\n".join(parts)


@dataclass(frozen=True, slots=True)
class _Axis:
    """From values to pixels; `ticks` are round numbers within."""

    low: float
    high: float
    begins: float
    ends: float
    ticks: tuple[float, ...]

    @classmethod
    def of(cls, values: Sequence[Floats], begins: float, ends: float) -> _Axis:
        """An axis for values, whose lowest is drawn at pixel `begins`."""
        known = np.concatenate([one[np.isfinite(one)] for one in values] or [np.zeros(1)])
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
        if high - low < 1e-6:
            low, high = low - 1.0, high + 1.0
        step = _round((high - low) / _TICKS)
        low, high = math.floor(low / step) * step, math.ceil(high / step) * step
        ticks = tuple(low + number * step for number in range(round((high - low) / step) + 1))
        return cls(low, high, begins, ends, ticks)

    def at(self, values: Floats | float) -> Floats:
        share = (np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low)
        return np.asarray(self.begins + share * (self.ends - self.begins))


def _round(step: float) -> float:
    """The next of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(power * times for times in (1.0, 2.0, 5.0, 10.0) if power * times >= step * (1.0 - 1e-9))


def _grid(x_axis: _Axis, y_axis: _Axis, x_name: str) -> list[str]:
    parts = []
    for tick in x_axis.ticks:
        x = float(x_axis.at(tick))
        parts.append(f'<path class="grid" d="M{x:.1f} {_TOP}V{HEIGHT - _BOTTOM}"/>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - _BOTTOM + 13}" class="tick middle">{_number(tick)}</text>')
    for tick in y_axis.ticks:
        y = float(y_axis.at(tick))
        kind = "zero" if abs(tick) < 1e-9 else "grid"
        parts.append(f'<path class="{kind}" d="M{_LEFT} {y:.1f}H{WIDTH - _RIGHT}"/>')
        parts.append(f'<text x="{_LEFT - 5}" y="{y + 3.5:.1f}" class="tick end">{_number(tick)}</text>')
    middle = (_LEFT + WIDTH - _RIGHT) / 2
    parts.append(f'<text x="{middle:.0f}" y="{HEIGHT - 8}" class="tick middle">{escape(x_name)}</text>')
    return parts


def _number(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-9 else value:.6g}"


def _line(line: Line, x_axis: _Axis, y_axis: _Axis) -> str:
    x, y = x_axis.at(line.x), y_axis.at(line.y)
    known = np.isfinite(x) & np.isfinite(y)
    path, pen_down = [], False
    for place in range(len(x)):
        if known[place]:
            path.append(f"{'L' if pen_down else 'M'}{x[place]:.1f} {y[place]:.1f}")
        pen_down = bool(known[place])
    dashes = ' stroke-dasharray="5 3"' if line.dashed else ""
    return f'<path class="line" stroke="{line.colour}"{dashes} d="{"".join(path)}"/>'


def _band(band: Band, x_axis: _Axis, y_axis: _Axis) -> str:
    known = np.isfinite(band.x) & np.isfinite(band.low) & np.isfinite(band.high)
    x, low, high = x_axis.at(band.x[known]), y_axis.at(band.low[known]), y_axis.at(band.high[known])
    around = [*zip(x, low, strict=True), *zip(x[::-1], high[::-1], strict=True)]
    return f'<polygon fill="{band.colour}" points="{" ".join(f"{one:.1f},{other:.1f}" for one, other in around)}"/>'


def _marks(marks: Sequence[Mark], x_axis: _Axis) -> Iterator[str]:
    """Lines with their names; a name that would run into the next line stands a row lower."""
    at = sorted((float(x_axis.at(mark.x)), mark.name) for mark in marks)
    for place, (x, name) in enumerate(at):
        room = at[place + 1][0] - x if place + 1 < len(at) else math.inf
        row = 1 if len(name) * _LETTER > room else 0
        yield (
            f'<path class="mark" d="M{x:.1f} {_TOP}V{HEIGHT - _BOTTOM}"/>'
            f'<text x="{x + 3:.1f}" y="{_TOP + 10 + 12 * row}" class="tick">{escape(name)}</text>'
        )


def _legend(names: Sequence[tuple[str, str]]) -> list[str]:
    parts, x = [], float(WIDTH - _RIGHT)
    for name, colour in reversed(names):
        parts.append(f'<text x="{x:.0f}" y="16" class="tick end">{escape(name)}</text>')
        x -= 6.2 * len(name) + 14
        parts.append(f'<rect x="{x:.0f}" y="8" width="9" height="9" fill="{colour}"/>')
        x -= 12
    return parts
