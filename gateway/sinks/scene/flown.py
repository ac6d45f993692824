"""The new rows of each fused track, out of many pictures, as columns.

A track's rows are drawn once: a correction of the past (a row of a time before the newest one that was drawn)
is archived in the tables, not drawn, because the viewer would show the old row and the new one side by side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.frames import RunwayFrame, turn
from gateway.observation import Attitude
from gateway.picture import Picture
from gateway.settings import Site
from gateway.sinks.scene.lately import Lately

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
    runway_m: Floats  # (n, 3)
    lat_lon_deg: Floats  # (n, 2)
    altitude_m: Floats  # above mean sea level, else above the ellipsoid
    has_height: Bools  # (n,); without one `altitude_m` is NaN and the third coordinate of `runway_m` is a guess
    pressure_altitude_m: Floats  # NaN = not lately reported
    velocity_mps: Floats  # (n, 3) in runway axes; up is NaN where it is not known
    covariance: Floats  # (n, 36)
    modes: Floats  # (n, 3)
    bias_m: Floats  # (n, 3)
    attitude_rad: Floats  # (n, 3) roll, pitch, yaw
    aircraft: tuple[str | None, ...]
    callsign: tuple[str | None, ...]
    radar_track: tuple[str | None, ...]
    state: tuple[str, ...]
    life: tuple[str, ...]


class Flights:
    """Gathers the rows of tracks from pictures; remembers the newest of each and the last attitudes."""

    def __init__(self, site: Site) -> None:
        self._landing_rad = site.runway.landing_compass_rad
        self._frame = RunwayFrame(site.runway)
        self._newest: Lately[int] = Lately()
        self._attitudes: dict[str, Floats] = {}  # (n, 4): time ns, roll, pitch, yaw
        self._told: Lately[str] = Lately(self._attitudes.pop)

    def gather(self, pictures: Sequence[Picture]) -> list[Flown]:
        """The new rows of each track, tracks in the order of their first row."""
        self._take_attitudes(pictures)
        parts = [picture.fuse for picture in pictures if len(picture.fuse.time)]
        if not parts:
            return []
        steps = [picture.step for picture in pictures if len(picture.fuse.time)]
        step = np.repeat(steps, [len(part.time) for part in parts])

        def column(name: str) -> Floats:
            return np.concatenate([getattr(part, name) for part in parts])

        def text(name: str) -> list[str | None]:
            return [one for part in parts for one in getattr(part, name)]

        time, track, place = column("time").astype(np.int64), column("track"), column("runway_m")
        lat_lon = np.degrees(np.stack([column("latitude_rad"), column("longitude_rad")], axis=-1))
        altitude, height = column("altitude_msl_m"), column("height_m")
        altitude = np.where(np.isfinite(altitude), altitude, height)
        has_height = np.asarray(np.isfinite(height))
        local = column("velocity_mps")
        velocity = turn(self._frame.runway_from_enu, np.nan_to_num(local))
        velocity[np.isnan(local[:, 2]), 2] = np.nan
        pressure = column("pressure_altitude_m")
        covariance, modes, bias = column("covariance"), column("modes"), column("bias_m")
        aircraft, radar_track, state = text("aircraft"), text("radar_track"), text("state")
        callsign, life = text("callsign"), text("life")
        whole = np.isfinite(place).all(axis=1)
        found = []
        for number in dict.fromkeys(track.tolist()):
            index = self._new_rows(number, np.flatnonzero((track == number) & whole), time)
            if not len(index):
                continue
            who = tuple(aircraft[row] for row in index)
            found.append(
                Flown(
                    number, time[index], step[index], place[index], lat_lon[index], altitude[index], has_height[index],
                    pressure[index], velocity[index],
                    covariance[index], modes[index], bias[index],
                    self._attitude(who, time[index], velocity[index]),
                    who,
                    tuple(callsign[row] for row in index),
                    tuple(radar_track[row] for row in index),
                    tuple(str(state[row]) for row in index),
                    tuple(str(life[row]) for row in index),
                )
            )  # fmt: skip
        return found

    def newest(self, track: int) -> int:
        """The time of the newest row of a track, ns; long ago for one without rows."""
        return self._newest.at(track)

    def end(self, track: int, at: int) -> None:
        """A track ended: rows of it that come later, and are older, are not drawn any more."""
        self._newest.is_new(track, at)

    def _new_rows(self, track: int, index: NDArray[np.intp], time: Ints) -> NDArray[np.intp]:
        """Those rows, as they were written, that do not go back behind what was drawn before them."""
        newest = np.maximum.accumulate(np.concatenate([[self.newest(track)], time[index]]))
        if len(index):
            self._newest.is_new(track, int(newest[-1]))
        return index[time[index] >= newest[:-1]]

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

    def _attitude(self, aircraft: Sequence[str | None], time: Ints, velocity_mps: Floats) -> Floats:
        """Roll, pitch, yaw of each row: what was last said, where it is fresh, else course and climb."""
        course = np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0])
        level = np.hypot(velocity_mps[:, 0], velocity_mps[:, 1])
        climb = np.where(
            level > 1.0, np.arctan2(np.nan_to_num(velocity_mps[:, 2]), level), 0.0
        )  # hovering is not a nose dive
        attitude = np.stack([np.zeros_like(course), climb, self._landing_rad - course], axis=-1)
        for name in {name for name in aircraft if name in self._attitudes}:
            told = self._attitudes[str(name)]
            last = np.searchsorted(told[:, 0], time, side="right") - 1
            fresh = (last >= 0) & (time - told[last, 0] <= ATTITUDE_NS)
            fresh &= np.array([one == name for one in aircraft])
            attitude[fresh] = told[last[fresh], 1:]
        return attitude
