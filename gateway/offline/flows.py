"""Arrival flows: which ways many arrivals took, how long they took, and who took none of them. Source: 002-7.

A track is east, north and height in metres about the airport over seconds to landing (negative). `literal` is as printed,
`jaccard` its repair, `default` compares whole tracks at equal distances to go and names who is typical of no flow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree
from scipy.spatial.distance import squareform

from gateway.estimators.fuzzy import feature_points, fuzzy_means

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Method = Literal["literal", "jaccard", "default"]

METHODS: tuple[Method, ...] = ("default", "jaccard", "literal")
OUTLIER = -1
POINTS = 50  # of a track that is compared as a whole
LEVEL_SCALE_M, HEIGHT_SCALE_M = 10_000.0, 1_000.0
CENTRES, SHARED = 30, 8
COMMON = (
    0.6  # of the centres that either of two tracks visits: half of a short arrival is the final that all of them share
)
LEAST_FLIGHTS = 3  # fewer are no flow: two may come the same way by chance, and which of two is typical cannot be said
SEPARATION_M = 304.8  # 1000 ft, vertical separation: mean tracks nearer than that, heights enlarged, are one flow
CORRIDOR_M = (
    1852.0  # half the width of RNAV 1, by which terminal procedures are flown: who is nearer is on the same way
)
ASIDE = 2.5  # times how near a flow's flights are to each other; who is further from all of them came alone
_DENSE = 3  # flights, the flight itself too, within whose distance a way is a way that is flown
_BESIDE = 50  # flights of a large flow that a flight is compared with
_FINAL = 4  # last points of a track that tell its landing direction
_THINNED = 400  # points of a track of which feature points are chosen
_FASTEST_MPS, _STEEPEST_MPS = 400.0, 60.0  # nothing that arrives is faster: a point that would have to be is damage


@dataclass(frozen=True, slots=True)
class Track:
    """One arrival: seconds to landing (n,), rising to 0, and east, north, height (n, 3), m."""

    name: str
    time_s: Floats
    place_m: Floats


@dataclass(frozen=True, slots=True)
class Flow:
    """Flights that came one way. The mean track (POINTS, 3) m and its spread (POINTS, 2), level and upright, 1 sigma, m."""

    flights: tuple[int, ...]
    mean_m: Floats
    spread_m: Floats
    mean_time_s: float  # from the first point that all of them have in common to landing
    time_spread_s: float


@dataclass(frozen=True, slots=True)
class Flows:
    """Flows, the largest first; of each track (n,) its flow's number or OUTLIER, and how typical of it it is, 0 to 1.

    `aside_m`: RMS distance of its way over the ground from the ways of the flow that it is most like; NaN where it is
    like none, and where a method does not ask.
    """

    flows: tuple[Flow, ...]
    labels: Integers
    membership: Floats
    aside_m: Floats


def cleaned(track: Track) -> Track:
    """Without points that nothing could have flown to: each further from the last good one than time allows, and back."""
    steps = np.abs(np.diff(track.place_m, axis=0)) / np.maximum(np.diff(track.time_s), 1.0)[:, None]
    if (np.hypot(steps[:, 0], steps[:, 1]) <= _FASTEST_MPS).all() and (steps[:, 2] <= _STEEPEST_MPS).all():
        return track
    kept = np.zeros(len(track.time_s), dtype=bool)
    off = np.linalg.norm(track.place_m - np.median(track.place_m, axis=0), axis=1)
    begin = int(np.argmin(np.abs(off - np.median(off))))  # a point that is surely good
    kept[begin] = True
    for places in (range(begin + 1, len(kept)), range(begin - 1, -1, -1)):
        good = begin
        for place in places:
            step_s = max(abs(track.time_s[place] - track.time_s[good]), 1.0)
            east, north, up = np.abs(track.place_m[place] - track.place_m[good]) / step_s
            if np.hypot(east, north) <= _FASTEST_MPS and up <= _STEEPEST_MPS:
                kept[place], good = True, place
    return Track(track.name, track.time_s[kept], track.place_m[kept])


def distance_to_go(track: Track) -> Floats:
    """Along its own way over the ground to its end (n,), m."""
    steps = np.linalg.norm(np.diff(track.place_m[:, :2], axis=0), axis=1)
    flown = np.concatenate([[0.0], np.cumsum(steps)])
    return np.asarray(flown[-1] - flown)


def by_distance(track: Track, from_m: float) -> Floats:
    """Places (POINTS, 3) at equal distances to go from `from_m` down to 0; what begins nearer stays where it began."""
    wanted = -np.linspace(from_m, 0.0, POINTS)
    to_go = -distance_to_go(track)
    return np.stack([np.interp(wanted, to_go, column) for column in track.place_m.T], axis=-1)


def found(tracks: Sequence[Track], method: Method = "default", *, least_flights: int = LEAST_FLIGHTS) -> Flows:
    """The flows of tracks that have been `cleaned`."""
    tracks = tuple(tracks)
    if len(tracks) < 2:
        return Flows((), np.full(len(tracks), OUTLIER), np.zeros(len(tracks)), np.full(len(tracks), math.nan))
    reach = float(np.median([distance_to_go(track)[0] for track in tracks]))
    places = np.stack([by_distance(track, max(reach, 1.0)) for track in tracks])
    aside_m = np.full(len(tracks), math.nan)
    if method == "default":
        alike = _by_shape(places, least_flights)
        aside_m = _aside(places[..., :2], alike)
        if (alike == OUTLIER).all():  # HDBSCAN parts: where all came one way it finds none
            whole = np.zeros(len(tracks), dtype=np.int64)
            aside_m = _aside(places[..., :2], whole)
            if float(np.median(aside_m)) <= CORRIDOR_M:
                alike = whole
        labels = _typical(alike, aside_m, places[..., :2], least_flights)
    else:
        labels = _by_centres(tracks, method, least_flights)
    return _described(_largest_first(labels), places, tracks, aside_m)


def _by_shape(places: Floats, least_flights: int) -> Integers:
    """HDBSCAN of whole tracks; the distance of two is their RMS distance over the points, heights ten times enlarged.

    Flights by chance closer to each other than to the rest of their flow would be a flow of their own, the sooner the fewer
    make one: flows that controllers could not hold apart are joined.
    """
    from sklearn.cluster import HDBSCAN

    scaled = places / [LEVEL_SCALE_M, LEVEL_SCALE_M, HEIGHT_SCALE_M] / np.sqrt(POINTS)
    scaled = scaled.reshape(len(scaled), -1)
    clusters = HDBSCAN(min_cluster_size=max(least_flights, 2), min_samples=min(_DENSE, len(scaled)), copy=True)
    labels = np.asarray(clusters.fit_predict(scaled), dtype=np.int64)
    numbers = range(int(labels.max(initial=OUTLIER)) + 1)
    if len(numbers) < 2:
        return labels
    means = np.stack([scaled[labels == number].mean(axis=0) for number in numbers])
    near = np.linalg.norm(means[:, None] - means, axis=-1) < SEPARATION_M / HEIGHT_SCALE_M
    _, joined = connected_components(csr_array(near), directed=False)
    return np.where(labels == OUTLIER, OUTLIER, joined[labels]).astype(np.int64)


def _aside(ground: Floats, labels: Integers) -> Floats:
    """RMS over each way (n, POINTS, 2) of the distance to the nearest other way of its flow (n,), m; NaN without a flow.

    Another flight may be the nearest at each point: who is vectored leaves the way of one for that of another. Of a large
    flow the `_BESIDE` most alike are looked at, so that its cost does not grow with the square of its flights.
    """
    aside_m = np.full(len(ground), math.nan)
    for number in range(int(labels.max(initial=OUTLIER)) + 1):
        flights = np.flatnonzero(labels == number)
        begins, steps = ground[flights, :-1], np.diff(ground[flights], axis=1)
        lengths = np.maximum(np.sum(steps**2, axis=-1), 1e-9)
        whole = ground[flights].reshape(len(flights), -1)
        _, alike = KDTree(whole).query(whole, k=min(len(flights), 1 + _BESIDE))
        for place, flight in enumerate(flights.tolist()):
            others = np.sort(alike[place][alike[place] != place])
            to = ground[flight][:, None, None] - begins[others]
            share = np.clip(np.sum(to * steps[others], axis=-1) / lengths[others], 0.0, 1.0)
            off = np.sum((to - share[..., None] * steps[others]) ** 2, axis=-1)
            aside_m[flight] = math.sqrt(float(np.mean(off.min(axis=(1, 2)))))
    return aside_m


def _typical(labels: Integers, aside_m: Floats, ground: Floats, least_flights: int) -> Integers:
    """Labels without those who only are more like this flow than like another.

    Who lands against the flow's direction, and who is further aside than ASIDE times the flow's median, or than as
    many corridors where the flow is narrower.
    """
    typical = labels.copy()
    final = ground[:, -1] - ground[:, -1 - _FINAL]
    final = final / np.maximum(np.linalg.norm(final, axis=-1, keepdims=True), 1e-9)
    for number in range(int(labels.max(initial=OUTLIER)) + 1):
        flights = np.flatnonzero(labels == number)
        against = np.sum(final[flights] * np.median(final[flights], axis=0), axis=-1) < 0.0
        far = aside_m[flights] > ASIDE * max(float(np.median(aside_m[flights])), CORRIDOR_M)
        typical[flights[against | far]] = OUTLIER
        if np.count_nonzero(typical == number) < least_flights:
            typical[flights] = OUTLIER
    return typical


def _by_centres(tracks: Sequence[Track], method: Method, least_flights: int) -> Integers:
    """As printed: tracks that visit enough of the same of thirty centres come the same way."""
    chosen = [_features(track) for track in tracks]
    whole = np.concatenate(chosen)
    low, high = whole.min(axis=0), whole.max(axis=0)
    _, membership = fuzzy_means((whole - low) / np.maximum(high - low, 1e-9), CENTRES)
    nearest = np.split(np.argmax(membership, axis=1), np.cumsum([len(one) for one in chosen])[:-1])
    visited = np.zeros((len(tracks), CENTRES), dtype=bool)
    for row, centres in zip(visited, nearest, strict=True):
        row[centres] = True
    counts = visited.astype(np.int64)
    shared = counts @ counts.T
    if method == "literal":
        _, labels = connected_components(csr_array(shared > SHARED), directed=False)
    else:
        either = counts.sum(axis=1)[:, None] + counts.sum(axis=1)[None, :] - shared
        # every pair of a flow has so much in common: one pair that has so by chance must not join two flows
        labels = fcluster(
            linkage(squareform(1.0 - shared / either, checks=False), "complete"), 1.0 - COMMON, "distance"
        )
    sizes = np.bincount(labels)
    return np.where(sizes[labels] >= least_flights, labels, OUTLIER).astype(np.int64)


def _features(track: Track) -> Floats:
    """Some fifty points (m, 4) of a track, m and s, that show its shape: chosen in the box that it fills itself."""
    some = np.unique(np.linspace(0, len(track.time_s) - 1, _THINNED).astype(int))
    points = np.concatenate([track.place_m[some], track.time_s[some, None]], axis=1)
    low, high = points.min(axis=0), points.max(axis=0)
    return points[feature_points((points - low) / np.maximum(high - low, 1e-9))]


def _largest_first(labels: Integers) -> Integers:
    """The same flows, numbered by size and, where that is equal, by their first flight."""
    numbers = [number for number in dict.fromkeys(labels.tolist()) if number != OUTLIER]
    order = sorted(numbers, key=lambda number: -int(np.count_nonzero(labels == number)))
    renamed = {number: place for place, number in enumerate(order)} | {OUTLIER: OUTLIER}
    return np.array([renamed[number] for number in labels.tolist()], dtype=np.int64)


def _described(labels: Integers, places: Floats, tracks: Sequence[Track], aside_m: Floats) -> Flows:
    flows, membership = [], np.zeros(len(tracks))
    for number in range(int(labels.max(initial=OUTLIER)) + 1):
        flights = np.flatnonzero(labels == number)
        own = places[flights]
        mean = own.mean(axis=0)
        off = own - mean
        spread = np.stack(
            [np.sqrt(np.mean(np.sum(off[..., :2] ** 2, axis=-1), axis=0) / 2.0), off[..., 2].std(axis=0)], axis=-1
        )
        durations = np.array([tracks[flight].time_s[-1] - tracks[flight].time_s[0] for flight in flights.tolist()])
        flows.append(Flow(tuple(flights.tolist()), mean, spread, float(durations.mean()), float(durations.std())))
        scaled = np.sqrt(np.mean(np.sum((off / [LEVEL_SCALE_M, LEVEL_SCALE_M, HEIGHT_SCALE_M]) ** 2, axis=-1), axis=-1))
        membership[flights] = np.exp(-0.5 * (scaled / max(float(np.sqrt(np.mean(scaled**2))), 1e-9)) ** 2)
    return Flows(tuple(flows), labels, membership, aside_m)
