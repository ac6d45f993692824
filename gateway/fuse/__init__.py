"""Fuse: one state for each aircraft from everything that saw it (paper 003, 2.4).

`lanes` holds the system tracks and their recent past; `life` begins, confirms and ends them (`agreement` is its test),
`continuing` finds them again when a radar numbers them anew, `joints` brings several radars' tracks into one, and `becoming`
ends what joined; `placing` puts measurements into them, late ones where they belong; `filtering` runs the filter over many
tracks at once; `weighting` holds the four ways to weigh a position source against a radar; `rows` makes the result.
"""

from gateway.fuse.agreement import CONFIRMED
from gateway.fuse.becoming import joined
from gateway.fuse.continuing import adopted_earlier, continued, reviewed, spans_with, taken_on
from gateway.fuse.headings import Headings
from gateway.fuse.joints import Regrouped, radar_tracks_of_aircraft, regrouped, remembered
from gateway.fuse.lanes import Adopted, Ended, Joint, Lane, Lanes, contains, emptied
from gateway.fuse.life import LifeChange, end_silent, sentence, told
from gateway.fuse.placing import Scene, give_back, lane_of, reroute, take_fix, take_plot
from gateway.fuse.rows import Fused, Row, coast, knows_height, table, work
from gateway.fuse.settled import Settled, remaining, settled

__all__ = [
    "CONFIRMED",
    "Adopted",
    "Ended",
    "Fused",
    "Headings",
    "Joint",
    "Lane",
    "Lanes",
    "LifeChange",
    "Regrouped",
    "Row",
    "Scene",
    "Settled",
    "adopted_earlier",
    "coast",
    "contains",
    "continued",
    "emptied",
    "end_silent",
    "give_back",
    "joined",
    "knows_height",
    "lane_of",
    "radar_tracks_of_aircraft",
    "regrouped",
    "remaining",
    "remembered",
    "reroute",
    "reviewed",
    "sentence",
    "settled",
    "spans_with",
    "table",
    "take_fix",
    "take_plot",
    "taken_on",
    "told",
    "work",
]
