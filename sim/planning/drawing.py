"""A plan in the viewer: the threat field from above with threats, areas, candidates and routes, and the price along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.sinks.scene import style
from gateway.sinks.scene.entry import entity
from sim.planning.areas import Area
from sim.planning.field import Threats, stations

Floats = NDArray[np.float64]

MODERN: style.Colour = (255, 255, 255)
SEED: style.Colour = (90, 235, 235)
LITERAL: style.Colour = (255, 110, 220)
CANDIDATE: style.Colour = (175, 175, 190)
_THREAT: style.Colour = (255, 60, 50)
_AREA: style.Colour = (255, 190, 60)
_OPTIMUM: style.Colour = (120, 220, 140)
_PIXELS = 400  # of the field along the longer side
_SHADES = np.array(
    [(14, 18, 42), (26, 52, 96), (40, 98, 120), (196, 150, 60), (190, 60, 40), (110, 20, 30)], dtype=float
)
_DEAREST = 30.0  # prices from here on have the last shade
_TICKS = 5


@dataclass(frozen=True, slots=True)
class Line:
    """One way to draw: its name, points (n, 2) m, colour, and width in points of the screen."""

    name: str
    curve_m: Floats
    colour: style.Colour
    width: float = 3.0


@dataclass(frozen=True, slots=True)
class Sheet:
    """One plan from above, under an entity of its own; its unit is a pixel of the field, y points down."""

    root: str
    box_m: Floats

    @property
    def pixel_m(self) -> float:
        """How large a pixel of the field is."""
        return float((self.box_m[1] - self.box_m[0]).max()) / _PIXELS

    def at(self, place_m: Floats) -> Floats:
        """Places (..., 2) m on the sheet."""
        west, north = self.box_m[0, 0], self.box_m[1, 1]
        return np.stack([place_m[..., 0] - west, north - place_m[..., 1]], axis=-1) / self.pixel_m

    def path(self, *parts: str) -> str:
        """An entity of this sheet."""
        return entity(self.root, *parts)

    def draw_field(self, recording: rr.RecordingStream, threats: Threats, lambda_m4: float) -> None:
        """What a metre costs, from 1 (dark) to 30 and more (red), with a scale in km at the borders."""
        low, high = self.box_m
        counts = np.maximum(np.rint((high - low) / self.pixel_m).astype(np.int64), 1)
        x = low[0] + (np.arange(counts[0]) + 0.5) * self.pixel_m
        y = high[1] - (np.arange(counts[1]) + 0.5) * self.pixel_m
        place = np.stack(np.meshgrid(x, y), axis=-1)
        price = 1.0 + lambda_m4 * threats.density(place)
        shade = np.clip(np.log(price) / np.log(_DEAREST), 0.0, 1.0) * (len(_SHADES) - 1)
        colour = [np.interp(shade, np.arange(len(_SHADES)), _SHADES[:, channel]) for channel in range(3)]
        picture = np.stack(colour, axis=-1).astype(np.uint8)
        recording.log(self.path("field"), rr.Image(picture, draw_order=-10.0), static=True)
        self._draw_scale(recording)

    def _draw_scale(self, recording: rr.RecordingStream) -> None:
        low, high = self.box_m
        step = _step(float((high - low).max()) / _TICKS)
        places, labels = [], []
        for axis in (0, 1):
            for value in np.arange(np.ceil(low[axis] / step), np.floor(high[axis] / step) + 1.0) * step:
                place = np.array(low)
                place[axis] = value
                place[1 - axis] -= 2.5 * self.pixel_m * (_PIXELS / 100.0)
                places.append(self.at(place))
                labels.append(f"{value / 1000.0:g}" if value or axis == 0 else "")
        points = rr.Points2D(places, labels=labels, show_labels=True, colors=[style.TEXT], radii=[0.01])
        recording.log(self.path("scale"), points, static=True)

    def draw_threats(self, recording: rr.RecordingStream, threats: Threats, areas: Sequence[Area]) -> None:
        """Where threats are, and areas to keep out of."""
        if len(threats.place_m):
            labels = [f"T{number}" for number in range(1, len(threats.place_m) + 1)]
            points = rr.Points2D(
                self.at(threats.place_m), colors=[_THREAT], radii=style.points(5.0), labels=labels, show_labels=True
            )
            recording.log(self.path("threats"), points, static=True)
        for number, area in enumerate(areas, 1):
            name = area.name or f"area {number}"
            line = rr.LineStrips2D(
                [self.at(area.outline())], colors=[_AREA], radii=style.points(1.5), labels=[name], show_labels=True
            )
            recording.log(self.path("areas", name), line, static=True)

    def draw_points(self, recording: rr.RecordingStream, name: str, place_m: Floats, radius: float = 2.5) -> None:
        """Points of one kind, without names."""
        if len(place_m):
            points = rr.Points2D(self.at(place_m), colors=[_OPTIMUM], radii=style.points(radius))
            recording.log(self.path(name), points, static=True)

    def draw_ends(self, recording: rr.RecordingStream, start_m: Floats, goal_m: Floats) -> None:
        """Where the route starts and ends."""
        ends = rr.Points2D(
            self.at(np.stack([start_m, goal_m])), colors=[style.TEXT], radii=style.points(4.5), labels=["start", "goal"],
            show_labels=True,
        )  # fmt: skip
        recording.log(self.path("ends"), ends, static=True)

    def draw_line(self, recording: rr.RecordingStream, line: Line) -> None:
        """A way."""
        drawn = rr.LineStrips2D([self.at(line.curve_m)], colors=[line.colour], radii=style.points(0.5 * line.width))
        recording.log(self.path("routes", line.name), drawn, static=True)

    def draw_price(self, recording: rr.RecordingStream, line: Line, threats: Threats, lambda_m4: float) -> None:
        """What a metre of it costs, and how far the nearest threat is, over the distance flown."""
        if not len(threats.place_m):
            return
        station = stations(line.curve_m)
        square = threats.square(line.curve_m)
        columns = [rr.TimeColumn("metres", sequence=np.rint(station).astype(np.int64))]
        for what, values in (
            ("price", 1.0 + lambda_m4 * (square**-2).sum(axis=-1)),
            ("nearest", np.sqrt(square.min(axis=-1)) / 1000.0),
        ):
            path = self.path(what, line.name)
            recording.log(
                path, rr.SeriesLines(colors=[line.colour], names=[line.name], widths=[line.width]), static=True
            )
            recording.send_columns(path, columns, rr.Scalars.columns(scalars=values))


def _step(about_m: float) -> float:
    """A round step for a scale: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(about_m))
    return float(power * min((1.0, 2.0, 5.0, 10.0), key=lambda times: abs(times * power - about_m)))


def views(sheet: Sheet, name: str, caption: str | None = None) -> rrb.Horizontal:
    """The sheet beside its price and the nearest threat over the distance flown."""
    plan = rrb.Spatial2DView(
        origin=f"/{sheet.root}",
        name=name,
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-0.09 * _PIXELS, 1.03 * _PIXELS], y_range=[-0.03 * _PIXELS, 1.08 * _PIXELS]
        ),
        contents=[f"+ /{sheet.root}/**", f"- /{sheet.root}/price/**", f"- /{sheet.root}/nearest/**"],
    )
    over = rrb.TimeAxis(view_range=rrb.TimeRange(rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.infinite()))
    price = rrb.TimeSeriesView(
        origin=f"/{sheet.root}/price", name="What a metre costs, over the metres flown", axis_x=over
    )
    nearest = rrb.TimeSeriesView(origin=f"/{sheet.root}/nearest", name="To the nearest threat, km", axis_x=over)
    beside: list[rrb.View] = [price, nearest]
    if caption is not None:
        beside.insert(0, rrb.TextDocumentView(origin=caption, name="Summary"))
    return rrb.Horizontal(plan, rrb.Vertical(*beside), column_shares=[3, 2], name=name)
