"""System tracks told to others: an ADSB_VEHICLE a second for each, and the HEARTBEAT of an ADS-B component.

What is told of a track is the last state that a measurement gave it, never one that was only carried on: a receiver
takes a report for what was so `tslc` whole seconds ago, and carries it on itself. Our states are not whole seconds old:
each is carried on by the fraction of a second that is missing, so that what is told is exactly true of that instant.
A track that is silent grows old in this way, and is told no more when it ends. A tentative track is not told: to others
it would be an aircraft like any other.

Our component is one of the system that is looked at: QGroundControl and MAVSDK take traffic only from a system that they
know as a vehicle, which most have as system 1. So the number of that vehicle is the one to publish as.

Whoever hears us may pass our reports on, also to us. They are known again by what they say, and not taken for news.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from adapters.mavlink_frames import FrameEncoder
from adapters.published import (
    COMPONENT,
    TYPE_UAV,
    TYPE_UNKNOWN,
    Key,
    Traffic,
    adsb_vehicle,
    heartbeat,
    key_of,
    made_up_address,
)
from gateway.fuse import Fused
from gateway.geodesy import meridian_radius_m, prime_vertical_radius_m
from gateway.observation import Observation, RadarPlot
from gateway.picture import Picture

SYSTEM = 1
HEARTBEATS, REPORTS, OUR_OWN = "publish: heartbeats", "publish: traffic reports", "publish: our own heard again"
_SECOND = 1_000_000_000
_SPREAD = 0.6180339887498949  # the golden section: any number of tracks falls evenly over the second
_ECHO_NS = 120 * _SECOND  # an autopilot keeps what it heard for up to a minute
_LATELY_NS = 10 * _SECOND
_SIMULATED_AT_MOST = 1000  # before those that said so long ago are forgotten


@dataclass(slots=True)
class _Told:
    """A live track: its newest measured row, and when it is told next."""

    fused: Fused
    row: int
    due: int


class PublishSink:
    """Tells `send` one frame at a time, as the session's time goes on; `send` must not wait and must not raise.

    `system`: what to publish as, see above. `leave_out`: aircraft that are not told of: a vehicle that listens and that
    avoids traffic must not be told of itself. The counters are totals of what was told.
    """

    def __init__(
        self, send: Callable[[bytes], None], *, system: int = SYSTEM, leave_out: frozenset[str] = frozenset()
    ) -> None:
        self._send = send
        self._leave_out = leave_out
        self._encoder = FrameEncoder(system, COMPONENT)
        self._tracks: dict[int, _Told] = {}
        self._heartbeat_due = 0
        self._simulated: dict[str, int] = {}  # radar track -> when it last said so
        self._lately: dict[Key, int] = {}
        self.counters = Counter({HEARTBEATS: 0, REPORTS: 0})

    def write(self, picture: Picture) -> None:
        """Take in what is new, and tell what is due."""
        self._hear(picture.observations)
        self._keep(picture.fuse, picture.now)
        now = picture.now
        if not 0 < self._heartbeat_due - now <= _SECOND:
            self._heartbeat_due = _next(self._heartbeat_due, now)
            self._send(heartbeat(self._encoder))
            self.counters[HEARTBEATS] += 1
        for track, told in self._tracks.items():
            if not 0 < told.due - now <= _SECOND:
                told.due = _next(told.due, now)
                if told.fused.aircraft[told.row] not in self._leave_out:
                    self._tell(track, told, now)

    def flush(self, now: int) -> None:
        """Nothing waits."""

    def close(self) -> None:
        """Tell no more."""
        self._tracks.clear()

    def is_our_own(self, frame: bytes) -> bool:
        """Whether a frame that came in says what we have told lately: somebody passes it on. Counted."""
        key = key_of(frame)
        if key is None or key not in self._lately:
            return False
        self.counters[OUR_OWN] += 1
        return True

    def _hear(self, observations: Sequence[Observation]) -> None:
        """Which radar tracks say of themselves that they are simulated."""
        for one in observations:
            if isinstance(one, RadarPlot) and one.simulated:
                self._simulated[f"{one.radar}/{one.track_number}"] = one.valid_at
        if len(self._simulated) > _SIMULATED_AT_MOST:
            newest = max(self._simulated.values())
            self._simulated = {name: at for name, at in self._simulated.items() if at > newest - _LATELY_NS}

    def _keep(self, fused: Fused, now: int) -> None:
        """The newest measured row of each track that is, or was, confirmed; tracks that ended go."""
        for row, (track, at, received) in enumerate(
            zip(fused.track.tolist(), fused.time.tolist(), fused.received.tolist(), strict=True)
        ):
            if received < 0:
                continue
            told = self._tracks.get(track)
            if told is None and fused.life[row] == "tentative":
                continue
            if told is None:
                self._tracks[track] = _Told(fused, row, now + int(track * _SPREAD % 1.0 * _SECOND))
            elif at >= told.fused.time[told.row]:
                told.fused, told.row = fused, row
        for ended in fused.ended:
            self._tracks.pop(ended.track, None)

    def _tell(self, track: int, told: _Told, now: int) -> None:
        frame = adsb_vehicle(self._encoder, self._traffic(track, told.fused, told.row, now))
        key = key_of(frame)
        assert key is not None
        self._lately.pop(key, None)
        self._lately[key] = now
        while now - self._lately[oldest := next(iter(self._lately))] > _ECHO_NS:
            del self._lately[oldest]
        self._send(frame)
        self.counters[REPORTS] += 1

    def _traffic(self, track: int, fused: Fused, row: int, now: int) -> Traffic:
        """A row as it was a whole number of seconds before now."""
        at = int(fused.time[row])
        age_s = max(now - at, 0) // _SECOND
        missing_s = max(now - at, 0) / _SECOND - age_s
        east, north, up = (_known(part) for part in fused.velocity_mps[row].tolist())
        latitude, longitude = _moved(
            float(fused.latitude_rad[row]), float(fused.longitude_rad[row]), east or 0.0, north or 0.0, missing_s
        )
        altitude = _known(float(fused.altitude_msl_m[row]))
        if altitude is not None and up is not None:
            altitude += up * missing_s
        aircraft, radar_track = fused.aircraft[row], fused.radar_track[row]
        simulated = [at - self._simulated.get(name, 0) <= _LATELY_NS for name in (radar_track or "").split()]
        return Traffic(
            address=address_of(aircraft, track),
            latitude_rad=latitude,
            longitude_rad=longitude,
            age_s=age_s,
            altitude_msl_m=altitude,
            pressure_altitude_m=_known(float(fused.pressure_altitude_m[row])),
            velocity_east_mps=east,
            velocity_north_mps=north,
            velocity_up_mps=up,
            callsign=fused.callsign[row] or _name(aircraft, radar_track),
            emitter_type=TYPE_UAV if (aircraft or "").startswith("mavlink:") else TYPE_UNKNOWN,
            is_simulated=any(simulated),
        )


def _name(aircraft: str | None, radar_track: str | None) -> str:
    """What people find again on their other screens; "" where an address says as much."""
    if aircraft is None:
        return "R" + radar_track.split()[0] if radar_track else ""
    kind, _, name = aircraft.partition(":")
    return "MAV" + name if kind == "mavlink" else "" if kind == "icao" else name


def address_of(aircraft: str | None, track: int) -> int:
    """The aircraft's own ICAO address, or one made up for its track. A second aircraft of one address has none."""
    own = re.fullmatch(r"icao:([0-9a-fA-F]{6})", aircraft or "")
    return int(own[1], 16) if own else made_up_address(track)


def _next(due: int, now: int) -> int:
    """When it is due again: a whole second later, in the same rhythm, whatever the ticks; from now if time has jumped."""
    return due + _SECOND if 0 <= now - due < _SECOND else now + _SECOND


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _moved(latitude: float, longitude: float, east_mps: float, north_mps: float, time_s: float) -> tuple[float, float]:
    """A position, moved on for less than a second. The height would change it by a millimetre, and is left out."""
    normal_m = float(prime_vertical_radius_m(latitude))
    meridian_m = float(meridian_radius_m(latitude))
    moved = latitude + north_mps * time_s / meridian_m
    return moved, longitude + east_mps * time_s / (normal_m * max(math.cos(latitude), 1e-9))
