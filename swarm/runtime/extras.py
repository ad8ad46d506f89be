"""Which packages are optional, and which extra of the project brings them.

What an agent and a coordinator need is always installed. A command that meets a package that is
not there ends with one line, and no module has to look whether what it imports is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from types import MappingProxyType
from typing import Final

from swarm.runtime.errors import Fault, InputError

EXTRAS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "ground": (
            "lz4",
            "matplotlib",
            "mcap",
            "prometheus_client",
            "pyproj",
            "scipy",
            "starlette",
            "uvicorn",
            "websockets",
            "zstandard",
        ),
        "study": ("distributed", "pyarrow"),
        "bench": ("ortools", "vrp_cli"),
        "terrain": ("rasterio",),
        "ros2": ("rosbags", "xxhash"),
    }
)
"""Modules that are imported where they are needed, by the extra that brings them."""


class MissingExtraError(InputError):
    """Something needs packages that are not installed."""

    def __init__(self, what: str, extra: str) -> None:
        self.what, self.extra = what, extra
        install = f"pip install 'peckorder[{extra}]'"
        super().__init__(Fault(what, "", f"needs the extra {extra}", install))

    def __str__(self) -> str:
        return f"{self.what} needs the extra {self.extra}: {self.faults[0].remedy}"


def missing_extra(error: ImportError, what: str) -> MissingExtraError | None:
    """How ``what``, such as ``swarm dashboard``, gets what could not be imported; None where no
    extra brings it.
    """
    module = (error.name or "").partition(".")[0]
    extra = next((extra for extra, modules in EXTRAS.items() if module in modules), None)
    if extra is None or not isinstance(error, ModuleNotFoundError):
        return None
    return MissingExtraError(what, extra)


def require_extra(extra: str, what: str) -> None:
    """Refuse ``what``, before anything is begun, where an extra is not installed whole.

    Raises:
        MissingExtraError: a package of it is not there.
    """
    if not all(map(_is_there, EXTRAS[extra])):
        raise MissingExtraError(what, extra)


def _is_there(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except ModuleNotFoundError:
        return False
