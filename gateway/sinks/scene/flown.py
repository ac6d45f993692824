"""The new rows of each fused track, out of many pictures, as columns.

A track's rows are drawn once: a correction of the past (a row of a time before the newest one that was drawn)
is archived in the tables, not drawn, because the viewer would show the old row and the new one side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame, turn
from gateway.observation import Attitude
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene.deck import DeckScene
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.sheaf import Sheaf

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

ATTITUDE_NS = 2_000_000_000  # an older attitude says nothing of now


@dataclass(frozen=True, slots=True)
class Flown:
    """New rows of one track, in the order of time, n of them."""

    track: int
    time: Ints
    step: Ints
    runway_m: Floats  # (n, 3); of a runway that moves, where it is from there at each time
    lat_lon_deg: Floats  # (n, 2)
    altitude_m: Floats  # above mean sea level, else above the ellipsoid
    has_height: Bools  # (n,); without one `altitude_m` is NaN and the third coordinate of `runway_m` is a guess
    pressure_altitude_m: Floats  # NaN = not lately reported
    velocity_mps: Floats  # (n, 3) in runway axes; up is NaN where it is not known
    covariance: Floats  # (n, 36)
    modes: Floats  # (n, 3)
    bias_m: Floats  # (n, 3)
    attitude_rad: Floats  # (n, 3) roll, pitch, yaw
    standing_m: Floats  # (n, 3) in the runway frame that stands still
    along_mps: Floats  # (n,) along the runway, relative to it
    compass_rad: Floats  # (n,) the direction of the x of `runway_m`
    aircraft: tuple[str | None, ...]
    callsign: tuple[str | None, ...]
    radar_track: tuple[str | None, ...]
    state: tuple[str, ...]
    life: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Columns:
    """What is drawn of the rows of many tracks, track by track: see `Flown` for what each means."""

    runway_m: Floats
    lat_lon_deg: Floats
    altitude_m: Floats
    has_height: Bools
    pressure_altitude_m: Floats
    velocity_mps: Floats
    covariance: Floats
    modes: Floats
    bias_m: Floats
    attitude_rad: Floats
    standing_m: Floats
    along_mps: Floats
    compass_rad: Floats


class Flock(Sequence[Flown]):
    """The new rows of many tracks: each by itself, and the columns of all, one track behind the other."""

    def __init__(self, each: Sequence[Flown], sheaf: Sheaf[Flown], columns: Columns) -> None:
        self.sheaf, self.columns = sheaf, columns
        self._each = each

    @overload
    def __getitem__(self, place: int) -> Flown: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[Flown]: ...
    def __getitem__(self, place: int | slice) -> Flown | Sequence[Flown]:
        return self._each[place]

    def __len__(self) -> int:
        return len(self._each)


class Flights:
    """Gathers the rows of tracks from pictures; remembers the newest of each and the last attitudes."""

    def __init__(self, site: Site, deck: DeckScene | None = None) -> None:
        self._deck = deck or DeckScene(site)
        self._landing_rad = site.runway.landing_compass_rad
        self._frame = RunwayFrame(site.runway)
        self._newest: Lately[int] = Lately()
        self._attitudes: dict[str, Floats] = {}  # (n, 4): time ns, roll, pitch, yaw
        self._told: Lately[str] = Lately(self._attitudes.pop)

    def gather(self, pictures: Sequence[Picture]) -> Flock:
        """The new rows of each track, tracks in the order of their first row."""
        self._take_attitudes(pictures)
        steps = [picture.step for picture in pictures if len(picture.fuse.time)]
        parts = [picture.fuse for picture in pictures if len(picture.fuse.time)] or [p.fuse for p in pictures[:1]]

        def column(name: str) -> Floats:
            return np.concatenate([getattr(part, name) for part in parts])

        def text(name: str) -> tuple[str | None, ...]:
            told = [one for part in parts for one in getattr(part, name)]
            return tuple(told[row] for row in rows)

        time, track, place = column("time").astype(np.int64), column("track").astype(np.int64), column("runway_m")
        tracks, order = self._new_rows(time, track, np.asarray(np.isfinite(place).all(axis=1)))
        rows = order.tolist()
        step = np.repeat(np.array(steps, dtype=np.int64), [len(part.time) for part in parts if len(part.time)])[order]
        time, height, altitude = time[order], column("height_m")[order], column("altitude_msl_m")[order]
        local = column("velocity_mps")[order]
        velocity = turn(self._frame.runway_from_enu, np.nan_to_num(local))
        velocity[np.isnan(local[:, 2]), 2] = np.nan
        sheaf = Sheaf.of([number for number, _ in tracks], [count for _, count in tracks], time, step)
        aircraft = text("aircraft")
        columns = Columns(
            runway_m=self._deck.place(time, place[order]),
            lat_lon_deg=np.degrees(np.stack([column("latitude_rad")[order], column("longitude_rad")[order]], axis=-1)),
            altitude_m=np.where(np.isfinite(altitude), altitude, height),
            has_height=np.asarray(np.isfinite(height)),
            pressure_altitude_m=column("pressure_altitude_m")[order],
            velocity_mps=velocity,
            covariance=column("covariance")[order],
            modes=column("modes")[order],
            bias_m=column("bias_m")[order],
            attitude_rad=self._attitude(aircraft, sheaf, velocity),
            standing_m=place[order],
            along_mps=self._deck.along_mps(time, velocity),
            compass_rad=np.broadcast_to(self._deck.compass_rad(time), time.shape),
        )
        callsign, radar_track = text("callsign"), text("radar_track")
        state, life = (tuple(str(one) for one in text(name)) for name in ("state", "life"))
        each = []
        for number, start, end in sheaf.cuts():
            mine = slice(start, end)
            numbers = (getattr(columns, name)[mine] for name in Columns.__slots__)
            words = (part[mine] for part in (aircraft, callsign, radar_track, state, life))
            each.append(Flown(number, time[mine], step[mine], *numbers, *words))
        return Flock(each, Sheaf(each, sheaf.ends, time, step), columns)

    def newest(self, track: int) -> int:
        """The time of the newest row of a track, ns; long ago for one without rows."""
        return self._newest.at(track)

    def end(self, track: int, at: int) -> None:
        """A track ended: rows of it that come later, and are older, are not drawn any more."""
        self._newest.is_new(track, at)

    def _new_rows(self, time: Ints, track: Ints, wanted: Bools) -> tuple[list[tuple[int, int]], NDArray[np.intp]]:
        """Each track and how many rows are new of it; the rows, track by track, that do not go back behind those before."""
        numbers = dict.fromkeys(track[wanted].tolist())
        found, kept = [], [np.empty(0, dtype=np.intp)]
        together = np.argsort(track, kind="stable")
        sorted_tracks = track[together]
        for number in numbers:
            mine = together[slice(*np.searchsorted(sorted_tracks, [number, number + 1]))]
            mine = mine[wanted[mine]]
            newest = np.maximum.accumulate(np.concatenate([[self.newest(number)], time[mine]]))
            self._newest.is_new(number, int(newest[-1]))
            mine = mine[time[mine] >= newest[:-1]]
            if len(mine):
                found.append((number, len(mine)))
                kept.append(mine)
        return found, np.concatenate(kept)

    def _take_attitudes(self, pictures: Sequence[Picture]) -> None:
        told: dict[str, list[tuple[float, ...]]] = {}
        for picture in pictures:
            for one in picture.observations:
                if isinstance(one, Attitude):
                    row = (float(one.valid_at), one.roll_rad, one.pitch_rad, one.yaw_rad)
                    told.setdefault(one.aircraft, []).append(row)
        for aircraft, attitudes in told.items():
            known = self._attitudes.get(aircraft, np.empty((0, 4)))[-1:]
            both = np.concatenate([known, np.array(attitudes)])
            self._told.is_new(aircraft, int(both[-1, 0]))
            self._attitudes[aircraft] = both[np.argsort(both[:, 0], kind="stable")]

    def _attitude(self, aircraft: Sequence[str | None], sheaf: Sheaf[int], velocity_mps: Floats) -> Floats:
        """Roll, pitch, yaw of each row: what was last said, where it is fresh, else course and climb."""
        course = np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0])
        level = np.hypot(velocity_mps[:, 0], velocity_mps[:, 1])
        climb = np.where(
            level > 1.0, np.arctan2(np.nan_to_num(velocity_mps[:, 2]), level), 0.0
        )  # hovering is not a nose dive
        attitude = np.stack([np.zeros_like(course), climb, self._landing_rad - course], axis=-1)
        for _, start, end in sheaf.cuts():
            names, time = aircraft[start:end], sheaf.time[start:end]
            for name in {name for name in names if name in self._attitudes}:
                told = self._attitudes[str(name)]
                last = np.searchsorted(told[:, 0], time, side="right") - 1
                fresh = (last >= 0) & (time - told[last, 0] <= ATTITUDE_NS)
                fresh &= np.array([one == name for one in names])
                attitude[start:end][fresh] = told[last[fresh], 1:]
        return attitude
