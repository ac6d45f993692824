"""What vehicles tell of their own motion, in columns: what dead reckoning reads of the last seconds.

Times are ns since 1970 UTC. What is told comes in any order and in any portions: a series is sorted by time and value, so that
it is the same whatever came first.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gateway.observation import AirData, Attitude, ImuSample, Many, Observation, VehicleStatus
from gateway.reckon.kinds import HULLS, ROTORS, WHEELS, WINGS, By

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

INERTIAL, ATTITUDE, AIRSPEED, ALTITUDE, HEADING, RESTING = range(6)
# Force, rate, sensor; quaternion; indicated airspeed; altitude above mean sea level; heading; rest.
WIDTHS = (7, 4, 1, 1, 1, 1)
MOVES, ON_GROUND, DISARMED = 0.0, 1.0, 2.0  # what a vehicle says of its rest
PLACE = 9  # latitude, longitude, height; velocity north, east, down; sigmas level, upright, of the velocity


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Values (n, k) and when each was so (n,), in order."""

    at: Ints
    values: Floats

    @classmethod
    def empty(cls, width: int) -> Series:
        """Nothing yet."""
        return cls(np.empty(0, np.int64), np.empty((0, width)))

    def with_more(self, more: Series) -> Series:
        """The same with what came since, each in its place."""
        if not len(more.at):
            return self
        first = int(np.searchsorted(self.at, more.at.min()))  # what is older stays where it is
        at, values = np.concatenate([self.at[first:], more.at]), np.concatenate([self.values[first:], more.values])
        if not (at[1:] > at[:-1]).all():
            order = np.lexsort((*values.T[::-1], at))
            at, values = at[order], values[order]
        return Series(np.concatenate([self.at[:first], at]), np.concatenate([self.values[:first], values]))

    def since(self, at: int) -> Series:
        """What was so at an instant, or later."""
        first = int(np.searchsorted(self.at, at))
        return self if not first else Series(self.at[first:], self.values[first:])

    def between(self, first: int, end: int) -> tuple[int, int]:
        """The rows from an instant on up to another."""
        begin, over = np.searchsorted(self.at, (first, end))
        return int(begin), int(over)


Portion = Mapping[str, Mapping[int, Series]]
"""What some aircraft told: by aircraft, by kind."""


@dataclass(frozen=True, slots=True, eq=False)
class Told:
    """What one vehicle told lately, by kind; and its positions, those that the picture had of it included."""

    series: tuple[Series, ...] = tuple(Series.empty(width) for width in WIDTHS)
    places: Series = Series.empty(PLACE)
    pictured: Series = Series.empty(PLACE)  # where the radar had it
    noise: Floats | None = None  # (6,) of force and rate in a root Hz, where no unit told these; None: one did
    by: By = By.UNIT

    def with_more(self, told: Mapping[int, Series]) -> Told:
        """The same with what came since."""
        series = tuple(one.with_more(told[kind]) if kind in told else one for kind, one in enumerate(self.series))
        return replace(self, series=series)

    def since(self, at: int) -> Told:
        """The same without what was before an instant."""
        series = tuple(one.since(at) for one in self.series)
        return replace(self, series=series, places=self.places.since(at), pictured=self.pictured.since(at))

    @property
    def inertial(self) -> Series:
        """Specific force and angular rate (n, 6) of the unit with the lowest number."""
        whole = self.series[INERTIAL]
        if not len(whole.at):
            return whole
        sensors = whole.values[:, 6]
        lowest = sensors == sensors.min()
        return whole if lowest.all() else Series(whole.at[lowest], whole.values[lowest])


def reads(observation: Observation) -> bool:
    """Whether dead reckoning reads this."""
    if isinstance(observation, Many):
        return observation.kind is ImuSample or "airspeed_mps" in observation.columns
    if isinstance(observation, AirData):
        told = observation.airspeed_mps, observation.altitude_msl_m, observation.compass_heading_rad
        return any(one is not None for one in told)
    return isinstance(observation, ImuSample | Attitude | VehicleStatus)


def before(observations: Iterable[Observation], until: int) -> tuple[list[Observation], list[Observation]]:
    """Those observations, or the parts of them, that were received before a stamp; and those that came then or later."""
    earlier, later = list[Observation](), list[Observation]()
    for one in observations:
        if isinstance(one, Many):
            is_now = one.columns["received_at"] < until
            if is_now.all():
                earlier.append(one)
            else:
                earlier.append(_rows(one, is_now))
                later.append(_rows(one, ~is_now))
        else:
            (earlier if one.received_at < until else later).append(one)
    return earlier, later


def carrying(vehicle_type: int | None) -> tuple[int, ...]:
    """What carries vehicles of a type on, any of these."""
    return (INERTIAL, *(kind for kind, types in _CARRIES.items() if vehicle_type in types))


_CARRIES = {AIRSPEED: WINGS, ATTITUDE: ROTORS | WHEELS | HULLS, HEADING: WHEELS | HULLS}
_COLUMNS = {AIRSPEED: "airspeed_mps", ALTITUDE: "altitude_msl_m", HEADING: "compass_heading_rad"}


def tells_motion(observations: Iterable[Observation], types: Mapping[str, int]) -> set[str]:
    """Who tells what vehicles like it can be carried on by; `types`: their MAV_TYPE."""
    names = set[str]()
    for one in observations:
        if isinstance(one, Many):
            if one.kind is ImuSample:
                if one.columns.keys() >= _UNIT:
                    names.update(one.columns["aircraft"].tolist())
                continue
            for kind in (AIRSPEED, HEADING):
                if (values := one.columns.get(_COLUMNS[kind])) is not None:
                    told = one.columns["aircraft"][~np.isnan(values)].tolist()
                    names.update(name for name in told if types.get(name) in _CARRIES[kind])
        elif isinstance(one, ImuSample | Attitude | AirData):
            said = (kind for kind, _ in _of_one(one))
            if any(kind == INERTIAL or types.get(one.aircraft) in _CARRIES.get(kind, ()) for kind in said):
                names.add(one.aircraft)
    return names


_UNIT = {"acceleration_mps2", "angular_rate_radps"}
_READ = _UNIT | {"aircraft", "valid_at", "sensor", *_COLUMNS.values()}


def by_share(observations: Iterable[Observation], shares: Mapping[str, int]) -> dict[int, list[Observation]]:
    """What is told of the aircraft of each share, by its number; without what is told of others."""
    found: defaultdict[int, list[Observation]] = defaultdict(list)
    for one in observations:
        if isinstance(one, Many):
            numbers = [shares.get(name, -1) for name in one.columns["aircraft"].tolist()]
            several = set(numbers)
            for share in several - {-1}:
                found[share].append(one if len(several) == 1 else _rows(one, np.array(numbers) == share))
        elif isinstance(one, ImuSample | Attitude | AirData | VehicleStatus) and one.aircraft in shares:
            found[shares[one.aircraft]].append(one)
    return found


def _rows(many: Many, which: NDArray[np.bool_]) -> Many:
    return Many(many.kind, {name: column[which] for name, column in many.columns.items()})


def portioned(observations: Iterable[Observation]) -> Portion:
    """What observations tell, by aircraft."""
    rows: defaultdict[tuple[str, int], list[tuple[int, tuple[float, ...]]]] = defaultdict(list)
    parts: defaultdict[tuple[str, int], list[Series]] = defaultdict(list)
    manys: defaultdict[tuple[type, frozenset[str]], list[Many]] = defaultdict(list)
    for one in observations:
        if isinstance(one, Many):
            manys[one.kind, frozenset(one.columns)].append(one)
        elif isinstance(one, ImuSample | Attitude | AirData | VehicleStatus):
            for kind, values in _of_one(one):
                rows[one.aircraft, kind].append((one.valid_at, values))
    for (of, names), several in manys.items():
        columns = {name: np.concatenate([one.columns[name] for one in several]) for name in names & _READ}
        for key, series in _of_many(Many(of, columns)):
            parts[key].append(series)
    for (aircraft, kind), told in rows.items():
        when = np.array([at for at, _ in told], np.int64)
        parts[aircraft, kind].append(Series(when, np.array([values for _, values in told], np.float64)))
    portion: defaultdict[str, dict[int, Series]] = defaultdict(dict)
    for (aircraft, kind), pieces in parts.items():
        whole = Series.empty(WIDTHS[kind])
        at, joined = np.concatenate([one.at for one in pieces]), np.concatenate([one.values for one in pieces])
        portion[aircraft][kind] = whole.with_more(Series(at, joined))
    return portion


def _of_one(one: ImuSample | Attitude | AirData | VehicleStatus) -> Sequence[tuple[int, tuple[float, ...]]]:
    if isinstance(one, ImuSample):
        if one.acceleration_mps2 is None or one.angular_rate_radps is None:
            return ()
        return ((INERTIAL, (*one.acceleration_mps2, *one.angular_rate_radps, float(one.sensor))),)
    if isinstance(one, Attitude):
        return ((ATTITUDE, _quaternion(one)),)
    if isinstance(one, VehicleStatus):
        rests = DISARMED if not one.armed else ON_GROUND if one.landed == "on ground" else MOVES
        return ((RESTING, (rests,)),)
    told = ((AIRSPEED, one.airspeed_mps), (ALTITUDE, one.altitude_msl_m), (HEADING, one.compass_heading_rad))
    return tuple((kind, (value,)) for kind, value in told if value is not None)


def _quaternion(one: Attitude) -> tuple[float, ...]:
    """As `inertial.from_angles`: one by one, since what is told in other portions must be the same, and without arrays, which
    take ten times as long for one.
    """
    halves = 0.5 * one.roll_rad, 0.5 * one.pitch_rad, 0.5 * one.yaw_rad
    (sr, sp, sy), (cr, cp, cy) = map(math.sin, halves), map(math.cos, halves)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def _of_many(many: Many) -> Iterable[tuple[tuple[str, int], Series]]:
    """What columns tell, aircraft by aircraft."""
    columns = many.columns
    wanted: list[tuple[int, Floats]] = []
    if many.kind is ImuSample:
        if columns.keys() >= _UNIT:
            sensor = columns["sensor"].astype(np.float64)[:, None]
            wanted.append((INERTIAL, np.hstack([columns["acceleration_mps2"], columns["angular_rate_radps"], sensor])))
    else:
        wanted += [(kind, columns[name][:, None]) for kind, name in _COLUMNS.items() if name in columns]
    if not wanted or not len(many):
        return
    by_aircraft: defaultdict[str, list[int]] = defaultdict(list)
    for row, name in enumerate(columns["aircraft"].tolist()):
        by_aircraft[name].append(row)
    for aircraft, members in by_aircraft.items():
        rows = np.array(members)
        for kind, values in wanted:
            mine = values[rows]
            known = ~np.isnan(mine).any(axis=1)
            if known.any():
                yield (aircraft, kind), Series(columns["valid_at"][rows][known], mine[known])


def true_airspeed_mps(indicated_mps: Floats, height_m: Floats) -> Floats:
    """What an indicated airspeed is at a height in the standard atmosphere."""
    thinner = np.clip(1.0 - 2.255_77e-5 * height_m, 0.2, 1.2) ** 4.2559
    return np.asarray(indicated_mps / np.sqrt(thinner))
