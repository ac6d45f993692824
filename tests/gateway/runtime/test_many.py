"""Work on many things at once: what comes of each, and of the processes that do it."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import psutil
import pytest

from gateway.runtime.cluster import ClusterError, on_cluster
from gateway.runtime.many import Job, gathered, in_processes

CODE = Job(exec, KeyError)
"""What is worked on is Python source; a KeyError is its way to say that it cannot be done."""


def _once(path: Path) -> str:
    """Ends the process that works on it for the first time."""
    return f"import os\nif not os.path.exists({str(path)!r}):\n os.mkdir({str(path)!r})\n os._exit(9)"


def test_what_cannot_be_done_is_named_in_its_place_and_all_else_is_done(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """One refuses, one is an error of the program, one ends every process, one the first only: each outcome is its own."""
    things = ["import time; time.sleep(0.3)", "raise KeyError('no such runway')", "1 / 0", _once(tmp_path / "met")]
    things += ["import os, signal; os.kill(os.getpid(), signal.SIGKILL)", "pass", "pass"]
    told: list[int] = []
    outcomes = gathered(in_processes(CODE, things, 2), len(things), told.append)
    assert [one.failure for one in outcomes] == [
        None,
        "'no such runway'",
        "An error of the program: ZeroDivisionError: division by zero",
        None,
        "Each of the 2 processes that worked on it was ended by signal 9; perhaps it needs more memory than there is.",
        None,
        None,
    ]
    assert (tmp_path / "met").exists()
    assert told == list(range(1, len(things) + 1))
    assert "Traceback" in capfd.readouterr().err  # of the program's error, for who mends it


def test_processes_end_when_nobody_wants_to_know_any_more() -> None:
    with closing(in_processes(CODE, ["pass", "import time; time.sleep(60)"], 2)) as ended:
        assert next(ended)[0] == 0
        assert len(multiprocessing.active_children()) == 2
    assert not multiprocessing.active_children()


def test_a_process_ends_when_its_parent_is_killed(tmp_path: Path) -> None:
    """It ends what it works on, and then finds nobody at the other end."""
    code = f"open({str(tmp_path / 'pid')!r}, 'w').write(str(__import__('os').getpid())); __import__('time').sleep(0.5)"
    parent = f"from gateway.runtime.many import *; list(in_processes(Job(exec, KeyError), [{code!r}], 1))"
    with subprocess.Popen([sys.executable, "-c", parent]) as started:
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.02)
        started.kill()
    worker = int((tmp_path / "pid").read_text())
    assert any(_is_gone(worker) or time.sleep(0.02) for _ in range(500))


def _is_gone(number: int) -> bool:
    return not psutil.pid_exists(number) or psutil.Process(number).status() == psutil.STATUS_ZOMBIE


@pytest.mark.filterwarnings("default")
def test_a_cluster_ends_the_job_though_a_worker_is_killed(tmp_path: Path) -> None:
    """Two workers, one killed when a few things are done: all are done all the same, each with its own outcome."""
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra cluster)")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "local_directory": tmp_path}
    things = [f"import time; time.sleep(0.1)\nif {number} == 7: raise KeyError('seven')" for number in range(30)]
    with distributed.LocalCluster(**options) as cluster:
        outcomes = {}
        for place, outcome in on_cluster(CODE, things, cluster.scheduler_address):
            outcomes[place] = outcome.failure
            if len(outcomes) == 5:
                os.kill(cluster.workers[0].pid, 9)
    assert outcomes == {number: "'seven'" if number == 7 else None for number in range(30)}


def test_without_dask_or_a_scheduler_it_is_said_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r"talkdown\[cluster\]"):
        next(on_cluster(CODE, ["pass"], "tcp://127.0.0.1:1"))
