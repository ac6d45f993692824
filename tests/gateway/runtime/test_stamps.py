"""The receiver's stamps."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gateway.runtime.stamps import Stamper


class Clocks:
    """UTC and monotonic time, ns, set by the test."""

    def __init__(self) -> None:
        self.utc = 1_700_000_000_000_000_123
        self.monotonic = 5_000

    def pass_ns(self, elapsed: int) -> None:
        self.utc += elapsed
        self.monotonic += elapsed


def stamper(clocks: Clocks) -> Stamper:
    return Stamper(lambda: clocks.utc, lambda: clocks.monotonic)


@given(st.lists(st.tuples(st.integers(-10_000_000, 10_000_000), st.booleans()), min_size=1, max_size=50))
def test_stamps_are_strictly_increasing_multiples_of_4_us_above_every_watermark(steps: list[tuple[int, bool]]) -> None:
    clocks = Clocks()
    given_out, least = stamper(clocks), 0
    for offset, is_watermark in steps:
        if is_watermark:
            mark = given_out.watermark()
            assert mark >= least
            least = max(least, mark)
        else:
            (stamp,) = given_out.stamps(np.array([clocks.utc + offset]))
            assert stamp > least
            assert stamp % 4000 == 0
            least = stamp


def test_a_clock_that_is_set_in_the_middle_moves_no_stamp() -> None:
    clocks = Clocks()
    given_out = stamper(clocks)
    (first,) = given_out.stamps(given_out.heard(np.array([0])))
    clocks.pass_ns(1_000_000)
    clocks.utc += 3_600_000_000_000
    (second,) = given_out.stamps(given_out.heard(np.array([clocks.utc - 1000])))
    assert second - first == 1_000_000 - 4000


def test_the_kernels_time_of_arrival_is_used_where_it_can_be_believed() -> None:
    clocks = Clocks()
    given_out = stamper(clocks)
    utc = clocks.utc
    told = given_out.heard(np.array([utc - 300_000, utc - 5_000_000_000, utc + 1, 0]))
    assert told.tolist() == [utc - 300_000, utc, utc, utc]
