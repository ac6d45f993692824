"""Arrival flows as predictions take them up: flows.json, each as few points, beside the sessions that they came from."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from adapters.reasons import reason_of
from gateway.geodesy import wrap_rad
from gateway.predict import ArrivalFlow
from gateway.runtime.whole import write_json
from gateway.settings import Site

FLOWS_FILE = "flows.json"
FORMAT = "talkdown flows 1"
_SAME_FIELD_RAD = 0.0016  # ten kilometres: flows of this airport


class FlowsError(Exception):
    """Flows that cannot be read; one plain sentence."""


def write_ways(flows: Sequence[ArrivalFlow], airport_deg: tuple[float, float], folder: Path) -> Path:
    """flows.json in a folder, whole. Raises OSError."""
    written = folder / FLOWS_FILE
    document = {
        "format": FORMAT,
        "airport_deg": list(airport_deg),
        "flows": [
            {
                "number": flow.number,
                "flights": flow.flights,
                "spread_m": flow.spread_m,
                "points": [
                    {
                        "latitude_deg": math.degrees(latitude),
                        "longitude_deg": math.degrees(longitude),
                        "above_runway_m": above_m,
                    }
                    for latitude, longitude, above_m in flow.points
                ],
            }
            for flow in flows
        ],
    }
    write_json(written, document)
    return written


def read_ways(path: Path) -> tuple[tuple[ArrivalFlow, ...], tuple[float, float]]:
    """The flows of a flows.json, or of a folder that has one, and their airport, degrees. Raises FlowsError."""
    file = path / FLOWS_FILE if path.is_dir() else path
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FlowsError(f"There is no {file}; `talkdown flows SESSIONS --archive DIR` makes one.") from error
    except (OSError, ValueError, RecursionError) as error:
        raise FlowsError(f"{file} cannot be read as JSON ({reason_of(error)}).") from error
    try:
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']!r}")
        latitude, longitude = (float(part) for part in document["airport_deg"])
        flows = tuple(_flow(row) for row in document["flows"])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise FlowsError(f"{file} is no list of flows that this version of Talkdown knows ({error}).") from error
    return flows, (latitude, longitude)


def flows_near(archive: Path, site: Site) -> tuple[ArrivalFlow, ...]:
    """The flows that lie in a folder of sessions, if they lead to this site. Raises FlowsError for a file that cannot be read."""
    if not (archive / FLOWS_FILE).is_file():
        return ()
    flows, (latitude, longitude) = read_ways(archive)
    north = math.radians(latitude) - site.runway.latitude_rad
    east = float(wrap_rad(math.radians(longitude) - site.runway.longitude_rad)) * math.cos(site.runway.latitude_rad)
    return flows if math.hypot(north, east) <= _SAME_FIELD_RAD else ()


def read_archived(stored: Sequence[Mapping[str, Any]] | None) -> tuple[ArrivalFlow, ...]:
    """What stands in session.json. Raises KeyError, TypeError, ValueError for what cannot be so."""
    return tuple(
        _checked(ArrivalFlow(**{**row, "points": tuple(tuple(one) for one in row["points"])})) for row in stored or ()
    )


def _flow(row: Mapping[str, Any]) -> ArrivalFlow:
    points = tuple(
        (
            math.radians(float(point["latitude_deg"])),
            math.radians(float(point["longitude_deg"])),
            float(point["above_runway_m"]),
        )
        for point in row["points"]
    )
    return _checked(ArrivalFlow(int(row["number"]), int(row["flights"]), float(row["spread_m"]), points))


def _checked(flow: ArrivalFlow) -> ArrivalFlow:
    """A flow that can be so. Raises TypeError, ValueError."""
    for latitude, longitude, above_m in flow.points:
        if not (abs(latitude) < 0.5 * math.pi and abs(longitude) <= 2.0 * math.pi and math.isfinite(above_m)):
            raise ValueError(f"flow {flow.number} has a point that is nowhere")
    if not (len(flow.points) > 1 and flow.spread_m >= 0.0):
        raise ValueError(f"flow {flow.number} has fewer than two points, or no spread")
    return flow
