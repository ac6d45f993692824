"""Whether sigmas of predictions mean what they say: missions that were drawn, flown, heard by the gateway, and scored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gateway.align import SECOND
from gateway.frames import RunwayFrame
from gateway.observation import Heard
from gateway.offline.score import Errors, Foretold, Score, Way, errors, joined, scores
from gateway.pipeline import initial, step
from gateway.predict import Predicted
from gateway.settings import DEMO_SITE, Options
from sim.studies import Table
from sim.studies.missions import STARTS, UP_M, Mission, missions

SECONDS = 600
HORIZONS_S = (10.0, 30.0, 60.0, 120.0)


def honesty(count: int, seed: int) -> tuple[Table, dict[str, float]]:
    """How often some missions' predictions were within one and two sigmas, by horizon; and the same by name."""
    rows: list[tuple[str | float, ...]] = []
    figures: dict[str, float] = {}
    for one in scored(count, seed):
        within = [100.0 * share for pair in (one.along_within, one.across_within) for share in pair]
        rows.append((f"{one.horizon_s:g} s", one.rms_m, one.straight_on_rms_m, *within))
        names = (f"{axis} within {sigmas}, {one.horizon_s:g} s" for axis in ("along", "across") for sigmas in (1, 2))
        figures |= dict(zip(names, within, strict=True))
    columns = ("horizon", "RMS m", "straight on m", "along within 1 sigma %", "2", "across 1", "2")
    title = f"sigmas in the gateway: {count} missions of {SECONDS} s"
    return Table(title, columns, tuple(rows), NOTES), figures


NOTES = (
    "L1 guidance, 18 to 45 m/s, corners up to 120 degrees, winds up to a quarter of the speed, gusts of 1 m/s",
    "68 and 95 % are honest; nothing was chosen on these missions but how gusts and slow turns count (seed 1)",
)


def scored(count: int, seed: int) -> list[Score]:
    """The scores of all predictions of some missions."""
    flown = missions(count, SECONDS, seed)
    said = sorted((one for mission in flown for one in mission.said), key=lambda one: one.received_at)
    heard = [Heard(one.received_at + 4 * place, (one,)) for place, one in enumerate(said)]
    return scores_of_all(joined(list(held(heard, {mission.aircraft: _way(mission) for mission in flown}).values())))


def scores_of_all(found: Errors) -> list[Score]:
    """By horizon, of all predictions."""
    return [one for one in scores(found) if one.group == "all"]


def held(heard: Sequence[Heard], ways: Mapping[str, Way]) -> dict[str, Errors]:
    """What a gateway at the demo's site that hears this foretells of each aircraft, held against the way that it came."""
    state = initial(DEMO_SITE, Options(horizons_s=HORIZONS_S))
    made: list[Predicted] = []
    aircraft: dict[int, str] = {}
    for first in range(0, len(heard), 500):
        state, picture = step(state, heard[first : first + 500])
        made.append(picture.predict)
        known = zip(picture.fuse.track.tolist(), picture.fuse.aircraft, strict=True)
        aircraft.update((track, name) for track, name in known if name is not None)
    return {name: _errors(made, track, ways[name]) for track, name in aircraft.items()}


def _way(mission: Mission) -> Way:
    frame = RunwayFrame(DEMO_SITE.runway)
    enu = np.concatenate([mission.places, np.full((len(mission.places), 1), UP_M)], axis=1)
    number = int(mission.aircraft.rpartition(":")[2])
    time = STARTS + np.arange(len(enu), dtype=np.int64) * SECOND + number * 1000
    return Way(time, *frame.geodetic_from_enu(enu))


def _errors(made: list[Predicted], track: int, way: Way) -> Errors:
    """One track's predictions against the way that was flown."""

    def column(name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.concatenate([getattr(one, name)[one.track == track] for one in made])

    count = len(column("made"))
    told = Foretold(
        column("made").astype(np.int64),
        column("valid").astype(np.int64),
        column("horizon_s"),
        column("latitude_rad"),
        column("longitude_rad"),
        column("height_m"),
        column("sigma_along_m"),
        column("sigma_across_m"),
        column("course_rad"),
        np.full(count, "two segments"),
        np.full(count, "declared"),
    )
    return errors(told, way, way)
