"""Options that several commands share, with their help, and how they become what the runtime takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from adapters.reasons import reason_of
from gateway.cli.failures import UsageError

if TYPE_CHECKING:
    from gateway.predict import ArrivalFlow
    from gateway.runtime.setup import Place, Serve
    from gateway.runtime.urls import Url
    from gateway.settings import Options


class Viewer(StrEnum):
    """How a person looks at the session."""

    native = "native"
    web = "web"
    none = "none"


class Estimator(StrEnum):
    """How aircraft are taken to move."""

    kalman = "kalman"
    imm = "imm"
    rmimm = "rmimm"
    alpha_beta_gamma = "alpha-beta-gamma"


class Weighting(StrEnum):
    """How GPS and radar are weighed against each other."""

    bias = "bias"
    covariance = "covariance"
    innovation = "innovation"
    literal = "literal"


class Association(StrEnum):
    """When a radar track and an aircraft are one."""

    default = "default"
    literal = "literal"


class Registration(StrEnum):
    """What is done about what radars measure too much."""

    apply = "apply"
    watch = "watch"
    off = "off"


class DeadReckoning(StrEnum):
    """Whether vehicles that tell how they move go on by that without positions."""

    on = "on"
    off = "off"


SiteOption = Annotated[
    Path | None,
    typer.Option(
        "--site",
        metavar="FILE",
        help="Site file (TOML): the runway and the radars. Without one the stream tells.",
        show_default=False,
    ),
]
ViewerOption = Annotated[
    Viewer | None,
    typer.Option(
        "--viewer",
        help="native: a window; web: an address for the browser; none. (default: native, web without a screen)",
        show_default=False,
    ),
]
ServeOption = Annotated[
    str | None,
    typer.Option(
        "--serve",
        metavar="HOST:PORT",
        help="Where viewers find the session, such as 0.0.0.0:9876 for a network. (default: this machine, a free port)",
        show_default=False,
    ),
]
ArchiveOption = Annotated[
    Path | None,
    typer.Option(
        "--archive", metavar="DIR", help="Keep the session: a folder of its own inside DIR.", show_default=False
    ),
]
EstimatorOption = Annotated[
    Estimator,
    typer.Option(
        "--estimator",
        help="How tracks move: kalman at constant velocity; imm and rmimm tell straight and turns apart; "
        "alpha-beta-gamma, at constant acceleration, is the light one.",
    ),
]
WeightingOption = Annotated[
    Weighting,
    typer.Option(
        "--weighting", help="How GPS and radar are weighed: bias estimates the GPS error; the others are paper 003's."
    ),
]
AssociationOption = Annotated[
    Association,
    typer.Option("--association", help="When a radar track and an aircraft are one: ours, or paper 003's literally."),
]
RegistrationOption = Annotated[
    Registration,
    typer.Option(
        "--registration",
        help="What radars measure too much: apply learns it and takes it off, watch only tells it, off does neither.",
    ),
]
DeadReckoningOption = Annotated[
    DeadReckoning,
    typer.Option(
        "--dead-reckoning",
        help="By what vehicles tell of their own motion: on goes on by it without GPS and refuses positions that it denies.",
    ),
]
KeyOption = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="MAVLink 2 signing: 64 hex digits, 32 bytes or a passphrase. Frames that are not signed with it are refused.",
        show_default=False,
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Show no progress and no summary; only failures.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the summary as one JSON object.")]
FlowsOption = Annotated[
    str | None,
    typer.Option(
        "--flows",
        metavar="FILE|DIR|off",
        help="Ways that arrivals come, as `talkdown flows` found them: where aircraft without a plan may go. "
        "(default: of a session its own, live those in the archive)",
        show_default=False,
    ),
]


@dataclass(frozen=True, slots=True)
class Methods:
    """How tracks are made, for a session that begins."""

    estimator: EstimatorOption = Estimator.kalman
    weighting: WeightingOption = Weighting.bias
    association: AssociationOption = Association.default
    registration: RegistrationOption = Registration.apply
    dead_reckoning: DeadReckoningOption = DeadReckoning.on
    flows: FlowsOption = None

    def options(self) -> Options:
        """The options of a run."""
        from gateway.settings import Options

        return choose(
            Options(),
            estimator=self.estimator,
            weighting=self.weighting,
            association=self.association,
            registration=self.registration,
            dead_reckoning=self.dead_reckoning,
        )


@dataclass(frozen=True, slots=True)
class Seen:
    """Where a session is seen, and kept."""

    viewer: ViewerOption = None
    serve: ServeOption = None
    archive: ArchiveOption = None


@dataclass(frozen=True, slots=True)
class Telling:
    """What is told on the terminal."""

    quiet: QuietOption = False
    json: JsonOption = False


def read_place(path: Path | None) -> Place | None:
    """The site file's place. Raises UsageError."""
    if path is None:
        return None
    from gateway.runtime.setup import Place
    from gateway.settings import SiteError, parse_site

    try:
        text = path.read_text(encoding="utf-8")
        return Place(parse_site(text, str(path)), text, str(path))
    except SiteError as error:
        raise UsageError(str(error)) from error
    except FileNotFoundError as error:
        raise UsageError(f"There is no site file {path}; `talkdown site` writes one to start from.") from error
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"The site file {path} cannot be read: {reason_of(error)}.") from error


def read_keys(place: Place | None, site_path: Path | None) -> dict[int, bytes]:
    """The keys of the site's radars by number; key files stand beside the site file. Raises UsageError."""
    keys: dict[int, bytes] = {}
    for radar in place.site.radars if place and site_path else ():
        if radar.key_file and site_path:
            path = site_path.parent / radar.key_file
            try:
                keys[radar.number] = path.read_bytes().strip()
            except OSError as error:
                raise UsageError(
                    f"The key file of radar {radar.number}, {path}, cannot be read: {reason_of(error)}."
                ) from error
            if not keys[radar.number]:
                raise UsageError(f"The key file of radar {radar.number}, {path}, is empty.")
    return keys


def read_flows(given: str | None) -> tuple[ArrivalFlow, ...] | None:
    """The arrival flows that --flows names; none where it says off; None where it is not given. Raises UsageError."""
    if given is None:
        return None
    if given == "off":
        return ()
    from gateway.runtime.flow_ways import FlowsError, read_ways

    try:
        return read_ways(Path(given))[0]
    except FlowsError as error:
        raise UsageError(str(error)) from error


def read_signing_key(path: Path | None) -> bytes | None:
    """The MAVLink signing key of a key file. Raises UsageError."""
    if path is None:
        return None
    from adapters.signing import SigningKeyError, read_key

    try:
        return read_key(path)
    except SigningKeyError as error:
        raise UsageError(str(error)) from error


def read_urls(texts: list[str], default_port: int) -> list[Url]:
    """The links that the texts describe. Raises UsageError."""
    from gateway.runtime.urls import LinkError, parse_url

    try:
        return [parse_url(text, default_port) for text in texts]
    except LinkError as error:
        raise UsageError(str(error)) from error


def choose(options: Options, **methods: StrEnum | None) -> Options:
    """The options with the methods that were asked for, by the options' names; None = as they are."""
    chosen: dict[str, Any] = {name: one.value for name, one in methods.items() if one is not None}
    return replace(options, **chosen)


def read_serve(text: str | None, viewer: Viewer) -> Serve | None:
    """Where to serve viewers: as told, else on this machine when there is a viewer. Raises UsageError."""
    from gateway.runtime.setup import Serve

    if text is None:
        return None if viewer is Viewer.none else Serve()
    host, colon, port = text.rpartition(":")
    if not colon or not host or not port.isdigit() or int(port) > 65535:
        raise UsageError(
            f"--serve {text!r} is not HOST:PORT; write 127.0.0.1:9876 for this machine, 0.0.0.0:9876 for its network."
        )
    return Serve(host.strip("[]"), int(port))
