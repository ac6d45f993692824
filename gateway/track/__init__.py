"""Track: which plots belong together. The radar's own numbers decide; plots without one become tracks by `unnumbered`."""

from gateway.track.looks import Look, look_of
from gateway.track.numbered import (
    FIRST_OWN,
    GREATEST_SPEED_MPS,
    PLOTS_AT_MOST,
    TRACKS_AT_MOST,
    Key,
    Number,
    Place,
    RadarTracks,
    Tracked,
    name_of,
    table,
)
from gateway.track.unnumbered import Taken, Unnumbered

__all__ = [
    "FIRST_OWN",
    "GREATEST_SPEED_MPS",
    "PLOTS_AT_MOST",
    "TRACKS_AT_MOST",
    "Key",
    "Look",
    "Number",
    "Place",
    "RadarTracks",
    "Taken",
    "Tracked",
    "Unnumbered",
    "look_of",
    "name_of",
    "table",
]
