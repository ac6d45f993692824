"""Track: which plots belong together. The radar's own numbers decide; plots without one become tracks by `unnumbered`."""

from gateway.track.numbered import (
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

__all__ = [
    "GREATEST_SPEED_MPS",
    "PLOTS_AT_MOST",
    "TRACKS_AT_MOST",
    "Key",
    "Number",
    "Place",
    "RadarTracks",
    "Tracked",
    "name_of",
    "table",
]
