"""The other stages and the gateway itself: /track, /associate, /register, /health, /log, and the end of tracks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr

from gateway.associate import Change
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, once, rows
from gateway.sinks.scene.flown import BEFORE_ALL, Flown
from gateway.sinks.scene.sources import raw_path

SAMPLE_NS = 1_000_000_000  # health and counts are read by people: once a second
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class StageScene:
    """Draws what the other stages found; remembers what was sampled when, and which sources each track came from."""

    def __init__(self, site: Site) -> None:
        self._site, self._units = site, style.units_of(site)
        self._sampled = BEFORE_ALL
        self._named: set[str] = set()
        self._sources: dict[int, set[str]] = {}

    def entries(self, pictures: Sequence[Picture], flights: Sequence[Flown]) -> list[Entry]:
        """What these pictures add."""
        for flown in flights:
            names = {name for name in flown.aircraft if name}
            names |= {name for text in flown.radar_track if text for name in text.split()}
            self._sources.setdefault(flown.track, set()).update(names)
        entries: list[Entry] = []
        log: list[tuple[int, int, str, str]] = []
        for picture in pictures:
            log += [(event.at, picture.step, event.text, event.level) for event in picture.events]
            entries += self._checks(picture)
            entries += self._joined(picture, log)
            if picture.now - self._sampled >= SAMPLE_NS:
                self._sampled = picture.now
                entries += self._sample(picture)
            entries += self._ended(picture, log)
        if log:
            log.sort(key=lambda line: line[0])
            time, step, texts, levels = zip(*log, strict=True)
            lines = rr.TextLog.columns(text=texts, level=[_LEVELS.get(level, "INFO") for level in levels])
            entries.append(rows("/log", time, step, lines))
        return entries

    def _plot(self, path: str, time: int, step: int, values: Sequence[float], names: Sequence[str]) -> Iterable[Entry]:
        if path not in self._named:
            self._named.add(path)
            yield Always(path, (rr.SeriesLines(names=list(names)),))
        yield once(path, time, step, rr.Scalars.columns(scalars=np.array([values], dtype=np.float64)))

    def _checks(self, picture: Picture) -> list[Entry]:
        """The association's counter, and each difference as a share of its gate: at 1 it is on the gate's edge."""
        checked = picture.associate
        entries: list[Entry] = []
        for row in range(len(checked.check_time)):
            pair = f"{checked.check_aircraft[row]} = {checked.check_radar_track[row]}"
            share = np.abs(checked.check_difference[row]) / checked.check_gate[row]
            time, radar_track = int(checked.check_time[row]), checked.check_radar_track[row]
            path = entity("associate", checked.check_aircraft[row], *radar_track.split("/"))
            values = [float(checked.check_counter[row]), *share.tolist()]
            names = [f"{pair} {what}" for what in ("counter", "range / gate", "azimuth / gate", "elevation / gate")]
            entries += self._plot(path, time, picture.step, values, names)
        return entries

    def _joined(self, picture: Picture, log: list[tuple[int, int, str, str]]) -> list[Entry]:
        """The point of association: where a radar track and an aircraft became one, or stopped being one."""
        entries: list[Entry] = []
        for change in picture.associate.changes:
            text = _said(change)
            if not any(text in event.text for event in picture.events):
                log.append((change.at, picture.step, text, "info"))
            path = entity("associate", "point", change.aircraft)
            if path not in self._named:
                self._named.add(path)
                look = rr.Points3D.from_fields(colors=style.JOINED, radii=style.points(6.0), show_labels=True)
                entries.append(Always(path, (look,)))
            mark = rr.Points3D.columns(positions=[change.runway_m], labels=[text])
            entries.append(once(path, change.at, picture.step, mark))
        return entries

    def _sample(self, picture: Picture) -> list[Entry]:
        now, step = picture.now, picture.step
        entries: list[Entry] = []
        counts = [float(len(picture.track.active)), float(picture.track.untracked)]
        entries += self._plot("/track", now, step, counts, ("radar tracks", "plots of no track"))
        pairs = [float(len(picture.associate.pairs))]
        entries += self._plot("/associate", now, step, pairs, ("pairs",))
        for radar, (range_m, azimuth_rad, elevation_rad) in zip(
            picture.register.radars, picture.register.correction, strict=True
        ):
            length = [range_m * self._units.lengths]
            angles = [math.degrees(azimuth_rad), math.degrees(elevation_rad)]
            name = f"radar {radar}"
            path = entity("register", "radar", radar, "range")
            entries += self._plot(path, now, step, length, (f"{name} range error, {self._units.length}",))
            path = entity("register", "angle", radar)
            names = (f"{name} azimuth error, degrees", f"{name} elevation error, degrees")
            entries += self._plot(path, now, step, angles, names)
        for source in picture.health.sources:
            values = [source.age_s, source.rate_hz, float(source.lost)]
            heard = [f"{source.name} {what}" for what in ("last heard, s ago", "rate, 1/s", "lost")]
            entries += self._plot(entity("health", source.name), now, step, values, heard)
        return entries

    def _ended(self, picture: Picture, log: list[tuple[int, int, str, str]]) -> list[Entry]:
        """A track that ended leaves the scene, with what its sources said, and the log says so."""
        entries: list[Entry] = []
        for ended in picture.fuse.ended:
            text = f"track {ended.track} ended: {ended.reason}"
            if not any(f"track {ended.track} ended" in event.text for event in picture.events):
                log.append((ended.at, picture.step, text, "info"))
            paths = [entity(root, ended.track) for root in ("fuse", "predict", "approach")]
            others = {name for track, names in self._sources.items() if track != ended.track for name in names}
            for name in sorted(self._sources.pop(ended.track, set()) - others):
                paths += [raw_path(name), entity("associate", "point", name)]
            clear = [once(path, ended.at, picture.step, rr.Clear.columns(is_recursive=[True])) for path in paths]
            state = rr.StateChange.columns(state=["ended"])
            entries += [*clear, once(entity("fuse", "state", ended.track), ended.at, picture.step, state)]
        return entries


def _said(change: Change) -> str:
    joined = "is" if change.kind == "associated" else "is no longer"
    return f"{change.aircraft} {joined} radar track {change.radar_track}"
