"""What new measurements tell of the noises of their sources: keys of these, and the sums of their `evidence`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gateway.align import Fix, Plot
from gateway.fuse.events import Event, Measure
from gateway.fuse.evidence import PLOT, REPORT, Part, changes_of, evidence
from gateway.fuse.scatter import Rows, left_of_plots, left_of_reports
from gateway.settings import PositionSource, RadarSite

Floats = NDArray[np.float64]

OF = "GPS of "  # an aircraft, as a source
Key = tuple[str, str, bool]  # source, part, whether the site file sets its noise


@dataclass(frozen=True, slots=True)
class Told:
    """What new measurements tell of one part: of k noises, each with the last measurement, and its sums of `evidence`."""

    part: Part
    keys: list[Key]
    measures: list[Measure]
    sigma: Floats  # (k,) as stated
    evidence: Floats  # (k, 9)


def told_by(
    rows: Rows, events: Sequence[Event], position: PositionSource, radars: Mapping[int, RadarSite]
) -> list[Told]:
    """What new measurements of one kind, reports or plots, tell of each of their parts; `rows` names them by number."""
    is_plot = isinstance(events[0].measure, Plot)
    left = left_of_plots(rows) if is_plot else left_of_reports(rows)
    fresh = np.flatnonzero(rows.new)
    if not len(fresh):
        return []
    left, sigma = left.of(fresh), rows.sigma[fresh]
    new = [events[place] for place in rows.event[fresh].tolist()]
    measures = [event.measure for event in new]
    sources: dict[str | int, int] = {}
    source = np.array([sources.setdefault(_source(measure), len(sources)) for measure in measures])
    names = [f"radar {name}" if is_plot else f"{OF}{name}" for name in sources]
    said = np.array([_said(name, position, radars) for name in sources])[source]
    changes = changes_of(new, sigma.shape[1])
    found = []
    for number, part in enumerate(PLOT if is_plot else REPORT):
        stated = sigma[:, part.first]
        is_set = np.abs(stated - said[:, number]) <= 1e-9 * stated
        weighed = evidence(left, changes, stated, part)
        # The first measurements of a source tell nothing: no noise is watched yet.
        some = np.flatnonzero(weighed.any(axis=1))
        noise, place = np.unique(2 * source[some] + is_set[some], return_inverse=True)
        last, total = np.zeros(len(noise), dtype=np.int64), np.zeros((len(noise), 9))
        last[place] = some
        np.add.at(total, place, weighed[some])
        keys = [(names[one >> 1], part.name, bool(one & 1)) for one in noise.tolist()]
        found.append(Told(part, keys, [measures[row] for row in last.tolist()], stated[last], total))
    return found


def _source(measure: Measure) -> str | int:
    """An aircraft, or a radar's number."""
    return measure.aircraft if isinstance(measure, Fix) else measure.radar


def _said(source: str | int, position: PositionSource, radars: Mapping[int, RadarSite]) -> tuple[float, ...]:
    """The sigma of each part that the site file sets, NaN = none."""
    if isinstance(source, str):
        return position.sigma_m, position.velocity_sigma_mps
    radar = radars.get(source)
    if radar is None:
        return math.nan, math.nan, math.nan
    return radar.range_sigma_m, radar.azimuth_sigma_rad, radar.elevation_sigma_rad
