"""Dead reckoning: how sure it is of each vehicle, /fuse/reckoned/sigma, and how far what goes on without positions is from
those that are muted, /fuse/reckoned/muted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from gateway.picture import Picture
from gateway.sinks.scene.entry import Entry, entity
from gateway.sinks.scene.lately import Lately
from gateway.sinks.scene.samples import Sample, plotted

_WHATS = ("track", "dead reckoning", "constant velocity")


class ReckoningScene:
    """Draws dead reckoning once a second of each vehicle that has it."""

    def __init__(self) -> None:
        self._named: Lately[str] = Lately()

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        samples = []
        for picture in pictures:
            for one in picture.reckoned:
                path, name = entity("fuse", "reckoned", "sigma", one.aircraft), f"{one.aircraft} dead reckoning, sigma"
                samples.append(Sample(path, one.at, picture.step, (one.level_sigma_m,), (name,)))
            samples += _muted(picture)
        return plotted(samples, self._named)


def _muted(picture: Picture) -> list[Sample]:
    """A row for each aircraft and time: what was off by how much, and three sigma of dead reckoning."""
    found: dict[tuple[str, int], list[float]] = {}
    for one in picture.muted:
        values = found.setdefault((one.aircraft, one.at), [math.nan] * 4)
        values[_WHATS.index(one.what)] = one.error_m
        if one.what == "dead reckoning":
            values[3] = 3.0 * one.sigma_m
    return [
        Sample(
            entity("fuse", "reckoned", "muted", aircraft),
            at,
            picture.step,
            tuple(values),
            tuple(f"{aircraft} off the muted GPS, {what}" for what in (*_WHATS, "3 sigma of dead reckoning")),
        )
        for (aircraft, at), values in found.items()
    ]
