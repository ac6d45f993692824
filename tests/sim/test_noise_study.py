"""The study of noise that is not as stated, on a few sessions."""

from __future__ import annotations

import pytest

from sim.studies.noise import sessions


@pytest.mark.parametrize(("part", "wrong"), [("", 1.0), ("velocity", 1.0 / 1.5)])
def test_of_the_approach_that_is_said_which_is_wrong(part: str, wrong: float) -> None:
    """At a report a second: within 3 minutes the noise that is not as stated, and no other; none if all are."""
    for heard in sessions("approach", part, 1.0, wrong, "kalman", 1, 11):
        assert list(heard.found_s) == ([part] if part else [])
        assert all(10.0 < after_s < 180.0 for after_s in heard.found_s.values())
        assert part or heard.nearest < 0.8
