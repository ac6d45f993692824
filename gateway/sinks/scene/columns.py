"""Component columns of many entities' rows at once, as Arrow arrays: what `Archetype.columns` gives of each, far cheaper.

Rerun's own conversion looks at every shape that a value can have, for 30 to 60 us a column. A crowd is thousands of them a
second. Here the shape is known, and a column is made once for all entities, whose rows stand behind one another in it
(`gateway.sinks.scene.sheaf`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from gateway.sinks.scene.style import Colour

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Column:
    """A component and its values, a list of them in each row."""

    descriptor: Any
    array: pa.Array

    def cut(self, start: int, count: int) -> Column:
        """Some of the rows; nothing is copied."""
        return Column(self.descriptor, self.array.slice(start, count))

    def component_descriptor(self) -> Any:
        """What Rerun asks for."""
        return self.descriptor

    def as_arrow_array(self) -> pa.Array:
        """What Rerun asks for."""
        return self.array


def _vectors(width: int, kind: pa.DataType) -> pa.DataType:
    return pa.list_(pa.field("item", kind, nullable=False), width)


_FLAT, _SPACE, _TURN, _GROUND = (
    _vectors(2, pa.float32()),
    _vectors(3, pa.float32()),
    _vectors(4, pa.float32()),
    _vectors(2, pa.float64()),
)
_POSITIONS_3D, _POSITIONS_2D = rr.Points3D.descriptor_positions(), rr.Points2D.descriptor_positions()
_COLOURS_3D, _LABELS_3D = rr.Points3D.descriptor_colors(), rr.Points3D.descriptor_labels()
_POSITIONS_MAP, _COLOURS_MAP = rr.GeoPoints.descriptor_positions(), rr.GeoPoints.descriptor_colors()
SCALARS, _ALBEDO = rr.Scalars.descriptor_scalars(), rr.Mesh3D.descriptor_albedo_factor()
_TRANSLATION, _QUATERNION = rr.Transform3D.descriptor_translation(), rr.Transform3D.descriptor_quaternion()
_STRIPS_3D, _STRIPS_MAP = rr.LineStrips3D.descriptor_strips(), rr.GeoLineStrings.descriptor_line_strings()
_SCALE = rr.Transform3D.descriptor_scale()
_HALF_SIZES, _CENTRES = rr.Ellipsoids3D.descriptor_half_sizes(), rr.Ellipsoids3D.descriptor_centers()
_AXES, _COLOURS_ELLIPSOID = rr.Ellipsoids3D.descriptor_quaternions(), rr.Ellipsoids3D.descriptor_colors()


def points_3d(place: Floats) -> tuple[Column, ...]:
    """Points (n, 3) in metres, one a row."""
    return (Column(_POSITIONS_3D, _each(place, _SPACE, np.float32)),)


def points_2d(place: Floats, counts: ArrayLike) -> tuple[Column, ...]:
    """Points (m, 2) on a flat screen, so many in each row (n,)."""
    flat = pa.FixedSizeListArray.from_arrays(_numbers(place, np.float32), type=_FLAT)
    return (Column(_POSITIONS_2D, _listed(flat, np.concatenate([[0], np.cumsum(counts)]))),)


def points_on_map(lat_lon_deg: Floats) -> tuple[Column, ...]:
    """Points (n, 2) in degrees of latitude and longitude, one a row."""
    return (Column(_POSITIONS_MAP, _each(lat_lon_deg, _GROUND, np.float64)),)


def labels(texts: Sequence[str]) -> tuple[Column, ...]:
    """What stands beside a point, one a row."""
    return (Column(_LABELS_3D, _listed(pa.array(texts, pa.string()), np.arange(len(texts) + 1))),)


def scalars(values: Floats) -> tuple[Column, ...]:
    """Values of plots: (n,), or (n, k) of k series."""
    count = len(values)
    wide = values.size // count if count else 1
    return (Column(SCALARS, _listed(_numbers(values, np.float64), np.arange(count + 1) * wide)),)


def scalars_of(values: Floats, widths: ArrayLike) -> tuple[Column, ...]:
    """Values of plots (m,), so many series in each row (n,)."""
    return (Column(SCALARS, _listed(_numbers(values, np.float64), np.concatenate([[0], np.cumsum(widths)]))),)


def strips_3d(strips: Sequence[Floats] | Floats, counts: ArrayLike) -> tuple[Column, ...]:
    """Lines (k, 3) in metres, so many in each row (n,)."""
    return (Column(_STRIPS_3D, _lines(strips, counts, _SPACE, np.float32)),)


def strips_on_map(strips: Sequence[Floats], counts: ArrayLike) -> tuple[Column, ...]:
    """Lines (k, 2) in degrees of latitude and longitude, likewise."""
    return (Column(_STRIPS_MAP, _lines(strips, counts, _GROUND, np.float64)),)


def clouds_3d(clouds: Sequence[Floats]) -> tuple[Column, ...]:
    """Points in metres, all of one (k, 3) in a row."""
    return (Column(_POSITIONS_3D, _cut_vectors(clouds, _SPACE, np.float32)),)


def clouds_on_map(clouds: Sequence[Floats]) -> tuple[Column, ...]:
    """Points in degrees of latitude and longitude, all of one (k, 2) in a row."""
    return (Column(_POSITIONS_MAP, _cut_vectors(clouds, _GROUND, np.float64)),)


def point_colours(colours: NDArray[np.uint32]) -> tuple[Column, ...]:
    """Of points in the scene and on the map, one a row: see `packed`."""
    array = _listed(pa.array(colours), np.arange(len(colours) + 1))
    return Column(_COLOURS_3D, array), Column(_COLOURS_MAP, array)


def mesh_colours(colours: NDArray[np.uint32]) -> tuple[Column, ...]:
    """Of a body, one a row."""
    return (Column(_ALBEDO, _listed(pa.array(colours), np.arange(len(colours) + 1))),)


def poses(place: Floats, turned: Floats, size: Floats) -> tuple[Column, ...]:
    """Where a body stands (n, 3) in metres, how it is turned (n, 4) as x, y, z, w, and how many metres (n,) its unit is."""
    return (
        Column(_TRANSLATION, _each(place, _SPACE, np.float32)),
        Column(_QUATERNION, _each(turned, _TURN, np.float32)),
        Column(_SCALE, _each(np.repeat(size, 3), _SPACE, np.float32)),
    )


def ellipsoids(place: Floats, half: Floats, axes: Floats, colours: NDArray[np.uint32]) -> tuple[Column, ...]:
    """Centres and half axes (n, 3) in metres, orientation (n, 4), colours (n,), one a row."""
    return (
        Column(_HALF_SIZES, _each(half, _SPACE, np.float32)),
        Column(_CENTRES, _each(place, _SPACE, np.float32)),
        Column(_AXES, _each(axes, _TURN, np.float32)),
        Column(_COLOURS_ELLIPSOID, _listed(pa.array(colours), np.arange(len(colours) + 1))),
    )


def packed(colour: Colour) -> int:
    """A colour as one number: red, green, blue and opacity, 8 bits each."""
    red, green, blue, alpha = (*colour, 255)[:4]
    return int(red << 24 | green << 16 | blue << 8 | alpha)


def _numbers(values: ArrayLike, kind: Any) -> pa.Array:
    return pa.array(np.ascontiguousarray(values, dtype=kind).reshape(-1))


def _each(values: Floats, wanted: pa.DataType, kind: Any) -> pa.Array:
    """One vector a row."""
    vectors = pa.FixedSizeListArray.from_arrays(_numbers(values, kind), type=wanted)
    return _listed(vectors, np.arange(len(vectors) + 1))


def _cut_vectors(parts: Sequence[Floats] | Floats, wanted: pa.DataType, kind: Any) -> pa.Array:
    """Vectors (k, width), all of one part in a row."""
    vectors = pa.FixedSizeListArray.from_arrays(_numbers(np.concatenate(parts), kind), type=wanted)
    return _listed(vectors, np.concatenate([[0], np.cumsum([len(part) for part in parts])]))


def _lines(strips: Sequence[Floats] | Floats, counts: ArrayLike, wanted: pa.DataType, kind: Any) -> pa.Array:
    points = _cut_vectors(strips, wanted, kind)
    whole = pa.list_(pa.field("item", wanted, nullable=False))  # as Rerun declares a line: all its points are there
    return _listed(points.cast(whole), np.concatenate([[0], np.cumsum(counts)]))


def _listed(values: pa.Array, ends: Any) -> pa.Array:
    """Rows of values, cut at `ends`, which begin with 0."""
    return pa.ListArray.from_arrays(pa.array(np.asarray(ends, dtype=np.int32)), values)
