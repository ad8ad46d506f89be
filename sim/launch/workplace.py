"""The folder below which real firmware works, in whatever shell scripts it brings along.

PX4's startup script names files below its working folder without quotes, and looks some up
along PATH: a space, a star or a colon in that name ends it. Leaves out: who works there
(sim.launch.launch).
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from swarm.errors import Fault, InputError

__all__ = ["firmware_workplace"]

_PLAIN: Final = re.compile(r"[A-Za-z0-9_./+-]+")
"""Signs that mean nothing to a shell, quoted or not, nor in PATH."""
_COMMON: Final = (Path("/tmp"), Path("/var/tmp"))  # noqa: S108 - files go into a private folder


def firmware_workplace(folders: Sequence[Path] | None = None) -> Path:
    """The first folder whose name a shell takes as it is, and in which files can be made.

    Args:
        folders: candidates; None: where temporary files go, then where they usually go.

    Raises:
        InputError: there is none.
    """
    candidates = folders or (Path(tempfile.gettempdir()), *_COMMON)
    for folder in candidates:
        # A shell that is started there calls it by its own name, not by that of a link.
        place = folder.resolve()
        if _PLAIN.fullmatch(str(place)) and place.is_dir() and os.access(place, os.W_OK | os.X_OK):
            return place
    problem = "firmware's scripts can work neither there nor in a common place"
    remedy = "name a folder by letters, digits and _ . + - only, and let files be made in it"
    raise InputError(Fault("TMPDIR", str(candidates[0]), problem, remedy))
