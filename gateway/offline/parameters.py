"""The flight parameters of a recording as columns: what each aircraft said of its speed, attitude, pressure and place."""

from __future__ import annotations

import math
from array import array
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gateway.estimators.inertial_wind import Felt
from gateway.observation import AEROPLANES, AirData, Attitude, GpsReport, ImuSample, Observation, VehicleStatus

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

NOTHING = math.nan
_GENERIC = 0  # MAV_TYPE


@dataclass(slots=True)
class Series:
    """Rows as they come, one time and some numbers each; in order of time once they are asked for."""

    width: int
    _time: array[int] = field(default_factory=lambda: array("q"))
    _values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, at: int, *values: float | None) -> None:
        """One row; what was not measured is None."""
        self._time.append(at)
        self._values.extend(NOTHING if value is None else value for value in values)

    def extend(self, at: Times, values: Floats) -> None:
        """Rows (n,) and (n, width)."""
        self._time.frombytes(np.ascontiguousarray(at, dtype=np.int64).tobytes())
        self._values.frombytes(np.ascontiguousarray(values, dtype=np.float64).tobytes())

    def __len__(self) -> int:
        return len(self._time)

    def rows(self) -> tuple[Times, Floats]:
        """Times (n,) ns, none falling, and values (n, width), all of them."""
        time = np.array(self._time, dtype=np.int64)
        order = np.argsort(time, kind="stable")
        return time[order], np.array(self._values, dtype=np.float64).reshape(-1, self.width)[order]

    def columns(self) -> tuple[Times, Floats]:
        """Times (n,) strictly increasing, ns, and values (n, width); of several rows of one time the first."""
        time, values = self.rows()
        unique, first = np.unique(time, return_index=True)
        return unique, values[first]


@dataclass(slots=True)
class Parameters:
    """What one aircraft said. Memory: some hundred bytes for each second and kind."""

    airspeed: Series = field(default_factory=lambda: Series(2))  # calibrated m/s, altitude m above mean sea level
    attitude: Series = field(default_factory=lambda: Series(3))  # roll, pitch, yaw, rad
    pressure: Series = field(default_factory=lambda: Series(2))  # static Pa, temperature K
    places: Series = field(default_factory=lambda: Series(5))  # latitude rad, longitude rad, altitude, height, sigma m
    forces: dict[int, Series] = field(default_factory=dict)  # by accelerometer: along the body, m/s2
    kind: int = 0  # as MAVLink numbers vehicles

    def take(self, observation: Observation) -> None:
        """Keep what a path can be made of."""
        if isinstance(observation, AirData):
            if observation.airspeed_mps is not None:
                self.airspeed.add(observation.valid_at, observation.airspeed_mps, observation.altitude_msl_m)
            if observation.static_pressure_pa is not None:
                self.pressure.add(observation.valid_at, observation.static_pressure_pa, observation.temperature_k)
        elif isinstance(observation, Attitude):
            self.attitude.add(observation.valid_at, observation.roll_rad, observation.pitch_rad, observation.yaw_rad)
        elif isinstance(observation, GpsReport):
            self.places.add(
                observation.valid_at,
                observation.latitude_rad,
                observation.longitude_rad,
                observation.altitude_msl_m,
                observation.height_m,
                observation.horizontal_sigma_m,
            )
        elif isinstance(observation, ImuSample):
            if observation.acceleration_mps2 is not None:
                self._force(observation.sensor).add(observation.valid_at, *observation.acceleration_mps2)
        elif isinstance(observation, VehicleStatus):
            self.kind = observation.vehicle_type

    def feel(self, sensor: int, at: Times, force_mps2: Floats) -> None:
        """Samples (n, 3) of an accelerometer; rows without any are left out."""
        felt = ~np.isnan(force_mps2).any(axis=1)
        self._force(sensor).extend(at[felt], force_mps2[felt])

    def _force(self, sensor: int) -> Series:
        return self.forces.setdefault(sensor, Series(3))

    def felt(self, origin: int) -> Felt | None:
        """The samples of the accelerometer that told most, with the attitude then, seconds from `origin`; None without any."""
        most = max(self.forces, key=lambda sensor: (len(self.forces[sensor]), -sensor), default=None)
        if most is None or len(self.attitude) < 2:
            return None
        time, force = self.forces[most].columns()
        attitude_at, attitude = self.attitude.columns()
        known = (time >= attitude_at[0]) & (time <= attitude_at[-1])
        angles = [_at(time[known], attitude_at, np.unwrap(column)) for column in attitude.T]
        return Felt((time[known] - origin) * 1e-9, force[known], np.stack(angles, axis=-1))

    @property
    def flies_by_its_nose(self) -> bool:
        """Whether it is an aeroplane, or may be one; others move where their nose does not point."""
        return self.kind in AEROPLANES or self.kind == _GENERIC

    def lacks(self) -> str | None:
        """What is missing for a path, in words; None: nothing."""
        kinds = (("airspeed", self.airspeed), ("attitude", self.attitude))
        missing = [name for name, series in kinds if len(series) < 2]
        return " and ".join(missing) or None


@dataclass(frozen=True, slots=True)
class Flown:
    """One aircraft's parameters at the times of its airspeeds, all (n,); NaN where nothing tells.

    Attitude is interpolated, as is pressure; an attitude that is more than a second away is none.
    """

    time: Times  # ns since 1970 UTC
    airspeed_mps: Floats  # calibrated
    roll_rad: Floats
    pitch_rad: Floats
    compass_rad: Floats  # continuous: it may go beyond a turn
    pressure_pa: Floats
    temperature_k: Floats
    altitude_m: Floats  # above mean sea level, as the vehicle has it

    @classmethod
    def of(cls, parameters: Parameters) -> Flown:
        """The parameters brought together; `lacks` says beforehand whether there is enough."""
        time, air = parameters.airspeed.columns()
        attitude_at, attitude = parameters.attitude.columns()
        roll, pitch, yaw = (_at(time, attitude_at, np.unwrap(column)) for column in attitude.T)
        far = np.abs(time - attitude_at[_nearest(time, attitude_at)]) > 1_000_000_000
        for column in (roll, pitch, yaw):
            column[far] = NOTHING
        pressure = temperature = np.full(len(time), NOTHING)
        if len(parameters.pressure) > 1:
            pressed_at, pressed = parameters.pressure.columns()
            pressure, temperature = (_at(time, pressed_at, column) for column in pressed.T)
        columns = (air[:, 0], roll, pitch, yaw, pressure, temperature, air[:, 1])
        return cls(time, *columns)._of(~np.isnan(air[:, 0] + pitch + yaw))

    def pieces(self, gap_s: float) -> list[Flown]:
        """The parts between silences that are longer than `gap_s`."""
        ends = np.flatnonzero(np.diff(self.time) > gap_s * 1e9) + 1
        return [self._of(rows) for rows in np.split(np.arange(len(self.time)), ends)]

    def _of(self, rows: NDArray[Any]) -> Flown:
        """Some of the rows."""
        return Flown(*(getattr(self, one.name)[rows] for one in fields(self)))


def _at(time: Times, known_at: Times, known: Floats) -> Floats:
    """A column at other times, linearly; times count from the first, so that they fit a float."""
    measured = ~np.isnan(known)
    if not measured.any():
        return np.full(len(time), NOTHING)
    at_s, known_s = (time - known_at[0]) * 1e-9, (known_at[measured] - known_at[0]) * 1e-9
    return np.asarray(np.interp(at_s, known_s, known[measured]))


def _nearest(time: Times, known_at: Times) -> NDArray[np.intp]:
    after = np.clip(np.searchsorted(known_at, time), 1, len(known_at) - 1)
    return after - (time - known_at[after - 1] < known_at[after] - time)
