"""The scenes that there are, listed and shown: `talkdown simulate --list`, `talkdown simulate NAME --show`."""

from __future__ import annotations

from pathlib import Path

from gateway.cli.failures import UsageError

_COLUMNS = ("scene", "vehicles", "radars", "length", "faults")


def list_scenes(folder: str | None) -> None:
    """A table of the shipped scenes, or of a folder's. A file that cannot be staged is listed with what is wrong."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from sim.scenes import scene_names, scenes_in

    if folder is not None and not Path(folder).is_dir():
        raise UsageError(f"--list takes a folder of scene files, and {folder} is none.")
    names = scene_names() if folder is None else [str(path) for path in scenes_in(Path(folder))]
    if not names:
        print(f"No scenes in {folder}: a scene is a .toml file with a table [scene].")
        return
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in _COLUMNS:
        table.add_column(column, justify="left" if column == "scene" else "right", no_wrap=True)
    table.add_column("", overflow="fold")
    for name in names:
        table.add_row(*(escape(cell) for cell in _row(name)))
    Console().print(table)


def _row(name: str) -> tuple[str, ...]:
    from gateway.settings import SiteError
    from sim.scenes import find_scene, stage

    called = Path(name).name
    try:
        script = find_scene(name)
        scene = stage(script, start_ns=0)
    except SiteError as error:
        return called, "", "", "", "", str(error)
    minutes, seconds = divmod(round(scene.duration_s), 60)
    counts = (len(scene.aircraft), len(scene.radars))
    return called, *map(str, counts), f"{minutes}:{seconds:02}", str(len(scene.faults) or ""), script.description


def show_scene(name: str) -> None:
    """The text of a scene's file, to be copied and changed."""
    from gateway.settings import SiteError
    from sim.scenes import find_scene

    try:
        print(find_scene(name).text, end="")
    except SiteError as error:
        raise UsageError(str(error)) from error
