"""Properties of the picture over small random scenarios: whatever is heard, in whatever order, it stays sound."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gateway import pipeline
from gateway.align import SECOND
from gateway.frames import RadarFrame, RunwayFrame, polar_from_xyz, turn
from gateway.observation import GpsReport, Heard, Observation, RadarPlot, Timing, Truth
from gateway.picture import Picture
from gateway.settings import DEMO_SITE, Options, Weighting

START = 1_790_000_000 * SECOND
FRAME = RunwayFrame(DEMO_SITE.runway)
RADAR = RadarFrame.of(DEMO_SITE.radars[0], FRAME)
WEIGHTINGS: list[Weighting] = ["bias", "covariance", "innovation", "literal"]


def _place(target: int, t_s: float) -> np.ndarray:
    """Three aircraft on neighbouring straight approaches, in the runway frame."""
    return np.array([-15_000.0 + 80.0 * t_s, 300.0 + 1200.0 * target, 900.0 - 3.0 * t_s])


@st.composite
def _reports(draw: st.DrawFn) -> Observation:
    target, t_s = draw(st.integers(0, 2)), draw(st.integers(0, 200)) / 10.0
    off_m = draw(st.lists(st.floats(-100.0, 100.0), min_size=3, max_size=3))
    latitude, longitude, height = FRAME.geodetic_from_runway(_place(target, t_s) + off_m)
    valid = START + round(t_s * SECOND)
    late = draw(st.integers(0, 3000)) * 1_000_000
    extra = {}
    if draw(st.booleans()):
        extra = {"velocity_east_mps": 80.0, "velocity_north_mps": draw(st.floats(-9, 9)), "velocity_up_mps": -3.0}
    return GpsReport(
        f"mavlink:{target + 1}",
        valid,
        valid + late,
        float(latitude),
        float(longitude),
        float(height) + 35.0,
        draw(st.none() | st.floats(0.0, 2000.0)),
        horizontal_sigma_m=draw(st.none() | st.floats(0.0, 200.0)),
        timing=draw(st.sampled_from([Timing.UTC, Timing.UTC, Timing.UTC, Timing.PROVISIONAL, Timing.FOREIGN])),
        **extra,
    )


@st.composite
def _plots(draw: st.DrawFn) -> Observation:
    target, t_s = draw(st.integers(0, 2)), draw(st.integers(0, 200)) / 10.0
    polar = polar_from_xyz(RADAR.from_enu(turn(FRAME.enu_from_runway, _place(target, t_s))))
    off = draw(st.tuples(st.floats(-50, 50), st.floats(-0.004, 0.004), st.floats(-0.004, 0.004)))
    there = draw(st.lists(st.booleans() | st.just(True), min_size=3, max_size=3).filter(any))
    parts = [float(p + o) if is_there else None for p, o, is_there in zip(polar, off, there, strict=True)]
    valid = START + round(t_s * SECOND)
    late = draw(st.integers(0, 1000)) * 1_000_000
    number = draw(st.sampled_from([target + 1, target + 1, target + 1, 0, 7]))
    return RadarPlot(1, number, valid, valid + late, *parts)


@st.composite
def _streams(draw: st.DrawFn) -> list[Observation]:
    """Regular radar plots of one aircraft, so that tracks and pairs come about, with anything at all among them."""
    regular: list[Observation] = []
    for k in range(draw(st.integers(0, 40))):
        polar = polar_from_xyz(RADAR.from_enu(turn(FRAME.enu_from_runway, _place(0, 0.45 * k))))
        valid = START + round(0.45 * k * SECOND)
        regular.append(RadarPlot(1, 1, valid, valid + 20_000_000, *polar.tolist()))
    for k in range(draw(st.integers(0, 6))):
        latitude, longitude, height = FRAME.geodetic_from_runway(_place(0, 3.0 * k))
        valid = START + 3 * k * SECOND
        msl_m = float(height) + 35.0
        regular.append(GpsReport("mavlink:1", valid, valid + SECOND, float(latitude), float(longitude), msl_m))
    return regular + draw(st.lists(_reports() | _plots(), max_size=25))


def _heard(observations: Sequence[Observation]) -> list[Heard]:
    arrivals: list[Heard] = []
    for one in sorted(observations, key=lambda one: one.received_at):
        now = max(one.received_at // 4000 * 4000, arrivals[-1].now + 4000 if arrivals else 0)
        arrivals.append(Heard(now, (one,)))
    return arrivals


def _run(heard: Sequence[Heard], weighting: Weighting, cuts: Sequence[int] = ()) -> list[Picture]:
    """The pictures of the arrivals in steps that end at the cuts, and a clock that runs on for 40 s."""
    end = [Heard((heard[-1].now if heard else START) + 40 * SECOND)]
    state, pictures = pipeline.initial(DEMO_SITE, Options(weighting=weighting)), []
    edges = [0, *sorted({cut for cut in cuts if 0 < cut < len(heard)}), len(heard)]
    for first, last in pairwise(edges):
        state, picture = pipeline.step(state, heard[first:last])
        pictures.append(picture)
    return [*pictures, pipeline.step(state, end)[1]]


def _bits(pictures: Sequence[Picture]) -> list[bytes | list[object]]:
    fused, names = [p.fuse for p in pictures], ("time", "received", "track", "runway_m", "velocity_mps", "covariance")
    parts: list[bytes | list[object]] = [b"".join(getattr(one, name).tobytes() for one in fused) for name in names]
    parts += [b"".join(p.predict.runway_m.tobytes() for p in pictures)]
    parts += [[value for one in fused for value in getattr(one, name)] for name in ("state", "aircraft", "radar_track")]
    return parts


SMALL = settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])


@SMALL
@given(_streams(), st.sampled_from(WEIGHTINGS), st.lists(st.integers(1, 70), max_size=8))
def test_any_cut_into_steps_gives_the_same_bits(
    stream: list[Observation], weighting: Weighting, cuts: list[int]
) -> None:
    """However the arrivals are cut into steps, rows and predictions are the same, to the bit."""
    heard = _heard(stream)
    assert _bits(_run(heard, weighting, cuts)) == _bits(_run(heard, weighting))


@SMALL
@given(_streams(), st.sampled_from(WEIGHTINGS), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0), st.floats(-1e4, 1e5))
def test_false_truth_changes_no_bit(
    stream: list[Observation], weighting: Weighting, latitude: float, longitude: float, height: float
) -> None:
    """A truth heard together with each observation, whatever it says, changes no bit of a row."""
    heard = _heard(stream)
    told = [
        Heard(one.now, (Truth("mavlink:1", one.now, one.now, latitude, longitude, height), *one.observations))
        for one in heard
    ]
    assert _bits(_run(told, weighting)) == _bits(_run(heard, weighting))


@SMALL
@given(_streams(), st.sampled_from(WEIGHTINGS))
def test_rows_tracks_and_pairs_are_sound(stream: list[Observation], weighting: Weighting) -> None:
    """Whatever is heard, arrival by arrival, the three below hold."""
    heard = _heard(stream)
    pictures = _run(heard, weighting, range(len(heard)))
    _check_covariances(pictures)
    _check_numbers(pictures)
    _check_pairs(pictures)


def _check_covariances(pictures: Sequence[Picture]) -> None:
    """The covariance of every row is symmetric, positive and finite, and so is its position."""
    for table in (picture.fuse for picture in pictures):
        assert np.isfinite(table.runway_m).all()
        assert np.isfinite(table.latitude_rad).all()
        for row in table.covariance.reshape(-1, 6, 6):
            size = np.sqrt(row.diagonal())
            assert (size > 0.0).all()
            scaled = row / np.outer(size, size)
            # of correlations: turned from one frame to another by products of numbers below one, a few roundings each
            assert np.abs(scaled - scaled.T).max() < 1e-12
            assert np.linalg.eigvalsh(scaled).min() > -1e-9


def _check_numbers(pictures: Sequence[Picture]) -> None:
    """A track has one aircraft or none throughout, numbers count from 1 without gaps, and every track that began ends."""
    who: dict[int, set[str | None]] = {}
    for picture in pictures:
        for track, aircraft in zip(picture.fuse.track.tolist(), picture.fuse.aircraft, strict=True):
            who.setdefault(track, set()).add(aircraft)
    assert sorted(who) == list(range(1, len(who) + 1))
    assert all(len(names) == 1 for names in who.values())
    ended = [one.track for picture in pictures for one in picture.fuse.ended]
    assert set(ended) == set(who)  # the clock ran on for 40 s


def _check_pairs(pictures: Sequence[Picture]) -> None:
    """At no step is a radar track two aircraft, or an aircraft two tracks of the radar that are both alive."""
    for picture in pictures:
        aircraft, tracks = [pair[0] for pair in picture.associate.pairs], [pair[1] for pair in picture.associate.pairs]
        assert len(set(aircraft)) == len(aircraft)
        assert len(set(tracks)) == len(tracks)
        for row, name in enumerate(picture.associate.check_radar_track):
            assert 0 <= picture.associate.check_counter[row] <= 5
            compared = picture.associate.check_difference[row]
            assert math.isnan(compared[1]) or abs(compared[1]) <= math.pi
            assert name.startswith("1/")
