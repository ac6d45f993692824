"""Makes every picture of README and docs anew: the sessions behind them, then the pictures, in the real viewer.

    python docs/pictures.py                # some minutes; needs what docs/make_pictures.py needs

Sessions and figures go into a temporary folder; pictures into docs/pictures/.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from gateway.settings import DEMO_SITE, format_site

DOCS = Path(__file__).resolve().parent
OUT = DOCS / "pictures"
FLIGHT = DOCS.parent / "tests" / "data" / "sitl-landing-excerpt.tlog"
LOG = FLIGHT.with_suffix(".BIN")
PROGRAM = Path(sys.executable).with_name("talkdown")
REGISTERED = ["aircraft=10", "radars=2", "duration_s=420", "gps.error_sigma_m=10"]
REGISTERED += ["radar1.range_error_m=150", "radar1.azimuth_error_deg=0.5", "radar1.elevation_error_deg=0.2"]
REGISTERED += ["radar1.time_error_s=0.05", "radar2.range_error_m=-40", "radar2.azimuth_error_deg=-0.2"]
MAX = ("--speed", "max", "--archive")
SCENE = ("--size", "2000x1200", "--view", "Demo field: approach")
PUBLISHED = """
name = "Demo field"
[runway]
latitude_deg = 31.0
longitude_deg = 104.0
height_m = 500.0
geoid_separation_m = -35.0
landing_direction_deg = 90.0
[[waypoint]]
name = "FAF"
latitude_deg = 31.0
longitude_deg = 103.86
[[waypoint]]
name = "ALPHA"
latitude_deg = 31.06
longitude_deg = 103.75
[[waypoint]]
name = "BRAVO"
latitude_deg = 30.93
longitude_deg = 103.8
[[weather]]
name = "CB 1"
latitude_deg = 31.005
longitude_deg = 103.76
radius_m = 3000.0
"""
SCOPE = "Precision approach: elevation over azimuth, x10"


def talkdown(*arguments: str | Path) -> str:
    """Run one command; what it printed."""
    command = [str(PROGRAM), *map(str, arguments)]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def draw(recording: Path, name: str, *options: str) -> None:
    """One picture of a recording."""
    target = OUT / f"{name}.png"
    command = [sys.executable, str(DOCS / "make_pictures.py"), str(recording), str(target), *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    print(f"{target.name}: {target.stat().st_size // 1000} kB")


def only_session(folder: Path) -> Path:
    """The one session in a folder."""
    (session,) = folder.iterdir()
    return session


def main() -> None:
    """All pictures."""
    OUT.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        talkdown("simulate", "landing", "--speed", "max", "--archive", work / "simulated")
        simulated = only_session(work / "simulated")
        talkdown("replay", simulated, "--viewer", "none", "--archive", work / "landing")
        landing = only_session(work / "landing") / "session.rrd"
        draw(landing, "landing", "--at", "0.75")
        draw(landing, "scope", "--at", "0.8", "--view", SCOPE)
        errors = [part for change in REGISTERED for part in ("--set", change)]
        talkdown("simulate", "traffic", *errors, "--seed", "3", "--speed", "max", "--archive", work / "off")
        talkdown("replay", only_session(work / "off"), "--viewer", "none", "--archive", work / "registered")
        draw(
            only_session(work / "registered") / "session.rrd", "registration", "--at", "0.97", "--page", "Registration"
        )
        few = ("--set", "radars=0", "--set", "gps.period_s=1")
        talkdown("simulate", "conflicts", "--set", "aircraft=10", "--set", "duration_s=420", *few, *MAX, work / "near")
        talkdown("replay", only_session(work / "near"), "--viewer", "none", "--archive", work / "told")
        draw(only_session(work / "told") / "session.rrd", "conflict", "--at", "0.64", *SCENE)
        field = work / "demo.toml"
        field.write_text(format_site(DEMO_SITE), encoding="utf-8")
        threatened = ("--seed", "2", "--speed", "28", "--height", "200")
        talkdown("plan", *threatened, "--site", field, "--out", work / "route")
        talkdown("simulate", work / "route.plan", "--site", field, *MAX, work / "flown")
        talkdown("replay", only_session(work / "flown"), "--viewer", "none", "--archive", work / "circle")
        draw(only_session(work / "circle") / "session.rrd", "circle", "--at", "0.82")
        talkdown("simulate", "spoofed", *MAX, work / "false")
        talkdown("replay", only_session(work / "false"), "--viewer", "none", "--archive", work / "denied")
        draw(only_session(work / "denied") / "session.rrd", "spoofed", "--at", "0.72")
        published = work / "published.toml"
        published.write_text(PUBLISHED, encoding="utf-8")
        talkdown("simulate", "approach", "--site", published, *few, *MAX, work / "one")
        talkdown("replay", only_session(work / "one"), "--viewer", "none", "--archive", work / "believed")
        draw(only_session(work / "believed") / "session.rrd", "candidates", "--at", "0.3", *SCENE)
        site = work / "field.toml"
        site.write_text(talkdown("site", FLIGHT), encoding="utf-8")
        talkdown("simulate", "radar", "--watch", FLIGHT, "--site", site, "--archive", work / "seen")
        (seen,) = (work / "seen").iterdir()
        talkdown("replay", FLIGHT, seen, "--site", site, "--viewer", "none", "--archive", work / "sitl")
        draw(only_session(work / "sitl") / "session.rrd", "sitl", "--at", "0.985")
        talkdown("replay", LOG, seen, "--from", "11:45", "--site", site, "--viewer", "none", "--archive", work / "log")
        draw(only_session(work / "log") / "session.rrd", "health", "--at", "0.7", "--page", "Health")


if __name__ == "__main__":
    main()
