"""The smoothed tracks of a session: gathered on the way, worked out when it is over, handed to who keeps and draws them.

A smoother begins at a track's end. Until then the filter's states wait on the disk, as large as a few hundred bytes a row for
one model and two thousand for four modes; in memory is a piece at a time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.fuse import Fused, Lanes, remaining
from gateway.fuse.weighting import Model
from gateway.offline.pieces import Piece, Pieces
from gateway.offline.smoothing import Smoothed, smoothed
from gateway.picture import Picture
from gateway.runtime.accuracy import Errors, SmoothedScore, Truths
from gateway.runtime.spool import Kept, Spool
from gateway.settings import Options, Site

Floats = NDArray[np.float64]
Give = Callable[
    [Fused, NDArray[np.int64]], None
]  # rows of one track, in the order of time, and their pictures' numbers

ALL = "all"
_TRUTHS_KEPT_NS = 150 * SECOND  # a row that coasted to its track's end waits for a minute and a half


class Smoothing:
    """Gathers from pictures; `finish` smooths. Every method raises OSError when the disk does not take what must wait.

    `folder` is where the waiting states are kept, None for the system's own place.
    """

    def __init__(self, site: Site, options: Options, folder: Path | None) -> None:
        self.rows = 0
        self.ended: list[tuple[int, int, int]] = []  # tracks, when they ended, and in which picture
        self._frame = RunwayFrame(site.runway)
        self._separation_m = site.runway.geoid_separation_m
        self._model = Model.of(options, site.position, {}, site.estimation)
        self._pieces = Pieces(self._model)
        self._folder = folder
        self._spool = Spool(folder)
        self._kept: defaultdict[int, list[tuple[Kept, Kept]]] = defaultdict(
            list
        )  # of each piece, it and where it truly was
        self._truths: defaultdict[str, Truths] = defaultdict(Truths)
        self._errors: defaultdict[str, tuple[Errors, Errors]] = defaultdict(lambda: (Errors(), Errors()))

    def add(self, picture: Picture) -> None:
        """Take from a picture what smoothing needs."""
        for truth in picture.truth:
            self._truths[truth.aircraft].add(truth)
        self.ended += [(one.track, max(one.at, picture.now), picture.step) for one in picture.fuse.ended]
        self._pieces.add(picture.fuse, picture.step, picture.now)
        if self._pieces.due:
            self._keep(self._pieces.take())
            self._forget_truths(picture.now - _TRUTHS_KEPT_NS)

    def finish(self, lanes: Lanes, give: Give, tell: Callable[[float], None]) -> None:
        """Smooth every track, in the order of their numbers, and give its rows; tell the share that is done."""
        self._pieces.settle(remaining(lanes))
        self._keep(self._pieces.take(all_of_it=True))
        total = max(sum(map(len, self._kept.values())), 1)
        done = 0
        results = Spool(self._folder)
        try:
            for track in sorted(self._kept):
                kept, places = self._kept[track][::-1], []
                found = smoothed(self._pieces_of(kept), self._model, self._frame)
                for (_, true), one in zip(kept, found, strict=True):
                    self._score(one, self._spool.read(true))
                    places.append(results.keep(one))
                    done += 1
                    tell(done / total)
                for place in reversed(places):
                    self._give(results.read(place), give)
                results.forget()
        finally:
            results.close()

    def scores(self) -> dict[str, SmoothedScore]:
        """Scores by the state of the track ("fused", "gps only", ...), and of "all" rows, where the truth is known."""
        kinds = [kind for kind in sorted(self._errors) if kind != ALL and self._errors[kind][0].count]
        if len(kinds) > 1:
            kinds.append(ALL)
        return {kind: SmoothedScore(*(errors.score() for errors in self._errors[kind])) for kind in kinds}

    def close(self) -> None:
        """Let go of the disk; calling it again does nothing."""
        self._spool.close()

    def _keep(self, pieces: list[Piece]) -> None:
        for piece in pieces:
            true = self._spool.keep(self._true_m(piece.rows))
            self._kept[piece.track].append((self._spool.keep(piece), true))

    def _pieces_of(self, kept: list[tuple[Kept, Kept]]) -> Iterator[Piece]:
        for place, _ in kept:
            piece: Piece = self._spool.read(place)
            yield piece

    def _score(self, one: Smoothed, true_m: Floats) -> None:
        """Note the distances to the truth; without a height there is none."""
        known = np.isfinite(true_m).all(axis=1) & np.isfinite(one.rows.height_m)
        filtered, after = (np.linalg.norm(place - true_m, axis=1) for place in (one.filtered_m, one.smoothed_m))
        states = np.array(one.rows.state, dtype=object)
        for state in (*dict.fromkeys(one.rows.state), ALL):
            rows = known & ((states == state) | (state == ALL))
            for kept, errors in zip(self._errors[state], (filtered, after), strict=True):
                kept.extend(errors[rows])

    def _forget_truths(self, before: int) -> None:
        for truths in self._truths.values():
            truths.forget_before(before)
        gone = [name for name, truths in self._truths.items() if not truths.time or truths.time[-1] < before]
        for name in gone:
            del self._truths[name]

    def _true_m(self, rows: Fused) -> Floats:
        """Where the aircraft truly was, in the runway frame (n, 3); NaN where nothing tells it."""
        known = [name for name in rows.aircraft if name is not None]
        truths = self._truths.get(known[0]) if known else None
        if truths is None:
            return np.full((len(rows.time), 3), np.nan)
        separation_m = self._separation_m
        if separation_m is None:
            told = (rows.height_m - rows.altitude_msl_m)[np.isfinite(rows.altitude_msl_m)]
            separation_m = float(told[-1]) if len(told) else 0.0
        return truths.runway_m(rows.time, self._frame, separation_m)

    def _give(self, one: Smoothed, give: Give) -> None:
        self.rows += len(one.rows.time)
        give(one.rows, one.step)
