"""Colours, line widths and units of the scene, each in one place."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.settings import Site
from gateway.settings.tables import FOOT_M

Colour = tuple[int, int, int] | tuple[int, int, int, int]

# The three tracks of paper 003's figure 6.
GPS: Colour = (255, 150, 30)
RADAR: Colour = (60, 140, 255)
UNNUMBERED: Colour = (45, 75, 115)  # plots that the radar did not number: dim, what a track takes of them stands out
FUSED: Colour = (235, 50, 50)
SMOOTHED: Colour = (90, 235, 235)  # what later measurements made of it

TRUTH: Colour = (150, 150, 150)
PREDICTED: Colour = (255, 140, 160)
CANDIDATE: Colour = (255, 190, 205)
CONFLICT: Colour = (255, 60, 220)
ALERT: Colour = (255, 60, 220)
PLAN: Colour = (150, 190, 120)
NEXT: Colour = (190, 255, 120)
JOINED: Colour = (255, 230, 80)
TEXT: Colour = (235, 235, 235)

RUNWAY: Colour = (225, 225, 225)
MARK: Colour = (200, 235, 210)  # texts stand on dark grey or, in the viewer's light theme, on middle grey
ANTENNA: Colour = (165, 205, 255)
CENTRELINE: Colour = (120, 160, 130)
GLIDE_PATH: Colour = (70, 200, 120)
COVERAGE: Colour = (45, 80, 130)
DECISION: Colour = (255, 230, 80)

TENTATIVE: Colour = (130, 70, 70)  # a fused track that may be nothing: dim
COASTING: Colour = (200, 110, 110)

STATES: dict[str, Colour] = {
    "gps only": GPS,
    "radar only": RADAR,
    "fused": FUSED,
    "coasting": (130, 130, 130),
    "ended": (60, 60, 60),
}
LIVES: dict[str, Colour] = {"tentative": TENTATIVE, "confirmed": FUSED, "coasting": COASTING}
AXES: tuple[Colour, Colour, Colour] = ((235, 110, 90), (110, 200, 110), (110, 150, 240))  # as everywhere: x, y, z
HORIZONTAL: Colour = (190, 120, 255)
VERTICAL: Colour = (70, 200, 190)
RADARS: tuple[tuple[str, Colour], ...] = (  # where several are beside each other
    ("blue", RADAR),
    ("green", (90, 215, 150)),
    ("violet", (200, 130, 255)),
    ("yellow", (255, 205, 90)),
)


def radar_colour(radar: int) -> Colour:
    """A radar's, where several are beside each other."""
    return RADARS[(radar - 1) % len(RADARS)][1]


def radar_colour_name(radar: int) -> str:
    """What people call it."""
    return RADARS[(radar - 1) % len(RADARS)][0]


def points(size: float) -> float:
    """A radius that stays the same on the screen at every zoom, in UI points."""
    return -size


@dataclass(frozen=True, slots=True)
class Units:
    """What labels and plots speak: the name of each unit, and how many of it are in the SI unit."""

    length: str = "m"
    lengths: float = 1.0
    distance: str = "km"
    distances: float = 1e-3
    speed: str = "m/s"
    speeds: float = 1.0
    climb: str = "m/s"
    climbs: float = 1.0
    tick_m: float = 10_000.0  # between marks on the extended centreline
    ticks: int = 5


SI = Units()
AVIATION = Units(
    length="ft",
    lengths=1.0 / FOOT_M,
    distance="NM",
    distances=1.0 / 1852.0,
    speed="kn",
    speeds=3600.0 / 1852.0,
    climb="ft/min",
    climbs=60.0 / FOOT_M,
    tick_m=5.0 * 1852.0,
    ticks=5,
)


def units_of(site: Site) -> Units:
    """The units that a site file asked for."""
    return AVIATION if site.units == "aviation" else SI
