"""Broken sessions mended: session.json from what is whole of it and from the inputs, tables and drawing by a replay.

A replay of the inputs gives the same rows and bits, so what was lost is not guessed. Only inputs cannot be made again.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from adapters import Kind, Source
from adapters.files import FileError
from gateway import __version__
from gateway.runtime.folder import FORMAT, INPUTS, SESSION_FILE, FolderError, InputFile, read_record
from gateway.runtime.inputs import SessionInput
from gateway.runtime.listing import TABLES, Listed, look
from gateway.runtime.loop import run_replay
from gateway.runtime.outputs import RRD_FILE
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import RunFailure
from gateway.runtime.whole import write_json
from gateway.settings import Options

_KINDS: dict[str, Kind] = {"tlog": "mavlink", "pcap": "radar", "jsonl": "told"}
_KEY = re.compile(r'^ "(\w+)": ', re.MULTILINE)  # of the outermost object, as we write it
_AGAIN = ".again.part"  # inside the session's folder


def repair(session: Listed) -> Listed:
    """A session with faults, mended as far as it can be; `mended` says what was done, `faults` what is left.

    Raises FolderError, one sentence, when it cannot be mended, OSError when the disk refuses.
    """
    done = []
    if session.record is None:
        _rebuild(session.folder)
        lost = "" if read_record(session.folder).site else ": its site is lost"
        done.append(f"{SESSION_FILE} written anew{lost}")
    for fault in look(session.folder).faults:
        if fault.file.endswith(".part"):
            (session.folder / fault.file).unlink()
            done.append(f"{fault.file} removed")
    seen = look(session.folder)
    remade = {f"{table}.parquet" for table in TABLES} | {RRD_FILE}
    broken = sorted({fault.file for fault in seen.faults} & remade)
    if broken and seen.record is not None and seen.record.command[:1] != ("simulate",):  # whose truth is nowhere else
        _replay(session.folder, broken)
        done.append(f"{', '.join(broken)} made again from the inputs")
    left = look(session.folder)
    told = ", ".join([*filter(None, (session.mended, left.mended)), *done])
    return replace(left, mended=told)


def _replay(folder: Path, names: list[str]) -> None:
    """Make some of a session's files again; each takes its place when it is whole."""
    beside = folder / _AGAIN
    shutil.rmtree(beside, ignore_errors=True)
    try:
        playback = open_playback([folder])
        setup = replace(playback.setup(), archive=beside, is_watched=False, folder_name=folder.name)
        run_replay(playback, setup)
        for name in names:
            if (beside / folder.name / name).exists():
                os.replace(beside / folder.name / name, folder / name)
    except (FileError, RunFailure) as error:
        raise FolderError(f"{folder} cannot be replayed, and so not mended: {error}") from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _rebuild(folder: Path) -> None:
    """Write session.json anew; the old one is kept as session.json.broken."""
    path = folder / SESSION_FILE
    found = _salvaged(path.read_text(encoding="utf-8", errors="replace"))
    made = _from_inputs(folder)
    os.replace(path, path.with_name(f"{SESSION_FILE}.broken"))
    for known in (made | found, made):  # what was salvaged may be spoiled itself
        write_json(path, known)
        try:
            read_record(folder)
        except FolderError:
            continue
        return


def _salvaged(text: str) -> dict[str, Any]:
    """The outermost values that are whole."""
    found, decoder = {}, json.JSONDecoder()
    for match in _KEY.finditer(text):
        try:
            found[match[1]] = decoder.raw_decode(text, match.end())[0]
        except (ValueError, RecursionError):
            continue
    return {**found, "format": FORMAT} if found else {}


def _from_inputs(folder: Path) -> dict[str, Any]:
    """What the recorded inputs alone tell of a session. Raises FolderError where there are none."""
    sources, stamps = [], []
    for number, path in enumerate(sorted((folder / INPUTS).glob("*"))):
        kind = _KINDS.get(path.suffix[1:])
        if kind is None or path.stem.endswith(".refused"):
            continue
        source = Source(number, kind, path.stem, "not known any more")
        arrivals = [arrival.received_at for arrival in SessionInput(path, source).arrivals()]
        stamps += arrivals[:1] + arrivals[-1:]
        sources.append(InputFile(number, kind, path.stem, source.origin, f"{INPUTS}/{path.name}", len(arrivals)))
    if not stamps:
        raise FolderError(f"{folder} cannot be mended: its {SESSION_FILE} is spoiled, and nothing was recorded.")
    return {
        "format": FORMAT,
        "version": __version__,
        "command": [],
        "options": asdict(Options()),
        "started_at": min(stamps),
        "sources": list(map(asdict, sources)),
        "watermark": max(stamps),
        "ended": "killed",
    }
