"""Align: what was said, brought into the site's frames, and radar brought to the time of a GPS report.

Positions of reports and plots become `Fix` and `Plot`: metres at the runway centre, and polar at the radar with what
`register` learnt taken off. `bracket` interpolates a radar track at a GPS report's time, each component on its own.

`reports` and `plots` bring each into the frames, `between` interpolates, `drawing` makes the result.
"""

from gateway.align.between import bracket
from gateway.align.drawing import Aligned, draw
from gateway.align.plots import SECOND, Correction, Plot, Polar, contradiction, place_plot, radar_from_status
from gateway.align.reports import Fix, Geoid, Local, ReckonedFix, place_reports

__all__ = [
    "SECOND",
    "Aligned",
    "Correction",
    "Fix",
    "Geoid",
    "Local",
    "Plot",
    "Polar",
    "ReckonedFix",
    "bracket",
    "contradiction",
    "draw",
    "place_plot",
    "place_reports",
    "radar_from_status",
]
