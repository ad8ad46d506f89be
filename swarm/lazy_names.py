"""Names that a package offers from its modules, each imported when it is first asked for.

Whoever needs one of them loads nothing of the others. A package says::

    if not TYPE_CHECKING:  # a type checker must know no other name
        __getattr__ = names_from(__name__, {"swarm.model": ("Mission", "Plan")})
"""

from __future__ import annotations

import sys

TYPE_CHECKING = False  # as typing has it, which everybody would have to import for it
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence


def names_from(package: str, where: Mapping[str, Sequence[str]]) -> Callable[[str], object]:
    """What a package needs as its ``__getattr__``.

    Args:
        package: its name.
        where: by module, the names that it offers from there.
    """
    modules = {name: module for module, names in where.items() for name in names}

    def look_up(name: str) -> object:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        from importlib import import_module

        found: object = getattr(import_module(modules[name]), name)
        setattr(sys.modules[package], name, found)  # this is asked once
        return found

    return look_up
