"""The drawings of `consistency`: mean NEES and NIS of each case and estimator, second by second, in their intervals."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

if TYPE_CHECKING:
    from sim.studies.consistency import Seconds


def draw(path: Path, found: Mapping[str, Seconds], runs: int) -> None:
    """Draw seconds by case and estimator ("case/estimator") into an .rrd: means for each degree of freedom, 1 = as told."""
    recording = rr.RecordingStream("talkdown consistency")
    recording.save(str(path))
    recording.log(
        "about", rr.TextDocument(f"Means over {runs} runs, for each degree of freedom: 1 = as told."), static=True
    )
    for name, seconds in found.items():
        case, _, estimator = name.partition("/")
        times = rr.TimeColumn("second", sequence=np.arange(len(seconds.second)))
        for what, values, inside in (
            ("NEES", seconds.nees, seconds.nees_inside),
            ("NIS", seconds.nis, seconds.nis_inside),
        ):
            entity = [case, what, estimator]
            recording.send_columns(
                rr.new_entity_path(entity), indexes=[times], columns=rr.Scalars.columns(scalars=values)
            )
            share = 100.0 * float(inside.mean())
            recording.log(
                rr.new_entity_path([*entity, "inside"]),
                rr.TextDocument(f"{share:.0f} % of the seconds inside the 95 % interval"),
                static=True,
            )
    recording.flush()
