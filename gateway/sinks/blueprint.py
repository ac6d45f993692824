"""How the viewer opens: the scene of the airfield large, the map and the plots beside it, the log below; health apart."""

from __future__ import annotations

import math

import rerun.blueprint as rrb

from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.health import SOURCES, VEHICLES, unit_part
from gateway.sinks.scene.register import VERDICT
from gateway.sinks.scene.scope import Scope
from gateway.sinks.scene.site import approach_reach_m

_RECENT = rrb.TimeRange(  # an approach lasts this long; left alone the viewer shows the minute about the cursor
    start=rrb.TimeRangeBoundary.cursor_relative(seconds=-480),
    end=rrb.TimeRangeBoundary.cursor_relative(seconds=30),
)


def blueprint(site: Site, *, modes: bool = False) -> rrb.Blueprint:
    """The views of a session at this site; one of the mode probabilities only where the estimator has `modes`."""
    return rrb.Blueprint(
        rrb.Tabs(_picture_page(site, modes), _registration_page(site), _health_page(), active_tab=0),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline="utc", play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _picture_page(site: Site, modes: bool) -> rrb.Horizontal:
    units = style.units_of(site)
    return rrb.Horizontal(
        rrb.Vertical(
            scene_view(site),
            rrb.Horizontal(
                scope_view(site),
                rrb.Tabs(_log(), rrb.StateTimelineView(origin="/fuse/state", name="Tracks")),
                column_shares=[3, 2],
            ),
            row_shares=[3, 2],
        ),
        rrb.Vertical(
            map_view(site),
            rrb.Tabs(
                _plot("Approach, degrees off", ["/approach/angle/**"], rrb.Corner2D.RightTop),
                _plot(
                    f"Approach, {units.length} off",
                    ["/approach/**", "- /approach/angle/**", "- /approach/distance/**", "- /approach/scope/**"],
                ),
                _plot(f"Distance to threshold, {units.distance}", ["/approach/distance/**"]),
            ),
            rrb.Tabs(
                _plot(f"Biases, {units.length}", ["/register/gps/**", "/register/error/range/**"]),
                *([_plot("Modes", ["/fuse/modes/**"])] if modes else []),
                _plot(
                    f"Speed, {units.speed}", ["/fuse/**", "- /fuse/modes/**", "- /fuse/sigma/**", "- /fuse/reckoned/**"]
                ),
                _plot(f"Sigma, {units.length}", ["/fuse/sigma/**", "/track/radars/**"]),
                _plot("Without GPS, m", ["/fuse/reckoned/**"]),
                _plot("Association", ["/associate/**"]),
                _plot("Lateness, s", ["/align/**"]),
            ),
            row_shares=[4, 3, 3],
        ),
        column_shares=[5, 3],
        name="Picture",
    )


def _registration_page(site: Site) -> rrb.Horizontal:
    """What is systematically wrong: in words, over time with its sigma and what is taken off, and what is left of it."""
    length = style.units_of(site).length
    units = {"range": length, "azimuth": "degrees", "elevation": "degrees", "time": "ms"}
    errors = [
        _plot(f"{what.capitalize()} error, {unit}", [f"/register/error/{what}/**"], has_legend=False)
        for what, unit in units.items()
    ]
    residuals = [
        _plot(f"{what.capitalize()}, {unit}: radar less report", [f"/register/residual/{what}/**"], has_legend=False)
        for what, unit in [*units.items()][:3]
    ]
    sources = _plot(f"Errors of position sources, {length}", ["/register/gps/**"], has_legend=False)
    return rrb.Horizontal(
        rrb.TextDocumentView(origin=VERDICT, name="Registration"),
        rrb.Vertical(*errors),
        rrb.Vertical(*residuals, sources),
        column_shares=[4, 5, 5],
        name="Registration",
    )


def _health_page() -> rrb.Horizontal:
    """What is heard of whom, and what vehicles last said of themselves: tables to read beside curves."""
    speeds, lengths, rates = (f"/health/reading/{unit_part(unit)}/**" for unit in ("m/s", "m", "1/s"))
    inner = [f"- /health/{part}/**" for part in ("lost", "time", "reading", "table")]
    return rrb.Horizontal(
        rrb.Vertical(
            rrb.TextDocumentView(origin=VEHICLES, name="Vehicles"),
            rrb.TextDocumentView(origin=SOURCES, name="Sources"),
            row_shares=[3, 2],
        ),
        rrb.Vertical(
            rrb.Tabs(
                _plot("Readings, m/s", [speeds]),
                _plot("Readings, m", [lengths]),
                _plot("Messages, 1/s", [rates]),
                _plot("Other readings", ["/health/reading/**", f"- {speeds}", f"- {lengths}", f"- {rates}"]),
            ),
            _plot("Clocks and delays, ms", ["/health/time/**"]),
            rrb.Tabs(_plot("Heard", ["/health/**", *inner]), _plot("Lost", ["/health/lost/**"])),
        ),
        column_shares=[2, 3],
        name="Health",
    )


def scene_view(site: Site) -> rrb.Spatial3DView:
    """The airfield and the whole approach, from its right side: runway to the right, glide path rising to the left.

    Nothing is stretched: heights are to scale with lengths, which is why the scene carries drop lines and
    poles.
    """
    reach_m = approach_reach_m(site)
    return rrb.Spatial3DView(
        origin="/",
        name=f"{site.name}: approach",
        contents=["/site/**", "/raw/**", "/track/**", "/fuse/**", "/predict/**", "/truth/**", "/associate/**"],
        background=rrb.Background(color=(14, 17, 22)),
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1 * reach_m, color=(255, 255, 255, 14)),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(-0.12 * reach_m, -0.5 * reach_m, 0.22 * reach_m),
            look_target=(-0.38 * reach_m, 0.0, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def scope_view(site: Site) -> rrb.Spatial2DView:
    """The controller's screen; its dots stay for five minutes."""
    x_range, y_range = Scope(site).bounds
    return rrb.Spatial2DView(
        origin="/approach/scope",
        name="Precision approach: elevation over azimuth, x10",
        background=rrb.Background(color=(14, 17, 22)),
        visual_bounds=rrb.VisualBounds2D(x_range=x_range, y_range=y_range),
        time_ranges=rrb.VisibleTimeRange(
            "utc",
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-300),
            end=rrb.TimeRangeBoundary.cursor_relative(),
        ),
    )


def map_view(site: Site) -> rrb.MapView:
    """The same from above; geo data only, so that it reads without tiles."""
    closer = math.log2(50_000.0 / max(approach_reach_m(site), 500.0))  # each level shows half of the one before
    return rrb.MapView(
        origin="/",
        name="Map",
        contents=["/site/**", "/raw/**", "/track/**", "/fuse/**", "/predict/**", "/truth/**"],
        zoom=10.0 + closer,
    )


def _log() -> rrb.TextLogView:
    columns = rrb.TextLogColumns(
        timeline_columns=[rrb.encodings.TimelineColumn("utc", visible=False)],  # too narrow to read: it is in the text
        text_log_columns=[rrb.encodings.TextLogColumn("LogLevel"), rrb.encodings.TextLogColumn("Body")],
    )
    return rrb.TextLogView(origin="/log", name="Log", columns=columns)


def _plot(
    name: str, contents: list[str], legend: rrb.Corner2D = rrb.Corner2D.LeftBottom, *, has_legend: bool = True
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        name=name,
        contents=contents,
        axis_x=rrb.TimeAxis(view_range=_RECENT),
        plot_legend=rrb.PlotLegend(legend, visible=has_legend),
    )
