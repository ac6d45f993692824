"""Whether a vehicle's position has frozen: the same to the last digit while the velocity beside it says that it moves.

What stands still tells the same place too, and no velocity: it is left alone. Receivers that tell a place twice between two
fixes do so for a second at most.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

MOVES_MPS = 3.0  # what stands does not tell so much
FROZEN_M, FROZEN_NS = 30.0, 2_000_000_000  # so far it has gone, by its own word, and for so long it tells one place
SILENT_NS = 2_000_000_000  # of a longer pause nobody knows how fast it was


@dataclass(frozen=True, slots=True)
class LastPlace:
    """The place that one vehicle told last, since when it tells it, and how far it went since by its velocity."""

    latitude_rad: float
    longitude_rad: float
    since: int
    at: int
    moved_m: float = 0.0

    @property
    def is_frozen(self) -> bool:
        """Whether it cannot be there any more."""
        return self.moved_m >= FROZEN_M and self.at - self.since >= FROZEN_NS

    def followed_by(self, at: int, latitude_rad: float, longitude_rad: float, speed_mps: float | None) -> LastPlace:
        """With the next place that was told, and the level speed beside it, None = not told; what comes late says nothing."""
        if at <= self.at:
            return self
        if (latitude_rad, longitude_rad) != (self.latitude_rad, self.longitude_rad):
            return LastPlace(latitude_rad, longitude_rad, at, at)
        if speed_mps is None or speed_mps < MOVES_MPS:
            return replace(self, since=at, at=at, moved_m=0.0)
        return replace(self, at=at, moved_m=self.moved_m + speed_mps * min(at - self.at, SILENT_NS) / 1e9)
