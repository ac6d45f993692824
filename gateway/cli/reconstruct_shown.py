"""What `talkdown reconstruct` prints: a table of sorties, and sentences beside it."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gateway.offline.reconstruction import Sortie


def show(found: dict[str, list[Sortie]]) -> None:
    """Print the table of sorties, and what a person should know beside it."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(box=None, padding=(0, 1, 0, 0))
    for place, heading in enumerate(("sortie", "lift-off", "lasted", "km", "end", "wind, m/s", "RMSE", "of way")):
        table.add_column(heading, justify="right" if place > 1 else "left", no_wrap=True)
    for aircraft, sorties in found.items():
        if not sorties:
            console.print(f"{aircraft} has no sortie: its airspeed never stays above the take-off speed for a minute.")
        for number, sortie in enumerate(sorties, 1):
            table.add_row(*_cells(f"{aircraft} {number}", sortie))
    if table.row_count:
        console.print(table)
    for aircraft, sorties in found.items():
        for number, sortie in enumerate(sorties, 1):
            for note in _notes(sortie):
                console.print(f"{aircraft} {number}: {note}", soft_wrap=True)


def _cells(name: str, sortie: Sortie) -> tuple[str, ...]:
    """`end`: how far the open path ended from where it should have, m; `RMSE` beside the positions, m, and of their way."""
    began = datetime.fromtimestamp(int(sortie.time[0]) // 1_000_000_000, UTC)
    minutes, seconds = divmod(round(sortie.duration_s), 60)
    east, north = sortie.wind_mps.mean(axis=0)
    wind = "-"
    if not math.isnan(east):
        wind = f"{math.hypot(east, north):.1f} from {math.degrees(math.atan2(-east, -north)) % 360:03.0f}"
    end = "-" if math.isnan(sortie.end_error_m) else f"{sortie.end_error_m:.0f} m"
    head = (name, f"{began:%H:%M:%S}", f"{minutes}:{seconds:02d}", f"{sortie.length_m / 1000:.1f}", end, wind)
    beside = sortie.compared
    if beside is None or beside.length_m == 0.0:
        return (*head, "-", "-")
    return (*head, f"{beside.rmse_m:.1f} m", f"{100 * beside.rmse_m / beside.length_m:.2f} %")


def _notes(sortie: Sortie) -> list[str]:
    """What a person should know of a sortie beside its row."""
    notes = []
    if not sortie.landed:
        notes.append("the recording ends in the air: the path is not closed.")
    elif not sortie.took_off and math.isnan(sortie.end_error_m):
        notes.append("the recording begins in the air: the path is not closed (--close-on LAT,LON).")
    if not math.isnan(sortie.heading_bias_rad):
        bias, sigma = (math.degrees(one) for one in (sortie.heading_bias_rad, sortie.heading_bias_sigma_rad))
        notes.append(f"on the take-off roll the heading showed {bias:+.1f} +- {sigma:.1f} degrees; it was taken off.")
    notes.extend(sortie.doubts)
    if sortie.fixes:
        notes.append(f"tied to {sortie.fixes} positions; 1 sigma at worst {sortie.sigma_m.max():.0f} m an axis.")
    if sortie.by_accelerations:
        notes.append("accelerations told how the wind changed (--constant-wind leaves them out).")
    if (radar := sortie.radar) is not None:
        notes.append(
            f"radar: {radar.used} plots tie the path, {radar.of - radar.used} refused (clutter, others)"
            + (
                f"; radar track {', '.join(radar.tracks)}."
                if radar.tracks
                else f"; {radar.doubt}."
                if radar.doubt
                else "."
            )
        )
        if radar.used:
            notes.append(
                f"1 sigma at worst {sortie.sigma_m.max():.0f} m an axis, if the radar measures nothing too much."
            )
    if sortie.height_by == "pitch":
        notes.append(
            "neither pressure nor altitude is told: its height is that of the pitch, which drifts by kilometres."
        )
    if sortie.lift_off is None:
        notes.append("nothing tells where it lifted off: the path is in metres from there (--lift-off LAT,LON).")
    return notes
