"""Which arrivals `talkdown flows` looks at, and the published procedures that they are compared with."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli.failures import UsageError

if TYPE_CHECKING:
    from rich.table import Table

    from gateway.offline.flows import Track
    from gateway.offline.procedures import Compared
    from gateway.settings.procedures import Published

_NUMBER = re.compile(r"0?[1-9]|[12]\d|3[0-6]")
_WINDS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")


@dataclass(frozen=True, slots=True)
class Selection:
    """The arrivals that are looked at, and what they are compared with."""

    runway: Annotated[
        str | None,
        typer.Option(
            "--runway",
            metavar="NAME",
            help="Only those that land on it: 16, or the name of a [\\[runway]] of --procedure, as 26L.",
            show_default=False,
        ),
    ] = None
    come_from: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="W|SW|240-300",
            help="Only those that begin there, as seen from the airport: a quadrant, an octant, or degrees clockwise.",
            show_default=False,
        ),
    ] = None
    procedure: Annotated[
        Path | None,
        typer.Option(
            "--procedure",
            metavar="FILE",
            help="Published procedures (TOML): who flew which, shortcuts, heights at the entry.",
            show_default=False,
        ),
    ] = None

    def published(self) -> Published:
        """What the file publishes; nothing without one.

        Raises UsageError for it, and for a --runway or --from that cannot be: before arrivals are read, which takes long.
        """
        from gateway.runtime.published import read_published
        from gateway.settings.procedures import Published
        from gateway.settings.reading import SiteError

        try:
            found = Published() if self.procedure is None else read_published(self.procedure)
        except SiteError as error:
            raise UsageError(str(error)) from error
        if self.come_from is not None:
            read_sector(self.come_from)
        names = [runway.name for runway in found.runways]
        if self.runway is not None and self.runway not in names and _NUMBER.fullmatch(self.runway) is None:
            known = (
                f"; there are {', '.join(names)}" if names else ", given with --procedure, to tell parallel ones apart"
            )
            raise UsageError(
                f"--runway {self.runway!r} is neither a number, 01 to 36, nor the name of a [[runway]]{known}."
            )
        return found

    def of(
        self, tracks: tuple[Track, ...], published: Published, airport_deg: tuple[float, float]
    ) -> tuple[Track, ...]:
        """Those of the arrivals that were asked for. Raises UsageError where there are none."""
        from gateway.offline.procedures import comes_from

        chosen = tracks if self.runway is None else _landing(tracks, self.runway, published, airport_deg)
        if self.come_from is not None:
            sector = read_sector(self.come_from)
            chosen = tuple(track for track in chosen if comes_from(track, *sector))
        if not chosen:
            raise UsageError(f"None of {len(tracks)} arrivals is as --runway and --from want it.")
        return chosen

    def compared(
        self, tracks: tuple[Track, ...], published: Published, airport_deg: tuple[float, float]
    ) -> Compared | None:
        """The arrivals beside the procedures, those to the runway that was asked for; None where there are none."""
        from gateway.offline.procedures import compared
        from gateway.runtime.published import procedures_about

        names = [runway.name for runway in published.runways]
        procedures = procedures_about(published, airport_deg, self.runway if self.runway in names else None)
        return compared(tracks, procedures) if procedures else None


def _landing(
    tracks: tuple[Track, ...], wanted: str, published: Published, airport_deg: tuple[float, float]
) -> tuple[Track, ...]:
    """Those that land on a runway, by its name or else its number."""
    from gateway.offline.procedures import lands_on, runway_of
    from gateway.runtime.published import thresholds_about

    names = [runway.name for runway in published.runways]
    if wanted not in names:
        return tuple(track for track in tracks if lands_on(track, int(wanted)))
    thresholds = thresholds_about(published, airport_deg)
    return tuple(track for track in tracks if runway_of(track, *thresholds) == names.index(wanted))


def read_sector(written: str) -> tuple[float, float]:
    """A sector's middle and half its width, rad. Raises UsageError."""
    word = written.strip().upper()
    if word in _WINDS:
        return math.radians(45.0 * _WINDS.index(word)), math.radians(45.0 if len(word) == 1 else 22.5)
    degrees = re.fullmatch(r"(\d{1,3}(?:\.\d+)?)-(\d{1,3}(?:\.\d+)?)", word)
    if degrees is None or max(float(part) for part in degrees.groups()) > 360.0:
        raise UsageError(f"--from {written!r} is not understood: write {', '.join(_WINDS)}, or degrees as 240-300.")
    begin, end = (float(part) for part in degrees.groups())
    half = 0.5 * ((end - begin) % 360.0)
    return math.radians(begin + half), math.radians(half)


def document(compared: Compared, tracks: Sequence[Track]) -> list[dict[str, Any]]:
    """For --json, a procedure each; metres, heights above the airport."""
    found = []
    for number, procedure in enumerate(compared.procedures):
        own = [
            (track.name, one)
            for track, one in zip(tracks, compared.flights, strict=True)
            if one is not None and one.procedure == number
        ]
        found.append(
            {
                "procedure": procedure.name,
                "share": len(own) / len(tracks),
                "flights": [
                    {
                        "flight": name,
                        "as_published": one.as_published(procedure),
                        "share": one.share,
                        "entry": procedure.points[one.entry],
                        "height_at_entry_m": float(one.heights_m[one.entry]),
                        "aside_m": None if math.isnan(one.aside_m) else one.aside_m,
                        "direct": [
                            {
                                "after": procedure.points[direct.after],
                                "to": procedure.points[direct.to],
                                "saved_m": direct.saved_m,
                            }
                            for direct in one.directs
                        ],
                        "too_low_at": [procedure.points[place] for place in one.too_low(procedure)],
                        "too_high_at": [procedure.points[place] for place in one.too_high(procedure)],
                    }
                    for name, one in own
                ],
            }
        )
    return found


def flown_by(compared: Compared, flights: Sequence[int]) -> dict[str, Any]:
    """For --json: which procedure most of some flights flew, what share of them, and how far aside of it, RMS m."""
    flown = [one for one in (compared.flights[flight] for flight in flights) if one is not None]
    counts = Counter(one.procedure for one in flown).most_common(1)
    if not counts:
        return {"procedure": None, "procedure_share": 0.0, "procedure_aside_m": None}
    ((most, count),) = counts
    squares = [one.aside_m**2 for one in flown if one.procedure == most and not math.isnan(one.aside_m)]
    return {
        "procedure": compared.procedures[most].name,
        "procedure_share": count / len(flights),
        "procedure_aside_m": math.sqrt(sum(squares) / len(squares)) if squares else None,
    }


def table_of(rows: Sequence[dict[str, Any]]) -> Table:
    """`document`'s rows for the terminal."""
    import statistics

    from rich.table import Table

    shown = Table(box=None, padding=(0, 2, 0, 0))
    headings = (
        "procedure",
        "flights",
        "share",
        "as published",
        "direct",
        "saved, km",
        "entry, m",
        "+-",
        "aside, m",
        "outside",
    )
    for place, heading in enumerate(headings):
        shown.add_column(heading, justify="right" if place else "left", no_wrap=True)
    for row in rows:
        flights = row["flights"]
        heights = [one["height_at_entry_m"] for one in flights]
        saved = [direct["saved_m"] / 1000.0 for one in flights for direct in one["direct"]]
        aside = [one["aside_m"] for one in flights if one["aside_m"] is not None]
        shown.add_row(
            row["procedure"],
            str(len(flights)),
            f"{100.0 * row['share']:.0f} %",
            str(sum(one["as_published"] for one in flights)),
            str(sum(bool(one["direct"]) for one in flights)),
            f"{statistics.fmean(saved):.1f}" if saved else "",
            f"{statistics.fmean(heights):.0f}" if heights else "",
            f"{statistics.pstdev(heights):.0f}" if heights else "",
            f"{statistics.fmean(aside):.0f}" if aside else "",
            str(sum(bool(one["too_low_at"] or one["too_high_at"]) for one in flights)),
        )
    return shown


def shortcuts(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Who was let go direct how often, by `document`'s rows: the most frequent first, in words."""
    counts: dict[tuple[str, str, str], list[float]] = {}
    for row in rows:
        for one in row["flights"]:
            for direct in one["direct"]:
                counts.setdefault((row["procedure"], direct["after"], direct["to"]), []).append(direct["saved_m"])
    ordered = sorted(counts.items(), key=lambda item: (-len(item[1]), item[0]))
    return [
        f"{procedure}: {len(saved)} direct to {to} after {after}, {sum(saved) / len(saved) / 1000.0:.1f} km shorter each"
        for (procedure, after, to), saved in ordered
    ]
