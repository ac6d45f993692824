"""How the viewer opens: the scene of the airfield large, the map and the plots beside it, the log below."""

from __future__ import annotations

import math

import rerun.blueprint as rrb

from gateway.settings import Site
from gateway.sinks.scene import style


def blueprint(site: Site) -> rrb.Blueprint:
    """The views of a session at this site; every one of them has data from the first seconds on."""
    units = style.units_of(site)
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                scene_view(site),
                rrb.Horizontal(
                    rrb.TextLogView(origin="/log", name="Log"),
                    rrb.StateTimelineView(origin="/fuse/state", name="Tracks"),
                ),
                row_shares=[4, 1],
            ),
            rrb.Vertical(
                map_view(site),
                rrb.Tabs(
                    _plot("Approach, degrees off", ["/approach/angle/**"]),
                    _plot(
                        f"Approach, {units.length} off",
                        ["/approach/**", "- /approach/angle/**", "- /approach/distance/**"],
                    ),
                    _plot(f"Distance to threshold, {units.distance}", ["/approach/distance/**"]),
                ),
                rrb.Tabs(
                    _plot(f"Biases, {units.length}", ["/register/gps/**", "/register/radar/**"]),
                    _plot("Modes", ["/fuse/modes/**"]),
                    _plot(f"Speed, {units.speed}", ["/fuse/**", "- /fuse/modes/**", "- /fuse/sigma/**"]),
                    _plot(f"Sigma, {units.length}", ["/fuse/sigma/**"]),
                    _plot("Association", ["/associate/**"]),
                    _plot("Health", ["/health/**"]),
                    _plot("Lateness, s", ["/align/**"]),
                ),
                row_shares=[4, 3, 3],
            ),
            column_shares=[5, 3],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline="utc", play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def scene_view(site: Site) -> rrb.Spatial3DView:
    """The airfield and the approach: seen from beside and behind the far end of the runway, up the approach."""
    slope = math.tan(site.runway.glide_path_rad)
    return rrb.Spatial3DView(
        origin="/",
        name=f"{site.name}: approach",
        contents=["/site/**", "/raw/**", "/fuse/**", "/predict/**", "/truth/**", "/associate/**"],
        background=rrb.Background(color=(14, 17, 22)),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(5000.0, -9000.0, 5000.0),
            look_target=(-12000.0, 0.0, 12000.0 * slope),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )


def map_view(site: Site) -> rrb.MapView:
    """The same from above; geo data only, so that it reads without tiles."""
    return rrb.MapView(
        origin="/",
        name="Map",
        contents=["/site/**", "/raw/**", "/fuse/**", "/predict/**", "/truth/**"],
        zoom=10.0,
    )


def _plot(name: str, contents: list[str]) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin="/",
        name=name,
        contents=contents,
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(visible=True),
    )
