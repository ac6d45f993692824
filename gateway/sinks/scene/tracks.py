"""The fused tracks: /fuse/{track} and, beside it, what is plotted of them: /fuse/modes, /fuse/sigma, /fuse/state.

A track is a point that keeps its size on the screen, an aircraft's outline that shows where it points, a label, an
ellipsoid of three sigma and a trail. The outline is a symbol, not to scale: its length is a tenth of the distance
to the runway, at least 40 m and at most 1/40 of the approach that is drawn: seen from afar, and not hiding the runway.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.settings import Site
from gateway.sinks.scene import columns, style
from gateway.sinks.scene.attitude import ellipsoid, quaternion_from_attitude
from gateway.sinks.scene.deck import DeckScene
from gateway.sinks.scene.entry import Always, Entry, entity, rows
from gateway.sinks.scene.flown import Flock, Flown
from gateway.sinks.scene.lately import BEFORE_ALL
from gateway.sinks.scene.site import approach_reach_m
from gateway.sinks.scene.trail import Trail, grown

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Words = NDArray[np.uint32]

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

    def __init__(self, site: Site, deck: DeckScene | None = None) -> None:
        self._units, self._deck = style.units_of(site), deck or DeckScene(site)
        self._longest_m = max(approach_reach_m(site) / 40.0, 40.0)
        self._drawn: dict[int, _Drawn] = {}

    def entries(self, flights: Flock) -> list[Entry]:
        """What these rows add to the scene, the map and the plots."""
        if not flights:
            return []
        looks: list[Entry] = []
        for flown in flights:
            if flown.track not in self._drawn:
                trail = Trail(entity("fuse", flown.track), "line", style.FUSED, 2.0)
                self._drawn[flown.track] = _Drawn(trail)
                looks += self._looks(flown.track)
        colours = _colours(flights)
        return [
            *looks,
            *self._here(flights, colours),
            *self._symbol(flights, colours),
            *self._labels(flights),
            *self._plots(flights),
            *self._states(flights),
            *grown((self._drawn[f.track].trail, f.time, f.step, f.runway_m, f.lat_lon_deg) for f in flights),
        ]

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

    def _here(self, flights: Flock, colours: Words) -> list[Entry]:
        units, all_of = self._units, flights.columns
        speed = np.hypot(all_of.velocity_mps[:, 0], all_of.velocity_mps[:, 1]) * units.speeds
        sink = -all_of.velocity_mps[:, 2] * units.climbs
        return [
            *flights.sheaf.rows(
                lambda flown: entity("fuse", flown.track),
                columns.points_3d(all_of.runway_m),
                columns.points_on_map(all_of.lat_lon_deg),
                columns.point_colours(colours),
                columns.scalars(np.stack([speed, sink], axis=-1)),
            )
        ]

    def _symbol(self, flights: Flock, colours: Words) -> list[Entry]:
        place, sheaf = flights.columns.runway_m, flights.sheaf
        roll, pitch, yaw = flights.columns.attitude_rad.T
        quaternion = quaternion_from_attitude(roll, pitch, yaw, flights.columns.compass_rad)
        length = np.clip(0.1 * np.linalg.norm(place, axis=-1), 40.0, self._longest_m)
        covariance = flights.columns.covariance.reshape(-1, 6, 6).copy()
        flat = ~flights.columns.has_height  # a guess's hundreds of metres would hide everything else
        covariance[flat, 2, :] = covariance[flat, :, 2] = 0.0
        half, axes = ellipsoid(self._deck.axes_from_enu, covariance, ELLIPSOID_SIGMAS)
        placed = columns.poses(place, quaternion, length)
        return [
            *sheaf.rows(lambda f: f"{entity('fuse', f.track)}/symbol", placed, columns.mesh_colours(colours)),
            *sheaf.rows(
                lambda f: f"{entity('fuse', f.track)}/ellipsoid", columns.ellipsoids(place, half, axes, colours)
            ),
        ]

    def _labels(self, flights: Flock) -> list[Entry]:
        """Who it is, how high, how fast: the data block of a controller's screen."""
        chosen = np.zeros(len(flights.sheaf.time), dtype=np.bool_)
        texts = []
        for flown, start, _ in flights.sheaf.cuts():
            drawn = self._drawn[flown.track]
            for row, now in enumerate(flown.time.tolist()):
                told = self._seen(flown, row)
                if now - drawn.labelled < LABEL_NS and told == drawn.labelled_state:
                    continue
                drawn.labelled, drawn.labelled_state = now, told
                chosen[start + row] = True
                texts.append(self._block(flown, row))
        if not texts:
            return []
        place = flights.columns.runway_m[chosen]
        # a line down to the runway's plane: without it nobody sees how high, or over which point of the ground
        drop = columns.strips_3d(np.stack([place, place * [1.0, 1.0, 0.0]], axis=1), np.ones(len(texts), np.int64))
        block = (*columns.points_3d(place), *columns.labels(texts))
        return [*flights.sheaf.where(chosen).rows(lambda f: f"{entity('fuse', f.track)}/label", block, drop)]

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

    def _plots(self, flights: Flock) -> list[Entry]:
        """Sigmas, mode probabilities and the error of the position source, where the estimator has them."""
        units, all_of = self._units, flights.columns
        variance = all_of.covariance.reshape(-1, 6, 6)[:, [0, 1, 2], [0, 1, 2]]
        horizontal = np.sqrt(np.maximum(0.5 * (variance[:, 0] + variance[:, 1]), 0.0))
        vertical = np.where(all_of.has_height, np.sqrt(np.maximum(variance[:, 2], 0.0)), np.nan)
        sigma = np.stack([horizontal, vertical], axis=-1) * units.lengths
        bias = all_of.bias_m * units.lengths
        named = np.array([aircraft is not None for flown in flights for aircraft in _same(flown)], dtype=np.bool_)
        return [
            *self._plot(flights, "sigma", sigma, ("horizontal", "vertical"), f" sigma, {units.length}"),
            *self._plot(flights, "modes", all_of.modes, ("straight", "left", "right"), " probability"),
            *self._plot(flights, "bias", bias, ("east", "north", "up"), f" error, {units.length}", named),
        ]

    def _plot(
        self,
        flights: Flock,
        kind: str,
        values: Floats,
        names: tuple[str, ...],
        quantity: str,
        wanted: Bools | None = None,
    ) -> list[Entry]:
        known = np.asarray(np.isfinite(values[:, 0]))
        if wanted is not None:
            known &= wanted
        sheaf = flights.sheaf.where(known)
        entries: list[Entry] = []
        for flown in sheaf.keys:
            if kind not in (drawn := self._drawn[flown.track]).named:
                drawn.named.add(kind)
                whose = _aircraft(flown) if kind == "bias" else f"track {flown.track}"
                titles = [f"{whose} {name}{quantity}" for name in names]
                look = rr.SeriesLines(names=titles, colors=style.AXES[: len(names)])
                entries.append(Always(_plotted_at(kind, flown), (look,)))
        return [*entries, *sheaf.rows(lambda flown: _plotted_at(kind, flown), columns.scalars(values[known]))]

    def _states(self, flights: Flock) -> list[Entry]:
        entries: list[Entry] = []
        for flown in flights:
            drawn = self._drawn[flown.track]
            if drawn.state == flown.state[-1] and flown.state.count(drawn.state) == len(flown.state):
                continue
            chosen = []
            for row, state in enumerate(flown.state):
                if state != drawn.state:
                    chosen.append(row)
                    drawn.state = state
            changes = rr.StateChange.columns(state=[flown.state[row] for row in chosen])
            path = entity("fuse", "state", flown.track)
            entries.append(rows(path, flown.time[chosen], flown.step[chosen], changes))
        return entries

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


def _aircraft(flown: Flown) -> str | None:
    """What flies there, as far as these rows say it."""
    return next((name for name in flown.aircraft if name), None)


def _same(flown: Flown) -> tuple[str | None, ...]:
    """Of each row, what flies there according to all of them."""
    return (_aircraft(flown),) * len(flown.time)


def _plotted_at(kind: str, flown: Flown) -> str:
    """Where that is plotted of a track: the error of a position source with what else is known of errors."""
    aircraft = _aircraft(flown)
    if kind == "bias" and aircraft is not None:
        return entity("register", "gps", aircraft)
    return entity("fuse", kind, flown.track)


def _colours(flights: Flock) -> Words:
    """A tentative track is dim, one that coasts is pale."""
    shades = {life: columns.packed(colour) for life, colour in style.LIVES.items()}
    return np.array([shades[life] for flown in flights for life in flown.life], dtype=np.uint32)
