"""A landing radar that looks at the aircraft of a recording or of a live link, and says what it sees on the radar's
wire.

It goes by what simulators say of the truth (SIM_STATE, SIMSTATE), and where an aircraft says none, by its own
position. Its clock is the aircraft's: a scan is made when a position a little newer than it has come, so that
positions are interpolated; nothing here reads a clock, and a recording gives the same datagrams at any speed.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gateway.observation import GpsReport, Heard, Observation, Timing, Truth
from gateway.settings import RadarSite, Site
from sim.radars import RadarSight, RadarVoice, plot_record
from sim.sensors import RadarParameters, during, measure_radar, stream

Floats = NDArray[np.float64]

SECOND_NS = 1_000_000_000
DELAY_S = 0.2  # a scan waits so long for positions on its other side
_TRUTH_HOLD_S, _REPORT_HOLD_S = 2.0, 6.0  # so long a silent aircraft is still there, straight on
_TRUTH_LOST_S = 10.0  # then its reports are believed again
_JUMP_NS = 60 * SECOND_NS  # a step of the aircraft's clock beyond this begins anew
_STAMP_STEP_NS = 4_000
_LEAST_STEP_NS = 5_000_000


@dataclass(frozen=True, slots=True)
class _Place:
    """Where an aircraft was in the radar's frame (3,), and how it moved (3,), NaN where it did not say."""

    at: int
    position_m: Floats
    velocity_mps: Floats


@dataclass(slots=True)
class _Watched:
    """One aircraft: its track number, its random stream, and its latest places in order of time."""

    number: int
    generator: np.random.Generator
    is_truth: bool = False
    places: list[_Place] = field(default_factory=list)

    def take(self, place: _Place) -> None:
        """Take a place in that is newer than all, by enough to tell a movement; old ones are forgotten."""
        if self.places and place.at < self.places[-1].at + _LEAST_STEP_NS:
            return
        self.places.append(place)
        if len(self.places) > 64:
            del self.places[:32]

    def seen_at(self, at: int) -> tuple[Floats, Floats] | None:
        """Position and velocity (1, 3) at a time; None before the first place and too long after the last."""
        after = next((index for index, place in enumerate(self.places) if place.at >= at), None)
        if after == 0:
            return None if self.places[0].at > at else _at(self.places[0], self.places[0], at)
        if after is not None:
            return _at(self.places[after - 1], self.places[after], at)
        hold_s = _TRUTH_HOLD_S if self.is_truth else _REPORT_HOLD_S
        if not self.places or at - self.places[-1].at > hold_s * SECOND_NS:
            return None
        return _at(self.places[-2] if len(self.places) > 1 else self.places[-1], self.places[-1], at)


class WatchingRadar:
    """Fed with observations, it gives back datagrams: (when they are sent, by the receiver's clock of the
    observations; bytes).

    `radar` stands in the site's runway frame; `parameters` say how it measures (seconds of `dropouts` count from its
    first scan); `geoid_separation_m` lifts altitudes above mean sea level where the site does not say.
    """

    def __init__(
        self,
        site: Site,
        radar: RadarSite,
        parameters: RadarParameters | None = None,
        *,
        seed: int = 0,
        key: bytes | None = None,
        geoid_separation_m: float = 0.0,
        delay_s: float = DELAY_S,
    ) -> None:
        self._sight = RadarSight(site, radar)
        self._radar, self._seed = radar, seed
        self._parameters = parameters or parameters_of(radar)
        self._voice = RadarVoice(radar.number, key)
        said = site.runway.geoid_separation_m
        self._separation_m = geoid_separation_m if said is None else said
        self._delay_ns = round(delay_s * SECOND_NS)
        self._period_ns = round(self._parameters.period_s * SECOND_NS)
        self._watched: dict[str, _Watched] = {}
        self._newest: int | None = None
        self._first_scan = self._next_scan = self._next_status = 0
        self._last_sent = 0

    def feed(self, observation: Observation) -> list[tuple[int, bytes]]:
        """Take an observation in; the datagrams that it makes due."""
        if not isinstance(observation, Truth | GpsReport) or not self._take(observation):
            return []
        return self._scan_until(max(self._newest or 0, 0) - self._delay_ns, observation.received_at)

    def finish(self) -> list[tuple[int, bytes]]:
        """The last scans, for which no newer positions will come."""
        return [] if self._newest is None else self._scan_until(self._newest, self._last_sent)

    def _take(self, seen: Truth | GpsReport) -> bool:
        """Take a position in; False where it is not to be believed."""
        height = seen.height_m
        if seen.altitude_msl_m is not None and (height is None or isinstance(seen, Truth)):
            height = seen.altitude_msl_m + self._separation_m
        if height is None or (isinstance(seen, GpsReport) and seen.timing is Timing.PROVISIONAL):
            return False
        self._begin_anew_after_a_jump(seen.valid_at)
        watched = self._watched.get(seen.aircraft)
        if watched is None:
            number = self._parameters.first_number + len(self._watched) if self._parameters.numbered else 0
            watched = _Watched(number, stream(self._seed, "watch", self._radar.number, seen.aircraft))
            self._watched[seen.aircraft] = watched
        if isinstance(seen, GpsReport) and watched.is_truth:
            if seen.valid_at - watched.places[-1].at < _TRUTH_LOST_S * SECOND_NS:
                return False
            watched.is_truth = False
        if isinstance(seen, Truth) and not watched.is_truth:
            watched.is_truth, watched.places = True, []
        parts = (seen.velocity_east_mps, seen.velocity_north_mps, seen.velocity_up_mps)
        said = np.array([math.nan if part is None else part for part in parts])
        position, velocity = self._sight.see_at(seen.latitude_rad, seen.longitude_rad, height, said)
        watched.take(_Place(seen.valid_at, np.reshape(position, 3), np.reshape(velocity, 3)))
        self._newest = max(self._newest or 0, seen.valid_at)
        return True

    def _begin_anew_after_a_jump(self, at: int) -> None:
        """The first position, or one whose clock has jumped, decides when scans are made."""
        if self._newest is not None and abs(at - self._newest) <= _JUMP_NS:
            return
        if self._newest is not None:
            for watched in self._watched.values():
                watched.is_truth, watched.places = False, []
        self._newest = at
        phase_ns = round(self._parameters.phase_s * SECOND_NS)
        self._first_scan = self._next_scan = -(-(at - phase_ns) // self._period_ns) * self._period_ns + phase_ns
        self._next_status = self._first_scan

    def _scan_until(self, until: int, received_at: int) -> list[tuple[int, bytes]]:
        sent = []
        while self._next_scan <= until:
            for datagram in self._scan(self._next_scan):
                wanted = received_at // _STAMP_STEP_NS * _STAMP_STEP_NS
                self._last_sent = max(wanted, self._last_sent + _STAMP_STEP_NS)
                sent.append((self._last_sent, datagram))
            self._next_scan += self._period_ns
        return sent

    def _scan(self, at: int) -> Iterator[bytes]:
        parameters = self._parameters
        elapsed_s = (at - self._first_scan) / SECOND_NS
        if during(parameters.dropouts, elapsed_s):
            return
        stamp = at + round(parameters.time_error_s * SECOND_NS)
        if at >= self._next_status:
            self._next_status = at + round(parameters.status_period_s * SECOND_NS)
            yield self._voice.status(stamp, self._sight.status(self._radar, parameters.period_s))
        plots = []
        for watched in self._watched.values():
            seen = watched.seen_at(at)
            if seen is None:
                continue
            measured = measure_radar(parameters, [elapsed_s], *seen, watched.generator)
            if measured.seen[0]:
                radial = float(measured.radial_mps[0])
                plots.append(plot_record(watched.number, stamp, measured.polar[0], radial, parameters))
        yield from self._voice.plots(stamp, plots)


def parameters_of(radar: RadarSite) -> RadarParameters:
    """What a radar measures with, as noisy and far-reaching as its site says; else 003's case."""
    return RadarParameters(
        range_sigma_m=radar.range_sigma_m,
        azimuth_sigma_rad=radar.azimuth_sigma_rad,
        elevation_sigma_rad=radar.elevation_sigma_rad,
        maximum_range_m=radar.maximum_range_m,
    )


def watch(heard: Iterable[Heard], radar: WatchingRadar) -> Iterator[tuple[int, bytes]]:
    """The datagrams of a radar that watches a whole recording, with the recording's stamps, in order."""
    for one in heard:
        for observation in one.observations:
            yield from radar.feed(observation)
    yield from radar.finish()


def _at(before: _Place, after: _Place, at: int) -> tuple[Floats, Floats]:
    """Position and velocity (1, 3) at a time between two places, or after both: by their velocities where they said
    them.

    Between: the cubic that has both positions and velocities. After: straight on.
    """
    step_s = (after.at - before.at) / SECOND_NS
    chord = (after.position_m - before.position_m) / step_s if step_s > 0.0 else np.zeros(3)
    first = np.where(np.isnan(before.velocity_mps), chord, before.velocity_mps)
    last = np.where(np.isnan(after.velocity_mps), chord, after.velocity_mps)
    if at >= after.at or step_s <= 0.0:
        beyond_s = (at - after.at) / SECOND_NS
        return (after.position_m + last * beyond_s)[None], last[None]
    u = (at - before.at) / SECOND_NS / step_s
    bend_first, bend_last = first - chord, last - chord
    position = before.position_m + chord * step_s * u
    position = position + step_s * u * (1.0 - u) * ((1.0 - u) * bend_first - u * bend_last)
    velocity = chord + (1.0 - u) * (1.0 - 3.0 * u) * bend_first - u * (2.0 - 3.0 * u) * bend_last
    return position[None], velocity[None]
