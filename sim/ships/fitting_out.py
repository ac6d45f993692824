"""A ship fitted out: hull, autopilot, track control and sea by their names, put together into a `Vessel`."""

from __future__ import annotations

from adapters.mission_writing import MissionItem
from sim.sensors import stream
from sim.ships.autopilots import build_autopilot
from sim.ships.hull import Hull, Weather
from sim.ships.track_control import TrackControl
from sim.ships.vessel import Vessel
from sim.ships.voyage import STEP_S
from sim.ships.waves import Waves
from sim.vehicles.flying import with_home
from sim.vehicles.missions import Mission
from sim.vehicles.motion import Home


def vessel(
    home: Home,
    items: tuple[MissionItem, ...] = (),
    *,
    hull: Hull | None = None,
    autopilot: str = "pid",
    law: str = "course",
    weather: Weather | None = None,
    waves: Waves | None = None,
    seed: int = 0,
    system: int = 1,
) -> Vessel:
    """A ship that lies stopped at home with a mission (`items`, without home) and waits to be armed.

    `autopilot` is one of `autopilots.KINDS`, `law` one of `track_control.LAWS`. Raises ValueError for another.
    """
    hull = hull or Hull()
    return Vessel(
        home,
        hull,
        build_autopilot(autopilot, hull, waves, STEP_S),
        Mission(with_home(home, items)),
        weather or Weather(),
        waves,
        stream(seed, "sea", system),
        TrackControl(law),
    )
