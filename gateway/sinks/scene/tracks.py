"""The fused tracks: /fuse/{track} and, beside it, what is plotted of them: /fuse/modes, /fuse/sigma, /fuse/state.

A track is a point that keeps its size on the screen, an aircraft's outline that shows where it points, a label, an
ellipsoid of three sigma and a trail. The outline is a symbol, not to scale: its length is a tenth of the distance
to the runway, at least 40 m and at most 1/40 of the approach that is drawn: seen from afar, and not hiding the runway.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.attitude import ellipsoid, quaternion_from_attitude
from gateway.sinks.scene.entry import Always, Entry, entity, rows, strips_3d
from gateway.sinks.scene.flown import Flown
from gateway.sinks.scene.lately import BEFORE_ALL
from gateway.sinks.scene.site import approach_reach_m
from gateway.sinks.scene.trail import Trail

Floats = NDArray[np.float64]

LABEL_NS = 1_000_000_000  # a label is text in every row: once a second is as often as a person reads
ELLIPSOID_SIGMAS = 3.0

# A flat aircraft of four triangles: body, wings, tail plane, fin; one unit from nose to tail.
OUTLINE = (
    ((0.6, 0.0, 0.0), (-0.4, 0.06, 0.0), (-0.4, -0.06, 0.0)),
    ((0.15, 0.0, 0.0), (-0.2, 0.5, 0.0), (-0.2, -0.5, 0.0)),
    ((-0.25, 0.0, 0.0), (-0.45, 0.2, 0.0), (-0.45, -0.2, 0.0)),
    ((-0.2, 0.0, 0.0), (-0.45, 0.0, 0.0), (-0.47, 0.0, 0.22)),
)


@dataclass(slots=True)
class _Drawn:
    """What was last drawn of one track."""

    trail: Trail
    labelled: int = BEFORE_ALL
    labelled_state: str = ""
    state: str = ""
    named: set[str] = field(default_factory=set)


class TrackScene:
    """Draws the rows of fused tracks; remembers what it drew of each."""

    def __init__(self, site: Site) -> None:
        self._units = style.units_of(site)
        self._frame = RunwayFrame(site.runway)
        self._longest_m = max(approach_reach_m(site) / 40.0, 40.0)
        self._drawn: dict[int, _Drawn] = {}

    def entries(self, flights: Sequence[Flown]) -> list[Entry]:
        """What these rows add to the scene, the map and the plots."""
        entries: list[Entry] = []
        for flown in flights:
            if flown.track not in self._drawn:
                trail = Trail(entity("fuse", flown.track), "line", style.FUSED, 2.0)
                self._drawn[flown.track] = _Drawn(trail)
                entries += self._looks(flown.track)
            drawn = self._drawn[flown.track]
            entries += self._here(flown)
            entries += self._symbol(flown)
            entries += self._label(flown, drawn)
            entries += self._plots(flown, drawn)
            entries += self._states(flown, drawn)
            entries += drawn.trail.extend(flown.time, flown.step, flown.runway_m, flown.lat_lon_deg)
        return entries

    def forget(self, track: int) -> None:
        """A track ended; its number is never used again."""
        self._drawn.pop(track, None)

    def _looks(self, track: int) -> list[Entry]:
        """Sizes, names, and colours of lines: what is the same in every row."""
        path, units = entity("fuse", track), self._units
        corners = np.array(OUTLINE).reshape(-1, 3)
        symbol = rr.Mesh3D(
            vertex_positions=corners,
            triangle_indices=np.arange(12).reshape(4, 3),
        )
        names = [f"track {track} speed, {units.speed}", f"track {track} sink rate, {units.climb}"]
        states = list(style.STATES)
        return [
            Always(
                path,
                (
                    rr.Points3D.from_fields(radii=style.points(2.5)),
                    rr.GeoPoints.from_fields(radii=style.points(5.0)),
                    rr.SeriesLines(names=names, colors=[style.HORIZONTAL, style.VERTICAL]),
                ),
            ),
            Always(f"{path}/symbol", (symbol,)),
            Always(
                f"{path}/label",
                (
                    rr.Points3D.from_fields(colors=style.TEXT, radii=style.points(0.1), show_labels=True),
                    rr.LineStrips3D.from_fields(colors=style.FUSED, radii=style.points(0.5)),
                ),
            ),
            Always(
                f"{path}/ellipsoid",
                (rr.Ellipsoids3D.from_fields(line_radii=style.points(0.5)),),
            ),
            Always(
                entity("fuse", "state", track),
                (rr.StateConfiguration(values=states, colors=[style.STATES[state] for state in states]),),
            ),
        ]

    def _here(self, flown: Flown) -> list[Entry]:
        units = self._units
        speed = np.hypot(flown.velocity_mps[:, 0], flown.velocity_mps[:, 1]) * units.speeds
        sink = -flown.velocity_mps[:, 2] * units.climbs
        return [
            rows(
                entity("fuse", flown.track),
                flown.time,
                flown.step,
                rr.Points3D.columns(positions=flown.runway_m, colors=_colours(flown)),
                rr.GeoPoints.columns(positions=flown.lat_lon_deg, colors=_colours(flown)),
                rr.Scalars.columns(scalars=np.stack([speed, sink], axis=-1)),
            )
        ]

    def _symbol(self, flown: Flown) -> list[Entry]:
        path = entity("fuse", flown.track)
        roll, pitch, yaw = flown.attitude_rad.T
        quaternion = quaternion_from_attitude(roll, pitch, yaw, self._frame.runway.landing_compass_rad)
        length = np.clip(0.1 * np.linalg.norm(flown.runway_m, axis=-1), 40.0, self._longest_m)
        covariance = flown.covariance.reshape(-1, 6, 6).copy()
        flat = ~flown.has_height  # a guess's hundreds of metres would hide everything else
        covariance[flat, 2, :] = covariance[flat, :, 2] = 0.0
        half, axes = ellipsoid(self._frame, covariance, ELLIPSOID_SIGMAS)
        placed = rr.Transform3D.columns(
            translation=flown.runway_m, quaternion=quaternion, scale=np.repeat(length[:, None], 3, axis=1)
        )
        colours = _colours(flown)
        shape = rr.Ellipsoids3D.columns(centers=flown.runway_m, half_sizes=half, quaternions=axes, colors=colours)
        return [
            rows(f"{path}/symbol", flown.time, flown.step, placed, rr.Mesh3D.columns(albedo_factor=colours)),
            rows(f"{path}/ellipsoid", flown.time, flown.step, shape),
        ]

    def _label(self, flown: Flown, drawn: _Drawn) -> list[Entry]:
        """Who it is, how high, how fast: the data block of a controller's screen."""
        chosen, texts = [], []
        for row, now in enumerate(flown.time.tolist()):
            told = self._seen(flown, row)
            if now - drawn.labelled < LABEL_NS and told == drawn.labelled_state:
                continue
            drawn.labelled, drawn.labelled_state = now, told
            chosen.append(row)
            texts.append(self._block(flown, row))
        if not chosen:
            return []
        place = flown.runway_m[chosen]
        block = rr.Points3D.columns(positions=place, labels=texts)
        # a line down to the runway's plane: without it nobody sees how high, or over which point of the ground
        drop = strips_3d(list(np.stack([place, place * [1.0, 1.0, 0.0]], axis=1)))
        return [rows(f"{entity('fuse', flown.track)}/label", flown.time[chosen], flown.step[chosen], block, drop)]

    def _block(self, flown: Flown, row: int) -> str:
        """Two lines of text; a pressure altitude is named as one, because it is no height."""
        units = self._units
        who = flown.aircraft[row] or f"radar {flown.radar_track[row]}"
        if flown.callsign[row]:
            who = f"{flown.callsign[row]} {who}"
        along, left, up = flown.velocity_mps[row].tolist()
        parts = ["height unknown"]
        if flown.has_height[row]:
            parts = [f"{flown.altitude_m[row] * units.lengths:.0f} {units.length}"]
        elif np.isfinite(flown.pressure_altitude_m[row]):
            parts = [f"pressure altitude {flown.pressure_altitude_m[row] * units.lengths:.0f} {units.length}"]
        parts.append(f"{np.hypot(along, left) * units.speeds:.0f} {units.speed}")
        if np.isfinite(up):
            digits = 1 if units is style.SI else 0
            parts.append(f"{'↑' if up >= 0.0 else '↓'}{abs(up) * units.climbs:.{digits}f} {units.climb}")
        return f"{who} {self._seen(flown, row)}\n{' '.join(parts)}"

    def _plots(self, flown: Flown, drawn: _Drawn) -> list[Entry]:
        """Sigmas, mode probabilities and the error of the position source, where the estimator has them."""
        track, units = flown.track, self._units
        variance = flown.covariance.reshape(-1, 6, 6)[:, [0, 1, 2], [0, 1, 2]]
        horizontal = np.sqrt(np.maximum(0.5 * (variance[:, 0] + variance[:, 1]), 0.0))
        vertical = np.where(flown.has_height, np.sqrt(np.maximum(variance[:, 2], 0.0)), np.nan)
        sigma = np.stack([horizontal, vertical], axis=-1) * units.lengths
        aircraft = next((name for name in flown.aircraft if name), None)
        kinds = [
            ("sigma", entity("fuse", "sigma", track), sigma, ("horizontal", "vertical"), f" sigma, {units.length}"),
            ("modes", entity("fuse", "modes", track), flown.modes, ("straight", "left", "right"), " probability"),
        ]
        if aircraft is not None:
            path = entity("register", "gps", aircraft)
            kinds.append(
                ("bias", path, flown.bias_m * units.lengths, ("east", "north", "up"), f" error, {units.length}")
            )
        entries: list[Entry] = []
        for kind, path, values, names, quantity in kinds:
            known = np.isfinite(values[:, 0])
            if not known.any():
                continue
            if kind not in drawn.named:
                drawn.named.add(kind)
                whose = aircraft if kind == "bias" else f"track {track}"
                titles = [f"{whose} {name}{quantity}" for name in names]
                entries.append(Always(path, (rr.SeriesLines(names=titles, colors=style.AXES[: len(names)]),)))
            plotted = rr.Scalars.columns(scalars=values[known])
            entries.append(rows(path, flown.time[known], flown.step[known], plotted))
        return entries

    def _states(self, flown: Flown, drawn: _Drawn) -> list[Entry]:
        chosen = []
        for row, state in enumerate(flown.state):
            if state != drawn.state:
                chosen.append(row)
                drawn.state = state
        if not chosen:
            return []
        changes = rr.StateChange.columns(state=[flown.state[row] for row in chosen])
        return [rows(entity("fuse", "state", flown.track), flown.time[chosen], flown.step[chosen], changes)]

    def _seen(self, flown: Flown, row: int) -> str:
        """Which sources see it; whether it is to be believed yet; how far off it may be by now, where none does."""
        state = flown.state[row]
        if flown.life[row] == "tentative":
            return f"{state}, tentative"
        if state != "coasting":
            return state
        level = flown.covariance[row].reshape(6, 6).diagonal()[:2]
        off = ELLIPSOID_SIGMAS * float(np.sqrt(0.5 * level.sum())) * self._units.lengths
        return f"{state} ± {off:.0f} {self._units.length}"


def _colours(flown: Flown) -> list[style.Colour]:
    """A tentative track is dim, one that coasts is pale."""
    return [style.LIVES[life] for life in flown.life]
