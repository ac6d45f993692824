"""Staged conflicts, from the wires' bytes on: each of six ways to meet is told a minute ahead, and nothing else."""

from __future__ import annotations

from sim.scenes import build_scene
from sim.studies.conflicts import AHEAD_S, START, outcome

QUICK = ("radars=0", "gps.period_s=2", "say.attitude_period_s=60", "say.truth_period_s=0", "duration_s=270")


def test_every_way_to_meet_is_told_a_minute_ahead_and_nothing_for_nothing() -> None:
    """Head-on, crossing, nearly abreast, overtaking, climbing and turned lately, without plans, reports each two seconds.

    `talkdown study conflicts` does the same with twenty pairs and a radar, and with an hour of traffic.
    """
    found = outcome(build_scene("conflicts", start_ns=START, seed=5, changes=(*QUICK, "aircraft=12")))
    assert sorted(found.kind) == ["abreast", "climbing", "crossing", "head-on", "overtaking", "turning"]
    assert (found.lead_s >= AHEAD_S).all()
    assert not found.wrong
