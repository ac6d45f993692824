"""What no stage of the picture reads (attitudes, inertial samples, air data), gathered: far the most of what comes in thick.

It goes to the sinks all the same. What is read by a stage is an arrival of its own, at its own instant; of what is not, it is
enough to know what was said, and in which order.
"""

from __future__ import annotations

from collections.abc import Mapping

from adapters import air, motion
from adapters.epoch import SessionEpoch
from adapters.listening import Listened
from adapters.meters import SECOND
from gateway.observation import Heard, Observation

Said = list[tuple[int, Heard]]
"""What some of many arrivals said, each with its place among them; of what was gathered, the last one's."""

PASSING = frozenset(
    (
        *(motion.ATTITUDE, motion.ATTITUDE_QUATERNION, motion.RAW_IMU, motion.SCALED_IMU, motion.SCALED_IMU2),
        *(motion.SCALED_IMU3, motion.HIGHRES_IMU, air.VFR_HUD, air.SCALED_PRESSURE, air.WIND, air.WIND_COV),
    )
)
"""The messages that say nothing else."""


class Gathered:
    """What arrivals said, in order; what was added in a row, within one second of stamps, is one Heard."""

    def __init__(self, epoch: SessionEpoch, listened: Mapping[int, Listened]) -> None:
        self.said: Said = []
        self._epoch, self._listened = epoch, listened
        self._observations: list[Observation] = []
        self._counts: dict[int, int] = {}  # of observations, by source
        self._place = self._received_at = 0
        self._until = 0  # the stamp at which the second is over

    def add(self, place: int, number: int, received_at: int, found: tuple[Observation, ...]) -> None:
        """What an arrival of a source said that no stage reads."""
        if received_at >= self._until:
            self.close()
            self._until = (received_at // SECOND + 1) * SECOND
        self._place, self._received_at = place, received_at
        self._observations += found
        self._counts[number] = self._counts.get(number, 0) + len(found)

    def close(self, notes: tuple[tuple[str, str], ...] = ()) -> None:
        """What was added since the last time is complete. To be called before anything sets the session's clock."""
        if not self._observations and not notes:
            return
        now = self._epoch.session_time(self._received_at)
        self.said.append((self._place, Heard(now, tuple(self._observations), notes)))
        for number, count in self._counts.items():
            self._listened[number].count(self._received_at, count)
        self._observations, self._counts = [], {}
