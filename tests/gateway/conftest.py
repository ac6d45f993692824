"""A small world for the picture's tests: aircraft on courses, what GPS and radar say of them, and the pipeline run on it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gateway import pipeline
from gateway.align import SECOND, Fix, Plot
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, turn
from gateway.observation import GpsReport, Heard, Observation, RadarPlot
from gateway.picture import Event, Picture
from gateway.settings import DEMO_SITE, Options, RadarSite, Site, with_radar
from gateway.state import State

Floats = NDArray[np.float64]

START = 1_790_000_000 * SECOND
TICK = 20_000_000
RUN_COLUMNS = [
    *("time", "received", "track", "aircraft", "radar_track", "updated_by", "state"),
    *(
        "latitude_rad",
        "longitude_rad",
        "height_m",
        "altitude_msl_m",
        "velocity_mps",
        "covariance",
        "runway_m",
        "bias_m",
    ),
]
PREDICTION_COLUMNS = ["made", "track", "valid", "horizon_s", "latitude_rad", "longitude_rad", "height_m", "sigma_m"]


@dataclass(frozen=True)
class Course:
    """A gently curved approach in the runway frame, metres and seconds."""

    along_m: float = -25_000.0
    left_m: float = 300.0
    height_m: float = 1300.0
    speed_mps: float = 80.0
    sink_mps: float = 3.0
    swing_m: float = 200.0

    def at(self, t_s: float) -> Floats:
        """Position (3,) at a time."""
        y = self.left_m + self.swing_m * math.sin(t_s / 30.0)
        return np.array([self.along_m + self.speed_mps * t_s, y, self.height_m - self.sink_mps * t_s])

    def velocity(self, t_s: float) -> Floats:
        """Velocity (3,) at a time."""
        return np.array([self.speed_mps, self.swing_m / 30.0 * math.cos(t_s / 30.0), -self.sink_mps])


@dataclass(frozen=True)
class Run:
    """What a run of the pipeline gave."""

    state: State
    pictures: tuple[Picture, ...]

    def column(self, name: str) -> list[Any]:
        """A column of all rows that were written, in writing order."""
        return [value for picture in self.pictures for value in getattr(picture.fuse, name)]

    def rows(self, **wanted: Any) -> list[dict[str, Any]]:
        """The rows that were written, as dicts, of which the named columns have these values."""
        columns = {name: self.column(name) for name in RUN_COLUMNS}
        every = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
        return [row for row in every if all(row[name] == value for name, value in wanted.items())]

    def last(self, **wanted: Any) -> dict[tuple[str, int], dict[str, Any]]:
        """The last row of each track, by its name, and time."""
        return {(row["aircraft"] or row["radar_track"], int(row["time"])): row for row in self.rows(**wanted)}

    def bits(self) -> list[bytes]:
        """Every row and every prediction, in writing order, to the bit."""
        parts = []
        for stage, names in (("fuse", RUN_COLUMNS), ("predict", PREDICTION_COLUMNS)):
            for name in names:
                columns = [getattr(getattr(picture, stage), name) for picture in self.pictures]
                if columns and isinstance(columns[0], np.ndarray):
                    parts.append(name.encode() + b"".join(column.tobytes() for column in columns))
                else:
                    parts.append(repr([value for column in columns for value in column]).encode())
        return parts

    @property
    def events(self) -> list[Event]:
        """Everything that was said."""
        return [event for picture in self.pictures for event in picture.events]

    def said(self, words: str) -> list[Event]:
        """What was said with these words in it."""
        return [event for event in self.events if words in event.text]

    @property
    def ended(self) -> list[Any]:
        """The tracks that ended."""
        return [ended for picture in self.pictures for ended in picture.fuse.ended]

    @property
    def checks(self) -> int:
        """How many reports were compared with radar tracks."""
        return sum(len(picture.associate.check_time) for picture in self.pictures)


class World:
    """Builders; the same arguments always give the same values."""

    START, SECOND = START, SECOND
    Course = Course
    SECOND_RADAR = RadarSite(2, -400.0, -200.0, 5.0, math.radians(265.0))

    def __init__(self, site: Site = DEMO_SITE) -> None:
        self.site = site
        self.frame = RunwayFrame(site.runway)
        self.radars = {radar.number: RadarFrame.of(radar, self.frame) for radar in site.radars}

    def with_site(self, site: Site) -> World:
        """The same builders at another site."""
        return World(site)

    @property
    def two_radars(self) -> World:
        """The same with a second radar."""
        return World(with_radar(self.site, self.SECOND_RADAR))

    @staticmethod
    def at(t_s: float) -> int:
        """An instant, ns."""
        return START + round(t_s * SECOND)

    # what sensors say -----------------------------------------------------------------------------------------------

    def report(
        self,
        course: Course,
        t_s: float,
        *,
        aircraft: str = "mavlink:1",
        late_s: float = 1.0,
        off_m: Sequence[float] = (0.0, 0.0, 0.0),
        **extra: Any,
    ) -> GpsReport:
        """A GPS report of a course, `off_m` off in the runway frame, with altitude above mean sea level."""
        latitude, longitude, height = self.frame.geodetic_from_runway(course.at(t_s) + np.asarray(off_m))
        separation = self.site.runway.geoid_separation_m or 0.0
        said: dict[str, Any] = {"altitude_msl_m": float(height) - separation, **extra}
        at = self.at(t_s)
        return GpsReport(aircraft, at, at + round(late_s * SECOND), float(latitude), float(longitude), **said)

    def polar(self, course: Course, t_s: float, radar: int = 1) -> Floats:
        """Range, azimuth, elevation (3,) of a course as a radar sees it without noise."""
        return polar_from_xyz(self.radars[radar].from_enu(turn(self.frame.enu_from_runway, course.at(t_s))))

    def radar_plot(
        self,
        course: Course,
        t_s: float,
        *,
        radar: int = 1,
        number: int = 3,
        late_s: float = 0.02,
        off: Sequence[float] = (0.0, 0.0, 0.0),
        missing: str = "",
        **extra: Any,
    ) -> RadarPlot:
        """A plot of a course; `missing` names components by their first letters: r, a, e."""
        polar = self.polar(course, t_s, radar) + np.asarray(off)
        said = [None if letter in missing else float(value) for letter, value in zip("rae", polar, strict=True)]
        at = self.at(t_s)
        return RadarPlot(radar, number, at, at + round(late_s * SECOND), *said, **extra)

    def fix(self, course: Course, t_s: float, *, serial: int = 0, aircraft: str = "mavlink:1", **extra: Any) -> Fix:
        """A GPS report as align makes it."""
        off_m = extra.pop("off_m", (0.0, 0.0, 0.0))
        enu = turn(self.frame.enu_from_runway, course.at(t_s) + np.asarray(off_m))
        nowhere, sigma = np.full(3, math.nan), np.full(3, 15.0)
        made = Fix(self.at(t_s), serial, self.at(t_s + 1.0), aircraft, enu, sigma, nowhere, 1.0, True)
        return replace(made, **extra)

    def plot(self, course: Course, t_s: float, *, serial: int = 0, **extra: Any) -> Plot:
        """A plot as align makes it."""
        said = self.radar_plot(course, t_s, **extra)
        parts = (said.range_m, said.azimuth_rad, said.elevation_rad)
        distance, azimuth, elevation = (math.nan if part is None else part for part in parts)
        polar, sigma = (distance, azimuth, elevation), (15.0, 1e-3, 1e-3)
        return Plot(said.valid_at, serial, said.received_at, said.radar, said.track_number, polar, sigma)

    def flight(
        self,
        course: Course | None = None,
        seconds: float = 40.0,
        *,
        aircraft: str | None = "mavlink:1",
        radars: Iterable[int] = (1,),
        number: int = 3,
        gps_period_s: float = 5.0,
        gps_phase_s: float = 0.13,
        plots_from_s: float = 0.05,
        missing: bool = True,
        seed: int = 1,
        **report: Any,
    ) -> list[Observation]:
        """Noisy reports and plots of one aircraft: GPS 15 m with an error of 60 m, radar 15 m and 1 mrad every 0.4 s."""
        course, random = course or Course(), np.random.default_rng(seed)
        said: list[Observation] = []
        if aircraft is not None:
            for k in range(math.ceil((seconds - gps_phase_s) / gps_period_s)):
                off = random.normal([40.0, 35.0, 28.0], 15.0)
                late_s = float(random.uniform(0.8, 2.0))
                t_s = gps_phase_s + k * gps_period_s
                said.append(self.report(course, t_s, aircraft=aircraft, late_s=late_s, off_m=off, **report))
        for radar in radars:
            for k in range(math.ceil((seconds - plots_from_s) / 0.4)):
                off = random.normal(0.0, [15.0, 1e-3, 1e-3])
                gone = "".join(np.array(list("rae"))[random.uniform(size=3) < [0.05, 0.2, 0.2]]) if missing else ""
                t_s = plots_from_s + 0.4 * k
                said.append(self.radar_plot(course, t_s, radar=radar, number=number, off=off, missing=gone))
        return [one for one in said if measures_something(one)]

    # the pipeline ---------------------------------------------------------------------------------------------------

    def heard(self, observations: Iterable[Observation]) -> list[Heard]:
        """Each observation as an arrival of its own, in order of arrival, all stamps different."""
        arrivals: list[Heard] = []
        for one in sorted(observations, key=lambda one: one.received_at):
            now = max(one.received_at // 4000 * 4000, arrivals[-1].now + 4000 if arrivals else 0)
            arrivals.append(Heard(now, (one,)))
        return arrivals

    def run(
        self,
        observations: Iterable[Observation] | Sequence[Heard],
        *,
        ticks: str = "all",
        options: Options | None = None,
        until_s: float | None = None,
        site: Site | None = None,
    ) -> Run:
        """The pipeline's pictures, with arrivals in ticks of "one", "20 ms" (with watermarks) or "all"."""
        given = list(observations)
        heard = given if given and isinstance(given[0], Heard) else self.heard(given)  # type: ignore[arg-type]
        end = heard[-1].now if until_s is None else self.at(until_s)
        steps = _ticks([one for one in heard if isinstance(one, Heard)], ticks, max(end, heard[-1].now))  # type: ignore[union-attr]
        state, pictures = pipeline.initial(site or self.site, options or Options()), []
        for arrivals in steps:
            state, picture = pipeline.step(state, arrivals)
            pictures.append(picture)
        return Run(state, tuple(pictures))


def measures_something(one: Observation) -> bool:
    """Whether a plot has any component."""
    return not isinstance(one, RadarPlot) or (one.range_m, one.azimuth_rad, one.elevation_rad) != (None, None, None)


def _ticks(heard: Sequence[Heard], ticks: str, end: int) -> list[list[Heard]]:
    last = [Heard(end)]
    if ticks == "all":
        return [[*heard, *last]]
    if ticks == "one":
        return [*([one] for one in heard), last]
    found: list[list[Heard]] = []
    for one in heard:
        if not found or one.now // TICK != found[-1][0].now // TICK:
            if found:
                found[-1].append(Heard((found[-1][0].now // TICK + 1) * TICK - 4000))
                # and ticks in which nothing arrived: the first one and the last one
                quiet = range(found[-1][0].now // TICK + 1, one.now // TICK)
                found += [[Heard((k + 1) * TICK - 4000)] for k in sorted({*quiet[:1], *quiet[-1:]})]
            found.append([])
        found[-1].append(one)
    return [*found, last]


@pytest.fixture(scope="session")
def world() -> World:
    """003's site with its one radar."""
    return World()


@pytest.fixture(scope="session")
def differences() -> Callable[[dict[Any, dict[str, Any]], dict[Any, dict[str, Any]]], float]:
    """The greatest difference of position, velocity and covariance between rows of the same keys, in m, m/s, m2."""

    def greatest(one: dict[Any, dict[str, Any]], other: dict[Any, dict[str, Any]]) -> float:
        names = ("runway_m", "velocity_mps", "covariance", "height_m", "altitude_msl_m")
        return max(
            float(np.max(np.abs(np.asarray(one[key][name]) - np.asarray(other[key][name]))))
            for key in one
            for name in names
        )

    return greatest
