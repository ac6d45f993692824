"""The scenes that can be asked for by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from gateway.settings import DEMO_SITE, Site
from sim.overrides import OverrideError, SceneParameters, override
from sim.scene import Scene
from sim.scenes.approach import approach, approach_parameters, landing, landing_parameters
from sim.scenes.conflicts import conflicts, conflicts_parameters
from sim.scenes.placement import as_the_site_says
from sim.scenes.traffic import traffic, traffic_parameters

RESERVED = "radar"  # `simulate radar` is the radar that watches a recording or a link

Build = Callable[[Site, SceneParameters, int, int], Scene]


@dataclass(frozen=True, slots=True)
class SceneKind:
    """A scene by name: what it shows, what can be set and what it is set to, and how it is built.

    `build(site, parameters, seed, start_ns)`.
    """

    says: str
    parameters: SceneParameters
    build: Build


SCENES: Mapping[str, SceneKind] = {
    "approach": SceneKind("one aircraft on 003's approach, 457 s", approach_parameters(), approach),
    "landing": SceneKind("the same approach flown to this runway, down to a standstill", landing_parameters(), landing),
    "traffic": SceneKind("many aircraft: arrivals, crossings, go-arounds, holdings", traffic_parameters(), traffic),
    "conflicts": SceneKind("twenty pairs that lose their separation", conflicts_parameters(), conflicts),
}


def build_scene(
    name: str,
    *,
    start_ns: int,
    site: Site = DEMO_SITE,
    seed: int = 0,
    changes: Iterable[str] = (),
    keys: Mapping[int, bytes] | None = None,
) -> Scene:
    """The scene of a name at a site, with changes such as "gps.period_s=1".

    `start_ns` is the session's beginning, ns since 1970 UTC; `keys` are those that radars sign with, by number.
    Raises OverrideError (one plain sentence) for an unknown scene or a change that cannot be made.
    """
    kind = SCENES.get(name)
    if kind is None:
        raise OverrideError(f"There is no scene {name!r}; there are {', '.join(SCENES)}.")
    parameters = override(as_the_site_says(kind.parameters, site), changes)
    scene = kind.build(site, parameters, seed, start_ns)
    keyed = [replace(radar, key=(keys or {}).get(radar.site.number)) for radar in scene.radars]
    return replace(scene, radars=tuple(keyed))


__all__ = ["RESERVED", "SCENES", "OverrideError", "SceneKind", "SceneParameters", "build_scene"]
