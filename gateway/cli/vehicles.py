"""`talkdown simulate vehicle`: vehicles that stations talk to, or their flight into an archived session."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from gateway.cli import options as take
from gateway.cli.failures import UsageError, sending, writing
from gateway.cli.vehicle_options import VehicleType, Wanted

if TYPE_CHECKING:
    from adapters.mission_writing import MissionItem
    from gateway.runtime.links import Link
    from gateway.runtime.setup import Place
    from sim.vehicles.motion import Home, Vehicle
    from sim.vehicles.speaking import Speaker
    from sim.vehicles.wind import WindParameters

_APART_M = 40.0  # several vehicles stand side by side
_LONGEST_S = 7200.0
_MOST_VEHICLES = 200


def simulate_vehicles(
    wanted: Wanted,
    site: Path | None,
    mavlink: str,
    *,
    seed: int,
    speed: float | None,
    archive: Path | None,
    quiet: bool,
) -> None:
    """Fly them: on a link until Ctrl-C, or with `archive` into a session. Raises UsageError, RunError."""
    import time

    place = take.read_place(site)
    items, home = _items_and_home(wanted, place)
    start_ns = time.time_ns() // 4000 * 4000
    if wanted.seconds is not None and not wanted.seconds > 0.0:
        raise UsageError(f"--seconds {wanted.seconds:g} is not above 0.")
    if archive is not None and not items:
        raise UsageError("--archive flies a mission to its end: give one with --mission FILE.")
    fleet = _fleet(wanted, items, home, seed)
    if wanted.start or archive is not None:
        _start(fleet)
    speakers = functools.partial(_speakers, fleet, wanted.kind, seed, start_ns)
    if archive is not None:
        _write(speakers(), archive, start_ns, place, wanted.seconds, quiet)
        return
    if speed is None:
        raise UsageError(
            "Stations cannot follow --speed max; write a number, or --archive DIR to fly without stations."
        )
    _serve(list(fleet.values()), speakers, wanted, mavlink, speed, quiet)


def _items_and_home(wanted: Wanted, place: Place | None) -> tuple[tuple[MissionItem, ...], Home]:
    from adapters.mission_files import MissionFileError, read_items
    from sim.vehicles.motion import Home

    items: tuple[MissionItem, ...] = ()
    point = None
    if wanted.mission is not None:
        try:
            items, point = read_items(wanted.mission)
        except MissionFileError as error:
            raise UsageError(str(error)) from error
    separation = 0.0 if place is None else place.site.runway.geoid_separation_m or 0.0
    ground_m = separation if place is None else place.site.runway.height_m
    if wanted.home is not None:
        latitude, longitude, altitude, heading = _numbers(
            wanted.home, "--home", (None, None, ground_m - separation, 0.0)
        )
        if not (abs(latitude) < 89.0 and abs(longitude) <= 180.0):
            raise UsageError(f"--home {wanted.home!r} is no place: write latitude and longitude in degrees.")
        where = (math.radians(latitude), math.radians(longitude))
        heading_rad = math.radians(heading) if wanted.home.count(",") == 3 else _first_course(items, *where)
        return items, Home(*where, altitude + separation, heading_rad, separation)
    if point is not None:
        where = (point.latitude_rad, point.longitude_rad)
        height = ground_m if point.altitude_msl_m is None else point.altitude_msl_m + separation
        return items, Home(*where, height, _first_course(items, *where), separation)
    if place is None:
        raise UsageError(
            "Where does it stand? Write --home LAT,LON[,ALTITUDE[,HEADING]], or give --site or a mission with a home."
        )
    runway = place.site.runway
    return items, Home(runway.latitude_rad, runway.longitude_rad, ground_m, runway.landing_compass_rad, separation)


def _numbers(text: str, option: str, defaults: tuple[float | None, ...]) -> list[float]:
    """Numbers with commas between; those that are missing at the end are the defaults. Raises UsageError."""
    words = text.split(",")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = [math.nan]
    numbers += [one for one in defaults[len(words) :] if one is not None]
    if len(numbers) != len(defaults) or not all(map(math.isfinite, numbers)):
        least = sum(one is None for one in defaults)
        raise UsageError(f"{option} {text!r} is not {least} to {len(defaults)} numbers with commas between.")
    return numbers


def _first_course(items: tuple[MissionItem, ...], latitude_rad: float, longitude_rad: float) -> float:
    """From home to the first place of a mission that is not home: where a take-off run goes; north where there is none."""
    for item in items:
        north = math.radians(item.latitude_deg) - latitude_rad
        east = (math.radians(item.longitude_deg) - longitude_rad) * math.cos(latitude_rad)
        if item.latitude_deg != 0.0 and math.hypot(north, east) > 1e-6:
            return math.atan2(east, north)
    return 0.0


def _fleet(wanted: Wanted, items: tuple[MissionItem, ...], home: Home, seed: int) -> dict[int, Vehicle]:
    """The vehicles by their numbers, side by side to the right of the first."""
    from sim.vehicles.steering import Plane

    if not 1 <= wanted.count <= _MOST_VEHICLES:
        raise UsageError(f"--count {wanted.count} is not from 1 to {_MOST_VEHICLES}.")
    make, plane = _maker(wanted), Plane.about(home)
    return {
        number: make(plane.beside(home, _APART_M * (number - 1)), items, seed=seed, system=number)
        for number in range(1, wanted.count + 1)
    }


def _maker(wanted: Wanted) -> Callable[..., Vehicle]:
    """A function of home and items that makes a vehicle."""
    from sim.ships.fitting_out import vessel
    from sim.vehicles.flying import HELICOPTER, QUADROTOR, aeroplane, rotorcraft

    if wanted.kind is VehicleType.ship:
        if wanted.wind is not None:
            raise UsageError("--wind is not for ships; leave it out.")
        return vessel
    wind = _wind(wanted.wind)
    if wanted.kind is VehicleType.plane:
        return functools.partial(aeroplane, wind=wind)
    kind = QUADROTOR if wanted.kind is VehicleType.copter else HELICOPTER
    return functools.partial(rotorcraft, kind=kind, wind=wind)


def _wind(text: str | None) -> WindParameters:
    from sim.vehicles.wind import WindParameters

    if text is None:
        return WindParameters()
    speed, where_from, gusts = _numbers(text, "--wind", (None, 0.0, 0.0))
    if not 0.0 <= speed <= 60.0 or not 0.0 <= gusts <= 15.0:
        raise UsageError(f"--wind {text!r}: 0 to 60 m/s, from degrees, gusts of 0 to 15 m/s.")
    return WindParameters(speed, math.radians(where_from), gusts)


def _start(fleet: dict[int, Vehicle]) -> None:
    from sim.vehicles.motion import Arm, SetMode

    for vehicle in fleet.values():
        for order in (Arm(True), SetMode("AUTO")):
            answer = vehicle.order(order)
            if answer.result != "accepted":
                raise UsageError(f"It cannot start: {answer.why}; give a mission with --mission FILE.")


def _speakers(fleet: dict[int, Vehicle], kind: VehicleType, seed: int, start_ns: int) -> list[Speaker]:
    from sim.ships.linked import ShipSpeaker
    from sim.vehicles.speaking import Speaker, sensors_of

    speaks = ShipSpeaker if kind is VehicleType.ship else Speaker
    return [speaks.of(number, one, sensors_of(seed, number), start_ns) for number, one in fleet.items()]


def _write(
    speakers: list[Speaker], archive: Path, start_ns: int, place: Place | None, seconds: float | None, quiet: bool
) -> None:
    from gateway.cli.progress import progressing
    from gateway.runtime.folder import FolderError
    from sim.vehicles.recording import write_flight

    longest = _LONGEST_S if seconds is None else seconds
    try:
        with writing(archive), progressing("seconds of the flight, at the most", show=not quiet) as told:
            folder = write_flight(
                speakers,
                archive,
                start_ns,
                site=None if place is None else place.text,
                longest_s=longest,
                command=tuple(sys.argv[1:]),
                progress=lambda second: told(second / longest),
            )
    except FolderError as error:
        raise UsageError(str(error)) from error
    if not quiet:
        for speaker in speakers:
            print(f"mavlink:{speaker.encoder.system} {_came_to(speaker)}")
        print(f"archived in {folder}")


def _came_to(speaker: Speaker) -> str:
    """How far its mission came, in a few words."""
    from sim.vehicles.missions import LAST_NAVIGATION
    from sim.vehicles.recording import is_done

    vehicle = speaker.vehicle
    reached = len(set(vehicle.mission.reached))
    total = sum(one.command <= LAST_NAVIGATION for one in vehicle.mission.items[1:])
    state = "still under way"
    if is_done(speaker):
        state = "at rest" if vehicle.is_landed else "waiting in the air"
    return f"{state} after {vehicle.moment.time_s:.0f} s, {reached} of {total} places reached"


def _serve(
    vehicles: list[Vehicle],
    speakers: Callable[[], list[Speaker]],
    wanted: Wanted,
    mavlink: str,
    speed: float,
    quiet: bool,
) -> None:
    """Talk on the links, each with speakers of its own."""
    from gateway.runtime.links import open_link
    from gateway.runtime.signals import StopSignals
    from gateway.runtime.urls import MAVLINK_PORT, LinkError
    from sim.vehicles.serving import LinkedVehicles, serve

    opened: list[Link] = []
    try:
        for url in take.read_urls(mavlink.split(","), MAVLINK_PORT):
            opened.append(open_link(url, is_drained=False))
        links = [LinkedVehicles(link, speakers()) for link in opened]
        if not quiet:
            numbers = ", ".join(f"mavlink:{number}" for number in range(1, len(vehicles) + 1))
            print(
                f"{wanted.kind.value} {numbers} on {', '.join(str(link.url) for link in opened)}; Ctrl-C ends.",
                flush=True,
            )
        with sending(), StopSignals() as stop:

            def is_over() -> bool:
                is_late = wanted.seconds is not None and vehicles[0].moment.time_s >= wanted.seconds
                return is_late or stop() is not None

            tell = (lambda text: None) if quiet else (lambda text: print(text, file=sys.stderr, flush=True))
            serve(vehicles, links, speed=speed, asked_to_stop=is_over, tell=tell)
    except LinkError as error:
        raise UsageError(str(error)) from error
    finally:
        for link in opened:
            link.close()
    if not quiet:
        print(f"sent {sum(one.sent for one in links)} MAVLink frames")
