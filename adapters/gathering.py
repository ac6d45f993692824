"""What no stage of the picture reads (attitudes, inertial samples, air data but winds), gathered: most of what comes in thick.

It goes to the sinks all the same. What is read by a stage is an arrival of its own, at its own instant; of what is not, it is
enough to know what was said, and in which order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from adapters import air, motion
from adapters.epoch import SessionEpoch
from adapters.listening import Listened
from gateway.observation import Heard, Observation

Said = list[tuple[int, Heard]]
"""What some of many arrivals said, each with its place among them; of what was gathered, the last one's."""

PASSING = frozenset(
    (
        *(motion.ATTITUDE, motion.ATTITUDE_QUATERNION, motion.RAW_IMU, motion.SCALED_IMU, motion.SCALED_IMU2),
        *(motion.SCALED_IMU3, motion.HIGHRES_IMU, air.VFR_HUD, air.SCALED_PRESSURE),
    )
)
"""The messages that say nothing else."""


class Gathered:
    """What arrivals of one second of stamps said, in order; what no stage reads is gathered until `close`."""

    def __init__(self, epoch: SessionEpoch, listened: Mapping[int, Listened]) -> None:
        self.said: Said = []
        self._epoch, self._listened = epoch, listened
        self._observations: list[Observation] = []
        self._counts = Counter[int]()  # of observations, by source
        self._place = self._received_at = 0
        self._said_at = 0  # it comes behind what was said since, and what is heard does not go back

    def say(self, place: int, received_at: int, heard: Heard | None) -> None:
        """What an arrival said that a stage reads, if it said anything."""
        if heard is not None:
            self._said_at = received_at
            self.said.append((place, heard))

    def add(self, place: int, number: int, received_at: int, found: Sequence[Observation]) -> None:
        """What an arrival of a source said that no stage reads."""
        self._place, self._received_at = place, received_at
        self._observations += found
        self._counts[number] += len(found)

    def add_all(self, place: int, received_at: int, found: Sequence[Observation], counts: Mapping[int, int]) -> None:
        """What several said, the last of which was at this place; `counts`: how much by source."""
        self._place, self._received_at = max(self._place, place), max(self._received_at, received_at)
        self._observations += found
        self._counts.update(counts)

    def close(self, notes: tuple[tuple[str, str], ...] = ()) -> None:
        """What was added since the last time is complete."""
        if not self._observations and not notes:
            return
        now = self._epoch.session_time(max(self._received_at, self._said_at))
        self.said.append((self._place, Heard(now, tuple(self._observations), notes)))
        for number, count in self._counts.items():
            self._listened[number].count(self._received_at, count)
        self._observations, self._counts = [], Counter()
