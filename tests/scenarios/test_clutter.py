"""A landing seen by a radar that numbers nothing, with birds about the approach and a shower that drifts over it."""

from __future__ import annotations

import numpy as np
import pytest

from adapters import Arrival, Source
from adapters.decode import Decoder
from gateway.frames import RunwayFrame
from gateway.pipeline import initial, step
from sim.events import events
from sim.scenes import build_scene

START_NS = 1_767_225_600_000_000_000
SECOND = 1_000_000_000
CHANGES = (
    "radar.numbered=false",
    "radar.birds=30",
    "radar.rain_per_scan=15",
    "radar.clutter_per_scan=3",
    "radar.detection_probability=0.95",
)
ON_IT_M, OFF_IT_M = 60.0, 200.0


def landed(seed: int, since_s: float, until_s: float) -> tuple[list[float], list[int], float]:
    """A landing in clutter, heard from a second on.

    How far the aircraft's confirmed track is off, m, for each of its rows; the confirmed tracks that are something else; and
    the aircraft's last row, s.
    """
    scene = build_scene("landing", start_ns=START_NS, seed=seed, changes=[*CHANGES, f"duration_s={until_s}"])
    decoder, state = Decoder([Source(0, "radar", "radar-1", "here")]), initial(scene.site)
    rows: list[tuple[int, float, float]] = []
    frame = RunwayFrame(scene.site.runway)
    for event in events(scene):
        if event.link != "radar:1" or event.at < START_NS + since_s * SECOND:
            continue
        heard = decoder.hear(Arrival(event.at, 0, event.data))
        if heard is None:
            continue
        state, picture = step(state, [heard])
        fused = picture.fuse
        for track, at, place, life in zip(fused.track.tolist(), fused.time, fused.runway_m, fused.life, strict=True):
            t_s = min((int(at) - START_NS) / SECOND, until_s)
            flown = scene.flown(scene.aircraft[0], t_s)
            true_m = frame.runway_from_geodetic(flown.latitude_rad, flown.longitude_rad, flown.height_m)
            if life == "confirmed":
                rows.append((track, t_s, float(np.linalg.norm(place - true_m))))
    off: dict[int, list[float]] = {}
    for track, _, off_m in rows:
        off.setdefault(track, []).append(off_m)
    false = [track for track, some in off.items() if float(np.median(some)) > OFF_IT_M]
    right = [row for row in rows if row[0] not in false]
    return [off_m for *_, off_m in right], false, max((t_s for _, t_s, _ in right), default=0.0)


@pytest.mark.parametrize(("since_s", "until_s"), [(420.0, 440.0), (470.0, 500.0)])
def test_an_aircraft_is_held_among_birds_and_rain(since_s: float, until_s: float) -> None:
    """On final and in the roll-out: one confirmed track, the aircraft's, to the last second."""
    off_m, false, last_s = landed(1, since_s, until_s)
    assert not false
    assert last_s > until_s - 2.0
    assert np.percentile(off_m, 95) < ON_IT_M


@pytest.mark.study
@pytest.mark.parametrize("seed", range(100, 150))
def test_no_false_track_is_confirmed_in_fifty_landings(seed: int) -> None:
    """From 16 km out to a standstill: the aircraft's track lasts to the end, and no other one is confirmed."""
    off_m, false, last_s = landed(seed, 330.0, 540.0)
    assert not false
    assert last_s > 538.0
    assert np.percentile(off_m, 95) < ON_IT_M
