"""How often a live session works in what came: seldom enough where much comes, often enough where little does."""

from itertools import pairwise

import pytest

from gateway.runtime import loop


@pytest.mark.parametrize(("rate", "tick_s"), [(100, 0.01), (3_000, 0.01), (10_000, 0.02), (50_000, 0.05)])
def test_the_more_comes_the_longer_a_tick_is(monkeypatch: pytest.MonkeyPatch, rate: int, tick_s: float) -> None:
    """A step has a price of its own. The rate is what counts, not what one tick brought: a stall makes no tick longer."""
    now, began = 1000.0, list[float]()

    class Clock:
        @staticmethod
        def monotonic() -> float:
            return now

        @staticmethod
        def sleep(seconds: float) -> None:
            nonlocal now
            now += seconds

    class Nothing:
        place = "known"

    def tick() -> int:
        nonlocal now
        came = round(rate * (now - began[-1])) if began else 0
        began.append(now)
        now += 0.3 if len(began) == 20 else 0.002
        return came

    monkeypatch.setattr(loop, "time", Clock)
    assert loop._live(tick, Nothing(), 1.5, lambda: None, 90.0) == "done"  # type: ignore[arg-type]
    lasted = [after - before for before, after in pairwise(began)]
    assert lasted[10] == pytest.approx(tick_s)
    assert lasted[19] == pytest.approx(0.3)
    assert lasted[-2] == pytest.approx(tick_s)
