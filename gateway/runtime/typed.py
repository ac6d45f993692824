"""Whether a value that was read from JSON is what a dataclass's annotation says: a damaged session.json must not go further."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints


def misfit(value: Any) -> str | None:
    """The first field of a dataclass that does not hold what its annotation says, nor what is in it; None where all do.

    Numbers have to be finite, and whole ones fit into 64 bits.
    """
    hints = _hints(type(value))  # type: ignore[arg-type]  # mypy doubts that types can be hashed
    return next((one.name for one in fields(value) if not _fits(getattr(value, one.name), hints[one.name])), None)


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    """A dataclass's annotations; evaluating them takes longer than all else that is done to a session.json."""
    return get_type_hints(kind)


def _fits(value: Any, kind: Any) -> bool:
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if origin is Literal:
        return isinstance(value, str) and value in parts
    if origin is tuple:
        return isinstance(value, tuple) and all(_fits(one, parts[0]) for one in value)
    if origin is Mapping:
        return isinstance(value, Mapping) and all(_fits(one, parts[1]) for one in value.values())
    if kind is Any:
        return True
    if kind is None or kind is type(None):
        return value is None
    if kind is int:
        return type(value) is int and -(1 << 63) <= value < 1 << 63
    if kind is float:
        return type(value) in (int, float) and math.isfinite(value)
    return isinstance(value, kind) and (not is_dataclass(value) or misfit(value) is None)
