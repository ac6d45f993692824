"""Arrival flows in the viewer: the tracks in the colours of their flows, the mean tracks, heights over distance to go."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.offline.flows import OUTLIER, Flows, Track, distance_to_go
from gateway.offline.procedures import Procedure
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import entity

Floats = NDArray[np.float64]

COLOURS: tuple[style.Colour, ...] = (
    *((60, 140, 255), (255, 150, 30), (70, 200, 120), (235, 50, 50), (190, 120, 255)),
    *((90, 235, 235), (255, 230, 80), (255, 140, 160), (150, 190, 120), (200, 160, 120)),
)
HEIGHTENED = 5.0
_ALONE: style.Colour = (110, 110, 110)
_PUBLISHED: style.Colour = (245, 245, 245)


def draw(tracks: tuple[Track, ...], flows: Flows, path: Path, procedures: Sequence[Procedure] = ()) -> None:
    """Write them into an .rrd, with the published procedures that they are compared with. Raises OSError."""
    with rr.RecordingStream("talkdown_flows", recording_id=path.stem) as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("arrival flows")
        recording.log("/flights", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for track, label in zip(tracks, flows.labels.tolist(), strict=True):
            group = "alone" if label == OUTLIER else f"flow {label + 1}"
            colour = _ALONE if label == OUTLIER else COLOURS[label % len(COLOURS)]
            raised = track.place_m * [1.0, 1.0, HEIGHTENED]
            line = rr.LineStrips3D([raised], colors=[colour], radii=style.points(0.7))
            recording.log(entity("flights", group, track.name), line, static=True)
            seen = rr.LineStrips2D([_plan_km(track.place_m)], colors=[colour], radii=style.points(0.7))
            recording.log(entity("plan", group, track.name), seen, static=True)
            to_go = distance_to_go(track)
            profile = np.stack([-to_go / 1000.0, -track.place_m[:, 2] / 100.0], axis=-1)
            low = rr.LineStrips2D([profile], colors=[colour], radii=style.points(0.7))
            recording.log(entity("heights", group, track.name), low, static=True)
        for number, flow in enumerate(flows.flows):
            colour, name = COLOURS[number % len(COLOURS)], f"flow {number + 1}"
            label = f"{name}: {len(flow.flights)} flights, {flow.mean_time_s / 60.0:.0f} min"
            mean = flow.mean_m * [1.0, 1.0, HEIGHTENED]
            line = rr.LineStrips3D([mean], colors=[colour], radii=style.points(3.0))
            recording.log(entity("flights", name, "mean"), line, static=True)
            seen = rr.LineStrips2D([_plan_km(flow.mean_m)], colors=[colour], radii=style.points(2.5))
            recording.log(entity("plan", name, "mean"), seen, static=True)
            begin = rr.Points2D(
                _plan_km(flow.mean_m[:1]), labels=[label], show_labels=True, colors=[colour], radii=style.points(5.0)
            )
            recording.log(entity("plan", name, "begin"), begin, static=True)
        for procedure in procedures:
            _draw_procedure(recording, procedure)


def _draw_procedure(recording: rr.RecordingStream, procedure: Procedure) -> None:
    """Its line and its points, on the ground in space: heights are bounds, not a way."""
    at = "published", procedure.name
    level = np.concatenate([procedure.place_m, np.zeros((len(procedure.points), 1))], axis=1)
    line = rr.LineStrips3D([level], colors=[_PUBLISHED], radii=style.points(1.2))
    recording.log(entity("flights", *at), line, static=True)
    seen = _plan_km(procedure.place_m)
    flat = rr.LineStrips2D([seen], colors=[_PUBLISHED], radii=style.points(1.2))
    recording.log(entity("plan", *at), flat, static=True)
    named = rr.Points2D(
        seen, labels=list(procedure.points), show_labels=True, colors=[_PUBLISHED], radii=style.points(3.5)
    )
    recording.log(entity("plan", *at, "points"), named, static=True)


def _plan_km(place_m: Floats) -> Floats:
    """As on a map: y of a 2D view points down."""
    return place_m[:, :2] * [1e-3, -1e-3]


def _blueprint() -> rrb.Blueprint:
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Tabs(
                rrb.Spatial2DView(origin="/plan", name="Arrivals from above, km"),
                rrb.Spatial3DView(origin="/flights", name="In space, heights five times as large"),
            ),
            rrb.Spatial2DView(origin="/heights", name="Height (100 m) over distance to go (km)"),
            column_shares=[3, 2],
        ),
        collapse_panels=True,
    )
