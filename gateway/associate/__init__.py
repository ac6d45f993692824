"""Associate: which radar track is which aircraft (paper 003, 2.3).

At most once a second, each aircraft's GPS report is checked against every radar track near it: gates of three sigma in
range, azimuth and elevation about the GPS point, a counter for each pair, associated when the counter is full, lost when
it is empty. A check waits until plots can bracket it and holds from the report's own time; late data repeat the checks
they touch and what followed from these, so that the result is that of in-order processing.

`gates` compares one report with the radar tracks near it; `ledger` counts and pairs; `checks` keeps both in order of time.

Radar tracks of several radars are compared with each other, too, whether a position source is there or not (paper 004, figure 1):
`tracklets` says where each was a moment ago, `pairing` which pairs fit, `joining` counts, and `combining` makes one of them.
"""

from gateway.associate.checks import (
    Associated,
    Association,
    Check,
    await_plots,
    check_again,
    check_due,
    forgotten,
    missing,
    pruned,
    table,
)
from gateway.associate.combining import MultiRadar, combined
from gateway.associate.gates import SILENT_S, Comparison, Nearby, Setting
from gateway.associate.joining import Together, compared, looked, together
from gateway.associate.ledger import Change, Count, Ledger, Span, Spans, aircraft_of, ordinal_of
from gateway.associate.pairing import Systematic

__all__ = [
    "SILENT_S",
    "Associated",
    "Association",
    "Change",
    "Check",
    "Comparison",
    "Count",
    "Ledger",
    "MultiRadar",
    "Nearby",
    "Setting",
    "Span",
    "Spans",
    "Systematic",
    "Together",
    "aircraft_of",
    "await_plots",
    "check_again",
    "check_due",
    "combined",
    "compared",
    "forgotten",
    "looked",
    "missing",
    "ordinal_of",
    "pruned",
    "table",
    "together",
]
