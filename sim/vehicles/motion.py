"""What a simulated vehicle is to everybody else: it is stepped, says how it moves, where its mission stands, and takes orders.

Whoever builds another kind of vehicle (a ship) gives it the attributes and methods of `Vehicle`; then it speaks MAVLink
(`speaker`), can be flown interactively (`talkdown simulate vehicle`) and recorded into a scene (`way`).

One vehicle is a few dozen floats and is stepped as such, fifty times a second: as arrays over vehicles a single one would take
many times as long, and of a hundred most of the time is encoding what they say (docs/simulated-vehicles.md has the figures).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

from sim.vehicles.missions import Mission

Vector = tuple[float, float, float]


class Moment(NamedTuple):
    """The truth about a vehicle at one instant.

    Attitude: roll right wing down, pitch nose up, yaw clockwise from north. Rates and specific force are means over the step
    that ended now, along the body (forward, right, down): those of which strapdown navigation makes exactly this way.
    """

    time_s: float  # since the vehicle was switched on
    latitude_rad: float
    longitude_rad: float
    height_m: float  # above the ellipsoid
    velocity_mps: Vector  # north, east, down, over the ground
    attitude_rad: Vector  # roll, pitch, yaw
    rate_radps: Vector
    force_mps2: Vector
    airspeed_mps: float | None  # None: nothing measures it
    wind_mps: Vector  # north, east, down: where to the air moves
    throttle: float  # 0 to 1


class Progress(NamedTuple):
    """Where the guidance stands. All None where there is nothing to go to."""

    distance_m: float | None = None  # to the place it goes to, level
    bearing_rad: float | None = None  # of that place
    cross_track_m: float | None = None  # to the right of the wanted way
    height_error_m: float | None = None  # wanted less actual
    speed_error_mps: float | None = None  # wanted less actual


class Arm(NamedTuple):
    """Switch the motors on or off. Off is refused in the air unless forced."""

    is_armed: bool
    is_forced: bool = False


class SetMode(NamedTuple):
    """Change the mode, by its name among the vehicle's `modes`."""

    name: str


class TakeOff(NamedTuple):
    """Leave the ground and climb to a height above home, m."""

    height_m: float


class GoTo(NamedTuple):
    """Go to a place and stay there. Height above the ellipsoid, m; None: as now. Radius of a circle, positive to the right."""

    latitude_rad: float
    longitude_rad: float
    height_m: float | None = None
    radius_m: float | None = None


class GoAround(NamedTuple):
    """Break off the landing, climb to a height above the place of landing, and try again; None: its own."""

    height_m: float | None = None


class ChangeSpeed(NamedTuple):
    """Another cruising speed, m/s, through the air (aeroplanes) or over the ground."""

    speed_mps: float


class GoToItem(NamedTuple):
    """Go on with this item of the mission."""

    number: int


Order = Arm | SetMode | TakeOff | GoTo | GoAround | ChangeSpeed | GoToItem


class Answer(NamedTuple):
    """What comes of an order; `why` is a short sentence for the pilot, empty where there is nothing to say."""

    result: Literal["accepted", "denied", "unsupported"] = "accepted"
    why: str = ""


@dataclass(frozen=True, slots=True)
class Home:
    """Where a vehicle stands when it is switched on, which way it points, and the geoid's height above the ellipsoid there."""

    latitude_rad: float
    longitude_rad: float
    height_m: float  # above the ellipsoid
    heading_rad: float = 0.0
    geoid_separation_m: float = 0.0

    @property
    def altitude_msl_m(self) -> float:
        """Above mean sea level."""
        return self.height_m - self.geoid_separation_m


class Vehicle(Protocol):
    """A vehicle that moves by itself, step by step. The same seed, orders and steps give the same bits."""

    @property
    def kind(self) -> int:
        """MAV_TYPE."""

    @property
    def modes(self) -> Mapping[str, int]:
        """ArduPilot's number of each mode that it has."""

    @property
    def step_s(self) -> float:
        """How far `step` goes."""

    @property
    def home(self) -> Home:
        """Where it was switched on."""

    @property
    def mission(self) -> Mission:
        """What it is to do."""

    @property
    def mode(self) -> str:
        """The mode it is in, one of `modes`."""

    @property
    def is_armed(self) -> bool:
        """Whether its motors may run."""

    @property
    def moment(self) -> Moment:
        """The truth now."""

    @property
    def settings(self) -> dict[str, float]:
        """Its parameters by ArduPilot's names; stations may set them."""

    @property
    def notes(self) -> list[str]:
        """Short sentences for people, as they come up; it only grows."""

    @property
    def is_landed(self) -> bool:
        """Whether it stands on the ground; for a ship always."""

    @property
    def progress(self) -> Progress:
        """Where its guidance stands."""

    def step(self) -> Moment:
        """One step further; the new `moment`."""

    def order(self, order: Order) -> Answer:
        """Do as told, from the next step on."""
