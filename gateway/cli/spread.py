"""Commands whose options come in groups: a dataclass for each group, its fields the options."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, get_type_hints


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """A command as the command line's library reads it: for a parameter that is a dataclass, a parameter for each field.

    Names of fields must differ among all groups and parameters of one command.
    """
    hints = get_type_hints(command, include_extras=True)
    groups = {name: kind for name, kind in hints.items() if is_dataclass(kind) and isinstance(kind, type)}
    signature = inspect.Signature(list(_parameters(command, hints, groups)))

    @functools.wraps(command)
    def called(*given: Any, **named: Any) -> None:
        bound = signature.bind(*given, **named)
        bound.apply_defaults()
        values = bound.arguments
        whole = {
            name: kind(**{one.name: values.pop(one.name) for one in fields(kind)}) for name, kind in groups.items()
        }
        command(**values, **whole)

    vars(called).update(
        __signature__=signature,
        __annotations__={one.name: one.annotation for one in signature.parameters.values()},
    )
    return called


def _parameters(
    command: Callable[..., None], hints: dict[str, Any], groups: dict[str, type]
) -> Iterator[inspect.Parameter]:
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            yield parameter.replace(annotation=hints[name])
            continue
        known = get_type_hints(groups[name], include_extras=True)
        for one in fields(groups[name]):
            default = inspect.Parameter.empty if one.default is MISSING else one.default
            kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
            yield inspect.Parameter(one.name, kind, default=default, annotation=known[one.name])
