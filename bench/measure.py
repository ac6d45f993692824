"""Child processes and what they cost, and the figures that come of it.

Light on purpose: a child's peak memory, as the system counts it, is never below what its parent held when it was started,
so nothing large is imported here or in `bench.__main__`.
"""

from __future__ import annotations

import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

_QUIET_ENVIRONMENT: Mapping[str, str] = {"RERUN_ANALYTICS": "0", "NO_COLOR": "1"}
_ONE_THREAD: Mapping[str, str] = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


@dataclass(frozen=True, slots=True)
class Figure:
    """One measured quantity: the median of some samples, and what it should be at most, or at least."""

    name: str
    unit: str
    samples: tuple[float, ...]
    at_most: float | None = None
    at_least: float | None = None

    @property
    def median(self) -> float:
        """Of the samples."""
        return statistics.median(self.samples)

    @property
    def holds(self) -> bool | None:
        """Whether the median keeps to the target; None without one."""
        if self.at_least is not None:
            return self.median >= self.at_least
        return None if self.at_most is None else self.median <= self.at_most

    @property
    def target(self) -> str:
        """The target as it reads in a table; empty without one."""
        if self.at_least is not None:
            return f"≥ {self.at_least:g} {self.unit}".rstrip()
        return "" if self.at_most is None else f"≤ {self.at_most:g} {self.unit}".rstrip()

    def document(self) -> dict[str, Any]:
        """As plain values for JSON."""
        return {**asdict(self), "median": self.median, "holds": self.holds}


@dataclass(frozen=True, slots=True)
class Cost:
    """What one child process took, its own children included. Peak memory is that of the largest of them."""

    wall_s: float
    cpu_s: float
    peak_mb: float


class ChildFailed(RuntimeError):
    """A command that should have run did not; the message says which, and its last words."""


def talkdown(*arguments: str) -> list[str]:
    """The command line of `talkdown` as it is installed beside this Python."""
    return [str(Path(sys.executable).with_name("talkdown")), *arguments]


def environment() -> dict[str, str]:
    """What children run in."""
    return {**os.environ, **_QUIET_ENVIRONMENT}


def run(command: Sequence[str]) -> Cost:
    """Run a command to its end. Raises ChildFailed when it does not exit with 0."""
    began = time.monotonic()
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment()
    ) as child:
        assert child.stderr is not None
        said = child.stderr.read()
        _, status, used = os.wait4(child.pid, 0)
        wall_s = time.monotonic() - began
        child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise ChildFailed(f"{' '.join(command)} ended with {child.returncode}: {said.decode(errors='replace')[-2000:]}")
    kib = used.ru_maxrss / 1024.0 if sys.platform == "darwin" else float(used.ru_maxrss)
    return Cost(wall_s, used.ru_utime + used.ru_stime, kib / 1024.0)


def output(command: Sequence[str]) -> str:
    """What a command prints. Raises ChildFailed when it does not exit with 0."""
    return _output(command, environment())


def alone(command: Sequence[str]) -> str:
    """The same, in one thread: CPU time of others in the same libraries would count for nothing."""
    return _output(command, {**environment(), **_ONE_THREAD})


def _output(command: Sequence[str], environment: Mapping[str, str]) -> str:
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    if ended.returncode != 0:
        raise ChildFailed(f"{' '.join(command)} ended with {ended.returncode}: {ended.stderr[-2000:]}")
    return ended.stdout


def machine() -> str:
    """Cores, processor and Python, in one line."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        lines = information.read_text(encoding="utf-8", errors="replace").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    return f"{os.cpu_count()} cores of {model}, {platform.system()}, Python {platform.python_version()}"


def load() -> str:
    """How busy the machine is with other things."""
    return f"load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else "load unknown"
