"""The picture of one planned flight: its sheet, its waypoints, and the map where the earth is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from gateway.sinks.scene import style
from sim.planning.drawing import CANDIDATE, MODERN, Line, Sheet, views
from sim.planning.flight import Flight
from sim.planning.mission import waypoints

Floats = NDArray[np.float64]

_CANDIDATES = 12  # of the paper's method there are hundreds


def draw(flight: Flight, lambda_m4: float, path: Path) -> None:
    """Write it into an .rrd. Raises OSError."""
    route = flight.route
    sheet = Sheet("plan", flight.shown_m())
    points = waypoints(flight)
    with rr.RecordingStream("talkdown_plan", recording_id=path.stem) as recording:
        recording.save(str(path), default_blueprint=_blueprint(sheet, flight))
        recording.send_recording_name(f"route: {flight.case.name}")
        sheet.draw_field(recording, flight.threats, lambda_m4)
        sheet.draw_threats(recording, flight.threats, flight.areas)
        for number, other in enumerate(route.candidates[:_CANDIDATES], 1):
            sheet.draw_line(recording, Line(f"candidate {number}", other.curve_m, CANDIDATE, 1.0))
        line = Line(route.name, route.curve_m, MODERN, 4.0)
        sheet.draw_line(recording, line)
        sheet.draw_price(recording, line, flight.threats, lambda_m4)
        sheet.draw_points(recording, "waypoints", points[1:-1, :2], 3.5)
        sheet.draw_ends(recording, route.curve_m[0], route.curve_m[-1])
        if flight.final is not None:
            final = np.stack([route.curve_m[-1], flight.final.meets_m, flight.final.aims_m])
            sheet.draw_line(recording, Line("final", final, style.GLIDE_PATH, 4.0))
        recording.log(
            "/summary", rr.TextDocument(_caption(flight, len(points)), media_type="text/markdown"), static=True
        )
        _draw_map(recording, flight, points)


def _draw_map(recording: rr.RecordingStream, flight: Flight, points: Floats) -> None:
    plane = flight.case.plane
    way = rr.GeoLineStrings(
        lat_lon=[plane.place_deg(flight.route.curve_m)], colors=[style.FUSED], radii=style.points(2.0)
    )
    recording.log("/map/route", way, static=True)
    at = rr.GeoPoints(lat_lon=plane.place_deg(points[:, :2]), colors=[style.PLAN], radii=style.points(4.0))
    recording.log("/map/waypoints", at, static=True)
    if len(flight.threats.place_m):
        threats = plane.place_deg(flight.threats.place_m)
        marks = rr.GeoPoints(lat_lon=threats, colors=[style.ALERT], radii=style.points(6.0))
        recording.log("/map/threats", marks, static=True)
    if flight.areas:
        borders = [plane.place_deg(area.outline()) for area in flight.areas]
        lines = rr.GeoLineStrings(lat_lon=borders, colors=[style.DECISION], radii=style.points(1.5))
        recording.log("/map/areas", lines, static=True)


def _caption(flight: Flight, count: int) -> str:
    found = flight.route.measures
    rows = [
        ("length", f"{found.length_m / 1000.0:.2f} km"),
        ("J", f"{found.cost_m / 1000.0:.2f} km"),
        ("nearest threat", f"{found.clearance_m / 1000.0:.2f} km"),
        ("least turn radius", f"{found.turn_radius_m:.0f} m"),
        ("level above home", f"{flight.level_m:.0f} m"),
        ("waypoints", f"{count}"),
        ("others looked into", f"{len(flight.route.candidates)}"),
    ]
    table = "\n".join(f"| {name} | {value} |" for name, value in rows if "inf" not in value)
    return f"**{flight.case.name}**, {flight.route.name}\n\n| | |\n|---|---|\n{table}\n"


def _blueprint(sheet: Sheet, flight: Flight) -> rrb.Blueprint:
    tabs: list[rrb.Container | rrb.View] = [
        views(sheet, "From above; a metre costs from 1 (dark) to 30 and more (red)", "/summary")
    ]
    if flight.case.is_placed or flight.final is not None:
        tabs.append(rrb.MapView(origin="/map", name="Map"))
    body = tabs[0] if len(tabs) == 1 else rrb.Tabs(*tabs)
    return rrb.Blueprint(body, rrb.TimePanel(timeline="metres", state="collapsed"), collapse_panels=True)
