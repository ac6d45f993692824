"""Registration while a session runs: how well a radar that is off is known after five minutes, and whether it ever does harm.

The whole gateway, from the wires' bytes on, over scenes: `traffic` with a radar that measures 150 m, 0.5 and 0.2 degrees too
much and stamps 50 ms late; and 003's straight-in approach, whose geometry does not tell everything, with and without
registration. Source: 004, the last two points of "what to reach".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adapters import Arrival, Kind, Source
from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.picture import Picture
from gateway.register import Registered
from gateway.runtime.run import Run
from gateway.runtime.setup import Place, Setup
from gateway.settings import DEMO_SITE, Options, Registering, with_radar
from sim.events import events
from sim.scene import Scene
from sim.scenes import build_scene
from sim.studies import Progress, Study, Table, silent

Floats = NDArray[np.float64]

START = 1_790_000_000 * SECOND
ERROR = np.array([150.0, math.radians(0.5), math.radians(0.2), 0.05])
SHOWN = np.array([1.0, math.degrees(1.0), math.degrees(1.0), 1e3])  # m, degrees, degrees, ms
WRONG = (
    *("radar.range_error_m=150", "radar.azimuth_error_deg=0.5", "radar.elevation_error_deg=0.2"),
    *("radar.time_error_s=0.05", "aircraft=10", "duration_s=300"),
)
SOURCES = {
    "a common error of 50 m": (
        *("gps.error_sigma_m=0", "gps.error_east_m=35"),
        *("gps.error_north_m=-30", "gps.error_up_m=20"),
    ),
    "own errors, 10 m an axis": ("gps.error_sigma_m=10",),
    "own errors, 60 m an axis": ("gps.error_sigma_m=60",),
}
BANDS_M = ((50_000.0, 25_000.0), (25_000.0, 10_000.0), (10_000.0, 1_200.0))


def run(runs: int = 50, seed: int = 1, *, rrd: Path | None = None, progress: Progress = silent) -> Study:
    """A table of what is known of the radar after 300 s, and one of the approach with and without registration.

    Traffic is flown a tenth as often as the approach. `rrd`: there are no figures to draw.
    """
    figures: dict[str, float] = {}
    rows = []
    many = max(runs // 10, 1)
    for place, (name, changes) in enumerate(SOURCES.items()):
        progress(name, 0.15 * place)
        off, sigma = traffic(changes, many, seed)
        rms = np.sqrt((off**2).mean(axis=0)) * SHOWN
        said = np.sqrt((sigma**2).mean(axis=0)) * SHOWN
        worst = np.abs(off).max(axis=0) * SHOWN
        names = ("range", "azimuth", "elevation", "time")
        figures |= {f"{name}, {one}": float(value) for one, value in zip(names, worst, strict=True)}
        rows += [(name, "RMS", *rms.tolist()), ("", "said", *said.tolist()), ("", "worst", *worst.tolist())]
    columns = ("position sources", "", "range m", "azimuth degrees", "elevation degrees", "time ms")
    found = Table(f"off from the radar's errors after 300 s of traffic, {many} runs", columns, tuple(rows))
    harm = _harm(runs, seed, figures, progress)
    return Study("live-registration", runs, seed, (found, harm), figures)


def traffic(changes: tuple[str, ...], runs: int, seed: int) -> tuple[Floats, Floats]:
    """By how much the radar's errors (runs, 4) are found wrong at the end, and the sigmas that are told of them."""
    off, sigma = [], []
    for index in range(runs):
        scene = build_scene("traffic", start_ns=START, seed=seed + index, changes=(*WRONG, *changes))
        told = None
        for picture in pictures(scene, "apply"):
            told = picture.register
        assert isinstance(told, Registered)
        off.append(told.error[0] - ERROR)
        sigma.append(told.sigma[0])
    return np.array(off), np.array(sigma)


def _harm(runs: int, seed: int, figures: dict[str, float], progress: Progress) -> Table:
    square: dict[Registering, list[Floats]] = {"off": [], "apply": []}
    applied = 0
    for index in range(runs):
        progress("straight in, with and without", 0.45 + 0.55 * index / runs)
        for use, found in square.items():
            errors = straight_in(use, seed + index)
            found.append(np.array([[(band**2).sum(), len(band)] for band in errors.bands()]))
            applied += errors.applied
    rows = []
    sums = {use: np.array(found).sum(axis=0) for use, found in square.items()}
    for row, (far, near) in enumerate(BANDS_M):
        without, with_it = (math.sqrt(sums[use][row, 0] / sums[use][row, 1]) for use in ("off", "apply"))
        name = f"{far / 1e3:g} to {near / 1e3:g} km"
        rows.append((name, without, with_it, with_it / without))
        figures[f"straight in, {name}"] = with_it / without
    columns = ("from the runway", "without m", "with m", "ratio")
    note = f"errors taken off in all runs together, of 4 in each: {applied}"
    return Table(f"003's approach: 3-D RMSE of the fused track, {runs} runs", columns, tuple(rows), (note,))


@dataclass(slots=True)
class Errors:
    """Of one approach: how far the last row of each time is off, m, and how far from the runway that was, m."""

    scene: Scene
    last: dict[int, Floats] = field(default_factory=dict)
    applied: int = 0
    verdicts: tuple[str, ...] = ()

    def take(self, picture: Picture) -> None:
        """What one picture adds."""
        for row, state in enumerate(picture.fuse.state):
            if state == "fused" and picture.fuse.updated_by[row] != "coast":
                self.last[int(picture.fuse.time[row])] = picture.fuse.runway_m[row]
        if len(picture.register.radars):
            self.applied = int(picture.register.applied[0].sum())
            self.verdicts = picture.register.verdict[0]

    def bands(self) -> list[Floats]:
        """Distances to the truth, by how far from the runway's centre the aircraft was."""
        (aircraft,) = self.scene.aircraft
        times = np.array(sorted(self.last))
        frame = RunwayFrame(self.scene.site.runway)
        flown = self.scene.flown(aircraft, np.minimum((times - START) / SECOND, self.scene.duration_s - 1e-3))
        true = frame.runway_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
        off = np.linalg.norm(np.array([self.last[int(time)] for time in times]) - true, axis=1)
        away = np.linalg.norm(true[:, :2], axis=1)
        return [off[(away <= far) & (away > near)] for far, near in BANDS_M]


def straight_in(use: Registering, seed: int) -> Errors:
    """One approach of 003, with a radar that has no errors."""
    scene = build_scene("approach", start_ns=START, seed=seed)
    errors = Errors(scene)
    for picture in pictures(scene, use):
        errors.take(picture)
    return errors


def pictures(scene: Scene, use: Registering) -> Iterator[Picture]:
    """What the gateway makes of a scene, a second at a time; of its radars it knows where they stand."""
    site = DEMO_SITE
    for radar in scene.radars:
        site = with_radar(site, radar.site)
    session = Run(Setup(Place(site, "", "the scene"), Options(registration=use), is_watched=False), scene.start_ns)
    numbers = {name: number for number, name in enumerate(scene.links, 1)}
    for name, number in numbers.items():
        kind: Kind = "radar" if name.startswith("radar") else "mavlink"
        session.add(Source(number, kind, name.replace(":", "-"), "the scene"))
    waiting, until = list[Arrival](), scene.start_ns + SECOND
    for event in events(scene):
        if event.at >= until:
            picture = session.work(waiting, until - 4000)
            if picture is not None:
                yield picture
            waiting, until = [], until + SECOND
        waiting.append(Arrival(event.at, numbers[event.link], event.data))
    last = session.work(waiting, scene.at_ns(scene.duration_s))
    if last is not None:
        yield last
