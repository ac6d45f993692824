"""A made-up session in paper 003's shape, as pictures: what every sink is tried on, without a pipeline."""

from __future__ import annotations

import math
import warnings
from collections import defaultdict
from collections.abc import Callable
from dataclasses import MISSING, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from gateway.align import Aligned
from gateway.associate import Associated, Change
from gateway.frames import RunwayFrame, turn
from gateway.fuse import Ended, Fused
from gateway.observation import Attitude, GpsReport, RadarPlot, Truth
from gateway.picture import Event, Health, Picture, SourceHealth, VehicleHealth
from gateway.predict import Predicted
from gateway.register import Registered, Residuals
from gateway.settings import DEMO_SITE, Site
from gateway.track import Tracked

START = 1_772_366_400_000_000_000  # 2026-03-01T12:00:00Z
TICK_S = 0.2
AIRCRAFT, RADAR_TRACK = "mavlink:1", "1/3"
Floats = NDArray[np.float64]
Make = Callable[..., list[Picture]]
Entities = dict[str, list[dict[str, Any]]]


def _course() -> tuple[Floats, Floats, Floats]:
    """Time, runway-frame position and velocity of 003's approach every 0.1 s."""
    fine = np.arange(0.0, 600.0, 0.1)
    ground = np.empty_like(fine)
    ground[0] = 50_000.0
    for step in range(1, len(fine)):
        speed = 72.0 + 58.0 * min(max((ground[step - 1] - 5000.0) / 25000.0, 0.0), 1.0)
        ground[step] = ground[step - 1] - 0.1 * speed
    s = np.maximum(ground, -1000.0)
    u = np.clip((s - 25_000.0) / 22_000.0, 0.0, 1.0)
    height = np.clip((s - 1214.0) * math.tan(math.radians(3.0)), 0.0, 1200.0)
    place = np.stack([-s, 6000.0 * u * u * (3.0 - 2.0 * u), height], axis=-1)
    return fine, place, np.gradient(place, 0.1, axis=0)


COURSE = _course()


def path(time_s: Floats) -> tuple[Floats, Floats]:
    """Runway-frame positions and velocities (n, 3) of 003's approach at seconds (n,) from its start."""
    fine, place, speed = COURSE
    at = [np.interp(time_s, fine, place[:, axis]) for axis in range(3)]
    going = [np.interp(time_s, fine, speed[:, axis]) for axis in range(3)]
    return np.stack(at, axis=-1), np.stack(going, axis=-1)


class _Maker:
    """Builds the pictures of one session; one instance a session, so that its random numbers are its own."""

    def __init__(self, site: Site, modes: bool) -> None:
        self.site, self.frame, self.modes = site, RunwayFrame(site.runway), modes
        self.random = np.random.default_rng(3)
        self.paired_at: float | None = None

    def fused(self, time_s: Floats, by: tuple[str, ...], state: str, track: int) -> Fused:
        n = len(time_s)
        place, speed = path(time_s)
        place = place + self.random.normal(0.0, 6.0, (n, 3)) + [0.0, 0.0, 12.0 * (state == "gps only")]
        latitude, longitude, height = self.frame.geodetic_from_runway(place)
        east_north_up = turn(self.frame.enu_from_runway, speed)
        sigma = np.diag([9.0, 12.0, 6.0, 1.0, 1.0, 0.5]) ** 2
        modes = np.full((n, 3), np.nan)
        if self.modes:
            left = 0.1 + 0.3 * np.sin(time_s / 40.0) ** 2
            modes = np.stack([0.9 - left, left, np.full(n, 0.1)], axis=-1)
        now = START + np.round(time_s * 1e9).astype(np.int64)
        none: tuple[str | None, ...] = (None,) * n
        return Fused(
            time=now,
            received=now + 100_000_000,
            track=np.full(n, track, dtype=np.int64),
            aircraft=(AIRCRAFT,) * n if state != "radar only" else none,
            radar_track=(RADAR_TRACK,) * n if state != "gps only" else none,
            updated_by=by,
            state=(state,) * n,
            latitude_rad=latitude,
            longitude_rad=longitude,
            height_m=height,
            altitude_msl_m=height + 35.0,
            velocity_mps=east_north_up,
            covariance=np.tile(sigma.reshape(-1), (n, 1)),
            modes=modes,
            runway_m=place,
            bias_m=np.tile([35.0, 40.0, 28.0], (n, 1)) * (1.0 - np.exp(-time_s / 60.0))[:, None],
            pressure_altitude_m=np.full(n, np.nan),
            callsign=none,
            life=("coasting" if state == "coasting" else "confirmed",) * n,
            wind_mps=np.full((n, 2), np.nan),
        )

    def predicted(self, time_s: float, track: int) -> Predicted:
        horizon = np.array([10.0, 30.0, 60.0])
        place, speed = path(np.array([time_s]))
        ahead = place + horizon[:, None] * speed
        latitude, longitude, height = self.frame.geodetic_from_runway(ahead)
        made = np.full(3, START + round(time_s * 1e9), dtype=np.int64)
        return Predicted(
            made=made,
            track=np.full(3, track, dtype=np.int64),
            valid=made + (horizon * 1e9).astype(np.int64),
            horizon_s=horizon,
            latitude_rad=latitude,
            longitude_rad=longitude,
            height_m=height,
            sigma_m=15.0 + horizon**1.3 * 3.0,
            method=("model",) * 3,
            intent=(None,) * 3,
            intent_kind=(None,) * 3,
            sigma_along_m=15.0 + horizon**1.3 * 3.0,
            sigma_across_m=15.0 + horizon**1.3 * 3.0,
            course_rad=np.zeros(3),
            confidence=np.full(3, np.nan),
            runway_m=ahead,
        )

    def observed(self, time_s: float, gps: bool, radar: bool) -> tuple[GpsReport | RadarPlot | Attitude, ...]:
        now = START + round(time_s * 1e9)
        place, speed = path(np.array([time_s]))
        found: list[GpsReport | RadarPlot | Attitude] = []
        if gps:
            off = place[0] + [35.0, 40.0, 28.0] + self.random.normal(0.0, 15.0, 3)
            latitude, longitude, height = (float(part[0]) for part in self.frame.geodetic_from_runway(off[None]))
            found.append(GpsReport(AIRCRAFT, now - 1_000_000_000, now, latitude, longitude, height_m=height))
            course = math.atan2(speed[0, 1], speed[0, 0])
            yaw = self.site.runway.landing_compass_rad - course
            found.append(Attitude(AIRCRAFT, now, now, 0.2 * math.sin(time_s / 20.0), -0.05, yaw))
        if radar:
            found.append(RadarPlot(1, 3, now - 50_000_000, now, 10_000.0, 0.01, 0.05))
        return tuple(found)

    def aligned(self, time_s: float, gps: bool, radar: bool) -> Aligned:
        now = START + round(time_s * 1e9)
        report, _ = path(np.array([time_s - 1.0]))
        plot, _ = path(np.array([time_s - 0.05]))
        report = report + np.array([35.0, 40.0, 28.0]) + self.random.normal(0.0, 15.0, 3)
        plot = plot + self.random.normal(0.0, 0.001, 3) * np.abs(plot[:, :1]) * [0.0, 1.0, 1.0] + [15.0, 0.0, 0.0]
        if radar and self.random.random() < 0.3:
            plot[:] = np.nan
        empty = np.empty((0, 3))
        return Aligned(
            (AIRCRAFT,) * gps,
            np.array([now - 1_000_000_000] * gps, dtype=np.int64),
            report if gps else empty,
            np.ones(int(gps), dtype=np.bool_),
            (RADAR_TRACK,) * radar,
            np.array([now - 50_000_000] * radar, dtype=np.int64),
            plot if radar else empty,
        )

    def associated(self, time_s: float, gps: bool, radar_seen: bool) -> Associated:
        checked = gps and radar_seen
        at = START + round(time_s * 1e9)
        changes: tuple[Change, ...] = ()
        if checked and self.paired_at is None and time_s > 12.0:
            self.paired_at = time_s
            place = path(np.array([time_s]))[0][0]
            where = (float(place[0]), float(place[1]), float(place[2]))
            changes = (Change(at, "associated", AIRCRAFT, RADAR_TRACK, where),)
        return Associated(
            np.array([at] * checked, dtype=np.int64),
            (AIRCRAFT,) * checked,
            (RADAR_TRACK,) * checked,
            np.array([[20.0, 0.002, np.nan]] * checked).reshape(-1, 3),
            np.array([[200.0, 0.01, 0.01]] * checked).reshape(-1, 3),
            np.array([min(round(time_s / 5.0), 3)] * checked, dtype=np.int64),
            ((AIRCRAFT, RADAR_TRACK),) if self.paired_at is not None else (),
            changes,
        )

    def vehicle(self, time_s: float) -> VehicleHealth:
        """A clock that settles after 5 s, and an aircraft that says how fast and how high it flies."""
        speed = float(np.linalg.norm(path(np.array([time_s]))[1]))
        settled = time_s >= 5.0
        times = (0.002, 0.01, 0.3) if settled else (math.nan,) * 3
        readings = (("airspeed, m/s", speed), ("altitude, m", 600.0), ("temperature, K", 288.0), ("ATTITUDE, 1/s", 4.0))
        return VehicleHealth(AIRCRAFT, "UTC" if settled else "not settled", *times, readings, (("landed", "in air"),))

    def picture(self, step: int, first_s: float, last_s: float, end: bool) -> Picture:
        time_s = first_s + step * TICK_S
        gps = step % round(5.0 / TICK_S) == 3
        radar = step % 2 == 0
        seen: list[tuple[float, str]] = [(time_s - 1.0, "gps")] * gps + [(time_s - 0.05, "radar")] * radar
        late = self.paired_at is None
        rows = [row for row in seen if row[0] >= first_s and (row[1] == "gps" or not late)]
        times = np.array([row[0] for row in rows])
        fused = self.fused(times, tuple(row[1] for row in rows), "gps only" if late else "fused", 1)
        now = START + round(time_s * 1e9)
        if end:
            fused = replace(fused, ended=(Ended(now, 1, "no data for 30 s"),))
        predicted = self.predicted(time_s, 1)
        if step % round(1.0 / TICK_S):
            predicted = slice_predicted(predicted, 0)
        place, speed = path(np.array([time_s]))
        latitude, longitude, height = (float(part[0]) for part in self.frame.geodetic_from_runway(place))
        velocity = turn(self.frame.enu_from_runway, speed[0])
        truth = Truth(AIRCRAFT, now, now, latitude, longitude, None, height, *velocity.tolist(), "approach")
        sources = (
            SourceHealth("mavlink:1", "mavlink", (time_s % 5.0), 0.2, step // 500),
            SourceHealth("radar 1", "radar", 0.2, 2.5, 0, (("crc error", 2),)),
        )
        return Picture(
            step=step,
            now=now,
            observations=self.observed(time_s, gps, radar),
            align=self.aligned(time_s, gps, radar),
            track=Tracked((RADAR_TRACK,), 0),
            associate=self.associated(time_s, gps, True),
            register=registered(now),
            fuse=fused,
            predict=predicted,
            truth=(truth,) if step % 5 == 0 else (),
            health=Health(sources, (self.vehicle(time_s),)),
            events=(Event(now, "info", "the session begins"),) if step == 0 else (),
        )


def registered(now: int) -> Registered:
    """A radar whose errors are found and taken off, with a pair at this instant."""
    off = np.array([[40.0, 3e-3, 2e-3, 0.02]])
    pair = Residuals(np.array([now]), np.array([1]), (AIRCRAFT,), off[:, :3], 0.1 * off[:, :3])
    return Registered(
        (1,), 0.9 * off, off, 0.1 * off, np.ones((1, 4), np.bool_), (("range: applied",) * 4,), residuals=pair
    )


def slice_predicted(predicted: Predicted, rows: int) -> Predicted:
    """The first rows of a prediction."""
    names = [name for name, one in Predicted.__dataclass_fields__.items() if one.default is MISSING]
    return Predicted(**{name: getattr(predicted, name)[:rows] for name in names})


def make_pictures(
    seconds: float = 60.0, *, first_s: float = 0.0, site: Site = DEMO_SITE, modes: bool = True, end: bool = False
) -> list[Picture]:
    """The pictures of `seconds` of the approach from `first_s` on; with `end`, the last one ends the track."""
    maker = _Maker(site, modes)
    steps = round(seconds / TICK_S)
    return [maker.picture(step, first_s, first_s + seconds, end and step == steps - 1) for step in range(steps)]


@pytest.fixture(scope="session")
def pictures() -> Make:
    """A function that makes the pictures of a part of the approach."""
    return make_pictures


def rows_of(path: Path) -> Entities:
    """The rows of each entity in the order of time: component -> value, `utc` in ns; static rows have no `utc`."""
    found: Entities = defaultdict(list)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a file still open has no index
        reader = RrdReader(path)
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        columns = {name: batch.column(name) for name in batch.schema.names}
        if "utc" in columns:
            columns["utc"] = columns["utc"].cast("int64")
        values = {name: column.to_pylist() for name, column in columns.items()}
        for row in range(batch.num_rows):
            found[chunk.entity_path].append({name: column[row] for name, column in values.items()})
    for rows in found.values():
        rows.sort(key=lambda row: (row.get("utc", 0), row["rerun.controls.RowId"]))
    return found


@pytest.fixture(scope="session")
def read() -> Callable[[Path], Entities]:
    """Reads a recording: see `rows_of`."""
    return rows_of
