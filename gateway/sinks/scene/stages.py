"""The other stages: /track, /associate, /log, and the end of tracks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import rerun as rr

from gateway.associate import Change
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene import style
from gateway.sinks.scene.entry import Always, Entry, entity, once, rows
from gateway.sinks.scene.flown import Flown
from gateway.sinks.scene.lately import BEFORE_ALL, Lately
from gateway.sinks.scene.samples import Sample, plotted
from gateway.sinks.scene.sources import raw_path

SAMPLE_NS = 1_000_000_000  # counts are read by people: once a second
_LEVELS = {"info": "INFO", "warning": "WARN", "error": "ERROR"}


class StageScene:
    """Draws what the other stages found; remembers what was sampled when, and which sources each track came from."""

    def __init__(self, site: Site) -> None:
        self._site, self._units = site, style.units_of(site)
        self._sampled = BEFORE_ALL
        self._named: Lately[str] = Lately()
        self._sources: dict[int, set[str]] = {}

    def entries(
        self, pictures: Sequence[Picture], flights: Sequence[Flown], newest: Callable[[int], int]
    ) -> list[Entry]:
        """What these pictures add; `newest` gives the time of a track's last row."""
        for flown in flights:
            names = {name for name in flown.aircraft if name}
            names |= {name for text in flown.radar_track if text for name in text.split()}
            self._sources.setdefault(flown.track, set()).update(names)
        entries: list[Entry] = []
        samples: list[Sample] = []
        log: list[tuple[int, int, str, str]] = []
        for picture in pictures:
            log += [(event.at, picture.step, event.text, event.level) for event in picture.events]
            samples += self._checks(picture)
            entries += self._joined(picture, log)
            if picture.now - self._sampled >= SAMPLE_NS:
                self._sampled = picture.now
                samples += self._sample(picture)
            entries += self._ended(picture, log, newest)
        entries += plotted(samples, self._named)
        if log:
            log.sort(key=lambda line: line[0])
            time, step, texts, levels = zip(*log, strict=True)
            clock = np.array(time, dtype="datetime64[ns]").astype("datetime64[s]").astype(str)
            told = [f"{instant[11:]} {text}" for instant, text in zip(clock.tolist(), texts, strict=True)]
            lines = rr.TextLog.columns(text=told, level=[_LEVELS.get(level, "INFO") for level in levels])
            entries.append(rows("/log", time, step, lines))
        return entries

    def _checks(self, picture: Picture) -> list[Sample]:
        """The association's counter, and each difference as a share of its gate: at 1 it is on the gate's edge."""
        checked, samples = picture.associate, []
        shares = np.abs(checked.check_difference) / checked.check_gate if len(checked.check_time) else np.empty((0, 3))
        for row, aircraft in enumerate(checked.check_aircraft):
            radar_track = checked.check_radar_track[row]
            path = entity("associate", aircraft, *radar_track.split("/"))
            values = (float(checked.check_counter[row]), *shares[row].tolist())
            whats = ("counter", "range / gate", "azimuth / gate", "elevation / gate")
            names = tuple(f"{aircraft} = {radar_track} {what}" for what in whats)
            samples.append(Sample(path, int(checked.check_time[row]), picture.step, values, names))
        return samples

    def _joined(self, picture: Picture, log: list[tuple[int, int, str, str]]) -> list[Entry]:
        """The point of association: where a radar track and an aircraft became one, or stopped being one."""
        entries: list[Entry] = []
        for change in picture.associate.changes:
            text = _said(change)
            if not any(text in event.text for event in picture.events):
                log.append((change.at, picture.step, text, "info"))
            path = entity("associate", "point", change.aircraft)
            if self._named.is_new(path, change.at):
                look = rr.Points3D.from_fields(colors=style.JOINED, radii=style.points(6.0), show_labels=True)
                entries.append(Always(path, (look,)))
            mark = rr.Points3D.columns(positions=[change.runway_m], labels=[text])
            entries.append(once(path, change.at, picture.step, mark))
        return entries

    def _sample(self, picture: Picture) -> list[Sample]:
        """Counts at this instant."""
        told: list[tuple[str, tuple[float, ...], tuple[str, ...]]] = []
        counts = (float(len(picture.track.active)), float(picture.track.untracked))
        told.append(("/track", counts, ("radar tracks", "plots of no track")))
        told.append(("/associate", (float(len(picture.associate.pairs)),), ("pairs",)))
        return [Sample(path, picture.now, picture.step, values, names) for path, values, names in told]

    def _ended(
        self, picture: Picture, log: list[tuple[int, int, str, str]], newest: Callable[[int], int]
    ) -> list[Entry]:
        """A track that ended leaves the scene, with what its sources said, and the log says so."""
        entries: list[Entry] = []
        for ended in picture.fuse.ended:
            text = f"track {ended.track} ended: {ended.reason}"
            if not (ended.quiet or any(f"track {ended.track} ended" in event.text for event in picture.events)):
                log.append((ended.at, picture.step, text, "info"))
            gone = max(ended.at, picture.now, newest(ended.track))  # the last rows can be newer than the reason to end
            paths = [entity(root, ended.track) for root in ("fuse", "predict", "approach")]
            mine = self._sources.pop(ended.track, set())
            if ended.into is not None:  # its sources go on there
                self._sources.setdefault(ended.into, set()).update(mine)
            others = {name for names in self._sources.values() for name in names}
            for name in sorted(mine - others):
                paths += [raw_path(name), entity("associate", "point", name)]
            clear = [once(path, gone, picture.step, rr.Clear.columns(is_recursive=[True])) for path in paths]
            state = rr.StateChange.columns(state=["ended"])
            entries += [*clear, once(entity("fuse", "state", ended.track), gone, picture.step, state)]
        return entries


def _said(change: Change) -> str:
    joined = "is" if change.kind == "associated" else "is no longer"
    return f"{change.aircraft} {joined} radar track {change.radar_track}"
