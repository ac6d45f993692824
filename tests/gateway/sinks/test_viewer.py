"""What a person sees: every view of the blueprint has something to show, early, in the middle and late.

Needs a viewer that can draw without a screen (a GPU, or Mesa's software Vulkan); where it cannot start, this is skipped.
"""

from __future__ import annotations

import io
import os
import runpy
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun.blueprint as rrb
import rerun_cli
from PIL import Image
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from gateway.settings import DEMO_SITE
from gateway.sinks.blueprint import blueprint
from gateway.sinks.rerun import RerunSink

SOFTWARE_VULKAN = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
PATIENCE_S = 30.0  # a viewer that has not started by then is not there


def until(what: Any, patience_s: float = PATIENCE_S) -> Any:
    """The first answer that is not None; None when patience ends."""
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        answer = what()
        if answer is not None:
            return answer
        time.sleep(0.1)
    return None


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ViewerClient]:
    """A viewer without a screen."""
    program = Path(rerun_cli.__file__).with_name("rerun")
    if sys.platform != "linux" or not program.exists():
        pytest.skip("the viewer is drawn without a screen on Linux only")
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path_factory.mktemp("run"))}
    environment.pop("DISPLAY", None)
    if SOFTWARE_VULKAN.exists():
        environment.setdefault("VK_ICD_FILENAMES", str(SOFTWARE_VULKAN))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [str(program), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "1600x900"]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet)

    def connected() -> ViewerClient | bool | None:
        if process.poll() is not None:
            return False
        try:
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.get_state()
        except (RuntimeError, OSError, ConnectionError):
            return None
        return client

    client = until(connected)
    if not client:
        process.kill()
        process.wait()
        pytest.skip("the viewer cannot start here without a screen: no Vulkan driver")
    yield client
    process.kill()
    process.wait()


PARTS = (0.25, 0.5, 0.75)
LEAST_PIXELS = 20


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, int]:
    """A recording of four minutes of the approach; where it begins and ends, ns."""
    path = tmp_path_factory.mktemp("session") / "session.rrd"
    make = runpy.run_path(str(Path(__file__).with_name("conftest.py")))["make_pictures"]
    made = make(240.0, first_s=120.0)
    sink = RerunSink(DEMO_SITE, path=path, modes=True, period_s=10.0, rows_limit=4096)
    for picture in made:
        sink.write(picture)
    sink.close()
    return path, made[0].now, made[-1].now


def views_of(part: Any) -> Iterator[rrb.View]:
    """The views of a blueprint, tabs and all."""
    if isinstance(part, rrb.View):
        yield part
    else:
        for inner in part.contents:
            yield from views_of(inner)


def shows(view: rrb.View, path: str) -> bool:
    """Whether a view's contents take in an entity; the most precise rule decides."""
    contents = view.contents if isinstance(view.contents, list) else [view.contents]
    matching = {}
    for rule in contents:
        sign = not rule.startswith("-")
        root = rule.removeprefix("-").strip().replace("$origin", str(view.origin).rstrip("/")).removesuffix("/**")
        if path == root or path.startswith(root + "/"):
            matching[len(root)] = sign
    return matching[max(matching)] if matching else False


def test_every_view_has_rows_from_early_on(session):
    """In each part of the session, each view has new rows: what it shows is not left over from the beginning.

    But for one: what dead reckoning says is drawn of vehicles that tell inertial samples, and this one tells none.
    """
    path, first, last = session
    rows = {}
    for chunk in RrdReader(path).stream():
        if not chunk.is_static:
            utc = chunk.to_record_batch().column("utc").cast("int64").to_numpy()
            rows.setdefault(chunk.entity_path, []).append(utc)
    views = list(views_of(blueprint(DEMO_SITE, modes=True).root_container))
    assert len({view.name for view in views}) == len(views) == 33
    for view in views:
        mine = [utc for name, parts in rows.items() if shows(view, name) for utc in parts]
        if view.name == "Without GPS, m":
            assert not mine
            continue
        assert mine, view.name
        utc = np.concatenate(mine)
        for part in PARTS:
            assert (utc <= first + part * (last - first)).any(), (view.name, part)


def test_what_is_seen_is_not_empty_early_in_the_middle_and_late(viewer, session):
    """Of the views that are open at the start, each draws something, changes with time, and reports no fault."""
    path, first, last = session
    viewer.open(str(path))

    def loaded() -> Any:
        state = viewer.get_state()
        return state if state.views and not state.loading and state.recordings[0].timelines else None

    assert until(loaded) is not None
    seen: dict[str, list[int]] = {}
    for part in PARTS:
        viewer.set_time("utc", timestamp=np.datetime64(int(first + part * (last - first)), "ns"), play_state="paused")
        state = viewer.get_state()
        assert [(view.name, view.reports) for view in state.views if view.reports] == []
        for view in state.views:
            drawn = painted_pixels(viewer, view)
            if drawn is not None:
                seen.setdefault(view.name, []).append(drawn)
    assert {"Log", "Map", f"{DEMO_SITE.name}: approach"} < set(seen)
    assert min(min(pixels) for pixels in seen.values()) >= LEAST_PIXELS, seen


def painted_pixels(viewer: ViewerClient, view: Any) -> int | None:
    """The same once the view has been painted: on a busy machine that may take it more than one picture."""
    last: list[int | None] = [None]

    def painted() -> bool | None:
        last[0] = drawn_pixels(viewer, view)
        return None if last[0] is not None and last[0] < LEAST_PIXELS else True

    until(painted, 10.0)
    return last[0]


def drawn_pixels(viewer: ViewerClient, view: Any) -> int | None:
    """How many pixels of a view show data; None for one behind another tab.

    In the scene, the map and the screen, where the site is drawn too, those are the red ones of the fused track;
    elsewhere all that are neither black, grey nor white. A view without data has none of them.
    """
    try:
        shot = viewer.take_screenshot(view.view_id, max_size=800)
    except ConnectionError:
        return None
    red, green, blue = np.moveaxis(np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int), -1, 0)
    if view.view_class in ("3D", "2D", "Map"):
        return int(((red > 140) & (green < 100) & (blue < 100)).sum())
    return int((np.maximum(red, np.maximum(green, blue)) - np.minimum(red, np.minimum(green, blue)) > 60).sum())
