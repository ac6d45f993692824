"""The page before the approach reports of many sessions: every approach with its grade, its report behind a link."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from urllib.parse import quote

from gateway.offline.report import Approach
from gateway.sinks.report import utc

GRADES = {"A": "#2e7d32", "B": "#b26a00", "C": "#c62828"}
_STYLE = """
body { font: 14px/1.4 system-ui, sans-serif; color: #111; max-width: 1200px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.35em; margin: 0 0 .2em } h2 { font-size: 1.05em; margin: 1.4em 0 .3em }
table { border-collapse: collapse; width: 100% } td, th { padding: .25em .8em .25em 0; text-align: left; vertical-align: top }
th { font-weight: 600; border-bottom: 1px solid #999 } tr + tr.first td { border-top: 1px solid #e3e3e3 }
.grade { font-weight: 700 } .note { color: #555; font-size: .9em } .number { text-align: right; white-space: nowrap }
.bar { display: flex; margin: .6em 0; color: #fff; font-weight: 600; print-color-adjust: exact } .bar span { padding: .1em .5em }
td:nth-child(-n+4) { white-space: nowrap }
@page { size: A4; margin: 12mm }
@media print { body { margin: 0; max-width: none; padding: 0; font-size: 10.5px } tr { break-inside: avoid }
a { color: inherit } }
"""


@dataclass(frozen=True, slots=True)
class Graded:
    """One approach, as a list shows it. `began`: ns since 1970 UTC; touchdown: m past the threshold and m/s down, or None."""

    aircraft: str
    began: int
    grade: str
    reasons: tuple[str, ...]
    past_threshold_m: float | None
    sink_mps: float | None


@dataclass(frozen=True, slots=True)
class Entry:
    """One session: its name, its page beside the index, its site, its approaches, or why it has no report."""

    name: str
    page: str
    site: str = ""
    approaches: tuple[Graded, ...] = ()
    failure: str | None = None


def graded(one: Approach) -> Graded:
    """What a list shows of an approach."""
    landed = one.touchdown
    return Graded(
        one.aircraft,
        int(one.course.time[0]),
        one.grade,
        one.reasons,
        None if landed is None else landed.past_threshold_m,
        None if landed is None else landed.sink_mps,
    )


def index(title: str, entries: Sequence[Entry]) -> str:
    """The page's text; sessions in the order in which they are given."""
    counts = Counter(one.grade for entry in entries for one in entry.approaches)
    none = [entry for entry in entries if not entry.approaches and entry.failure is None]
    failed = [entry for entry in entries if entry.failure is not None]
    approaches = sum(counts.values())
    parts = [
        f"<h1>{escape(title)}</h1>",
        f"<p>{approaches} approaches in {len(entries)} sessions.</p>",
        _bar(counts) if approaches else "",
        "<p class='note'>A: nothing was wrong. B: what was wrong was right at the lower gate. C: it was not right there, "
        "that gate was not seen to be passed, or the touchdown was beside the runway.</p>",
        _table(entries) if approaches else "",
        _list("Sessions without an approach", [_link(entry) for entry in none]),
        _list("Without a report", [f"{escape(one.name)}: {escape(one.failure or '')}" for one in failed]),
    ]
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}: approaches</title>'
        f'<link rel="icon" href="data:,"><style>{_STYLE}</style></head><body>\n{"".join(parts)}\n</body></html>\n'
    )


def _bar(counts: Counter[str]) -> str:
    pieces = [
        f'<span style="flex: {counts[grade]}; background: {colour}">{grade}&nbsp;{counts[grade]}</span>'
        for grade, colour in GRADES.items()
        if counts[grade]
    ]
    return f'<div class="bar">{"".join(pieces)}</div>'


def _table(entries: Sequence[Entry]) -> str:
    headings = ("session", "site", "on final, UTC", "aircraft", "grade", "reasons", "past threshold", "sink rate")
    numbers = headings[-2:]
    head = "".join(f'<th class="number">{one}</th>' if one in numbers else f"<th>{one}</th>" for one in headings)
    rows = []
    for entry in entries:
        for place, one in enumerate(entry.approaches):
            session = (_link(entry), escape(entry.site)) if not place else ("", "")
            aircraft = f'<a href="{quote(entry.page)}#{place + 1}">{escape(one.aircraft)}</a>'
            cells = "".join(f"<td>{text}</td>" for text in (*session, utc(one.began), aircraft))
            grade = f'<td class="grade" style="color: {GRADES.get(one.grade, "inherit")}">{escape(one.grade)}</td>'
            reasons = f"<td>{'<br>'.join(map(escape, one.reasons))}</td>"
            touchdown = "".join(
                f'<td class="number">{"" if value is None else f"{value:.{digits}f} {unit}"}</td>'
                for value, digits, unit in ((one.past_threshold_m, 0, "m"), (one.sink_mps, 2, "m/s"))
            )
            rows.append(f"<tr{'' if place else ' class=first'}>{cells}{grade}{reasons}{touchdown}</tr>")
    return f"<table><tr>{head}</tr>\n" + "\n".join(rows) + "</table>"


def _link(entry: Entry) -> str:
    return f'<a href="{quote(entry.page)}">{escape(entry.name)}</a>'


def _list(heading: str, items: Sequence[str]) -> str:
    return f"<h2>{heading}</h2><ul>{''.join(f'<li>{one}</li>' for one in items)}</ul>" if items else ""
