"""What is believed of each track: /predict/{track}/candidates, the points that it may go to, and /predict/{track}/gates, what is
wrong with its approach. Each row is what was believed then; where nothing is believed any more, it is taken away."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.predict import Candidates
from gateway.predict.finals import GateAlerts
from gateway.predict.gates import SPEEDS
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, once
from gateway.sinks.scene.mapped import label_look, lat_lon_deg

Floats = NDArray[np.float64]


class BelievedScene:
    """Draws candidates with their weights, and alerts of the gates, as labels."""

    def __init__(self, site: Site) -> None:
        self._frame, self._units = RunwayFrame(site.runway), style.units_of(site)
        self._published = {waypoint.name for waypoint in site.waypoints}
        self._shown: dict[str, int] = {}  # by path, the track

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        entries: list[Entry] = []
        for picture in pictures:
            entries += self._candidates(picture.predict.candidates, picture.step)
            entries += self._alerts(picture.predict.gates, picture.step)
        return entries

    def end(self, track: int) -> None:
        """A track ended: what was drawn of it is taken away with it."""
        self._shown = {path: of for path, of in self._shown.items() if of != track}

    def _candidates(self, told: Candidates, step: int) -> Iterable[Entry]:
        for at, tracks in told.rounds:
            now = told.time == at
            for track in tracks:
                rows = np.flatnonzero(now & (told.track == track)).tolist()
                labels = [self._candidate(told.name[row], float(told.weight[row])) for row in rows]
                yield from self._row(
                    entity("predict", track, "candidates"), track, at, step, told.places_m[rows], labels
                )

    def _alerts(self, told: GateAlerts, step: int) -> Iterable[Entry]:
        for at, tracks in told.rounds:
            now = told.time == at
            for track in tracks:
                rows = np.flatnonzero(now & (told.track == track)).tolist()
                label = "\n".join(self._alert(told.kind[row], float(told.off[row])) for row in rows)
                places = told.places_m[rows[:1]]
                yield from self._row(
                    entity("predict", track, "gates"), track, at, step, places, [label] if rows else []
                )

    def _candidate(self, name: str, weight: float) -> str:
        """A published point has its name from the site: the weight stands below it."""
        return f"\n{100.0 * weight:.0f} %" if name in self._published else f"{name} {100.0 * weight:.0f} %"

    def _alert(self, kind: str, off: float) -> str:
        if kind in SPEEDS:
            return f"{kind}: {off * self._units.speeds:.0f} {self._units.speed}"
        return f"{kind}: {off * self._units.lengths:.0f} {self._units.length}"

    def _row(self, path: str, track: int, at: int, step: int, places: Floats, labels: list[str]) -> Iterable[Entry]:
        if not labels:
            if self._shown.pop(path, None) is not None:
                yield once(path, at, step, rr.Clear.columns(is_recursive=[False]))
            return
        if path not in self._shown:
            colour = style.CANDIDATE if path.endswith("candidates") else style.ALERT
            yield Always(path, label_look(colour, 3.0))
        self._shown[path] = track
        places = np.nan_to_num(places)  # a point without a height stands on the runway's plane
        count = [len(labels)]
        yield once(
            path,
            at,
            step,
            rr.Points3D.columns(positions=places, labels=labels).partition(count),
            rr.GeoPoints.columns(positions=lat_lon_deg(self._frame, places)).partition(count),
        )
