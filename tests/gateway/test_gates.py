"""The gates of a stabilised approach: what is too much, for how long, and what is said of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from gateway.frames import RunwayFrame, turn
from gateway.observation import AirData, GpsReport, Heard
from gateway.picture import Event, Picture
from gateway.pipeline import initial, step
from gateway.predict.gates import KINDS, alerts, excess, gate_heights
from gateway.settings import DEMO_SITE, Options, Stabilised

SECOND = 1_000_000_000
T0 = 1_790_000_000 * SECOND
RUNWAY = DEMO_SITE.runway
SLOPE = math.tan(RUNWAY.glide_path_rad)
LIMITS = Stabilised(approach_speed_mps=70.0)


def test_each_kind_is_too_much_just_beyond_its_limit() -> None:
    """4 km before the threshold half a degree in height, 1.25 to the side, 15 % more and 5 % less speed are the limits."""
    before_aim = 4000.0 + RUNWAY.aiming_point_x_m - RUNWAY.threshold_x_m
    high, wide = before_aim * math.tan(math.radians(0.5)), before_aim * math.tan(math.radians(1.25))
    for share in (0.99, 1.01):
        off = excess(
            LIMITS,
            RUNWAY,
            [4000.0] * 5,
            [share * high, -share * high, 0.0, 0.0, 0.0],
            [0.0, 0.0, -share * wide, 0.0, 0.0],
            [70.0, 70.0, 70.0, 70.0 * (1.0 + 0.15 * share), 70.0 * (1.0 - 0.05 * share)],
            [70.0] * 5,
        )
        assert np.diagonal(off.ratio).tolist() == pytest.approx([share] * 5)


def test_near_the_runway_the_least_lengths_hold() -> None:
    """200 m before the threshold 9 m above the glide path and 19 m to the side are as good as on it."""
    off = excess(LIMITS, RUNWAY, [200.0], [9.0], [19.0], [70.0], [70.0])
    assert (off.ratio < 1.0).all()


def test_gates_of_a_slow_aircraft_are_as_long_before_the_runway() -> None:
    """An airliner's are at 305 and 152 m, those of a drone at 15 m/s at 65 and 33 m; the site's own hold for all."""
    upper, lower = gate_heights(Stabilised(), RUNWAY, [80.0, 15.0])
    assert upper.tolist() == pytest.approx([304.8, 83.0 * 15.0 * SLOPE])
    assert lower.tolist() == pytest.approx([152.4, 41.5 * 15.0 * SLOPE])
    assert gate_heights(Stabilised(upper_gate_m=200.0), RUNWAY, [80.0, 15.0])[0].tolist() == [200.0, 200.0]


def test_above_the_upper_gate_nothing_is_judged() -> None:
    """10 km out, 300 m too high: above 1000 ft nobody need be stabilised."""
    assert np.isnan(excess(LIMITS, RUNWAY, [10_000.0], [300.0], [0.0], [70.0], [70.0]).ratio).all()


def test_alerts_last_and_do_not_flicker() -> None:
    """A second beyond the limit is none; two begin it; it ends after three within 80 % of it. The worst of it is told."""
    above = np.array([0, 60, 0, 60, 70, 60, 35, 60, 20, 20, 20, 20, 0], dtype=np.float64)
    n, zero = len(above), np.zeros(len(above))
    (told,) = alerts(excess(LIMITS, RUNWAY, np.full(n, 4000.0), above, zero, zero + 70.0, zero + 70.0))
    assert (told.kind, told.begins, told.ends, told.worst) == ("too high", 3, 10, 70.0)


def fly(
    height: Callable[[float], float],
    side: Callable[[float], float],
    speed: float = 70.0,
    limits: Stabilised = LIMITS,
    headwind: float | None = None,
) -> list[Picture]:
    """Down the final from 8 km, so much above the glide path and to the left at each second; the wind is told or not."""
    site, frame, heard = replace(DEMO_SITE, stabilised=limits), RunwayFrame(RUNWAY), []
    along = turn(frame.enu_from_runway, np.array([1.0, 0.0, 0.0]))
    for k in range(int(7800.0 / speed)):
        before = 8000.0 - speed * k
        place = [RUNWAY.aiming_point_x_m - before, side(before), before * SLOPE + height(before)]
        latitude, longitude, up = map(float, frame.geodetic_from_runway(place))
        at = T0 + k * SECOND
        told = GpsReport("mavlink:1", at, at, latitude, longitude, None, up, speed, 0.0, -speed * SLOPE, 3.0, 3.0, 0.3)
        heard.append(Heard(at + 1000, (told,)))
        if headwind is not None:
            east, north, _ = (-headwind * along).tolist()
            heard.append(Heard(at + 2000, (AirData("mavlink:1", at, at, wind_east_mps=east, wind_north_mps=north),)))
    _, picture = step(initial(site, Options()), [*heard, Heard(heard[-1].now + SECOND)])
    return [picture]


def said(pictures: Sequence[Picture]) -> list[Event]:
    return [event for picture in pictures for event in picture.events if "gate" in event.text or " too " in event.text]


def test_a_good_approach_passes_both_gates_and_nothing_is_wrong() -> None:
    """On the glide path and the centreline: two gates, both stabilised."""
    told = said(fly(lambda before: 0.0, lambda before: 0.0))
    assert [event.text for event in told] == [
        "track 1 (mavlink:1) passes the gate at 304 m stabilised",
        "track 1 (mavlink:1) passes the gate at 152 m stabilised",
    ]


def test_a_high_approach_is_told_until_it_is_on_the_path_again() -> None:
    """60 m too high from 5 to 4 km: said once, shown each second with how much, and over when it is."""
    pictures = fly(lambda before: 60.0 if 4000.0 < before < 5000.0 else 0.0, lambda before: 0.0)
    told = [event for event in said(pictures) if " too " in event.text]
    assert [event.level for event in told] == ["warning", "info"]
    assert "is too high on final" in told[0].text
    assert told[1].text == "track 1 (mavlink:1) is no longer too high"
    table = pictures[0].predict.gates
    assert set(table.kind) == {"too high"}
    assert 10 <= len(table.time) <= 25
    assert max(table.off) == pytest.approx(60.0, abs=15.0)


def test_a_gate_that_is_passed_unstabilised_says_why() -> None:
    """20 % too fast all the way: told at the first gate and at the second."""
    told = [event for event in said(fly(lambda before: 0.0, lambda before: 0.0, 84.0)) if "gate at" in event.text]
    assert [event.level for event in told] == ["warning", "warning"] or told[1].level == "warning"
    assert "not stabilised: 14 m/s too fast over the ground" in told[-1].text


def test_the_speed_through_the_air_counts_where_the_wind_is_known() -> None:
    """62 m/s over the ground are too slow; in a headwind of 8 m/s that it tells they are right, in one of 24 too fast."""
    texts = []
    for headwind in (None, 8.0, 24.0):
        texts.append(" ".join(event.text for event in said(fly(level, level, 62.0, headwind=headwind))))
    assert "8 m/s too slow over the ground" in texts[0]
    assert " too " not in texts[1]
    assert "16 m/s too fast through the air" in texts[2]


def level(before: float) -> float:
    """As it should be."""
    return 0.0


def test_one_who_crosses_the_final_is_not_judged() -> None:
    """Nothing is said of an aircraft that flies across the extended centreline at 100 m."""
    frame, heard = RunwayFrame(RUNWAY), []
    for k in range(40):
        place = [RUNWAY.threshold_x_m - 3000.0, 1500.0 - 75.0 * k, 100.0]
        latitude, longitude, up = map(float, frame.geodetic_from_runway(place))
        at = T0 + k * SECOND
        told = GpsReport("mavlink:1", at, at, latitude, longitude, None, up, 0.0, -75.0, 0.0, 3.0, 3.0, 0.3)
        heard.append(Heard(at + 1000, (told,)))
    _, picture = step(initial(DEMO_SITE, Options()), heard)
    assert not said([picture])
    assert not len(picture.predict.gates.time)


def test_the_kinds_have_their_names() -> None:
    """As people and reports call them."""
    assert KINDS == ("too high", "too low", "off centreline", "too fast", "too slow")
