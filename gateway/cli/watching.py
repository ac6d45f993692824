"""The radar that watches: `talkdown simulate radar --watch FILE|URL`."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from adapters.reasons import reason_of
from gateway.cli import options as take
from gateway.cli.failures import RunError, UsageError

if TYPE_CHECKING:
    from gateway.observation import Heard
    from gateway.runtime.playback import Playback
    from gateway.settings import Site
    from sim.watch import WatchingRadar

Datagrams = Iterable[tuple[int, bytes]]


def watch_and_send(
    watched: str,
    site_path: Path | None,
    radar_url: str,
    *,
    seed: int,
    settings: list[str],
    speed: float | None,
    archive: Path | None,
    quiet: bool,
) -> None:
    """Send, or write into `archive`, what a radar at the site sees of the aircraft of a recording or a link."""
    from adapters.files import FileError
    from gateway.runtime.folder import FolderError
    from gateway.runtime.urls import LinkError
    from sim.overrides import OverrideError

    is_file = Path(watched).exists() or ":" not in watched
    try:
        if is_file:
            _watch_recording(Path(watched), site_path, radar_url, seed, settings, speed, archive, quiet)
        else:
            _watch_link(watched, site_path, radar_url, seed, settings, archive)
    except (FileError, FolderError, LinkError, OverrideError) as error:
        raise UsageError(str(error)) from error
    except OSError as error:
        raise RunError(f"The radar's datagrams could not be kept or sent: {reason_of(error)}.") from error


def _watch_recording(
    path: Path,
    site_path: Path | None,
    radar_url: str,
    seed: int,
    settings: list[str],
    speed: float | None,
    archive: Path | None,
    quiet: bool,
) -> None:
    from gateway.runtime.playback import open_playback

    playback = open_playback([path])
    place = take.read_place(site_path) or playback.place or playback.find_place()
    if place is None:
        raise UsageError(f"Nothing in {path} tells where the runway is; give a site file with --site.")
    radar = _radar(place.site, site_path, seed, settings)
    datagrams = _seen(_heard(playback), radar)
    if archive is not None:
        from sim.recording import write_datagrams

        archive.mkdir(parents=True, exist_ok=True)
        target = archive / f"{path.stem}-radar.pcap"
        if target.exists():
            raise UsageError(f"{target} exists already; move it away, or name another folder.")
        count = write_datagrams(datagrams, target)
        told = f"{count} datagrams in {target}"
    else:
        told = f"sent {_send(datagrams, radar_url, speed)} radar datagrams"
    if not quiet:
        print(told)


def _radar(site: Site, site_path: Path | None, seed: int, settings: list[str]) -> WatchingRadar:
    """The site's first radar, or a usual one where the site has none, changed as asked."""
    from dataclasses import replace

    from sim.overrides import SceneParameters, override
    from sim.scenes.placement import usual_radar
    from sim.watch import WatchingRadar, parameters_of

    stands = site.radars[0] if site.radars else usual_radar(site, 1)
    base = replace(SceneParameters(), radars=(parameters_of(stands),))
    keys = take.read_keys(take.read_place(site_path), site_path)
    parameters = override(base, settings).radars[0]
    return WatchingRadar(site, stands, parameters, seed=seed, key=keys.get(stands.number))


def _heard(playback: Playback) -> Iterator[Heard]:
    from adapters.decode import Decoder

    decoder = Decoder(playback.sources)
    for arrival in playback.arrivals():
        yield decoder.feed(arrival)


def _seen(heard: Iterable[Heard], radar: WatchingRadar) -> Iterator[tuple[int, bytes]]:
    from sim.watch import watch

    return watch(heard, radar)


def _send(datagrams: Datagrams, radar_url: str, speed: float | None) -> int:
    """Send at their own intervals, `speed` times as fast; how many."""
    from gateway.runtime.pace import Datagram, Pace, find, send_paced
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import RADAR_PORT

    (url,) = take.read_urls([radar_url], RADAR_PORT)
    seen = (Datagram(at, "radar", "radar", data) for at, data in datagrams)
    with StopSignals() as stop:
        return sum(send_paced(seen, {"radar": find(url)}, Pace(speed, stop)).values())


def _watch_link(
    text: str, site_path: Path | None, radar_url: str, seed: int, settings: list[str], archive: Path | None
) -> None:
    """Listen to a link and send what the radar sees, until asked to stop."""
    from adapters.decode import Decoder
    from gateway.runtime.links import open_link, resolve
    from gateway.runtime.receiver import Receiver
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import RADAR_PORT, parse_url

    place = take.read_place(site_path)
    if place is None:
        raise UsageError("A radar that watches a link needs to know where it stands: give a site file with --site.")
    if archive is not None:
        raise UsageError("--archive keeps what a radar sees of a recording; of a link, let talkdown live archive it.")
    radar = _radar(place.site, site_path, seed, settings)
    (url,) = take.read_urls([radar_url], RADAR_PORT)
    family, address = resolve(url, socket.SOCK_DGRAM)
    receiver = Receiver([open_link(parse_url(text))], [])
    receiver.start()
    decoder = Decoder()
    try:
        with StopSignals() as stop, socket.socket(family, socket.SOCK_DGRAM) as out:
            while not stop():
                delivery = receiver.drain()
                for source in delivery.sources:
                    decoder.add(source)
                for arrival in delivery.arrivals:
                    for observation in decoder.feed(arrival).observations:
                        for _, data in radar.feed(observation):
                            out.sendto(data, address)
                time.sleep(0.01)
    finally:
        receiver.close()
