"""What was drawn lately: so that a recording of days, with thousands of aircraft in it, stays small in memory."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

BEFORE_ALL = -(2**62)
FORGOTTEN_NS = 600_000_000_000  # longer than any trail and far longer than any track lives without data
_SWEEP_NS = 60_000_000_000

Key = TypeVar("Key", bound=Hashable)


class Lately(Generic[Key]):
    """Keys and when each was last touched; those not touched for ten minutes are forgotten, and told to `forget`.

    What comes back after that counts as new: its looks are sent again, which costs one row and changes nothing.
    """

    def __init__(self, forget: Callable[[Key], object] = lambda key: None) -> None:
        self._at: dict[Key, int] = {}
        self._forget = forget
        self._swept = BEFORE_ALL

    def __len__(self) -> int:
        return len(self._at)

    def is_new(self, key: Key, at: int) -> bool:
        """Touch a key at an instant (ns); whether it was not known."""
        known = self._at.get(key)
        self._at[key] = at if known is None else max(known, at)
        if at - self._swept >= _SWEEP_NS:
            self._swept = at
            for old in [one for one, touched in self._at.items() if touched < at - FORGOTTEN_NS and one != key]:
                self.drop(old)
        return known is None

    def at(self, key: Key) -> int:
        """When a key was last touched, ns; long ago for one that is not known."""
        return self._at.get(key, BEFORE_ALL)

    def drop(self, key: Key) -> None:
        """Forget a key now."""
        if self._at.pop(key, None) is not None:
            self._forget(key)
