"""The option `--record`, for every command that flies or watches a mission."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarm.runtime.errors import Fault, InputError
from swarm.runtime.extras import require_extra

RecordOption = Annotated[
    Path | None,
    typer.Option(
        "--record",
        metavar="FILE.mcap",
        help="Record everything that is said, for swarm replay, swarm explain and Foxglove. The "
        "file must be new; after every second it is whole, whatever happens then.",
        show_default=False,
    ),
]


def check_new_recording(path: Path) -> None:
    """Refuse a path at which nothing can be recorded.

    Raises:
        InputError: it has another ending, exists, its folder does not, or what records is not
            installed.
    """
    require_extra("ground", "--record")
    if path.suffix.lower() != ".mcap":
        problem = f"no recording is called {path.name!r}"
        raise InputError(Fault(str(path), "", problem, "end the name in .mcap"))
    if path.exists():
        problem = "exists already, and a recording is never overwritten"
        raise InputError(Fault(str(path), "", problem, "give another name"))
    if not path.parent.is_dir():
        problem = f"there is no folder {path.parent}"
        raise InputError(Fault(str(path), "", problem, "make it first, or give another path"))
