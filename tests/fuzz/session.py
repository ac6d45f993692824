"""An archived session, and the same with one of its files spoiled."""

from __future__ import annotations

import json
import random
import shutil
from pathlib import Path

import corpus
import spoiled

from gateway.runtime.folder import SESSION_FILE
from gateway.runtime.loop import run_replay
from gateway.runtime.playback import open_playback
from gateway.runtime.setup import Place, Setup
from gateway.settings import format_site

_FORMATS = {".json": "json", ".jsonl": "jsonl", ".tlog": "tlog", ".pcap": "pcap"}


def session_seeds(folder: Path, source: random.Random) -> list[corpus.Seed]:
    """Makes a session of a flight, a radar and a told plan in a folder; its files that can be spoiled."""
    raw = folder.parent / "raw"
    raw.mkdir()
    paths = [raw / "landing.pcap", raw / "mission.plan"]
    by_name = {seed.name: seed.content for seed in corpus.files(source)}
    for path in paths:
        path.write_bytes(by_name[path.name])
    playback = open_playback(paths)
    place = Place(corpus.SITE, format_site(corpus.SITE), "the fuzzer's")
    archive = folder.parent / "archive"
    run_replay(playback, Setup(place, archive=archive, is_watched=False, keys=corpus.RADAR_KEYS))
    (made,) = archive.iterdir()
    made.rename(folder)
    for large in folder.glob("*.rrd"):
        large.unlink()
    return [
        corpus.Seed(f"session/{path.relative_to(folder)}", path.read_bytes())
        for path in sorted(folder.rglob("*"))
        if path.suffix in _FORMATS
    ]


def spoil_session(source: random.Random, folder: Path, seed: corpus.Seed, copy: Path) -> Path:
    """A copy of the session with one file spoiled; sometimes as if it had been killed while it ran."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(folder, copy)
    name = seed.name.removeprefix("session/")
    (copy / name).write_bytes(spoiled.spoil(source, seed))
    if name != SESSION_FILE and source.random() < 0.3:
        record = json.loads((copy / SESSION_FILE).read_text())
        (copy / SESSION_FILE).write_text(json.dumps({**record, "ended": None, "watermark": None}))
    return copy
