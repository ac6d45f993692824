"""How sources and vehicles are heard, and what vehicles last said of themselves: /health.

Curves for what changes: /health/SOURCE, /health/lost/SOURCE, /health/time/VEHICLE, /health/reading/UNIT/VEHICLE (readings
by their unit, so that each plot has one; a series each in one entity, because to send an entity costs the same for one
number as for thirty). And two tables for what is read: /health/table/vehicles and /health/table/sources.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import rerun as rr

from gateway.observation import FlightPlan
from gateway.picture import Picture, SourceHealth, VehicleHealth
from gateway.reckon import Reckoned
from gateway.sinks.scene.entry import Always, Entry, entity, once
from gateway.sinks.scene.lately import BEFORE_ALL, Lately
from gateway.sinks.scene.samples import Sample, plotted

SAMPLE_NS = 1_000_000_000  # people read it: once a second
RECKONED_NS = (
    3 * SAMPLE_NS
)  # what dead reckoning has found is told each second, of a crowd somewhat later; then it is old
VEHICLES_ABREAST = 5  # columns that can be read side by side
VEHICLES_AT_MOST = 25
_SERIES_AT_MOST = 4096  # entities whose series are remembered; one that is forgotten numbers its series anew

VEHICLES, SOURCES = "/health/table/vehicles", "/health/table/sources"


class HealthScene:
    """Draws health once a second; a table is sent when it says something else than before."""

    def __init__(self) -> None:
        self._sampled = BEFORE_ALL
        self._named: Lately[str] = Lately()
        self._series: dict[str, dict[str, None]] = {}  # what those of each entity are called, in their order
        self._tables: dict[str, str] = {}
        self._plans: dict[str, str] = {}  # what each aircraft's plan holds; also those that came from a file
        self._planned: Lately[str] = Lately(self._plans.pop)
        self._reckoned: dict[str, Reckoned] = {}  # what dead reckoning has last found of each aircraft
        self._found: Lately[str] = Lately(self._reckoned.pop)

    def entries(self, pictures: Sequence[Picture]) -> list[Entry]:
        """What these pictures add."""
        entries: list[Entry] = []
        samples: list[Sample] = []
        for picture in pictures:
            self._take_plans(picture)
            for one in picture.reckoned:
                self._reckoned[one.aircraft] = one
                self._found.is_new(one.aircraft, picture.now)
            is_told = picture.health.sources or picture.health.vehicles
            if is_told and not 0 <= picture.now - self._sampled < SAMPLE_NS:
                self._sampled = picture.now
                samples += _of_sources(picture)
                vehicles = [self._with_reckoned(one, picture.now) for one in picture.health.vehicles]
                samples += self._of_vehicles(picture, vehicles)
                entries += self._changed(picture, VEHICLES, vehicles_table(self._with_plans(picture, vehicles)))
                entries += self._changed(picture, SOURCES, sources_table(picture.health.sources))
        return plotted(samples, self._named) + entries

    def _take_plans(self, picture: Picture) -> None:
        for plan in picture.observations:
            if isinstance(plan, FlightPlan):
                kinds = Counter(point.kind for point in plan.points)
                self._plans[plan.aircraft] = ", ".join(kind if n == 1 else f"{n} {kind}s" for kind, n in kinds.items())
                self._planned.is_new(plan.aircraft, picture.now)

    def _with_reckoned(self, vehicle: VehicleHealth, now: int) -> VehicleHealth:
        """What a vehicle says, with what dead reckoning has found of it lately."""
        found = self._reckoned.get(vehicle.aircraft)
        if found is None or not 0 <= now - found.at < RECKONED_NS:
            return vehicle
        readings, words = found.shown()
        return replace(vehicle, readings=(*vehicle.readings, *readings), words=(*vehicle.words, *words))

    def _with_plans(self, picture: Picture, vehicles: Sequence[VehicleHealth]) -> list[VehicleHealth]:
        """The vehicles, each with what its flight plan holds among its words."""
        found = []
        for vehicle in vehicles:
            if plan := self._plans.get(vehicle.aircraft):
                self._planned.is_new(vehicle.aircraft, picture.now)
                vehicle = replace(vehicle, words=(*vehicle.words, ("flight plan", plan)))
            found.append(vehicle)
        return found

    def _of_vehicles(self, picture: Picture, vehicles: Sequence[VehicleHealth]) -> list[Sample]:
        """What vehicles last said in numbers, and how well their times are known."""
        samples = []
        for vehicle in vehicles:
            name = vehicle.aircraft
            times = {f"{name} {what}, ms": 1e3 * value for what, value in _times_s(vehicle).items()}
            told = {entity("health", "time", name): times}
            for reading, value in vehicle.readings:
                path = entity("health", "reading", unit_part(reading.partition(", ")[2]), name)
                told.setdefault(path, {})[f"{name} {reading}"] = value
            samples += [self._sample(picture, path, values) for path, values in told.items()]
        return [sample for sample in samples if not all(map(math.isnan, sample.values))]

    def _sample(self, picture: Picture, path: str, values: dict[str, float]) -> Sample:
        """Values by the series that the entity has; what is told for the first time gives it one more."""
        series = self._series[path] = self._series.pop(path, {})  # newest last
        if len(self._series) > _SERIES_AT_MOST:
            del self._series[next(iter(self._series))]
        if not values.keys() <= series.keys():
            series.update(dict.fromkeys(values))
            self._named.drop(path)
        row = tuple(values.get(name, math.nan) for name in series)
        return Sample(path, picture.now, picture.step, row, tuple(series))

    def _changed(self, picture: Picture, path: str, text: str) -> list[Entry]:
        """A table, if it is not the one that is shown already."""
        known = self._tables.get(path)
        if text == known:
            return []
        self._tables[path] = text
        look = [] if known is not None else [Always(path, (rr.TextDocument.from_fields(media_type="text/markdown"),))]
        return [*look, once(path, picture.now, picture.step, rr.TextDocument.columns(text=[text]))]


def _of_sources(picture: Picture) -> list[Sample]:
    told: list[tuple[str, tuple[float, ...], tuple[str, ...]]] = []
    for source in picture.health.sources:
        if source.kind == "pipeline":  # it is no source: it is never silent and loses nothing
            continue
        name = source.name
        heard = (f"{name} last heard, s ago", f"{name} rate, 1/s")
        told.append((entity("health", name), (source.age_s, source.rate_hz), heard))
        told.append((entity("health", "lost", name), (float(source.lost),), (f"{name} lost",)))
    return [
        Sample(path, picture.now, picture.step, values, names)
        for path, values, names in told
        if not any(map(math.isnan, values))
    ]


def _times_s(vehicle: VehicleHealth) -> dict[str, float]:
    """How well a vehicle's time is known and how late its frames are, s."""
    return {"clock sigma": vehicle.clock_sigma_s, "delay": vehicle.delay_s, "delay 99 %": vehicle.delay_99_s}


def unit_part(unit: str) -> str:
    """A unit as a part of an entity's path: "mps" of "m/s"."""
    return "".join(sign for sign in unit.replace("/", "p") if sign.isalnum()) or "1"


def sources_table(sources: Sequence[SourceHealth]) -> str:
    """How each source is heard, and below it everything that was counted, by its reason, as Markdown tables."""
    heard = ["| source | heard | rate | lost |", "|---|--:|--:|--:|"]
    counted = ["| source | counted | |", "|---|---|--:|"]
    for source in sources:
        name = _cell(source.name)
        if source.kind != "pipeline":
            age = f"{source.age_s:.1f} s ago" if source.age_s < 9.95 else f"**{source.age_s:.0f} s ago**"
            heard.append(f"| {name} | {age} | {source.rate_hz:.1f}/s | {source.lost:,} |")
        for place, (reason, total) in enumerate(source.counters):
            counted.append(f"| {'' if place else name} | {_cell(reason)} | {total:,} |")
    return "\n".join([*heard, "", *counted])


def vehicles_table(vehicles: Sequence[VehicleHealth]) -> str:
    """What each vehicle last said, vehicles abreast and quantities as rows, in Markdown."""
    if not vehicles:
        return "No vehicle was heard yet."
    shown = vehicles[:VEHICLES_AT_MOST]
    parts = [_abreast(shown[at : at + VEHICLES_ABREAST]) for at in range(0, len(shown), VEHICLES_ABREAST)]
    if len(vehicles) > len(shown):
        parts.append(f"and {len(vehicles) - len(shown)} more vehicles")
    return "\n\n".join(parts)


def _abreast(vehicles: Sequence[VehicleHealth]) -> str:
    columns = []
    for vehicle in vehicles:
        known = {what: value for what, value in _times_s(vehicle).items() if not math.isnan(value)}
        milliseconds = {f"{what}, ms": _number(1e3 * value) for what, value in known.items()}
        readings = {what: _number(value) for what, value in vehicle.readings if not math.isnan(value)}
        columns.append({"clock": vehicle.clock, **milliseconds, **dict(vehicle.words), **readings})
    rows = dict.fromkeys(what for column in columns for what in column)
    lines = ["| | " + " | ".join(_cell(vehicle.aircraft) for vehicle in vehicles) + " |"]
    lines.append("|---|" + "--:|" * len(vehicles))
    lines += [
        f"| {_cell(what)} | " + " | ".join(_cell(column.get(what, "")) for column in columns) + " |" for what in rows
    ]
    return "\n".join(lines)


def _number(value: float) -> str:
    """Three digits at least, none that nobody reads, and no exponent."""
    return f"{value:,.{max(0, 2 - math.floor(math.log10(abs(value)))) if 1e-9 < abs(value) < 100.0 else 0}f}"


def _cell(text: str) -> str:
    """What a source says of itself can hold anything; a table's cell holds no bar and no line's end."""
    return " ".join(text.replace("|", "/").split())
