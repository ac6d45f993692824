"""Plots that the radar did not number: hypotheses fade with their likelihood, confirmed tracks stand out: /track."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, once, rows
from gateway.sinks.scene.scope import Scope, raw_at
from gateway.track import Look

Floats = NDArray[np.float64]

DRAWN = ("hypotheses", "confirmed", "taken")
SILENT_NS = 15_000_000_000
FAINTEST, STRONGEST = 24.0, 200.0  # of 255: a hypothesis of likelihood 0, and of 1


class ClutterScene:
    """Draws what is thought of unnumbered plots; remembers which radars are drawn, and when each was last."""

    def __init__(self, site: Site) -> None:
        self._scope = Scope(site)
        self._known: set[int] = set()
        self._drawn: dict[int, int] = {}

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add, radar by radar, in order of time."""
        looks: dict[int, list[tuple[Look, int]]] = {}
        for picture in pictures:
            for look in picture.track.looks:
                looks.setdefault(look.radar, []).append((look, picture.step))
        found: list[Entry] = []
        for radar, some in looks.items():
            some.sort(key=lambda one: one[0].at)
            if radar not in self._known:
                self._known.add(radar)
                found += self._looks(radar)
            found += _drawn(radar, some)
            found.append(self._on_scope(radar, some))
            self._drawn[radar] = some[-1][0].at
        return [*found, *self._silent(pictures[-1])] if pictures else found

    def _on_scope(self, radar: int, looks: Sequence[tuple[Look, int]]) -> Entry:
        """The plots that tracks took, on the controller's screen: its own are dim, whatever they are of."""
        time, step = [look.at for look, _ in looks], [number for _, number in looks]
        spots = [self._scope.both(look.taken_m).reshape(-1, 2) for look, _ in looks]
        shown = [one[np.isfinite(one).all(axis=1)] for one in spots]
        dots = rr.Points2D.columns(positions=np.concatenate(shown)).partition(_lengths(shown))
        return rows(_scope_path(radar), time, step, dots)

    def _silent(self, picture: Picture) -> list[Entry]:
        """Of a radar that has fallen silent nothing is left in the scene."""
        silent = [radar for radar, at in self._drawn.items() if picture.now - at > SILENT_NS]
        found: list[Entry] = []
        for radar in silent:
            del self._drawn[radar]
            clear = rr.Clear.columns(is_recursive=[False])
            paths = [*(_path(radar, what) for what in DRAWN), _scope_path(radar)]
            found += [once(path, picture.now, picture.step, clear) for path in paths]
        return found

    def _looks(self, radar: int) -> list[Entry]:
        """How they look at all times."""
        colour = style.radar_colour(radar)
        # A fused track stands at the same place, with a label of its own: these are shown when pointed at.
        told = rr.Points3D.from_fields(colors=style.FUSED, radii=style.points(5.0), show_labels=False)
        return [
            Always(_path(radar, "hypotheses"), (rr.Points3D.from_fields(radii=style.points(2.5)),)),
            Always(_path(radar, "confirmed"), (told,)),
            Always(_path(radar, "taken"), (rr.Points3D.from_fields(colors=colour, radii=style.points(3.0)),)),
            Always(
                _scope_path(radar), (rr.Points2D.from_fields(colors=colour, radii=style.points(1.0), draw_order=30.0),)
            ),
        ]


def _path(radar: int, what: str) -> str:
    return entity("track", radar, what)


def _scope_path(radar: int) -> str:
    return raw_at(f"{radar}/taken")


def _drawn(radar: int, looks: Sequence[tuple[Look, int]]) -> list[Entry]:
    time, step = [look.at for look, _ in looks], [number for _, number in looks]
    red, green, blue = style.radar_colour(radar)[:3]
    hypotheses, alphas, confirmed, labels, taken = [], [], [], [], []
    for look, _ in looks:
        told = np.array([bool(name) for name in look.track], dtype=np.bool_)
        hypotheses.append(look.runway_m[~told])
        alphas.append(FAINTEST + (STRONGEST - FAINTEST) * look.likelihood[~told])
        confirmed.append(look.runway_m[told])
        labels.append([name for name in look.track if name])
        taken.append(look.taken_m[np.isfinite(look.taken_m).all(axis=1)])
    shade = np.concatenate(alphas).astype(np.uint32)
    colours = np.uint32(red << 24 | green << 16 | blue << 8) | shade
    faint = rr.Points3D.columns(positions=np.concatenate(hypotheses), colors=colours).partition(_lengths(hypotheses))
    named = [name for some in labels for name in some]
    bright = rr.Points3D.columns(positions=np.concatenate(confirmed), labels=named).partition(_lengths(confirmed))
    plots = rr.Points3D.columns(positions=np.concatenate(taken)).partition(_lengths(taken))
    return [
        rows(_path(radar, "hypotheses"), time, step, faint),
        rows(_path(radar, "confirmed"), time, step, bright),
        rows(_path(radar, "taken"), time, step, plots),
    ]


def _lengths(parts: Sequence[Floats]) -> list[int]:
    return [len(part) for part in parts]
