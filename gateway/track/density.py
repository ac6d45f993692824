"""How dense a radar's clutter is where, and how often it sees a target: given, or learnt from its scans."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RANGES, AZIMUTHS = 64, 64  # cells
ELEVATION_RAD = math.radians(10.0)  # over which clutter and targets are strewn
LEARNT_IN = 20.0  # scans
KERNEL = (1.0 / 9.0, 2.0 / 9.0, 3.0 / 9.0, 2.0 / 9.0, 1.0 / 9.0)  # over neighbouring cells
AT_FIRST_WORTH = 2.0  # scans, of what is expected at first
AT_FIRST = 3.0  # clutter plots a scan, over the whole coverage: what is expected before anything was seen
NEWBORN = 0.005  # targets that come, a scan, over the whole coverage
FIRST_DETECTION, LEAST_DETECTION, MOST_DETECTION = 0.9, 0.5, 0.98
LEAST = 1e-3  # clutter plots a scan: without any, one plot would be a track
DETECTION_LEARNT_IN = 200.0  # looks at confirmed tracks


@dataclass(frozen=True, slots=True, eq=False)
class Density:
    """Clutter plots a scan in each cell (RANGES, AZIMUTHS) of a radar's coverage, and how likely a target is detected."""

    counts: Floats
    greatest_m: float
    detection: float
    scans: float = 0.0  # that were learnt from
    learns_clutter: bool = True
    learns_detection: bool = True

    @classmethod
    def at_first(cls, greatest_m: float, clutter: float | None, detection: float | None) -> Density:
        """Before anything was seen; `clutter` plots a scan and the probability of detection are not learnt where given."""
        count = max(AT_FIRST if clutter is None else clutter, LEAST) / (RANGES * AZIMUTHS)
        return cls(
            np.full((RANGES, AZIMUTHS), count),
            greatest_m,
            FIRST_DETECTION if detection is None else detection,
            learns_clutter=clutter is None,
            learns_detection=detection is None,
        )

    def of(self, value: Floats) -> tuple[Floats, Floats]:
        """Clutter and new targets (m,) a scan in a unit of what each plot (3, m) measured: m, rad, rad or some of these."""
        ranges, azimuths = self._cells(value)
        missing = np.isnan(value)
        counts = np.maximum(self.counts, _smoothed(self.counts))
        by_azimuth, by_range, over_all = counts.sum(axis=0), counts.sum(axis=1), float(counts.sum())
        count = counts[ranges, azimuths]
        count = np.where(missing[0], by_azimuth[azimuths], count)
        count = np.where(missing[1], np.where(missing[0], over_all, by_range[ranges]), count)
        whole = np.array([self.greatest_m, 2.0 * math.pi, ELEVATION_RAD])[:, None]
        cell = whole / np.array([RANGES, AZIMUTHS, 1.0])[:, None]
        volume = np.where(missing, 1.0, whole).prod(axis=0)
        return count / np.where(missing, 1.0, cell).prod(axis=0), NEWBORN / volume

    def after(self, value: Floats, unexplained: Floats, share: float) -> Density:
        """The same after a piece of a scan, that share of it: plots (3, m), and how much of each no track explained."""
        if not self.learns_clutter:
            return self
        placed = ~np.isnan(value[:2]).any(axis=0)
        ranges, azimuths = self._cells(value[:, placed])
        cells = np.bincount(ranges * AZIMUTHS + azimuths, unexplained[placed], minlength=RANGES * AZIMUTHS)
        grown = cells.reshape(RANGES, AZIMUTHS)
        least = AT_FIRST / (RANGES * AZIMUTHS)
        known = min(self.scans + AT_FIRST_WORTH, LEARNT_IN)
        counts = np.maximum(self.counts * (1.0 - share / known) + grown / known, least)
        return replace(self, counts=counts, scans=min(self.scans + share, LEARNT_IN))

    def detecting(self, hits: int, looks: int) -> Density:
        """The same after so many looks at confirmed tracks, of which so many had plots."""
        if not looks or not self.learns_detection:
            return self
        gain = 1.0 - (1.0 - 1.0 / DETECTION_LEARNT_IN) ** looks
        learnt = self.detection + gain * (hits / looks - self.detection)
        return replace(self, detection=min(max(learnt, LEAST_DETECTION), MOST_DETECTION))

    def _cells(self, value: Floats) -> tuple[Ints, Ints]:
        share = np.nan_to_num(value[:2])
        ranges = np.clip(share[0] / self.greatest_m * RANGES, 0, RANGES - 1).astype(np.int64)
        azimuths = np.floor((share[1] / (2.0 * math.pi) + 0.5) * AZIMUTHS).astype(np.int64) % AZIMUTHS
        return ranges, azimuths


def _smoothed(counts: Floats) -> Floats:
    """What lies in a cell tells of its neighbours, too: clutter has no edges there, and rain moves into the next ones."""
    padded = np.pad(counts, ((2, 2), (0, 0)), mode="edge")
    along: Floats = sum(
        (part * padded[place : place + RANGES] for place, part in enumerate(KERNEL)), np.zeros(counts.shape)
    )
    wide = np.concatenate([along[:, -2:], along, along[:, :2]], axis=1)
    return sum((part * wide[:, place : place + AZIMUTHS] for place, part in enumerate(KERNEL)), np.zeros(counts.shape))
