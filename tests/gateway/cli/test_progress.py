"""Progress where no terminal is: lines, now and then, on stderr."""

from __future__ import annotations

import pytest

from gateway.cli import progress


def test_long_work_says_how_far_it_is_where_a_log_takes_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once the time between two lines is over, with what is being done."""
    monkeypatch.setattr(progress, "_LINE_EVERY_S", 0.0)
    with progress.progressing("study", show=True) as tell:
        tell(0.25)
        tell(0.5, "drawing [all]")
    assert capsys.readouterr().err == "study: 25 %\ndrawing [all]: 50 %\n"


@pytest.mark.parametrize("show", [True, False])
def test_short_work_and_quiet_work_say_nothing(show: bool, capsys: pytest.CaptureFixture[str]) -> None:
    """A command that is over at once leaves the log to its result."""
    with progress.progressing("study", show=show) as tell:
        tell(1.0)
    assert capsys.readouterr() == ("", "")
