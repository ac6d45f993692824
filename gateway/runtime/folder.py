"""A session's folder: session.json, and the names beside it.

session.json is always whole: it is written beside itself and renamed. It is written at the start, each time the
session's files are flushed, and at the end, so that the folder of a killed session says nearly everything.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from adapters import Kind, Source
from adapters.reasons import reason_of
from gateway.predict import ArrivalFlow
from gateway.register import Remembered
from gateway.runtime.flow_ways import read_archived
from gateway.runtime.remembering import is_of, read_remembered
from gateway.runtime.setup import Setup
from gateway.runtime.typed import misfit
from gateway.runtime.whole import write_json
from gateway.settings import Mute, Options, Site

SESSION_FILE = "session.json"
INPUTS = "inputs"
FORMAT = 1
_YEAR_2200 = 7_258_118_400 * 10**9
_LEAST, _LARGEST = 1e-3, 1e6  # of an option's seconds, sigmas and counts
_SESSIONS_AT_MOST = 200  # that are looked through, the newest first: their names begin with when they began
_LEAST_FREE_BYTES = 32 << 20  # below, a session would end before it was worth anything


class FolderError(ValueError):
    """A folder that cannot be used as, or is no session; the message is one plain sentence."""


@dataclass(frozen=True, slots=True)
class InputFile:
    """One source of a session and the file that holds what it sent."""

    number: int
    kind: Kind
    name: str
    origin: str
    file: str  # relative to the session's folder
    arrivals: int = 0
    refused: int = 0

    @property
    def source(self) -> Source:
        """The source as it was live."""
        return Source(self.number, self.kind, self.name, self.origin)


@dataclass(frozen=True, slots=True)
class Record:
    """What session.json says. Instants are ns since 1970 UTC by the receiver's clock; `ended` is None while it runs."""

    version: str
    command: tuple[str, ...]
    options: Options
    started_at: int
    site: str | None = None  # the site file's text
    site_origin: str = ""
    epoch_offset_s: int | None = None
    registration: Remembered | None = None  # what was known of the radars' errors at the start, from an earlier session
    registered: Remembered | None = None  # and what is known of them by now
    flows: tuple[ArrivalFlow, ...] = ()  # ways that arrivals come, as they were known at the start
    sources: tuple[InputFile, ...] = ()
    counters: Mapping[str, int] = field(default_factory=dict)
    watermark: int | None = None
    ended: str | None = None  # "done", "interrupted", "failed: ...", "killed"
    summary: Mapping[str, Any] = field(default_factory=dict)


def session_name(started_at: int, name: str) -> str:
    """A folder's name: when it began (UTC) and where."""
    moment = datetime.fromtimestamp(started_at // 1_000_000_000, UTC)
    words = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower()[:40]
    return f"{moment:%Y%m%dT%H%M%SZ}" + (f"-{words}" if words else "")


def make_folder(parent: Path, name: str) -> Path:
    """A new folder for one session inside `parent`, with room for its inputs.

    Raises FolderError when `parent` is a session itself, is no folder, cannot be written or has no room.
    """
    if (parent / SESSION_FILE).exists():
        raise FolderError(
            f"{parent} is a session already; name the folder that sessions are kept in, such as {parent.parent}."
        )
    try:
        parent.mkdir(parents=True, exist_ok=True)
        if shutil.disk_usage(parent).free < _LEAST_FREE_BYTES:
            raise FolderError(f"The disk of {parent} is full; make room, or choose another folder for --archive.")
        for attempt in range(1, 1000):
            folder = parent / (name if attempt == 1 else f"{name}-{attempt}")
            try:
                folder.mkdir()
            except FileExistsError:
                continue
            (folder / INPUTS).mkdir()
            return folder
    except FileExistsError as error:
        raise FolderError(
            f"{parent} is a file; --archive needs a folder, which is made if it does not exist."
        ) from error
    except OSError as error:
        raise FolderError(
            f"{parent} cannot be written to ({reason_of(error)}); choose another folder for --archive."
        ) from error
    raise FolderError(f"{parent} holds 1000 sessions of this second; choose another folder for --archive.")


def write_record(folder: Path, record: Record) -> None:
    """Put session.json in its place, whole. Raises OSError."""
    document: dict[str, Any] = {"format": FORMAT, **asdict(record)}
    document["started"] = _readable(record.started_at)
    document["watermark_utc"] = None if record.watermark is None else _readable(record.watermark)
    write_json(folder / SESSION_FILE, document)


def read_record(folder: Path) -> Record:
    """What the session.json of a folder says.

    Raises FolderError when there is none, or it is none of ours.
    """
    path = folder / SESSION_FILE
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        if not folder.exists():
            raise FolderError(f"There is no folder {folder}.") from error
        raise FolderError(f"{folder} is no session: it has no {SESSION_FILE}.") from error
    except (OSError, ValueError, RecursionError) as error:
        raise FolderError(
            f"{path} cannot be read ({error}); `talkdown sessions {folder} --repair` writes it anew from the inputs."
        ) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise FolderError(f"{path} is not of a format that this version of Talkdown knows.")
    try:
        return _record(document)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise FolderError(f"{path} lacks or spoils what a session needs ({error}).") from error


def remembered_for(setup: Setup, site: Site) -> Remembered | None:
    """What is known of a site's radars before a session: what it was given, or what the last one there in the archive learnt."""
    if not setup.takes_up or setup.archive is None:
        return setup.remembered
    try:
        folders = sorted((one for one in setup.archive.iterdir() if one.is_dir()), reverse=True)
    except OSError:
        return None  # there is none yet
    for folder in folders[:_SESSIONS_AT_MOST]:
        try:
            record = read_record(folder)
        except FolderError:
            continue
        if record.command[:1] == ("live",) and record.registered is not None and is_of(record.registered, site):
            return record.registered
    return None


def _record(document: dict[str, Any]) -> Record:
    known = {name.name for name in fields(Record)}
    plain = {key: value for key, value in document.items() if key in known}
    plain["command"] = tuple(document["command"])
    plain["options"] = read_options(document["options"])
    plain["sources"] = tuple(_input_file(row) for row in document["sources"])
    plain |= {name: read_remembered(plain.get(name)) for name in ("registration", "registered")}
    plain["flows"] = read_archived(plain.get("flows"))
    record = Record(**plain)
    numbers = [source.number for source in record.sources]
    spoiled = misfit(record) or _out_of_range(record) or ("sources" if len(set(numbers)) < len(numbers) else None)
    if spoiled is not None:
        raise ValueError(f"{spoiled} cannot be so")
    return record


def _out_of_range(record: Record) -> str | None:
    """What is a number, but none with which a session can be run."""
    options = record.options
    instants = {"started_at": record.started_at, "watermark": record.watermark, "begins_at": options.begins_at}
    for name, instant in instants.items():
        if instant is not None and not 0 <= instant < _YEAR_2200:
            return name
    if abs(record.epoch_offset_s or 0) * 10**9 > _YEAR_2200:
        return "epoch_offset_s"
    lengths = {one.name: getattr(options, one.name) for one in fields(options)}
    lengths |= {"horizons_s": max(options.horizons_s, default=1.0), "soonest": min(options.horizons_s, default=1.0)}
    for name, length in lengths.items():
        if isinstance(length, float | int) and name != "begins_at" and not _LEAST <= length <= _LARGEST:
            return name
    return None


def _input_file(row: dict[str, Any]) -> InputFile:
    known = {name.name for name in fields(InputFile)}
    return InputFile(**{key: value for key, value in row.items() if key in known})


def read_options(stored: Mapping[str, Any]) -> Options:
    """Options as they were archived; those that this version does not know are an error of its reader's, not silent."""
    values = {key: tuple(value) if isinstance(value, list) else value for key, value in stored.items()}
    values["mutes"] = tuple(Mute(**mute) for mute in values.get("mutes", ()))
    return replace(Options(), **cast("dict[str, Any]", values))


def _readable(instant: int) -> str:
    return datetime.fromtimestamp(instant / 1e9, UTC).isoformat(timespec="milliseconds")
