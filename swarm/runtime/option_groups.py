"""Options that commands have in common as a group, of which a command has one parameter.

A group is a dataclass. Its fields are annotated as parameters of a command would be, with the
options of `swarm.runtime.options`, or are made by `option` and `argument` if no other has them. A
command has one parameter of that class and is decorated with `with_options`; on the command line
it has the options of the fields instead.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import field, fields, is_dataclass
from typing import Annotated, Any, get_type_hints

import typer

_OPTION = "option"


def option(default: object, *names: str, **settings: Any) -> Any:
    """A field of a group, as `typer.Option`; its default is shown unless it is None."""
    return _field(default, typer.Option(*names, **settings, show_default=default is not None))


def argument(default: object, **settings: Any) -> Any:
    """The same for an argument."""
    return _field(default, typer.Argument(**settings, show_default=default is not None))


def _field(default: object, parameter: Any) -> Any:
    return field(default=default, metadata={_OPTION: parameter})


def option_of(group: type, name: str) -> Any:
    """One option of a group, made by `option`, for a command that has no other of it."""
    return next(each.metadata[_OPTION] for each in fields(group) if each.name == name)


def with_options(command: Callable[..., int]) -> Callable[..., int]:
    """Give a command the options of every group that is a parameter of it."""
    own = inspect.signature(command, eval_str=True).parameters
    groups: dict[str, Any] = {
        name: each.annotation for name, each in own.items() if is_dataclass(each.annotation)
    }

    @functools.wraps(command)
    def run(**given: Any) -> int:
        for name, group in groups.items():
            said = {each.name: given.pop(each.name) for each in fields(group) if each.name in given}
            given[name] = group(**said)
        return command(**given)

    parameters: list[inspect.Parameter] = []
    for name, parameter in own.items():
        if name in groups:
            parameters += _parameters(groups[name])
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
    run.__signature__ = inspect.Signature(parameters, return_annotation=int)  # type: ignore[attr-defined]  # functions have one
    run.__annotations__ = {each.name: each.annotation for each in parameters} | {"return": int}
    del run.__wrapped__  # or its own signature would be read
    return run


def _parameters(group: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    parameters = []
    for each in fields(group):
        hint = hints[each.name]
        if _OPTION in each.metadata:
            hint = Annotated[hint, each.metadata[_OPTION]]
        kind = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter(each.name, kind, default=each.default, annotation=hint))
    return parameters
