"""Approach reports as one HTML file that needs nothing else: each approach begins a new sheet when printed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from html import escape
from typing import Any

from gateway.offline.precision import azimuth_limit, elevation_limit, radar_range
from gateway.offline.report import Approach
from gateway.offline.touchdown import Touchdown
from gateway.register import Remembered
from gateway.settings import Site
from gateway.settings.tables import FOOT_M
from gateway.sinks.report_plots import Band, Line, Mark, plot

_TRACK, _TRUTH, _LIMIT, _PATH = "#c62828", "#555555", "#dfe7f1", "#1565c0"
_ERRORS = (
    ("range", 1.0, "m", 1),
    ("azimuth", math.degrees(1.0), "deg", 3),
    ("elevation", math.degrees(1.0), "deg", 3),
    ("time", 1.0, "s", 3),
)
_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; color: #111; max-width: 800px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.35em; margin: 0 0 .2em } h2 { font-size: 1.05em; margin: 1em 0 .3em }
table { border-collapse: collapse; width: 100% } td, th { padding: .15em .6em .15em 0; text-align: left; vertical-align: top }
th { font-weight: 600; border-bottom: 1px solid #999 } .grade { font-size: 2em; font-weight: 700; float: right; padding: 0 .4em;
border: 2px solid } section { break-after: page } section:last-child { break-after: auto } svg { width: 100%; height: auto;
break-inside: avoid; font: 11px system-ui, sans-serif } .title { font-weight: 600; font-size: 12px }
.middle { text-anchor: middle }
.end { text-anchor: end } .grid { stroke: #e3e3e3 } .zero { stroke: #777 } .line { fill: none; stroke-width: 1.6 }
.mark { stroke: #888; stroke-dasharray: 2 3 } .note { color: #555; font-size: .9em }
@page { size: A4; margin: 12mm }
@media print { body { margin: 0; max-width: none; padding: 0; font-size: 10.5px } h2 { break-after: avoid; margin: .5em 0 .2em }
p, ul { margin: .3em 0 } table { break-inside: avoid } }
"""


def page(
    name: str, site: Site, summary: Mapping[str, Any], learnt: Remembered | None, approaches: Sequence[Approach]
) -> str:
    """The file's text. `name` is the session's, `summary` and `learnt` what session.json says of it and of the radars' errors."""
    sections = [
        _section(number, len(approaches), name, site, summary, learnt, one) for number, one in enumerate(approaches, 1)
    ]
    none = f"<section><h1>{escape(name)}</h1><p>Nobody was on final long enough: no approach to report.</p></section>"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(name)}: approaches</title>'
        f'<link rel="icon" href="data:,"><style>{_STYLE}</style></head><body>\n{"".join(sections) or none}\n</body></html>\n'
    )


def _section(
    number: int, of: int, name: str, site: Site, summary: Mapping[str, Any], learnt: Remembered | None, one: Approach
) -> str:
    course = one.course
    lasted = (int(course.time[-1]) - int(course.time[0])) / 1e9
    parts = [
        f'<section id="{number}"><div class="grade">{escape(one.grade)}</div>',
        f"<h1>{escape(one.aircraft)}, {escape(site.name)}</h1>",
        f"<p>Approach {number} of {of} in {escape(name)}: {utc(int(course.time[0]))} UTC, {lasted:.0f} s on final.</p>",
        *_moves(site),
        "<h2>Grade</h2><ul>" + "".join(f"<li>{escape(reason)}</li>" for reason in one.reasons) + "</ul>",
        "<p class='note'>A: nothing was wrong. B: what was wrong was right at the lower gate. C: it was not right there, "
        "that gate was not seen to be passed, or the touchdown was beside the runway.</p>",
        *_plots(site, one),
        "<h2>Gates</h2>",
        _gates(one),
        "<h2>Touchdown</h2>",
        _touchdowns(one),
        "<h2>Sources</h2>",
        _sources(one, summary),
        "<h2>Association and registration</h2>",
        f"<p>{escape(_association(one, summary))}</p><p>{escape(_registration(learnt))}</p>",
        "<h2>Accuracy</h2>",
        f"<p>{escape(_accuracy(one))}</p></section>\n",
    ]
    return "\n".join(parts)


def _moves(site: Site) -> list[str]:
    if site.runway.follows is None:
        return []
    text = f"The runway is the deck of {site.runway.follows}: places, speeds and sink rates are relative to it as it moved."
    return [f"<p>{escape(text)}</p>"]


def _plots(site: Site, one: Approach) -> list[str]:
    course, true = one.course, one.true_course
    about = course if true is None else true
    x = course.distance_m / 1000.0
    reach = radar_range(site, about)
    marks = [Mark(f"{gate.height_m:.0f} m gate", gate.distance_m / 1000.0) for gate in one.gates]
    marks += [Mark(point.name, point.distance_m / 1000.0) for point in site.decision_points]
    where = "distance to the threshold, km"

    def drawn(title: str, values: str, limit: Any) -> str:
        middle = getattr(about, values)
        most = limit(reach, middle)
        lines = [] if true is None else [Line("truth", true.distance_m / 1000.0, middle, _TRUTH, dashed=True)]
        lines.append(Line("track", x, getattr(course, values), _TRACK))
        band = Band("Annex 10", about.distance_m / 1000.0, middle - most, middle + most, _LIMIT)
        return plot(title, where, lines, [band], marks)

    before_aim = course.distance_m + site.runway.aiming_point_x_m - site.runway.threshold_x_m
    path = Line("glide path", x, before_aim * math.tan(site.runway.glide_path_rad), _PATH, dashed=True)
    return [
        "<h2>Deviations</h2>",
        drawn("Above the glide path, m", "above_m", elevation_limit),
        drawn("Left of the centreline, m", "left_m", azimuth_limit),
        "<p class='note'>Annex 10: what a precision approach radar may be off (0.4 % of the range and a tenth of the deviation, "
        "at least 6 m upright; 0.6 % and a tenth, at least 9 m to the side), about the "
        f"{'track' if true is None else 'truth'}.</p>",
        "<h2>Profile</h2>",
        plot("Height above the runway, m", where, [path, Line("track", x, course.height_m, _TRACK)], (), marks),
        plot(
            "Ground speed, m/s" if site.runway.follows is None else "Speed relative to the deck, m/s",
            where,
            [Line("track", x, course.speed_mps, _TRACK)],
            (),
            marks,
        ),
        plot("Sink rate, m/s", where, [Line("track", x, course.sink_mps, _TRACK)], (), marks),
    ]


def _gates(one: Approach) -> str:
    rows = [
        (
            f"{gate.which}, {gate.height_m:.0f} m ({gate.height_m / FOOT_M:.0f} ft)",
            f"{gate.distance_m / 1000.0:.2f} km",
            f"{gate.above_m:+.1f} m",
            f"{gate.left_m:+.1f} m",
            f"{gate.speed_mps:.1f} m/s",
            f"{gate.sink_mps:.1f} m/s",
            ", ".join(gate.wrong) or "stabilised",
        )
        for gate in one.gates
    ]
    text = _table(("gate", "to go", "above", "left", "speed", "sink rate", ""), rows)
    text += (
        "<p class='note'>The gates are 1000 and 500 ft above the runway, or as much lower as slow aircraft have the same time "
        "to go from (83 and 41.5 s), unless the site file gives others.</p>"
    )
    alerts = "; ".join(
        f"{alert.kind} for {alert.ends - alert.begins} s, at most {alert.worst:.1f}" for alert in one.alerts
    )
    return text + (f"<p>{escape(alerts)} (m; m/s).</p>" if alerts else "")


def _touchdowns(one: Approach) -> str:
    if one.touchdown is None:
        return "<p>None was seen.</p>"

    def row(who: str, seen: Touchdown) -> tuple[str, ...]:
        return (
            who,
            utc(seen.time, tenths=True),
            f"{seen.past_threshold_m:.0f} m",
            f"{seen.left_m:+.1f} m",
            f"{seen.speed_mps:.1f} m/s",
            f"{seen.sink_mps:.2f} m/s",
        )

    rows = [row("track", one.touchdown)] + ([] if one.true_touchdown is None else [row("truth", one.true_touchdown)])
    return _table(("", "UTC", "past the threshold", "left", "speed", "sink rate"), rows)


def _sources(one: Approach, summary: Mapping[str, Any]) -> str:
    rows = []
    for seen in one.sources:
        latency = "not told"
        if seen.latency_median_s is not None and seen.latency_p95_s is not None:
            latency = f"{max(seen.latency_median_s, 0.0):.3f} s, 95 %: {max(seen.latency_p95_s, 0.0):.3f} s"
        rows.append((seen.source, str(seen.updates), f"{seen.rate_hz:.2f} Hz", f"{seen.longest_gap_s:.1f} s", latency))
    text = _table(("updates by", "count", "rate", "longest gap", "latency, median"), rows)
    counters = summary.get("counters") or {}
    told = "; ".join(f"{what} {count}" for what, count in counters.items())
    return text + (f"<p class='note'>Whole session: {escape(told)}.</p>" if told else "")


def _association(one: Approach, summary: Mapping[str, Any]) -> str:
    states = ", ".join(f"{state} {100.0 * share:.0f} %" for state, share in one.states)
    tracks = ", ".join(one.radar_tracks) or "none"
    whole = f"{summary.get('associations', 0)} made and {summary.get('associations_lost', 0)} lost in the session"
    return f"The track was {states}. Radar tracks: {tracks}; associations: {whole}."


def _registration(learnt: Remembered | None) -> str:
    if learnt is None or not learnt.radars:
        return "Nothing was learnt of a radar's constant errors."
    told = []
    for radar in learnt.radars:
        words = [
            f"{name} {scale * error:.{digits}f} +- {scale * sigma:.{digits}f} {unit}"
            for (name, scale, unit, digits), error, sigma in zip(_ERRORS, radar.error, radar.sigma, strict=True)
            if error is not None and sigma is not None
        ]
        too_much = f"measures too much by {', '.join(words)}" if words else "has no constant error that was settled"
        told.append(f"Radar {radar.number} {too_much}")
    return "; ".join(told) + "."


def _accuracy(one: Approach) -> str:
    if one.accuracy is None:
        return "The session has no truth of this aircraft."
    seen = one.accuracy
    return (
        f"Against the truth over {seen.seconds} s: RMSE {seen.lateral_rmse_m:.2f} m to the side, "
        f"{seen.vertical_rmse_m:.2f} m upright; within Annex 10 {100.0 * seen.azimuth_within:.0f} % in azimuth, "
        f"{100.0 * seen.elevation_within:.0f} % in elevation."
    )


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(one)}</th>" for one in headings)
    body = "".join("<tr>" + "".join(f"<td>{escape(one)}</td>" for one in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def utc(time: int, *, tenths: bool = False) -> str:
    """An instant, ns since 1970 UTC, as date and time; with `tenths` as the time of day only."""
    moment = datetime.fromtimestamp(time // 1_000_000_000, UTC)
    return f"{moment:%H:%M:%S}.{time // 100_000_000 % 10}" if tenths else f"{moment:%Y-%m-%d %H:%M:%S}"
