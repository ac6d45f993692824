"""Paper 002-5's runs drawn into an .rrd: headings, rudders and cross-track errors over time, and a route from above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from sim.ships.autopilots import KINDS
from sim.ships.hull import Ship, Weather
from sim.ships.track_control import LAWS, Route, TrackControl
from sim.ships.voyage import STEP_S, Sea, Voyage, make_voyage
from sim.studies.figures import line, path_of, plot
from sim.studies.ship import CURRENT_MPS, HULL, SEA, WIND_RAD, autopilot, hold, track, turn

Floats = NDArray[np.float64]

GREY, ORANGE, RED, BLUE, GREEN = [150, 150, 150], [255, 140, 0], [230, 30, 40], [60, 120, 255], [40, 170, 90]
OF_KIND = {"mechanical": GREY, "pid": BLUE, "adaptive": ORANGE, "expert": GREEN, "pd": RED}
OF_LAW = {"los": ORANGE, "integral": BLUE, "course": RED}
EVERY = 5  # of the steps, one is drawn: a second
# origin, title, the plots (name, heading) of it, and how long it is
PAGES = (
    ("turn", "20 degrees", (("heading", "heading (deg)"), ("rudder", "rudder (deg)")), 300.0),
    ("wind", "Wind", (("heading", "heading error (deg)"), ("rudder", "rudder (deg)")), 600.0),
    ("waves", "Waves", (("heading", "measured and own heading (deg)"), ("rudder", "rudder (deg)")), 120.0),
    ("current", "Cross current", (("right", "right of the leg (m)"), ("heading", "heading (deg)")), 900.0),
    ("slow", "Adaptive: 3 m/s", (("heading", "heading (deg)"), ("rudder", "rudder (deg)")), 600.0),
    ("large", "Expert: 90 degrees", (("heading", "heading (deg)"), ("rudder", "rudder (deg)")), 200.0),
)
ROUTE = Route(
    np.array([[0.0, 0.0], [0.0, 3000.0], [3000.0, 4500.0], [3000.0, 8000.0], [6500.0, 8000.0]]), reach_m=320.0
)
ROUTE_S = 1800.0


def draw(path: Path, seed: int) -> None:
    """Write the figures of one run."""
    with rr.RecordingStream("talkdown_study", recording_id=f"ship-{seed}") as recording:
        recording.save(str(path), default_blueprint=_blueprint())
        recording.send_recording_name("002-5: a ship's autopilots")
        for kind in KINDS:
            _draw_turn(recording, "turn", kind, turn(kind, 20.0, duration_s=300.0))
        for kind in ("mechanical", "pd", "pid", "expert"):
            _draw_turn(recording, "wind", kind, hold(kind, 1, seed, None, None))
        for kind in ("pid", "adaptive"):
            _draw_turn(recording, "slow", kind, turn(kind, 20.0, 3.0))
        for kind in ("pid", "expert"):
            _draw_turn(recording, "large", kind, turn(kind, 90.0, duration_s=200.0))
        _draw_waves(recording, seed)
        for law in LAWS:
            _draw_track(recording, law, track(law, 1, seed, None))
        _draw_route(recording, seed)


def _blueprint() -> rrb.Blueprint:
    tabs: list[rrb.Container] = []
    for page, title, plots, span_s in PAGES:
        views = [plot(f"/{page}/{name}", heading, span_s) for name, heading in plots]
        tabs.append(rrb.Vertical(*views, name=title))
    above = rrb.Spatial2DView(
        origin="/route", name="a route (grey) from above, m: los (orange), integral (blue), course (red)"
    )
    tabs.append(rrb.Vertical(above, name="Route"))
    return rrb.Blueprint(rrb.Tabs(*tabs), rrb.TimePanel(timeline="time", state="collapsed"), collapse_panels=True)


def _lines(
    recording: rr.RecordingStream, path: str, voyage: Voyage, values: Floats, color: list[int], name: str
) -> None:
    shown = values.reshape(len(voyage.time_s), -1)[::EVERY, 0]
    line(recording, f"{path}/{path_of(name)}", voyage.time_s[::EVERY], shown, color, name)


def _draw_turn(recording: rr.RecordingStream, page: str, kind: str, voyage: Voyage) -> None:
    for name, angle in (("heading", voyage.heading_rad), ("rudder", voyage.rudder_rad)):
        _lines(recording, f"/{page}/{name}", voyage, np.degrees(angle), OF_KIND[kind], kind)


def _draw_waves(recording: rr.RecordingStream, seed: int) -> None:
    """The PID without and with the filter, on the same sea."""
    for name, told, color in (("no filter", None, ORANGE), ("filter", SEA, BLUE)):
        voyage = hold("pid", 1, seed, SEA, told)
        _lines(recording, "/waves/rudder", voyage, np.degrees(voyage.rudder_rad), color, name)
        _lines(recording, "/waves/heading", voyage, np.degrees(voyage.heading_rad), color, name)
        if told is not None:
            _lines(recording, "/waves/heading", voyage, np.degrees(voyage.measured_rad), GREY, "measured")


def _draw_track(recording: rr.RecordingStream, law: str, voyage: Voyage) -> None:
    _lines(recording, "/current/right", voyage, voyage.right_m, OF_LAW[law], law)
    _lines(recording, "/current/heading", voyage, np.degrees(voyage.heading_rad), OF_LAW[law], law)


def _draw_route(recording: rr.RecordingStream, seed: int) -> None:
    """A route with three turns, in wind, waves and current, by each law; drawn with north up."""
    recording.log(
        "/route/plan",
        rr.LineStrips2D([ROUTE.points_m * [1.0, -1.0]], colors=GREY, radii=-1.0),
        static=True,
    )
    sea = Sea.drawn(Weather(WIND_RAD, (CURRENT_MPS, 0.0)), SEA, ROUTE_S, (), seed)
    for law in LAWS:
        ship, control = Ship.under_way((), HULL.speed_mps), TrackControl(law)
        voyage = make_voyage(HULL, ship, autopilot("pid", SEA), sea, ROUTE_S, route=ROUTE, control=control)
        way = np.stack([voyage.east_m, -voyage.north_m], axis=1)[:: round(5.0 / STEP_S)]
        strip = rr.LineStrips2D([way], colors=OF_LAW[law], radii=-1.5)
        recording.log(f"/route/{law}", strip, static=True)
