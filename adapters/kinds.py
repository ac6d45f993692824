"""What a file is, told from what is in it, never from its name.

.tlog               from the first record on: stamp, frame, stamp, frame
.pcap, .pcapng      by their magic; a capture can hold landing-radar datagrams, MAVLink datagrams, or both
.BIN                ArduPilot dataflash: A3 95 80 (its format message comes first)
.ulg                PX4: "ULog" 01 12 35
.plan               JSON that says "fileType": "Plan"
waypoints           "QGC WPL "
session folder      holds session.json
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

from adapters.mavlink_frames import V1, V2, FrameScanner, parse
from adapters.mission_files import mission_kind
from adapters.pcap import is_capture
from adapters.reasons import reason_of
from adapters.tlog import record_end

Kind = Literal["tlog", "pcap", "pcapng", "BIN", "ulg", "plan", "waypoints", "session"]

_BEGINNING = 1 << 16


class FileError(ValueError):
    """A file that cannot be used; the message is one plain sentence."""


def kind_of(path: Path) -> Kind:
    """What a file or folder is.

    Raises FileError when it does not exist, is empty or is no recording that we know.
    """
    if path.is_dir():
        if (path / "session.json").is_file():
            return "session"
        raise FileError(f"{path} is a folder without session.json: name a session's folder or a recording.")
    try:
        with path.open("rb") as file:
            beginning = file.read(_BEGINNING)
    except OSError as error:
        raise FileError(f"{path} cannot be read ({reason_of(error)}).") from error
    if not beginning:
        raise FileError(f"{path} is empty.")
    if is_capture(beginning):
        return "pcapng" if beginning[:4] == b"\x0a\x0d\x0d\x0a" else "pcap"
    if beginning[:3] == b"\xa3\x95\x80":
        return "BIN"
    if beginning[:7] == b"ULog\x01\x12\x35":
        return "ulg"
    if _is_tlog(beginning):
        return "tlog"
    mission = mission_kind(beginning)
    if mission is not None:
        return mission
    can = "a .tlog, .BIN, .ulg, .pcap or .pcapng file, or a session's folder, can be replayed"
    raise FileError(f"{path} is {_what_else(beginning)}: {can}.")


def _is_tlog(beginning: bytes) -> bool:
    """Whether records stand here: three in a row, or as many as there are, at least one good by its checksum."""
    for start in range(min(len(beginning), 2048)):
        if start + 8 < len(beginning) and beginning[start + 8] not in (V1, V2):
            continue
        at, good, count = start, 0, 0
        while count < 20 and (end := record_end(beginning, at)) is not None:
            frame = parse(beginning[at + 8 : end])
            good += frame is not None and frame.verdict == "good"
            at, count = end, count + 1
        if good and (count >= 3 or (start == 0 and at == len(beginning))):
            return True
    return False


_BEGINNINGS = {  # what people take for a recording, or drop by mistake
    b"\x89PNG": "a picture",
    b"\xff\xd8\xff": "a picture",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a zip archive, to be unpacked first",
    b"\x1f\x8b": "compressed by gzip, to be unpacked first",
    b"BZh": "compressed by bzip2, to be unpacked first",
    b"\xfd7zXZ": "compressed by xz, to be unpacked first",
    b"\x28\xb5\x2f\xfd": "compressed by zstd, to be unpacked first",
    b"PAR1": "a Parquet table, not a recording",
    b"RRF": "a Rerun recording, which a viewer opens",
    b"MATLAB": "a MATLAB file, not a recording",
    b"SQLite format 3": "a database, not a recording",
    b"FMT, 128": "a dataflash log as text, not the .BIN that it was made from",
}


def _what_else(beginning: bytes) -> str:
    for first, what in _BEGINNINGS.items():
        if beginning.startswith(first):
            return what
    if any(frame for frame in FrameScanner().feed_datagram(beginning)):
        return "a stream of MAVLink frames without times"
    if len(beginning) < 24:
        return "too short to be a recording"
    if beginning.lstrip()[:1] in (b"{", b"[") and _is_json(beginning):
        return "a JSON file, not a recording"
    text = beginning[:512]
    return (
        "a text file, not a recording" if all(byte >= 32 or byte in b"\t\r\n" for byte in text) else "not a recording"
    )


def _is_json(beginning: bytes) -> bool:
    try:
        json.JSONDecoder().raw_decode(beginning.decode("utf-8", "ignore").lstrip())
    except ValueError:
        return len(beginning) == _BEGINNING  # cut by us, most likely
    except RecursionError:  # nested deeper than anything that is one
        return False
    return True
