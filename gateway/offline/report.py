"""Approaches of an archived session, judged: deviations, gates, touchdown, sources, accuracy, and a grade with its reasons.

A way is positions and velocities in the runway frame over time; an approach is the part of it that is on final, a second
apart. The limits are ICAO Annex 10's for precision approach radar (volume I, 3.2), the gates those of `gateway.predict.gates`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.offline.precision import Accuracy, Course, accuracy_of
from gateway.offline.touchdown import Touchdown, touchdown
from gateway.offline.way import Flown, resampled
from gateway.predict.approach import deviations
from gateway.predict.gates import (
    KINDS,
    Alert,
    alerts,
    excess,
    gate_heights,
    on_final,
)
from gateway.settings import Site

Floats = NDArray[np.float64]
Words = NDArray[np.str_]

SECOND = 1_000_000_000
LEAST_S = 20  # on final: less is no approach
APART_S = 30  # without being on final: the next one is another
ROLLS_S = 120  # after the threshold, within which the touchdown is looked for
_GAPS_TOO_LONG_S = 10.0
_MEASURE = ("gps", "radar")  # dead reckoning is wanted only where the others give nothing
_BETWEEN = 2  # rows, the fewest of which a gap can be told


@dataclass(frozen=True, slots=True)
class Heard:
    """What stands beside a way's rows (n,): who updated it, the state, s from measured to heard (NaN: coasted), radar track."""

    updated_by: Words
    state: Words
    delay_s: Floats
    radar_track: Words


@dataclass(frozen=True, slots=True)
class Gate:
    """How a height was passed: what was too much then. `distance_m` is to the threshold."""

    which: str  # "upper", "lower"
    height_m: float
    passed_at: int
    distance_m: float
    above_m: float
    left_m: float
    speed_mps: float
    sink_mps: float
    wrong: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Seen:
    """What one kind of source gave the track on the approach. Latency: from measured to heard, s; None: not told."""

    source: str
    updates: int
    rate_hz: float
    longest_gap_s: float
    latency_median_s: float | None
    latency_p95_s: float | None


@dataclass(frozen=True, slots=True)
class Approach:
    """One approach, judged. The truth's course and touchdown are None where the session has no truth."""

    aircraft: str
    course: Course
    true_course: Course | None
    gates: tuple[Gate, ...]
    alerts: tuple[Alert, ...]
    touchdown: Touchdown | None
    true_touchdown: Touchdown | None
    sources: tuple[Seen, ...]
    states: tuple[tuple[str, float], ...]  # the track's, and their shares of its rows
    radar_tracks: tuple[str, ...]
    accuracy: Accuracy | None
    grade: str
    reasons: tuple[str, ...]


def approaches(site: Site, aircraft: str, flown: Flown, heard: Heard, true: Flown | None) -> list[Approach]:
    """The approaches of one aircraft, in the order of time."""
    if len(flown.time) < _BETWEEN:
        return []
    whole = _course(site, resampled(flown))
    return [_judged(site, aircraft, course, flown, heard, true) for course in _parts(site, whole)]


def _course(site: Site, way: Flown) -> Course:
    """Where it is not on final, the deviations are NaN."""
    off = deviations(site.runway, way.place_m, way.velocity_mps[:, 0])
    speed = np.hypot(way.velocity_mps[:, 0], way.velocity_mps[:, 1])
    on = on_final(off, way.velocity_mps)
    distance, above, left = (np.where(on, one, math.nan) for one in (off.distance_m, off.vertical_m, off.lateral_m))
    return Course(way.time, distance, above, left, way.place_m[:, 2], speed, -way.velocity_mps[:, 2])


def _parts(site: Site, whole: Course) -> list[Course]:
    """Each stretch on final that is long enough and comes lower than the upper gate."""
    rows = np.flatnonzero(np.isfinite(whole.distance_m))
    if not len(rows):
        return []
    found = []
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > APART_S) + 1):
        course = _between(whole, part[0], part[-1] + 1)
        upper = float(gate_heights(site.stabilised, site.runway, _wanted(site, course)[-1])[0])
        if len(part) >= LEAST_S and np.nanmin(course.height_m) < upper:
            found.append(course)
    return found


def _between(course: Course, begin: int, end: int) -> Course:
    return Course(
        course.time[begin:end],
        course.distance_m[begin:end],
        course.above_m[begin:end],
        course.left_m[begin:end],
        course.height_m[begin:end],
        course.speed_mps[begin:end],
        course.sink_mps[begin:end],
    )


def _wanted(site: Site, course: Course) -> Floats:
    """The speed to approach at: the site's, or the least flown on this final until then."""
    if site.stabilised.approach_speed_mps is not None:
        return np.full(len(course.time), site.stabilised.approach_speed_mps)
    return np.asarray(np.fmin.accumulate(course.speed_mps))


def _judged(site: Site, aircraft: str, course: Course, flown: Flown, heard: Heard, true: Flown | None) -> Approach:
    begin, end = int(course.time[0]), int(course.time[-1])
    found = excess(
        site.stabilised,
        site.runway,
        course.distance_m,
        course.above_m,
        course.left_m,
        course.speed_mps,
        _wanted(site, course),
    )
    told = tuple(alerts(found))
    gates = _gates(site, course, told)
    rows = (flown.time >= begin) & (flown.time <= end)
    sources = _seen(flown.time[rows], heard, rows, (end - begin) / SECOND)
    words, counts = np.unique(heard.state[rows], return_counts=True)
    tracks = tuple(one for one in dict.fromkeys(heard.radar_track[rows].tolist()) if one)
    landed = touchdown(site.runway, flown, end - APART_S * SECOND, end + ROLLS_S * SECOND)
    true_course = None if true is None else _course(site, resampled(true, course.time))
    true_landed = None if true is None else touchdown(site.runway, true, end - APART_S * SECOND, end + ROLLS_S * SECOND)
    accuracy = None if true_course is None else accuracy_of(site, course, true_course)
    grade, reasons = _grade(site, gates, told, landed, sources, accuracy)
    return Approach(
        aircraft,
        course,
        None if accuracy is None else true_course,
        gates,
        told,
        landed,
        true_landed,
        sources,
        tuple((word, count / int(counts.sum())) for word, count in zip(words.tolist(), counts.tolist(), strict=True)),
        tracks,
        accuracy,
        grade,
        reasons,
    )


def _gates(site: Site, course: Course, told: Sequence[Alert]) -> tuple[Gate, ...]:
    passed = []
    heights = gate_heights(site.stabilised, site.runway, _wanted(site, course)[-1])
    for which, height in zip(("upper", "lower"), heights, strict=True):
        above = np.flatnonzero(course.height_m > height)
        if not len(above) or above[-1] + 1 >= len(course.time):
            continue  # it came from below, or never came so low
        row = int(above[-1]) + 1
        wrong = tuple(kind for kind in KINDS if any(one.kind == kind and one.begins <= row < one.ends for one in told))
        passed.append(
            Gate(
                which,
                float(height),
                int(course.time[row]),
                float(course.distance_m[row]),
                float(course.above_m[row]),
                float(course.left_m[row]),
                float(course.speed_mps[row]),
                float(course.sink_mps[row]),
                wrong,
            )
        )
    return tuple(passed)


def _seen(times: NDArray[np.int64], heard: Heard, rows: NDArray[np.bool_], lasts_s: float) -> tuple[Seen, ...]:
    found = []
    for source in np.unique(heard.updated_by[rows]).tolist():
        own = heard.updated_by[rows] == source
        if source == "coast":
            continue
        delay = heard.delay_s[rows][own]
        delay = delay[np.isfinite(delay)]
        edges = np.concatenate([times[:1], np.unique(times[own]), times[-1:]])
        median, p95 = np.quantile(delay, [0.5, 0.95]).tolist() if len(delay) else (None, None)
        gap = float(np.diff(edges).max()) / SECOND
        found.append(Seen(source, int(own.sum()), float(own.sum()) / max(lasts_s, 1.0), gap, median, p95))
    return tuple(found)


def _grade(
    site: Site,
    gates: Sequence[Gate],
    told: Sequence[Alert],
    landed: Touchdown | None,
    sources: Sequence[Seen],
    accuracy: Accuracy | None,
) -> tuple[str, tuple[str, ...]]:
    """A: nothing is wrong. B: what was wrong was right again at the lower gate. C: it was not, or nobody can say.

    What the sources saw does not change how it was flown: it is said, and does not lower the grade.
    """
    reasons = [
        f"at the {gate.which} gate, {gate.height_m:.0f} m: " + (", ".join(gate.wrong) if gate.wrong else "stabilised")
        for gate in gates
    ]
    lowest = next((gate for gate in gates if gate.which == "lower"), None)
    if not any(gate.which == "upper" for gate in gates):
        reasons.append("the upper gate was not seen to be passed")
    if lowest is None:
        reasons.append("the lower gate was not seen to be passed: it cannot be said to be stabilised")
    reasons += [f"{one.kind} for {one.ends - one.begins} s" for one in told]
    outside = landed is not None and not site.runway.threshold_x_m <= landed.along_m <= -site.runway.threshold_x_m
    if landed is None:
        reasons.append("no touchdown was seen")
    elif outside:
        reasons.append("the touchdown is not on the runway")
    reasons += [
        f"{one.source} gave the track nothing for {one.longest_gap_s:.0f} s"
        for one in sources
        if one.source in _MEASURE and one.longest_gap_s > _GAPS_TOO_LONG_S
    ]
    if accuracy is not None and min(accuracy.azimuth_within, accuracy.elevation_within) < 0.95:
        reasons.append("the track was off the truth by more than Annex 10 allows a precision radar")
    if lowest is None or lowest.wrong or outside:
        return "C", tuple(reasons)
    return ("B" if told or any(gate.wrong for gate in gates) else "A"), tuple(reasons)
