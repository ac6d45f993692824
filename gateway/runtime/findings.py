"""What a survey of a recording means for its reader: what Talkdown can make of it, what is missing, what to do about it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from gateway.observation import Timing
from gateway.runtime.survey import AircraftSeen, RadarSeen, Stream, Survey

_LOSSY = 0.01  # a share of frames lost that a person should know of
_SILENT_NS = 5_000_000_000  # tracks coast after 2 s and are worth little after 5
_SLOW_S = 0.5  # link delay at the 99th percentile beyond which receive times would mislead
_HISTORY_S = 10.0


@dataclass(frozen=True, slots=True)
class Finding:
    """One sentence. "good": can be used; "missing": what is not there and what comes of it; "wrong": damage or loss."""

    kind: Literal["good", "missing", "wrong"]
    text: str


def findings(found: Survey) -> list[Finding]:
    """All of them, the good first."""
    told = [*_of_aircraft(found), *_of_radars(found), *_of_links(found), *_of_all(found)]
    order = {"good": 0, "missing": 1, "wrong": 2}
    return sorted(told, key=lambda finding: order[finding.kind])


def _of_aircraft(found: Survey) -> Iterator[Finding]:
    for name, seen in sorted(found.aircraft.items()):
        if name.startswith("mavlink:"):
            yield from _of_vehicle(found, seen)
    traffic = [seen for name, seen in found.aircraft.items() if not name.startswith("mavlink:")]
    if traffic:
        together = _together(traffic)
        yield Finding("good", f"{together.name}: {together.reports.count} positions; a track for each.")
        yield from _of_reports(together)


def _of_vehicle(found: Survey, seen: AircraftSeen) -> Iterator[Finding]:
    name, reports = seen.name, seen.reports
    if not reports.count:
        yield Finding("missing", f"{name} tells no position that can be used{_refusals(found)}: it will not be drawn.")
        return
    yield Finding("good", f"{name}: {reports.count} positions, {reports.rate_hz:.1f}/s; a track.")
    yield from _of_reports(seen)
    if reports.longest_gap_ns >= _SILENT_NS:
        gap_s, since_s = reports.longest_gap_ns / 1e9, (reports.gap_at - found.began) / 1e9
        yield Finding(
            "wrong", f"{name} tells no position for {gap_s:.1f} s from second {since_s:.0f}: it coasts there."
        )
    if seen.with_height and not seen.with_ellipsoid_height and not _has_geoid(found):
        yield Finding(
            "missing",
            f"{name} tells altitudes above mean sea level only: set geoid_separation_m in the site file, or heights above the "
            "ellipsoid are wrong by as much.",
        )
    if not seen.kinds["Attitude"]:
        yield Finding("missing", f"{name} tells no attitude: it is drawn along its course.")
    if seen.kinds["Truth"]:
        yield Finding("good", f"{name} comes with a simulator's truth: tracks are scored against it.")
    if seen.plan_points > 1:
        yield Finding("good", f"{name} has told a plan of {seen.plan_points} points.")


def _of_reports(seen: AircraftSeen) -> Iterator[Finding]:
    """What positions carry, and what not."""
    yield from _of_time(seen)
    if not seen.with_accuracy:
        yield Finding("missing", f"{seen.name}: no position says how accurate it is; [position] of the site file must.")
    if not seen.with_height:
        yield Finding("missing", f"{seen.name}: only pressure altitudes; without a radar the height is not known.")


def _together(traffic: Sequence[AircraftSeen]) -> AircraftSeen:
    """Other aircraft as one: there can be hundreds."""
    names = sorted(seen.name for seen in traffic)
    shown = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
    together = AircraftSeen(f"Traffic of {len(names)} ({shown})", Stream("positions"))
    for seen in traffic:
        together.reports.count += seen.reports.count
        together.timings += seen.timings
        together.with_accuracy += seen.with_accuracy
        together.with_height += seen.with_height
    return together


def _has_geoid(found: Survey) -> bool:
    return found.place is None or bool(found.place.site.runway.geoid_separation_m)


def _of_time(seen: AircraftSeen) -> Iterator[Finding]:
    """How far the times of an aircraft's reports can be trusted."""
    of = seen.reports.count
    if foreign := seen.timings[Timing.FOREIGN]:
        yield Finding("wrong", f"{seen.name}: {foreign} of {of} positions are by a foreign clock: shown, not fused.")
    if provisional := seen.timings[Timing.PROVISIONAL]:
        yield Finding(
            "missing",
            f"{seen.name}: {provisional} of {of} positions come before its clock is set: shown, not fused with others.",
        )
    if envelope := seen.timings[Timing.ENVELOPE]:
        yield Finding(
            "missing",
            f"{seen.name} never tells UTC for {envelope} of {of} positions (no SYSTEM_TIME with a date): their time is when the "
            "least delayed frame was heard.",
        )


def _refusals(found: Survey) -> str:
    """Why positions were refused, the commonest reason first."""
    reasons = ("no fix", "no position yet", "no altitude yet", "position out of range", "undecided")
    counted = {
        reason: sum(n for name, n in found.counters.items() if name.endswith(f" {reason}")) for reason in reasons
    }
    most = max(counted, key=lambda reason: counted[reason])
    return f" ({counted[most]} refused: {most})" if counted[most] else ""


def _of_radars(found: Survey) -> Iterator[Finding]:
    for number, seen in sorted(found.radars.items()):
        if seen.plots.count:
            yield Finding("good", _radar(seen))
        if seen.plots.count > seen.numbered:
            bare = seen.plots.count - seen.numbered
            yield Finding("missing", f"radar {number}: {bare} plots carry no track number and are only shown.")
        known = found.place is not None and any(radar.number == number for radar in found.place.site.radars)
        if not seen.states and not known:
            yield Finding(
                "missing",
                f"radar {number} never says where it stands: add [[radar]] number = {number} to the site file.",
            )
    if not found.radars:
        yield Finding(
            "missing",
            "No landing radar: tracks rest on what aircraft say. `talkdown simulate radar --watch FILE` makes one to try.",
        )


def _radar(seen: RadarSeen) -> str:
    partial = f", {seen.partial} of them partial" if seen.partial else ""
    return f"radar {seen.number}: {seen.plots.count} plots{partial} of {len(seen.tracks)} tracks, {seen.plots.rate_hz:.1f}/s."


def _of_links(found: Survey) -> Iterator[Finding]:
    for component in found.components.values():
        if component.lost_share >= _LOSSY:
            lost = component.counters["lost"]
            yield Finding("wrong", f"{component.name}: {lost} frames lost by sequence ({component.lost_share:.1%}).")
    for name, vehicle in sorted(found.vehicles.items()):
        if math.isfinite(vehicle.delay_99_s) and vehicle.delay_99_s >= _SLOW_S:
            late = ", some too late to be used" if vehicle.delay_99_s > _HISTORY_S else ""
            yield Finding(
                "wrong",
                f"{name}: its link holds frames back, {vehicle.delay_s:.2f} s in the median and {vehicle.delay_99_s:.1f} s for "
                f"one in a hundred{late}; they are placed by the vehicle's own clock.",
            )


def _of_all(found: Survey) -> Iterator[Finding]:
    if found.place is None:
        yield Finding("missing", "Nothing tells where the runway is: give replay a site file with --site.")
    else:
        yield Finding("good", f"Site: {found.place.origin}.")
    if found.epoch_offset_s:
        yield Finding("good", f"Its clocks are {found.epoch_offset_s:+d} s from its stamps: the session follows them.")
