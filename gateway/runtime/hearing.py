"""What comes in, until the pipeline has it: recorded as it came, decoded, and without what is not to be heard."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from adapters import Source
from adapters.arrivals import Arrivals
from adapters.decode import Decoder
from adapters.signing import SigningGuard
from gateway.observation import Heard
from gateway.runtime.mutes import Muting
from gateway.runtime.outputs import Outputs
from gateway.runtime.recorder import Recorder
from gateway.runtime.setup import Setup


class Hearing:
    """The sources of a session, how much came of each, and what it said; `recorder` keeps every arrival where there is one."""

    def __init__(self, setup: Setup, recorder: Recorder | None) -> None:
        signing = None if setup.signing_key is None else SigningGuard(setup.signing_key, setup.live)
        self.decoder = Decoder([], keys=setup.keys, live=setup.live, signing=signing)
        self.muting = Muting(setup.options.mutes)
        self._mutes_any = bool(setup.options.mutes)
        self._recorder = recorder
        self._sources: dict[int, Source] = {}
        self._arrivals: Counter[int] = Counter()  # by source

    def add(self, source: Source) -> None:
        """A source that is new. Raises OSError."""
        self._sources[source.number] = source
        self.decoder.add(source)
        if self._recorder is not None:
            self._recorder.add(source)

    def hear(self, arrivals: Arrivals, outputs: Outputs | None) -> list[Heard]:
        """What holds something for the picture; what `outputs` published themselves is left out."""
        numbers = np.bincount(arrivals.source)
        for source in np.flatnonzero(numbers).tolist():
            self._arrivals[source] += int(numbers[source])
        if outputs is not None and outputs.publishes_on:
            arrivals = self._without_our_own(arrivals, outputs)
        said, refused = self.decoder.hear_many(arrivals)
        if self._recorder is not None:
            self._recorder.keep_all(arrivals, refused)
        if not self._mutes_any:
            return [heard for _, heard in said]
        left = (self.muting.without_muted(heard, arrivals[place].received_at) for place, heard in said)
        return [heard for heard in left if heard is not None]

    def _without_our_own(self, arrivals: Arrivals, outputs: Outputs) -> Arrivals:
        """What came in, but for what we published ourselves and somebody passed on."""
        others = []
        for arrival in arrivals:
            if not outputs.is_our_own(arrival.data):
                others.append(arrival)
            elif self._recorder is not None:
                self._recorder.refuse(arrival)
        return arrivals if len(others) == len(arrivals) else Arrivals.of(others)

    def counters(self) -> dict[str, int]:
        """What was not understood, by reason, and what was muted."""
        return {**self.decoder.counters(), **self.muting.counters}

    def sources(self) -> tuple[dict[str, Any], ...]:
        """The sources, with how much came of each."""
        return tuple(
            {"number": source.number, "kind": source.kind, "name": source.name, "origin": source.origin}
            | {"arrivals": self._arrivals[source.number]}
            for source in self._sources.values()
        )
