"""Aircraft that are drawn by chance: each scheme is a table of a scene file, [traffic] or [conflicts]."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.settings import Site
from sim.routes import RoutePath
from sim.scenes.conflicts import conflicts
from sim.scenes.traffic import traffic

Scheme = Callable[[Site, int, float, int], list[tuple[str, RoutePath]]]

SCHEMES: Mapping[str, Scheme] = {"traffic": traffic, "conflicts": conflicts}  # site, how many, duration s, seed
