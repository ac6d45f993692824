"""Renders the pictures of README and docs from an archived session, in the real viewer, without a screen.

    python docs/make_pictures.py SESSION.rrd OUT.png [--at 0.8] [--size 1600x900] [--page NAME] [--view NAME]

`--at` is the part of the session at which the cursor stands, `--page` the tab of the window that is in front (Picture, Health),
`--view` the name of one view instead of the whole window.
Needs a GPU or Mesa's software Vulkan (Debian: apt-get install mesa-vulkan-drivers libgl1 libegl1 libxkbcommon-x11-0).
"""

from __future__ import annotations

import io
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import numpy as np
import rerun_cli
import typer
from PIL import Image
from rerun.experimental import ViewerClient

SOFTWARE_VULKAN = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
PATIENCE_S = 60.0
MENU_SHARE = 0.04  # the height of the viewer's own menu bar, which tells of this machine, not of the session


@contextmanager
def viewer(size: str) -> Iterator[ViewerClient]:
    """A viewer without a screen, until the end of the block."""
    program = Path(rerun_cli.__file__).with_name("rerun")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as run:
        environment = {**os.environ, "XDG_RUNTIME_DIR": run, "RERUN_ANALYTICS": "0"}
        if SOFTWARE_VULKAN.exists():
            environment.setdefault("VK_ICD_FILENAMES", str(SOFTWARE_VULKAN))
        command = [str(program), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", size]
        quiet = subprocess.DEVNULL
        process = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet)
        try:
            yield connected(process, f"rerun+http://127.0.0.1:{port}/proxy")
        finally:
            process.kill()
            process.wait()


def connected(process: subprocess.Popen[bytes], address: str) -> ViewerClient:
    """A client of the viewer as soon as it answers; exits with a sentence when it does not start."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end and process.poll() is None:
        try:
            client = ViewerClient.connect(address)
            client.get_state()
            return client
        except (RuntimeError, ConnectionError):
            time.sleep(0.2)
    raise SystemExit("The viewer does not start without a screen here: is a Vulkan driver installed?")


def opened(client: ViewerClient, session: Path) -> tuple[int, int]:
    """Open a recording; its first and last instant, ns."""
    client.open(str(session.resolve()))
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        state = client.get_state()
        if not state.loading and state.views and state.recordings:
            for timeline in state.recordings[0].timelines:
                if timeline.name == "utc" and timeline.start is not None and timeline.end is not None:
                    return timeline.start, timeline.end
        time.sleep(0.2)
    raise SystemExit(f"The viewer finds no session in {session}.")


def turn_to(client: ViewerClient, page: str) -> None:
    """Bring the page of this name to the front; exits with a sentence when there is none."""
    blueprint = client.get_blueprint(of="recording").blueprint
    containers = {
        path: parts["ContainerBlueprint"] for path, parts in blueprint.items() if "ContainerBlueprint" in parts
    }
    named = {container["display_name"]: path for path, container in containers.items() if "display_name" in container}
    if page not in named:
        raise SystemExit(f"There is no page {page!r}; there are: {', '.join(sorted(named))}.")
    for container in containers.values():
        if named[page] in container["contents"]:
            container["active_tab"] = named[page]
    client.set_blueprint(blueprint, of="recording")


def picture(
    session: Path,
    out: Path,
    at: Annotated[float, typer.Option(min=0.0, max=1.0)] = 0.8,
    size: str = "1600x900",
    page: str | None = None,
    view: str | None = None,
) -> None:
    """Render one picture of a session."""
    with viewer(size) as client:
        first, last = opened(client, session)
        instant = np.datetime64(int(first + at * (last - first)), "ns")
        if page is not None:
            turn_to(client, page)
        client.set_time("utc", timestamp=instant, play_state="paused")
        time.sleep(7.0)  # the plots settle, and the viewer's own notices go
        names = {one.name: one.view_id for one in client.get_state().views}
        if view is not None and view not in names:
            raise SystemExit(f"There is no view {view!r}; there are: {', '.join(sorted(names))}.")
        try:
            shot = client.take_screenshot(None if view is None else names[view], max_size=int(size.split("x")[0]))
        except ConnectionError as error:
            raise SystemExit(f"The view {view!r} is behind another tab, and cannot be drawn alone.") from error
    image = Image.open(io.BytesIO(shot)).convert("RGB")
    if view is None:
        image = image.crop((0, round(MENU_SHARE * image.height), image.width, image.height))
    image.save(out, optimize=True)
    print(f"{out}: {image.width} x {image.height}, {out.stat().st_size // 1000} kB")


if __name__ == "__main__":
    typer.run(picture)
