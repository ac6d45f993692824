"""Scenes: TOML files, those that are shipped and those that people write."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

from gateway.settings import Site, SiteError
from sim.overrides import OverrideError, SceneParameters
from sim.scene import Scene
from sim.scenes.reading import parse_scene, read_scene
from sim.scenes.script import Script
from sim.scenes.staging import stage

_SHIPPED = Path(__file__).parent
_MISSIONS = (".plan", ".waypoints")
_FLIGHT = """\
[scene]
description = {description}

[wind]
speed_mps = 4.0
from_deg = 0.0
gust_sigma_mps = 0.8

[gps]
period_s = 0.5
sigma_m = 1.5
error_east_m = 0.0
error_north_m = 0.0
error_up_m = 0.0
velocity_sigma_mps = 0.2
latency_low_s = 0.05
latency_high_s = 0.2

[[vehicle]]
kind = "aeroplane"
route = {file}
autopilot = true
"""


def scenes_in(folder: Path) -> tuple[Path, ...]:
    """The scene files of a folder: every .toml that has a table [scene]."""
    files = (path for path in sorted(folder.glob("*.toml")) if path.is_file())
    return tuple(path for path in files if "[scene]" in path.read_text("utf-8", "replace"))


def scene_names() -> tuple[str, ...]:
    """The names of the scenes that are shipped."""
    return tuple(path.stem for path in scenes_in(_SHIPPED))


def find_scene(name: str) -> Script:
    """A scene by its name, or by its file; of a mission file: an aeroplane that flies it by itself.

    Raises SiteError (one plain sentence) for an unknown name and for what is wrong in the file.
    """
    shipped = _SHIPPED / f"{name}.toml"
    if name in scene_names():
        return read_scene(shipped)
    if name.endswith(_MISSIONS):
        return _flight(Path(name))
    if name.endswith(".toml") or "/" in name:
        return read_scene(Path(name))
    near = get_close_matches(name, scene_names(), n=1)
    meant = f"perhaps {near[0]} is meant" if near else f"there are {', '.join(scene_names())}"
    raise SiteError(f"There is no scene {name!r}; {meant}. A file of your own is named with its ending, {name}.toml.")


def _flight(mission: Path) -> Script:
    if not mission.is_file():
        raise SiteError(f"{mission} cannot be read (no such file).")
    text = _FLIGHT.format(
        description=json.dumps(f"{mission.name}, flown by an autopilot."), file=json.dumps(mission.name)
    )
    return parse_scene(text, str(mission), mission.parent, mission.stem)


def build_scene(
    name: str,
    *,
    start_ns: int,
    site: Site | None = None,
    seed: int | None = None,
    changes: Iterable[str] = (),
    keys: Mapping[int, bytes] | None = None,
) -> Scene:
    """`stage` of the scene of a name or file. Raises OverrideError, SiteError: one plain sentence."""
    return stage(find_scene(name), start_ns=start_ns, site=site, seed=seed, changes=changes, keys=keys)


__all__ = [
    "OverrideError",
    "SceneParameters",
    "Script",
    "build_scene",
    "find_scene",
    "parse_scene",
    "read_scene",
    "scene_names",
    "scenes_in",
    "stage",
]
