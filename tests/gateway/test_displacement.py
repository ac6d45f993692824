"""Velocities that are not those of their positions: what is told of them, when, and what the filter makes of it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gateway.align import SECOND, Local
from gateway.fuse.consistency import Consistency
from gateway.fuse.displacement import Displacements
from gateway.fuse.events import NEVER, Event
from gateway.fuse.evidence import Finding
from gateway.fuse.scatter import Rows
from gateway.observation import GpsReport
from gateway.settings import EstimatorName, PositionSource
from sim.told_pictures import QUIET, errors_m, pictures, told
from sim.told_rides import honest

LEFT_OUT = ": its velocities are left out until they fit; put right what sends them"
AXES = ("east", "north", "up")
SWAPPED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def _heard(world: Any, fixes: list[Any], known: Consistency = Consistency()) -> tuple[Consistency, dict[str, Finding]]:
    """What is found of reports that are heard second by second, whatever a filter makes of them."""
    state = np.zeros(9), np.eye(9), np.zeros((0, 3))
    events = [
        Event(fix, *state, gps_at=fix.at, radar_at=NEVER, interval=0, outlying=False, height_at=fix.at, barometric=None,
              callsign=None, belief=None)
        for fix in fixes
    ]  # fmt: skip
    found: dict[str, Finding] = {}
    for second in range(fixes[0].at // SECOND, fixes[-1].at // SECOND + 1):
        known = known.hearing((1, event) for event in events if event.at // SECOND == second)
        known, new = known.planning((second + 1) * SECOND).judged(PositionSource(), {}, (second + 2) * SECOND - 1)
        for one in new:
            found.setdefault(one.topic, one)
    return known, found


def _fixes(
    world: Any, seconds: float, period_s: float, wrong: Any = 1.0, *, noise_m: float = 15.0, speed_mps: float = 80.0
) -> list[Any]:
    """Reports of a descent that turns all the while, 2 degrees a second; velocities times a number or a matrix."""
    random, matrix = np.random.default_rng(7), np.eye(3) * wrong if np.isscalar(wrong) else wrong
    made, turn = [], 0.035
    for k in range(int(seconds / period_s)):
        t = k * period_s
        place = np.array([math.sin(turn * t), 1.0 - math.cos(turn * t), 0.0]) * speed_mps / turn + [
            0.0,
            0.0,
            2e3 - 4 * t,
        ]
        velocity = np.array([math.cos(turn * t), math.sin(turn * t), 0.0]) * speed_mps + [0.0, 0.0, -4.0]
        fix = world.fix(world.Course(), t, serial=k)
        place, velocity = place + random.normal(0.0, noise_m, 3), velocity + random.normal(0.0, 1.0, 3)
        made.append(replace(fix, enu_m=place, velocity_mps=matrix @ velocity, sigma_m=np.full(3, noise_m)))
    return made


@pytest.mark.parametrize("period_s", [0.2, 1.0, 5.0, 10.0])
@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (0.0, "is next to nothing while its positions move"),
        (-1.0, "has the wrong sign"),
        (100.0, "as if it were in cm/s and read as m/s"),
        (0.01, "as if it were in m/s and read as cm/s"),
        (3.6, "as if it were in km/h and read as m/s"),
        (1.9438, "as if it were in knots and read as m/s"),
        (0.5144, "as if it were in m/s and read as knots"),
        (3.2808, "as if it were in feet a second and read as m/s"),
        (2.0, "times what its positions move by"),
        (SWAPPED, "has east and north swapped"),
        (np.diag([-1.0, 1.0, 1.0]), "has east and west confused"),
    ],
)
def test_what_a_velocity_is_instead_is_said_within_a_hundred_seconds(
    world: Any, wrong: Any, said: str, period_s: float
) -> None:
    """At any rate, in a turn, and nothing is said of how the positions scatter."""
    known, found = _heard(world, _fixes(world, 100.0, period_s, wrong))
    (finding,) = (one for one in found.values() if ": its velocity" in one.text)
    assert said in finding.text
    assert finding.text.startswith("GPS of mavlink:1: its velocity")
    assert finding.text.endswith(LEFT_OUT)
    assert not any("scatters" in one.text for one in found.values())
    assert known.contradicted == {"mavlink:1"}


def test_a_climb_rate_of_the_wrong_sign_is_said(world: Any) -> None:
    """Its level velocity is right, and not spoken of."""
    _, found = _heard(world, _fixes(world, 400.0, 2.0, np.diag([1.0, 1.0, -1.0])))
    (finding,) = found.values()
    assert (
        finding.text == f"GPS of mavlink:1: its climb rate has the wrong sign, as if up were taken for down{LEFT_OUT}"
    )


def test_a_velocity_without_a_climb_rate_is_judged_too(world: Any) -> None:
    """What is known of it stands along the report's own axes."""
    fixes = [
        replace(one, velocity_mps=np.full(3, math.nan), local=Local(np.eye(3), one.velocity_mps * [2.0, 2.0, math.nan], True))
        for one in _fixes(world, 60.0, 1.0)
    ]  # fmt: skip
    known, found = _heard(world, fixes)
    assert known.contradicted
    assert "times what its positions move by" in found["velocity and positions, GPS of mavlink:1"].text


@pytest.mark.parametrize("period_s", [0.2, 1.0, 5.0, 10.0])
@pytest.mark.parametrize("noise_m", [0.5, 15.0])
@pytest.mark.parametrize("speed_mps", [0.0, 5.0, 80.0])
def test_right_velocities_have_nothing_against_them(
    world: Any, period_s: float, noise_m: float, speed_mps: float
) -> None:
    """Parked, slow and fast, with reports of any rate: not even enough to be suspected."""
    known, found = _heard(world, _fixes(world, 200.0, period_s, noise_m=noise_m, speed_mps=speed_mps))
    assert not any("left out" in one.text for one in found.values())
    assert known.displacements.sums[:, :, 0].max() < 4.0


def test_positions_that_jump_or_stand_still_are_no_wrong_velocity(world: Any) -> None:
    """Jumps of 3 km there and back each 20 s, noise ten times as stated, and a receiver whose positions froze."""
    fixes = _fixes(world, 300.0, 1.0, speed_mps=10.0)
    jumping = [replace(one, enu_m=one.enu_m + 3000.0 * (k // 20 % 2)) for k, one in enumerate(fixes)]
    frozen = [replace(one, enu_m=fixes[50].enu_m) if k > 50 else one for k, one in enumerate(fixes)]
    noisy = [replace(one, sigma_m=one.sigma_m / 10.0) for one in fixes]
    for wrong in (jumping, frozen, noisy):
        assert not _heard(world, wrong)[0].contradicted


def test_velocities_that_were_put_right_are_believed_again(world: Any) -> None:
    """Within two minutes."""
    fixes = _fixes(world, 240.0, 1.0)
    known, _ = _heard(world, [replace(one, velocity_mps=1.94 * one.velocity_mps) for one in fixes[:120]])
    assert known.contradicted
    assert not _heard(world, fixes[120:], known)[0].contradicted


def _half_as_fast(world: Any, ticks: str, estimator: EstimatorName) -> Any:
    """Reports each 5 s, a third of them late, of which the velocities, m/s, were taken for knots."""
    random, course = np.random.default_rng(1), world.Course()
    reports = []
    for k in range(28):
        east, north, up = (0.5144 * (world.frame.enu_from_runway @ course.velocity(5.0 * k))).tolist()
        off = random.normal(0.0, 15.0, 3)
        speed = {"velocity_east_mps": east, "velocity_north_mps": north, "velocity_up_mps": up}
        reports.append(world.report(course, 5.0 * k, off_m=off, late_s=8.5 if k % 3 == 1 else 0.1, **speed))
    return world.run(reports, ticks=ticks, options=replace(QUIET, estimator=estimator))


@pytest.mark.parametrize("estimator", ["kalman", "imm", "rmimm", "alpha-beta-gamma"])
def test_a_filter_leaves_out_velocities_that_are_known_to_be_wrong(world: Any, estimator: EstimatorName) -> None:
    """Also where reports come too seldom for it to get lost: half the speed each 5 s; said once, right from the next report
    on, with the same bits however arrivals fall into ticks."""
    runs = [_half_as_fast(world, ticks, estimator) for ticks in ("one", "all")]
    (event,) = runs[0].said("left out")
    assert "read as knots" in event.text
    course = world.Course()
    off_m: dict[bool, list[float]] = {False: [], True: []}
    for one in runs[0].pictures:
        for at, place in zip(one.fuse.time, one.fuse.runway_m, strict=True):
            off_m[one.now > event.at].append(float(np.linalg.norm(place - course.at((at - world.START) / SECOND))))
    assert max(off_m[False]) > 150.0
    assert len(off_m[True]) >= 20
    assert max(off_m[True]) < 60.0
    next_rows = next(one.fuse for one in runs[0].pictures if one.now > event.at and len(one.fuse.time))
    speed_mps = np.linalg.norm(next_rows.velocity_mps[next_rows.time.argmax()])
    assert speed_mps == pytest.approx(np.linalg.norm(course.velocity(0.0)), abs=15.0)  # by positions before that report
    one, other = (run.state.consistency for run in runs)
    assert one.displacements.sums.tobytes() == other.displacements.sums.tobytes()
    lanes = [next(iter(run.state.lanes.lanes.values())).last.mean.tobytes() for run in runs]
    assert lanes[0] == lanes[1]


@pytest.mark.parametrize(("every", "arrivals"), [(5, 390), (50, 640)])
def test_positions_beside_wrong_velocities_are_not_denied_by_inertial_data(every: int, arrivals: int) -> None:
    """Dead reckoning that learnt from velocities in knots begins anew; until then it would refuse every good position, and
    does not begin to where it never agreed with one: reports each 5 s tell of the knots only after half a minute.
    """
    teller, said = told("aeroplane", honest)
    in_knots = []
    for number, one in enumerate(said[:arrivals]):
        made = [
            replace(each, **{f"velocity_{axis}_mps": 1.944 * getattr(each, f"velocity_{axis}_mps") for axis in AXES})
            if isinstance(each, GpsReport)
            else each
            for each in one.observations
            if (number + 1) % every == 0 or not isinstance(each, GpsReport)
        ]
        in_knots.append(replace(one, observations=tuple(made)))
    some = [picture for _, picture in pictures(in_knots)]
    events = [event.text for picture in some for event in picture.events]
    assert any("read as m/s: its velocities are left out" in text for text in events)
    assert not any("it is not used" in text for text in events)
    last = errors_m(teller, some)[-3:]
    assert {by for _, by, _, _ in last} == {"gps"}
    assert max(off for _, _, off, _ in last) < 25.0


def test_what_is_known_of_aircraft_is_bounded() -> None:
    """The least lately heard of too many are forgotten, those not heard for long, and soon those of which nothing is known."""
    names, count = [f"a{k}" for k in range(12)], 12
    rows = Rows(
        np.arange(count), np.arange(count) * SECOND, np.zeros((count, 6)), np.ones((count, 6)), np.zeros(count), np.arange(count)
    )  # fmt: skip
    known = Displacements().after(rows, names)
    assert not known.remembered(60 * SECOND, 0, 10).aircraft
    known = replace(known, sums=known.sums + 1.0)
    assert list(known.remembered(60 * SECOND, 0, 10).aircraft) == names[2:]
    kept = known.remembered(60 * SECOND, 9 * SECOND, 10)
    assert list(kept.aircraft) == names[9:]
    assert kept.heard.tolist() == [9 * SECOND, 10 * SECOND, 11 * SECOND]
    assert len(kept.sums) == len(kept.start) == 3
