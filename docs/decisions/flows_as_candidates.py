"""Are arrivals foretold better where flows of the others are candidates of intent? docs/papers/002-7.md has the answer.

    python docs/decisions/flows_as_candidates.py [arrivals.csv.gz LATITUDE LONGITUDE] [--every 9] [--narrower-than 926]

Each flight (every so many) is replayed second by second with the flows of all others and without any; predictions at instants
where a flow was believed are compared with where the flight came to. Without a file: the synthetic set of `sim/arrivals.py`.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from gateway import pipeline
from gateway.observation import GpsReport, Heard
from gateway.offline.flows import Track, cleaned, found
from gateway.predict import ArrivalFlow
from gateway.runtime.arrivals import arrivals_among, flights_of, onto_level
from gateway.runtime.flow_tables import ways_of
from gateway.settings import DEMO_SITE, Options, Site
from sim.arrivals import arrivals

SECOND = 1_000_000_000
START = 1_790_000_000 * SECOND
LATENCY_NS = 200_000_000
TOGETHER = 20  # reports a step


def main() -> None:
    """Print RMS and median by horizon."""
    wanted = argparse.ArgumentParser()
    wanted.add_argument("file", nargs="*")
    wanted.add_argument("--every", type=int, default=9)
    wanted.add_argument("--narrower-than", type=float, default=926.0)
    asked = wanted.parse_args()
    if asked.file:
        where = float(asked.file[1]), float(asked.file[2])
        tracks = arrivals_among(flights_of(Path(asked.file[0])), where)[0]
    else:
        where, tracks = (49.0, 2.5), tuple(cleaned(track) for track in arrivals(5).tracks)
    runway = replace(DEMO_SITE.runway, latitude_rad=math.radians(where[0]), longitude_rad=math.radians(where[1]))
    site = replace(DEMO_SITE, runway=runway, radars=())
    off: dict[float, list[tuple[float, float]]] = defaultdict(list)
    for place in range(0, len(tracks), asked.every):
        others = [track for other, track in enumerate(tracks) if other != place]
        # the gateway leaves out flows that are wide: here the bound is asked for, so all that pass it count as narrow
        flows = [
            replace(flow, spread_m=0.0)
            for flow in ways_of(found(others).flows, where)
            if flow.spread_m < asked.narrower_than
        ]
        without, by_flow = foretold(tracks[place], where, site, ()), foretold(tracks[place], where, site, tuple(flows))
        for key, (error, intent) in by_flow.items():
            if intent and intent.startswith("flow") and key in without:
                off[key[1]].append((without[key][0], error))
    for horizon_s, errors in sorted(off.items()):
        rms, median = np.sqrt(np.mean(np.square(errors), axis=0)), np.median(errors, axis=0)
        print(f"{horizon_s:5.0f} s, {len(errors):5d} predictions, without flows and with:", end=" ")
        print(f"RMS {rms[0]:5.0f} and {rms[1]:5.0f} m, median {median[0]:5.0f} and {median[1]:5.0f} m")


def foretold(
    track: Track, where: tuple[float, float], site: Site, flows: tuple[ArrivalFlow, ...]
) -> dict[tuple[int, float], tuple[float, str | None]]:
    """By instant and horizon the error over the ground, m, and the intent."""
    longitude, latitude = onto_level(where)(track.place_m[:, 0], track.place_m[:, 1], inverse=True)
    seconds, heights = track.time_s - track.time_s[0], track.place_m[:, 2] + site.runway.height_m
    state = pipeline.initial(site, Options(), flows=flows)
    truth = state.frame.runway_from_geodetic(np.radians(latitude), np.radians(longitude), heights)
    heard = []
    for second, *angles, height in zip(
        seconds.tolist(), latitude.tolist(), longitude.tolist(), heights.tolist(), strict=True
    ):
        at = START + round(second) * SECOND
        there = (*map(math.radians, angles), height - site.runway.geoid_separation_m)
        heard.append(
            Heard(at + LATENCY_NS, (GpsReport("icao:abcdef", at, at + LATENCY_NS, *there, horizontal_sigma_m=30.0),))
        )
    made = {}
    for first in range(0, len(heard), TOGETHER):
        state, picture = pipeline.step(state, heard[first : first + TOGETHER])
        told = picture.predict
        for row, valid in enumerate(((told.valid - START) / SECOND).tolist()):
            if valid <= seconds[-1]:
                came = [np.interp(valid, seconds, truth[:, axis]) for axis in (0, 1)]
                error = math.hypot(*(told.runway_m[row, :2] - came))
                made[int(told.made[row]), float(told.horizon_s[row])] = error, told.intent[row]
    return made


if __name__ == "__main__":
    main()
