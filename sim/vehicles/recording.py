"""Vehicles flown as fast as it goes into a session folder that `talkdown replay` reads, with their truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from adapters import Arrival, Source
from adapters.mavlink_frames import Frame, FrameEncoder, parse
from adapters.mission_client import MissionClient
from gateway import __version__
from gateway.observation import Truth
from gateway.runtime.folder import Record, make_folder, session_name
from gateway.runtime.recorder import Recorder
from gateway.settings import Options
from gateway.sinks.batches import TRUTH, truth_batch
from sim.scene import LARGEST_SYSTEM, STAMP_STEP_NS
from sim.vehicles.flying import STEP_S
from sim.vehicles.motion import Moment
from sim.vehicles.speaking import AUTOPILOT, Speaker

_TRUTH_EVERY = 12  # steps of what flies: four times a second
_TOLD_EVERY_S = 5.0
_MISSION_PLANNER = 190  # MAV_COMP_ID_MISSIONPLANNER
_AFTERWARDS_S = 5.0  # how long it goes on after the last vehicle is done


def write_flight(
    speakers: Sequence[Speaker],
    parent: Path,
    start_ns: int,
    *,
    site: str | None = None,
    longest_s: float,
    command: tuple[str, ...] = (),
    progress: Callable[[float], None] = lambda second: None,
) -> Path:
    """Fly vehicles that are under way, each on a link of its own, until all are done; the new folder inside `parent`.

    `site`: the text of a site file. Raises FolderError when the folder cannot be made, OSError when the disk refuses.
    """
    folder = make_folder(parent, session_name(start_ns, "flight"))
    record = Record(__version__, command, Options(), start_ns, site, "the site file" if site else "", ended="done")
    recorder = Recorder(folder, record)
    stations = [Station(speaker) for speaker in speakers]
    for number, speaker in enumerate(speakers, 1):
        recorder.add(Source(number, "mavlink", f"mavlink-{speaker.encoder.system}", "simulated vehicle"))
    last, told_s, rows = start_ns, 0.0, list[Truth]()
    for steps, (which, moment, frames) in enumerate(_flown(speakers, longest_s)):
        at = start_ns + round(moment.time_s * 1e9)
        for frame in (*frames, *stations[which].exchange(at)):
            last = max(at // STAMP_STEP_NS * STAMP_STEP_NS, last + STAMP_STEP_NS)
            recorder.keep(Arrival(last, which + 1, frame))
        if steps // len(speakers) % _TRUTH_EVERY == 0:
            rows.append(_truth(speakers[which], moment, at))
        if moment.time_s - told_s >= _TOLD_EVERY_S:
            told_s = moment.time_s
            progress(told_s)
    separation = speakers[0].vehicle.home.geoid_separation_m
    table = pa.Table.from_batches([truth_batch(rows, separation)], TRUTH)
    pq.write_table(table, folder / "truth.parquet", compression="zstd")
    recorder.close()
    recorder.flush(last, {})
    return folder


@dataclass(slots=True)
class Station:
    """A ground station that reads a vehicle's mission once, as real ones do: recordings hold missions because of that."""

    speaker: Speaker
    _encoder: FrameEncoder = field(default_factory=lambda: FrameEncoder(LARGEST_SYSTEM, _MISSION_PLANNER))
    _client: MissionClient | None = None

    def exchange(self, now: int) -> list[bytes]:
        """What both say at an instant, ns."""
        if self._client is None:
            self._client = MissionClient("", now)
        said: list[bytes] = []
        while (ask := self._client.due(now)) is not None:
            name, values = ask
            target = {"target_system": self.speaker.encoder.system, "target_component": AUTOPILOT}
            said.append(self._encoder.encode(name, **target, **values))
            for answer in self.speaker.hear(_parsed(said[-1]), now):
                said.append(answer)
                frame = _parsed(answer)
                self._client.hear(frame.message, frame.payload, now)
        return said


def _parsed(raw: bytes) -> Frame:
    frame = parse(raw)
    assert frame is not None  # we have just made it
    return frame


def _flown(speakers: Sequence[Speaker], longest_s: float) -> Iterator[tuple[int, Moment, list[bytes]]]:
    """Which vehicle, its moment and what it says, step by step; a vehicle with longer steps is silent between them."""
    rests_since = 0.0
    for step in range(1, round(longest_s / STEP_S) + 1):
        flown_s = step * STEP_S
        for which, speaker in enumerate(speakers):
            vehicle = speaker.vehicle
            if vehicle.moment.time_s + vehicle.step_s <= flown_s + 1e-6:
                moment = vehicle.step()
                yield which, moment, speaker.say(round(flown_s * 1e9))
        if any(not is_done(speaker) for speaker in speakers):
            rests_since = flown_s
        elif flown_s - rests_since >= _AFTERWARDS_S:
            return


def is_done(speaker: Speaker) -> bool:
    """Whether a vehicle has done what it was to do: it stands or lies still, or waits in the air where its mission left it."""
    vehicle = speaker.vehicle
    if not vehicle.is_landed:
        return vehicle.mission.is_complete
    has_ended = not vehicle.is_armed or vehicle.mission.is_complete
    return has_ended and max(map(abs, vehicle.moment.velocity_mps)) < 0.5


def _truth(speaker: Speaker, moment: Moment, at: int) -> Truth:
    north, east, down = moment.velocity_mps
    height, separation = moment.height_m, speaker.vehicle.home.geoid_separation_m
    place = (moment.latitude_rad, moment.longitude_rad, height - separation, height)
    return Truth(f"mavlink:{speaker.encoder.system}", at, at, *place, east, north, -down)
