"""Where we are, told by what aircraft say when there is no site file: home, the mission's landing, or the standing point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from adapters import Arrival, Source
from adapters.decode import Decoder
from adapters.signing import SigningGuard
from gateway.observation import FlightPlan, GpsReport, Heard, Observation, VehicleStatus
from gateway.runtime.setup import Place
from gateway.settings import format_site, parse_site

_ASK_EVERY_NS = 1_000_000_000
_TOGETHER = 1000  # arrivals that are decoded at once
_THIN_NS = 1_000_000_000  # a position a second of each aircraft tells where it stands


class PlaceFinder:
    """Gathers what tells of the place. Memory: a report a second of each aircraft, and its flight plans."""

    def __init__(self) -> None:
        self._telling: list[Observation] = []
        self._reported_at: dict[str, int] = {}
        self._asked_at: int | None = None

    def look(self, heard: Sequence[Heard]) -> Place | None:
        """Take in what was heard; the place as soon as it is told, asked once a second of session time."""
        for item in heard:
            for observation in item.observations:
                self.gather(observation)
        now = heard[-1].now if heard else 0
        if self._asked_at is not None and 0 <= now - self._asked_at < _ASK_EVERY_NS:  # time can be set back
            return None
        self._asked_at = now
        return self.place()

    def gather(self, observation: Observation) -> None:
        """Keep an observation if it can tell of the place."""
        if isinstance(observation, GpsReport):
            last = self._reported_at.get(observation.aircraft)
            if last is not None and 0 <= observation.valid_at - last < _THIN_NS:
                return
            self._reported_at[observation.aircraft] = observation.valid_at
        elif not isinstance(observation, FlightPlan | VehicleStatus):
            return
        self._telling.append(observation)

    def place(self, *, complete: bool = False) -> Place | None:
        """The place that is told by now, or None; `complete`: nothing more will come."""
        from gateway.offline.site import propose_site

        proposal = propose_site(self._telling, complete=complete)
        if proposal is None:
            return None
        text = format_site(proposal.site)
        return Place(parse_site(text), text, proposal.origin)  # from the text, so that a replay has the same digits

    def search(self, sources: Iterable[Source], arrivals: Iterable[Arrival]) -> Place | None:
        """The place that a whole recording tells of."""
        return look_over(sources, arrivals).place


@dataclass(frozen=True, slots=True)
class Overview:
    """What a whole recording tells before it is replayed."""

    place: Place | None
    vehicles: tuple[str, ...]  # in the order they were heard
    extents: Mapping[int, tuple[int, int]]  # the first and last stamp of each source that says anything
    epoch_offset_s: int


def look_over(sources: Iterable[Source], arrivals: Iterable[Arrival], signing_key: bytes | None = None) -> Overview:
    """One reading of a whole recording; with a key, what is not signed with it tells nothing."""
    guard = None if signing_key is None else SigningGuard(signing_key)
    decoder, finder = Decoder(tuple(sources), signing=guard), PlaceFinder()
    vehicles: dict[str, None] = {}
    extents: dict[int, tuple[int, int]] = {}
    left = iter(arrivals)
    while some := list(islice(left, _TOGETHER)):
        for stamp, source, _, _ in some:
            extents[source] = (extents[source][0] if source in extents else stamp, stamp)
        for _, heard in decoder.hear_many(some)[0]:
            for observation in heard.observations:
                finder.gather(observation)
                if isinstance(observation, VehicleStatus):
                    vehicles.setdefault(observation.aircraft)
    place = finder.place(complete=True)
    return Overview(place, tuple(vehicles), extents, decoder.epoch_offset_s or 0)
