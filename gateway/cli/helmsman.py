"""`talkdown simulate helmsman`: a ship's autopilot in a process of its own, which steers a ship over MAVLink."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from gateway.cli import options as take
from gateway.cli.failures import UsageError, sending

if TYPE_CHECKING:
    from sim.ships.helmsman import Helmsman

_SETTINGS = ("autopilot", "track", "waves_deg")


def steer_a_ship(url: str, settings: list[str], quiet: bool) -> None:
    """Steer the ship on a link along her mission, until she has arrived or Ctrl-C. Raises UsageError, RunError."""
    from gateway.runtime.links import open_link
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import MAVLINK_PORT, LinkError
    from sim.ships.linked import steer

    helmsman = _helmsman(settings)
    (where,) = take.read_urls([url], MAVLINK_PORT)
    try:
        link = open_link(where, is_drained=False)
    except LinkError as error:
        raise UsageError(str(error)) from error
    if not quiet:
        print(f"waiting for a ship on {where}; Ctrl-C ends.", flush=True)
    tell = (lambda text: None) if quiet else (lambda text: print(text, file=sys.stderr, flush=True))
    try:
        with sending(), StopSignals() as stop:
            steer(link, helmsman, asked_to_stop=stop, tell=tell)
    finally:
        link.close()


def _helmsman(settings: list[str]) -> Helmsman:
    """An autopilot as asked for. Raises UsageError."""
    import math

    from sim.ships.autopilots import KINDS, build_autopilot
    from sim.ships.helmsman import Helmsman
    from sim.ships.hull import Hull
    from sim.ships.track_control import LAWS, TrackControl
    from sim.ships.voyage import STEP_S
    from sim.ships.waves import Waves

    said = dict(zip(_SETTINGS, ("pid", "course", "0"), strict=True))
    for setting in settings:
        key, _, value = setting.partition("=")
        if key not in said:
            raise UsageError(f"--set {setting!r}: a helmsman has {', '.join(_SETTINGS)}.")
        said[key] = value
    for key, allowed in (("autopilot", KINDS), ("track", LAWS)):
        if said[key] not in allowed:
            raise UsageError(f"--set {key}={said[key]}: must be one of {', '.join(allowed)}.")
    try:
        sigma_deg = float(said["waves_deg"])
    except ValueError:
        sigma_deg = -1.0
    if not 0.0 <= sigma_deg <= 20.0:
        raise UsageError(f"--set waves_deg={said['waves_deg']}: must be 0 to 20 degrees of yawing; 0 is no filter.")
    sea = Waves(sigma_rad=math.radians(sigma_deg)) if sigma_deg else None
    return Helmsman(build_autopilot(said["autopilot"], Hull(), sea, STEP_S), TrackControl(said["track"]))
