"""`talkdown register`: the systematic errors of the radars of a recording."""

from __future__ import annotations

import json as text
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError, writing
from gateway.cli.replay_options import FilesArgument

if TYPE_CHECKING:
    from gateway.estimators.registration import Method
    from gateway.offline.pairing import Gathering
    from gateway.offline.registration import Result
    from gateway.runtime.playback import Playback
    from gateway.runtime.setup import Place

_HELP = """
Find the systematic errors of the radars of a recording, or of an archived session: how much range, azimuth, elevation and
time each measures too much, how sure that is, and what the geometry of these flights does not tell.

Positions that aircraft report of themselves are held beside what the radar saw of them (paper 004). Of a session the result is
kept in its folder as registration.json.

Examples:

  talkdown register sessions/20260301T120000Z-demo-field

  talkdown register flight.tlog radar.pcap --site field.toml --json

  talkdown register flight.tlog radar.pcap --site field.toml --write-site registered.toml

  talkdown register flight.tlog radar.pcap --site field.toml --literal --frame geodetic --iterations 2
"""

RESULT_FILE = "registration.json"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("register", help=_HELP)(find_errors)


def find_errors(
    files: FilesArgument,
    site: take.SiteOption = None,
    frame: Annotated[
        str, typer.Option("--frame", metavar="ecef|geodetic|polar", help="In which coordinates pairs are compared.")
    ] = "ecef",
    literal: Annotated[
        bool, typer.Option("--literal", help="As printed: unweighted, without a prior, every pair believed.")
    ] = False,
    iterations: Annotated[
        int, typer.Option("--iterations", metavar="N", min=1, max=20, help="How often it is solved at least.")
    ] = 2,
    write_site: Annotated[
        Path | None,
        typer.Option(
            "--write-site",
            metavar="FILE",
            help="Write the site file with what was found, so that it is taken off from then on.",
            show_default=False,
        ),
    ] = None,
    quiet: take.QuietOption = False,
    json: take.JsonOption = False,
) -> None:
    """Find the errors of radars."""
    from gateway.estimators.registration_frames import SYSTEMS
    from gateway.offline.registration import LEAST_PAIRS, method_for, registered, site_with
    from gateway.settings import format_site

    system = next((one for one in SYSTEMS if one == frame), None)
    if system is None:
        raise UsageError(f"--frame {frame!r} is none of {', '.join(SYSTEMS)}.")
    gathering = _gathered(files, site, quiet)
    method = method_for(gathering, system, iterations, literal=literal)
    result = registered(gathering, method)
    if result is None:
        raise RunError(
            f"Only {len(gathering.pairs)} reports stand beside plots of the radar track of the same aircraft; "
            f"{LEAST_PAIRS} are needed at least. `talkdown check` tells what the recording holds."
        )
    document = _document(result, method)
    if len(files) == 1 and files[0].is_dir():
        _write(files[0] / RESULT_FILE, text.dumps(document, indent=1) + "\n")
    if write_site is not None:
        _write(write_site, format_site(site_with(gathering.site, gathering.radars, result)))
    if json:
        print(text.dumps(document))
    elif not quiet:
        _show(result)


def _gathered(files: list[Path], site: Path | None, quiet: bool) -> Gathering:
    """The pairs of a recording or session."""
    from adapters.files import FileError
    from gateway.cli.progress import progressing
    from gateway.offline.pairing import Gathering
    from gateway.runtime.folder import FolderError
    from gateway.runtime.playback import open_playback
    from gateway.runtime.setup import RunFailure

    place = take.read_place(site)
    try:
        playback = open_playback(files)
        found = place or playback.place or playback.find_place()
        if found is None:
            raise UsageError("Nothing in this recording tells where the runway is; give a site file with --site.")
        gathering = Gathering(found.site)
        with progressing("pairing", show=not quiet) as tell:
            _gather(playback, found, gathering, tell)
    except (FileError, FolderError) as error:
        raise UsageError(str(error)) from error
    except RunFailure as failure:
        raise RunError(str(failure)) from failure
    return gathering


def _gather(playback: Playback, place: Place, gathering: Gathering, tell: Callable[[float], None]) -> None:
    """Run the recording through the picture, and gather pairs on the way."""
    from gateway.picture import Picture
    from gateway.runtime.loop import run_replay
    from gateway.runtime.run import Run
    from gateway.runtime.setup import Setup

    def watch(run: Run, picture: Picture | None) -> None:
        if picture is not None:
            gathering.take(picture)
        tell(playback.fraction())

    setup = Setup(place=place, options=playback.options, remembered=playback.remembered, is_watched=False)
    run_replay(playback, setup, watch=watch)


def _document(result: Result, method: Method) -> dict[str, Any]:
    radars = {
        str(number): {
            verdict.name: {
                "measures_too_much": verdict.value,
                "sigma": verdict.sigma,
                "unit": "m" if verdict.name == "range" else "s" if verdict.name == "time" else "rad",
                "observable": verdict.observable,
                "to_be_applied": verdict.is_found,
                "verdict": verdict.sentence(),
            }
            for verdict in verdicts
        }
        for number, verdicts in result.radars.items()
    }
    rest = {key: value for key, value in asdict(result).items() if key != "radars"}
    plain = {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in rest.items()}
    return {"radars": radars, **plain, "method": asdict(method)}


def _write(path: Path, content: str) -> None:
    with writing(path):
        path.write_text(content, encoding="utf-8")


def _show(result: Result) -> None:
    for number, verdicts in result.radars.items():
        print(f"radar {number}")
        for verdict in verdicts:
            print(f"  {verdict.sentence()}")
    east, north, up = result.source_m
    sigmas = result.source_sigma_m
    print(
        f"position sources together: {east:+.0f} m east (+- {sigmas[0]:.0f}), {north:+.0f} m north (+- {sigmas[1]:.0f}), "
        f"{up:+.0f} m up (+- {sigmas[2]:.0f})"
    )
    if not math.isnan(result.own_sigma_m):
        print(f"each aircraft's own, about {result.own_sigma_m:.0f} m an axis")
    print(
        f"{result.pairs} pairs of {len(result.aircraft)} aircraft; condition {result.condition:.1f}, "
        f"chi-square {result.chi_square_per_freedom:.2f} a degree of freedom"
    )
    if result.is_prior_wrong:
        print(
            "The position sources are further off than was assumed of them (chi-square of the prior): do not trust this."
        )
