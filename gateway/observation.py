"""What sensors said, in their own coordinates, never corrected.

Every observation has `valid_at` (when it was so, by its source's clock) and `received_at` (when we heard), both ns since
1970 UTC. Not measured is None.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from numpy.typing import NDArray

from gateway.frozen import made_swiftly
from gateway.settings import Weather


class Timing(Enum):
    """How far an observation's `valid_at` can be trusted, and so what it may be fused with."""

    UTC = "utc"  # the source's own UTC, or a radar's header time
    ENVELOPE = "envelope"  # no UTC for 15 s: lower envelope of (received - boot); fused, with this said
    PROVISIONAL = "provisional"  # no UTC yet: shown, not fused with others
    FOREIGN = "foreign"  # more than 5 s from the session's time: shown, not fused, named


@made_swiftly
@dataclass(frozen=True, slots=True)
class GpsReport:
    """A position that an aircraft reported of itself.

    Altitude above mean sea level, height above the ellipsoid, or both. Sigmas are None when the stream gives none.
    """

    aircraft: str
    valid_at: int
    received_at: int
    latitude_rad: float
    longitude_rad: float
    altitude_msl_m: float | None = None
    height_m: float | None = None
    velocity_east_mps: float | None = None
    velocity_north_mps: float | None = None
    velocity_up_mps: float | None = None
    horizontal_sigma_m: float | None = None
    vertical_sigma_m: float | None = None
    velocity_sigma_mps: float | None = None
    compass_heading_rad: float | None = None  # where the nose points, clockwise from true north
    timing: Timing = Timing.UTC
    pressure_altitude_m: float | None = (
        None  # above the 1013.25 hPa surface (or a QNH's): never mixed with the other two
    )
    timing_sigma_s: float = (
        0.0  # of `valid_at`, where it was told in coarse steps (tslc of ADSB_VEHICLE: whole seconds)
    )
    callsign: str | None = None


@made_swiftly
@dataclass(frozen=True, slots=True)
class RadarPlot:
    """One detection of a radar, in its own frame; any component may be missing. Track number 0: not tracked by the radar."""

    radar: int
    track_number: int
    valid_at: int
    received_at: int
    range_m: float | None = None
    azimuth_rad: float | None = None
    elevation_rad: float | None = None
    radial_velocity_mps: float | None = None  # positive: receding
    snr_db: float | None = None
    range_sigma_m: float | None = None
    azimuth_sigma_rad: float | None = None
    elevation_sigma_rad: float | None = None
    simulated: bool = False
    timing: Timing = Timing.UTC


@made_swiftly
@dataclass(frozen=True, slots=True)
class RadarStatus:
    """What a radar says of itself."""

    radar: int
    valid_at: int
    received_at: int
    state: str  # "off", "standby", "operating", "fault"
    mode: str  # "search", "precision approach"
    update_period_s: float
    latitude_rad: float
    longitude_rad: float
    height_m: float
    compass_boresight_rad: float


@made_swiftly
@dataclass(frozen=True, slots=True)
class Attitude:
    """Roll, pitch, yaw (yaw clockwise from true north; pitch nose up; roll right wing down)."""

    aircraft: str
    valid_at: int
    received_at: int
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


@made_swiftly
@dataclass(frozen=True, slots=True)
class ImuSample:
    """One sample of an inertial unit, along the body's axes: x forward, y right, z down. Sensors count from 1."""

    aircraft: str
    valid_at: int
    received_at: int
    sensor: int
    acceleration_mps2: tuple[float, float, float] | None = None  # specific force: at rest (0, 0, -9.81)
    angular_rate_radps: tuple[float, float, float] | None = None
    magnetic_field_gauss: tuple[float, float, float] | None = None


@made_swiftly
@dataclass(frozen=True, slots=True)
class AirData:
    """What a vehicle says of the air: speeds, pressures, and the wind it has estimated (where the air moves TO)."""

    aircraft: str
    valid_at: int
    received_at: int
    airspeed_mps: float | None = None
    groundspeed_mps: float | None = None
    climb_mps: float | None = None
    altitude_msl_m: float | None = None
    static_pressure_pa: float | None = None
    differential_pressure_pa: float | None = None
    temperature_k: float | None = None
    wind_east_mps: float | None = None
    wind_north_mps: float | None = None
    wind_up_mps: float | None = None
    compass_heading_rad: float | None = None  # where the nose points, clockwise from true north


AEROPLANES = frozenset((1, *range(19, 26)))  # MAV_TYPE: fixed wing, and those that take off upright
COPTERS = frozenset((2, 3, 4, 13, 14, 15, 29, 35))


@made_swiftly
@dataclass(frozen=True, slots=True)
class VehicleStatus:
    """What a vehicle says of itself: its kind, whether it is armed, its mode as a number of its autopilot."""

    aircraft: str
    valid_at: int
    received_at: int
    vehicle_type: int
    autopilot: int
    armed: bool
    custom_mode: int
    landed: str | None = None  # "on ground", "in air", "taking off", "landing"; None where it does not say


@made_swiftly
@dataclass(frozen=True, slots=True)
class FlightPlan:
    """Points that a vehicle has said, or was told, that it will pass; home comes as the sequence number 0."""

    aircraft: str
    valid_at: int
    received_at: int
    points: tuple[PlanPoint, ...]


@made_swiftly
@dataclass(frozen=True, slots=True)
class PlanPoint:
    """One point of a flight plan. The altitude is above mean sea level when `altitude_msl_m`, else above home.

    A point of kind "loiter" is flown round at `radius_m`, positive to the right, for at least so many `turns`. Home has its own
    altitude above mean sea level, and above home and round it those at which the vehicle circles when it has returned.
    """

    sequence: int
    kind: str  # "home", "waypoint", "loiter", "take-off", "landing", "other"
    latitude_rad: float
    longitude_rad: float
    altitude_msl_m: float | None = None
    altitude_above_home_m: float | None = None
    radius_m: float | None = None
    turns: float | None = None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Intent:
    """Where a vehicle goes next, as it says or a person does: a point, an item of its plan with this number, or a known name.

    With none of them what the same teller said before is withdrawn.
    """

    aircraft: str
    valid_at: int
    received_at: int
    told_by: str  # "declared" (by a person), "utm", "mission", "high latency"
    sequence: int | None = None
    latitude_rad: float | None = None
    longitude_rad: float | None = None
    altitude_msl_m: float | None = None
    height_m: float | None = None
    name: str | None = None  # of a published point, or "runway", "go-around", "home"


@made_swiftly
@dataclass(frozen=True, slots=True)
class WeatherArea:
    """An area to avoid, as a person told it while the session ran; None: the one of this name is gone."""

    name: str
    valid_at: int
    received_at: int
    area: Weather | None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Truth:
    """Where a simulator says the aircraft really is. Archived, drawn and scored against; never reaches a stage."""

    aircraft: str
    valid_at: int
    received_at: int
    latitude_rad: float
    longitude_rad: float
    altitude_msl_m: float | None = None
    height_m: float | None = None
    velocity_east_mps: float | None = None
    velocity_north_mps: float | None = None
    velocity_up_mps: float | None = None
    mode: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Many:
    """Observations of one kind in columns, where tens of thousands a second come that no stage reads.

    Read one by one they are what they are. `columns`: by field, an element for each, and three for a vector; NaN = not
    measured; a field that none of them has is left out.
    """

    kind: type[ImuSample | AirData]
    columns: Mapping[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.columns["valid_at"])

    def __iter__(self) -> Iterator[ImuSample | AirData]:
        told = [map(_told, column.tolist()) for column in self.columns.values()]
        for values in zip(*told, strict=True):
            yield self.kind(**dict(zip(self.columns, values, strict=True)))


def _told(value: Any) -> Any:
    """A value of a column as an observation holds it."""
    if isinstance(value, list):
        return None if math.isnan(value[0]) else tuple(value)
    return None if isinstance(value, float) and math.isnan(value) else value


_Said = VehicleStatus | FlightPlan | Intent | WeatherArea | Truth
Observation = GpsReport | RadarPlot | RadarStatus | Attitude | ImuSample | AirData | Many | _Said


def how_many(observation: Observation) -> int:
    """How many observations it is."""
    return len(observation) if isinstance(observation, Many) else 1


@made_swiftly
@dataclass(frozen=True, slots=True)
class Heard:
    """One arrival, decoded: the unit of work of the pipeline.

    `now` is the session's time of the arrival: its stamp plus the session's epoch offset. A Heard without observations is
    the receiver's watermark: nothing that was stamped at or before `now` is still to come. `notes` are what the decoder
    found worth telling a person once, as (level, text); they become the picture's events.
    """

    now: int
    observations: tuple[Observation, ...] = ()
    notes: tuple[tuple[str, str], ...] = ()
