"""Arrivals in columns are the same arrivals."""

from hypothesis import given
from hypothesis import strategies as st

from adapters import Arrival
from adapters.arrivals import Arrivals

ONES = st.lists(
    st.builds(Arrival, st.integers(0, 2**62), st.integers(0, 5), st.binary(max_size=9), st.sampled_from(["", "a:1"]))
)


@given(ONES, st.integers(0, 40), st.integers(0, 40))
def test_columns_read_one_by_one_are_the_arrivals_that_they_were_made_of(ones: list[Arrival], at: int, to: int) -> None:
    columns = Arrivals.of(ones)
    assert len(columns) == len(ones)
    assert list(columns) == ones
    assert [columns[place] for place in range(len(ones))] == ones
    assert list(columns[at:to]) == ones[at:to]
    assert Arrivals.of(columns) is columns


@given(st.lists(ONES, max_size=4))
def test_parts_joined_are_one_after_the_other(parts: list[list[Arrival]]) -> None:
    assert list(Arrivals.joined([Arrivals.of(one) for one in parts])) == [one for part in parts for one in part]


@given(ONES)
def test_of_each_source_the_places_are_told_in_order(ones: list[Arrival]) -> None:
    told = dict(Arrivals.of(ones).by_source())
    numbers = sorted({one.source for one in ones})
    assert told == {number: [place for place, one in enumerate(ones) if one.source == number] for number in numbers}
