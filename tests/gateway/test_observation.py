"""Observations are frozen values, however swiftly they are made."""

import copy
import inspect
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from typing import get_args

import pytest

from gateway.frozen import made_swiftly
from gateway.observation import Heard, Many, Observation

KINDS = (*(one for one in get_args(Observation) if one is not Many), Heard)


@dataclass(frozen=True, slots=True)
class Plain:
    """What a dataclass is by itself."""

    first: int
    second: str = "two"
    third: float | None = None


@made_swiftly
@dataclass(frozen=True, slots=True)
class Swift:
    """The same."""

    first: int
    second: str = "two"
    third: float | None = None


@pytest.mark.parametrize("kind", KINDS)
def test_an_observation_is_a_frozen_value(kind: type) -> None:
    names = [one.name for one in fields(kind)]
    made = kind(*range(len(names)))
    assert type(made) is kind
    assert [getattr(made, name) for name in names] == list(range(len(names)))
    assert made == kind(**{name: place for place, name in enumerate(names)})
    assert hash(made) == hash(copy.copy(made))
    assert pickle.loads(pickle.dumps(made)) == made == copy.deepcopy(made)
    assert replace(made, **{names[0]: -1}) != made
    for name in (names[0], "something"):
        with pytest.raises((FrozenInstanceError, TypeError)):
            setattr(made, name, 1)


def test_what_is_made_swiftly_is_made_as_ever() -> None:
    assert inspect.signature(Swift) == inspect.signature(Plain)
    assert repr(Swift(1, third=2.0)) == repr(Plain(1, third=2.0)).replace("Plain", "Swift")
    assert Swift(1) == Swift(first=1, second="two", third=None)
    for wrong in ((), (1, 2, 3, 4)):
        with pytest.raises(TypeError, match=r"Swift.__init__\(\)"):
            Swift(*wrong)


def test_what_a_factory_makes_belongs_to_one_instance() -> None:
    @made_swiftly
    @dataclass(frozen=True, slots=True)
    class Holding:
        first: int
        held: list[int] = field(default_factory=list)

    one, other = Holding(1), Holding(2)
    one.held.append(3)
    assert (one.held, other.held, Holding(3, [4]).held) == ([3], [], [4])
