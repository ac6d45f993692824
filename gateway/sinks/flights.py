"""Rebuilt flights in the viewer: the path through the air, the path over the ground, and the aircraft that flies it.

Metres east, north and up of the first sortie's lift-off point. What a paper drew with Direct3D in 2012 is a recording that can
be scrubbed. Source: 002-2 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.offline.carrying import level_m
from gateway.offline.reconstruction import Sortie
from gateway.sinks.scene import style
from gateway.sinks.scene.attitude import quaternion_from_attitude
from gateway.sinks.scene.entry import entity
from gateway.sinks.scene.tracks import OUTLINE

Floats = NDArray[np.float64]

_DRAWN_HZ = 5.0  # of a sample's symbol and plots: as often as the eye asks for
_OPEN: style.Colour = (140, 140, 140)
_SYMBOL_SHARE = 0.06  # the symbol's length as a share of the flight's extent


def draw(flights: Mapping[str, Sequence[Sortie]], path: Path) -> None:
    """Write the flights into an .rrd. Raises OSError when the disk does not take it."""
    with rr.RecordingStream("talkdown_flights", recording_id=path.stem) as recording:
        recording.save(str(path), default_blueprint=_blueprint(flights))
        recording.send_recording_name("flights rebuilt from flight parameters")
        recording.log("/flight", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        first = next((sorties[0] for sorties in flights.values() if sorties), None)
        for aircraft, sorties in flights.items():
            for number, sortie in enumerate(sorties, 1):
                _sortie(recording, f"{aircraft}, sortie {number}", sortie, _between(first, sortie))


def _blueprint(flights: Mapping[str, Sequence[Sortie]]) -> rrb.Blueprint:
    span_s = max((sortie.duration_s for sorties in flights.values() for sortie in sorties), default=60.0)
    ends = (rrb.TimeRangeBoundary.cursor_relative(seconds=span) for span in (-span_s, span_s))
    axis = rrb.TimeAxis(view_range=rrb.TimeRange(*ends))  # the viewer can hold a range only about its cursor
    plots = [
        rrb.TimeSeriesView(origin=f"/plots/{name}", name=title, axis_x=axis)
        for name, title in (
            ("height", "height above lift-off, m"),
            ("airspeed", "true airspeed, m/s"),
            ("wind", "wind, where the air moves to: east and north, m/s"),
            ("off", "distance to the reported positions, m"),
        )
    ]
    space = rrb.Spatial3DView(
        origin="/flight", name="Flight: through the air (grey), over the ground (red), reported (orange), radar (blue)"
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(space, rrb.MapView(origin="/map", name="Map", zoom=12.0), row_shares=[2, 1]),
            rrb.Vertical(*plots),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline="utc", state="collapsed"),
        collapse_panels=True,
    )


def _between(first: Sortie | None, sortie: Sortie) -> Floats:
    """From the first sortie's lift-off to this one's, (3,) m."""
    if first is None or first.lift_off is None or sortie.lift_off is None:
        return np.zeros(3)
    there = level_m(np.array([sortie.lift_off[0]]), np.array([sortie.lift_off[1]]), first.lift_off)[0]
    return np.array([*there, 0.0])


def _sortie(recording: rr.RecordingStream, name: str, sortie: Sortie, offset_m: Floats) -> None:
    path = np.concatenate([sortie.path_m, sortie.height_m[:, None]], axis=1) + offset_m
    alone = np.concatenate([sortie.open_m[:, :2], sortie.height_m[:, None]], axis=1) + offset_m
    lines = [("open", alone, _OPEN, 0.7), ("path", path, style.FUSED, 1.0)]
    if (beside := sortie.compared) is not None:
        lines.append(
            ("reported", np.concatenate([beside.place_m, beside.height_m[:, None]], axis=1) + offset_m, style.GPS, 0.7)
        )
    for kind, points, colour, width in lines:
        drawn = rr.LineStrips3D([points], colors=[colour], radii=style.points(width))
        recording.log(entity("flight", name, kind), drawn, static=True)
    if sortie.radar is not None and len(sortie.radar.place_m):
        plots = rr.Points3D(sortie.radar.place_m + offset_m, colors=style.RADAR, radii=style.points(0.6))
        recording.log(entity("flight", name, "radar plots"), plots, static=True)
    lat_lon = sortie.geodetic_deg
    if lat_lon is not None:
        way = rr.GeoLineStrings(lat_lon=[lat_lon], colors=[style.FUSED], radii=style.points(2.0))
        recording.log(entity("map", name), way, static=True)
    _aircraft(recording, name, sortie, path, lat_lon)
    _plots(recording, name, sortie)


def _aircraft(
    recording: rr.RecordingStream, name: str, sortie: Sortie, path_m: Floats, lat_lon_deg: Floats | None
) -> None:
    some = _thinned(sortie)
    corners = np.array(OUTLINE).reshape(-1, 3)
    symbol = entity("flight", name, "aircraft")
    shape = rr.Mesh3D(vertex_positions=corners, triangle_indices=np.arange(12).reshape(4, 3), albedo_factor=style.TEXT)
    recording.log(symbol, shape, static=True)
    size = max(_SYMBOL_SHARE * float(np.ptp(path_m[:, :2], axis=0).max()), 20.0)
    east_is_90 = np.pi / 2.0  # the compass direction of these axes' x
    turned = quaternion_from_attitude(sortie.roll_rad, sortie.pitch_rad, sortie.compass_rad, east_is_90)
    place = rr.Transform3D.columns(
        translation=path_m[some], quaternion=turned[some], scale=np.full((len(some), 3), size)
    )
    when = rr.TimeColumn("utc", timestamp=sortie.time[some].astype("datetime64[ns]"))
    recording.send_columns(symbol, [when], place)
    if lat_lon_deg is not None:
        here = entity("map", name, "aircraft")
        recording.log(here, rr.GeoPoints.from_fields(colors=style.FUSED, radii=style.points(6.0)), static=True)
        recording.send_columns(here, [when], rr.GeoPoints.columns(positions=lat_lon_deg[some]))


def _plots(recording: rr.RecordingStream, name: str, sortie: Sortie) -> None:
    some = _thinned(sortie)
    series = [
        ("height", sortie.time[some], sortie.height_m[some], [f"{name}, by {sortie.height_by}"], [style.FUSED]),
        ("airspeed", sortie.time[some], sortie.true_airspeed_mps[some], [name], [style.FUSED]),
        (
            "wind",
            sortie.time[some],
            sortie.wind_mps[some],
            [f"{name}, east", f"{name}, north"],
            [style.HORIZONTAL, style.VERTICAL],
        ),
    ]
    if (beside := sortie.compared) is not None:
        off = np.stack([beside.off_m, beside.off_open_m], axis=-1)
        series.append(("off", beside.time, off, [f"{name}", f"{name}, through the air alone"], [style.FUSED, _OPEN]))
    for kind, time, values, names, colours in series:
        path = entity("plots", kind, name)
        recording.log(path, rr.SeriesLines(names=names, colors=colours), static=True)
        when = rr.TimeColumn("utc", timestamp=time.astype("datetime64[ns]"))
        recording.send_columns(path, [when], rr.Scalars.columns(scalars=values))


def _thinned(sortie: Sortie) -> NDArray[np.intp]:
    """The first sample of each fifth of a second."""
    return np.unique(sortie.time // int(1e9 / _DRAWN_HZ), return_index=True)[1]
