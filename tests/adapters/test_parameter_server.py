"""A vehicle's side of the parameter protocol."""

from __future__ import annotations

import math
from typing import Any

from adapters.mavlink_frames import encode, parse
from adapters.parameter_server import hear_parameters

SETTINGS = {"WP_RADIUS": 25.0, "AIRSPEED_CRUISE": 22.0}


def answered(name: str, **values: Any) -> Any:
    frame = parse(encode(name, {"target_system": 1, "target_component": 1, **values}, system=250))
    assert frame is not None
    return hear_parameters(frame.message, frame.payload, SETTINGS, {"WP_RADIUS": (1.0, 100.0)})


def test_the_list_tells_every_parameter_with_its_place() -> None:
    values, change = answered("PARAM_REQUEST_LIST")
    told = [(one["param_id"], one["param_value"], one["param_index"], one["param_count"]) for one in values]
    assert told == [(b"AIRSPEED_CRUISE", 22.0, 0, 2), (b"WP_RADIUS", 25.0, 1, 2)]
    assert change is None


def test_one_parameter_is_told_by_name_or_by_place_and_what_there_is_not_is_not_answered() -> None:
    by_name, _ = answered("PARAM_REQUEST_READ", param_id=b"WP_RADIUS", param_index=-1)
    by_place, _ = answered("PARAM_REQUEST_READ", param_id=b"", param_index=1)
    assert by_name == by_place == [answered("PARAM_REQUEST_LIST")[0][1]]
    assert answered("PARAM_REQUEST_READ", param_id=b"NO_SUCH_THING_AT", param_index=-1) == ([], None)
    assert answered("PARAM_REQUEST_READ", param_id=b"", param_index=7) == ([], None)


def test_a_parameter_is_set_and_told_as_it_is_then_but_never_beyond_its_limits() -> None:
    (told,), change = answered("PARAM_SET", param_id=b"WP_RADIUS", param_value=40.0, param_type=9)
    assert (told["param_value"], change) == (40.0, ("WP_RADIUS", 40.0))
    for senseless in (math.nan, math.inf, 0.0, 100.5):
        (told,), change = answered("PARAM_SET", param_id=b"WP_RADIUS", param_value=senseless, param_type=9)
        assert (told["param_value"], change) == (25.0, None)
    (told,), change = answered("PARAM_SET", param_id=b"AIRSPEED_CRUISE", param_value=23.0, param_type=9)
    assert (told["param_value"], change) == (22.0, None)
    assert answered("PARAM_SET", param_id=b"UNKNOWN", param_value=1.0, param_type=9) == ([], None)
