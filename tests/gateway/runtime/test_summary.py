"""What the summary counts, by the names that people use."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from gateway.observation import AirData, GpsReport, ImuSample, Intent
from gateway.runtime.summary import Tally
from gateway.settings import DEMO_SITE


def picture(*observations: Any) -> Any:
    none = np.zeros(0, dtype=np.int64)
    reports = tuple(one.aircraft for one in observations if isinstance(one, GpsReport))
    return SimpleNamespace(
        now=0,
        observations=observations,
        truth=(),
        align=SimpleNamespace(report_aircraft=reports),
        associate=SimpleNamespace(changes=()),
        fuse=SimpleNamespace(track=none, time=none, aircraft=()),
        predict=SimpleNamespace(made=none),
        health=SimpleNamespace(sources=()),
    )


def test_observations_are_counted_by_what_people_call_them() -> None:
    tally = Tally(DEMO_SITE.runway)
    tally.add(picture(ImuSample("mavlink:1", 0, 0, 1), AirData("mavlink:1", 0, 0), Intent("mavlink:1", 0, 0, "utm")))
    tally.add(picture(ImuSample("mavlink:1", 0, 0, 1)))
    assert tally.named_observations() == {"IMU samples": 2, "air data": 1, "intents": 1}


def test_reports_of_traffic_are_counted_among_the_others_and_apart() -> None:
    tally = Tally(DEMO_SITE.runway)
    tally.add(picture(GpsReport("mavlink:1", 0, 0, 0.5, 0.5), GpsReport("icao:4840d6", 0, 0, 0.5, 0.5)))
    assert tally.named_observations() == {"GPS reports": 2, "GPS reports of traffic": 1}
