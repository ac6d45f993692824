"""Properties of the landing-radar wire."""

from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.landing_radar import MODES, REASONS, STATES, Datagram, Header, Plot, Record, Status, decode, encode
from adapters.radar import LandingRadarReceiver, Taken

TIMES = st.integers(3 * 10**12, 7_258_118_400 * 10**9 - 1)


def _fixed(low: int, high: int, per_unit: int) -> st.SearchStrategy[float | None]:
    return st.none() | st.integers(low, high).map(lambda number: number / per_unit)


def _sigma(per_unit: int) -> st.SearchStrategy[float | None]:
    return st.none() | st.integers(1, 65535).map(lambda number: number / per_unit)


@st.composite
def _plots(draw: st.DrawFn) -> tuple[Header, list[Record]]:
    time = draw(TIMES)
    header = Header("plots", draw(st.integers(1, 65535)), draw(st.integers(0, 2**32 - 1)), time, draw(st.booleans()))
    plot = st.builds(
        Plot,
        st.integers(0, 65535),
        st.integers(-(2**31), 2**31 - 1).map(lambda micros: time + micros * 1000),
        _fixed(0, 2**32 - 1, 100),
        _fixed(-1_800_000_000, 1_800_000_000, 10**7),
        _fixed(-900_000_000, 900_000_000, 10**7),
        _fixed(-32768, 32767, 100),
        _fixed(0, 65535, 100),
        _sigma(100),
        _sigma(10**6),
        _sigma(10**6),
    )
    return header, draw(st.lists(plot, max_size=40))


@st.composite
def _status(draw: st.DrawFn) -> tuple[Header, list[Record]]:
    header = Header("status", draw(st.integers(1, 65535)), draw(st.integers(0, 2**32 - 1)), draw(TIMES))
    signed = st.integers(-(2**31), 2**31 - 1)
    status = Status(
        draw(st.sampled_from(STATES)),
        draw(st.sampled_from(MODES)),
        draw(st.integers(0, 65535)) / 1000,
        draw(signed) / 10**7,
        draw(signed) / 10**7,
        draw(signed) / 1000,
        draw(st.integers(0, 2**32 - 1)) / 10**7,
    )
    return header, [status]


KEYS = st.none() | st.binary(min_size=1, max_size=64)


@settings(max_examples=150)
@given(_plots() | _status(), KEYS)
def test_every_datagram_that_can_be_written_reads_the_same(
    written: tuple[Header, list[Record]], key: bytes | None
) -> None:
    header, content = written
    found = decode(encode(header, content, key=key), key)
    assert isinstance(found, Datagram)
    assert found.records == tuple(content)
    assert found.header.authenticated == (key is not None)
    assert (found.header.radar, found.header.sequence, found.header.time) == (
        header.radar, header.sequence, header.time,
    )  # fmt: skip


@settings(max_examples=100)
@given(_plots() | _status(), KEYS, st.data())
def test_any_cut_or_flipped_byte_is_refused_and_never_raises(
    written: tuple[Header, list[Record]], key: bytes | None, data: st.DataObject
) -> None:
    """CRC-32 finds every change of one byte; a change of the header can break an earlier rule."""
    header, content = written
    whole = encode(header, content, key=key)
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    at, flip = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255))
    flipped = whole[:at] + bytes([whole[at] ^ flip]) + whole[at + 1 :]
    for damaged in (cut, flipped):
        assert decode(damaged, key) in REASONS


SENT = st.tuples(st.integers(0, 2**32 - 1) | st.integers(0, 3000), TIMES | st.integers(4 * 10**12, 5 * 10**12))


@settings(max_examples=150)
@given(st.lists(SENT, max_size=30), st.data())
def test_with_a_key_nothing_is_ever_taken_twice_whatever_is_sent_again(
    sent: list[tuple[int, int]], data: st.DataObject
) -> None:
    receiver = LandingRadarReceiver({7: b"key"})
    datagrams = [encode(Header("plots", 7, sequence, time), [], key=b"key") for sequence, time in sent]
    again = data.draw(st.lists(st.sampled_from(datagrams), max_size=30)) if datagrams else []
    taken = [one for one in datagrams + again if isinstance(receiver.hear(one, "a", "a", 0), Taken)]
    assert len(taken) == len(set(taken))


@settings(max_examples=150)
@given(st.lists(SENT, max_size=30))
def test_losses_are_never_more_than_the_radar_could_have_sent(sent: list[tuple[int, int]]) -> None:
    """1024 at once, else 1000 a second: never 2^32 for one that is late."""
    receiver = LandingRadarReceiver()
    for sequence, time in sent:
        before = receiver.counters["lost"]
        receiver.hear(encode(Header("plots", 7, sequence, time), []), "a", "a", 0)
        span_s = (max(time for _, time in sent) - min(time for _, time in sent)) / 10**9
        assert receiver.counters["lost"] - before <= max(1024, 1000 * span_s)


@settings(max_examples=200)
@given(st.binary(max_size=200), KEYS)
def test_no_bytes_raise(data: bytes, key: bytes | None) -> None:
    assert decode(b"LR\x01" + data, key) in REASONS or len(data) >= 25
