"""What holds up the receiving thread is kept from doing so, while a session is live and no longer."""

import gc
import sys

from gateway.runtime.interpreter import UnhurriedCollection


class Knot:
    """Garbage that only the collector can find."""

    def __init__(self, said: list[str]) -> None:
        self.me, self.said = self, said

    def __del__(self) -> None:
        self.said.append("collected")


def test_garbage_is_collected_when_it_is_due_and_not_before() -> None:
    switch_s = sys.getswitchinterval()
    said: list[str] = []
    with UnhurriedCollection() as collection:
        assert gc.get_freeze_count() > 0
        assert sys.getswitchinterval() < switch_s
        Knot(said)
        held = [[number] for number in range(100_000)]
        collection.collect_when_due()
        assert not said
        collection._due_s = 0.0
        collection.collect_when_due()
        assert said == ["collected"]
        assert len(held) == 100_000
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    assert sys.getswitchinterval() == switch_s
