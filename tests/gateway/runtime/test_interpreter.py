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


def test_full_collections_wait_until_they_are_due() -> None:
    before, switch_s = gc.get_threshold(), sys.getswitchinterval()
    said: list[str] = []
    with UnhurriedCollection() as collection:
        assert gc.get_freeze_count() > 0
        assert sys.getswitchinterval() < switch_s
        knot = Knot(said)
        gc.collect(1)
        gc.collect(1)  # now it is old
        del knot
        held = [[number] for number in range(50_000)]
        assert not said
        collection.collect_when_due()
        assert not said
        collection._due_s = 0.0
        collection.collect_when_due()
        assert said == ["collected"]
        del held
    assert gc.get_threshold() == before
    assert gc.get_freeze_count() == 0
    assert sys.getswitchinterval() == switch_s
