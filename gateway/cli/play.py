"""`talkdown play`: send a recording onto the wires, at its own intervals."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from gateway.cli import options as take
from gateway.cli.failures import UsageError, sending
from gateway.cli.replay_options import FilesArgument, FromOption, ToOption, read_speed, seek

_HELP = """
Send a recording onto UDP as it once came in, frame by frame, at its own intervals: for a `talkdown live`, or any ground
station, to hear.

Every MAVLink peer of the recording has a socket of its own, so the receiver hears as many peers as there were.

Examples:

  talkdown play flight.tlog

  talkdown play flight.BIN --from 10:50 --to 13:00

  talkdown play sessions/20260301T120000Z-demo-field --mavlink udpout:127.0.0.1:14550 --speed 4
"""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("play", help=_HELP)(play)


def play(
    files: FilesArgument,
    begin: FromOption = None,
    end: ToOption = None,
    mavlink: Annotated[
        str, typer.Option("--mavlink", metavar="URL", help="Where MAVLink frames go.")
    ] = "udpout:127.0.0.1:14550",
    radar: Annotated[
        str, typer.Option("--radar", metavar="URL", help="Where radar datagrams go.")
    ] = "udpout:127.0.0.1:30070",
    speed: Annotated[str, typer.Option("--speed", metavar="max|N", help="N times its own pace.")] = "1",
    quiet: take.QuietOption = False,
) -> None:
    """Send a recording onto the wires."""
    from adapters.files import FileError
    from gateway.runtime.folder import FolderError
    from gateway.runtime.playback import open_playback
    from gateway.runtime.player import play_onto
    from gateway.runtime.seeking import SeekError
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import MAVLINK_PORT, RADAR_PORT, LinkError
    from gateway.settings import Options

    pace = read_speed(speed, 1.0)
    (mavlink_url,) = take.read_urls([mavlink], MAVLINK_PORT)
    (radar_url,) = take.read_urls([radar], RADAR_PORT)
    for url in (mavlink_url, radar_url):
        if url.scheme != "udpout":
            raise UsageError(f"play sends, so it needs udpout:HOST:PORT and not {url}.")
    try:
        with sending():
            playback = open_playback(files)
            playback, options = seek(playback, Options(), begin, end, None)
            if not quiet:
                for note in playback.notes:
                    print(note, file=sys.stderr)
            with StopSignals() as stop:
                since = options.begins_at
                sent = play_onto(playback, mavlink_url, radar_url, speed=pace, begins_at=since, asked_to_stop=stop)
    except (FileError, FolderError, LinkError, SeekError) as error:
        raise UsageError(str(error)) from error
    if not quiet:
        to = [f"{number} {kind}" for kind, number in sent.items() if number]
        print(f"sent {' and '.join(to) or 'nothing'}")
