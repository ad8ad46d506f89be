"""Files and folders that only their owner can read, from their first moment on.

The mode is given when a file is made and set again behind it, so no umask widens or narrows
it. Leaves out: what is in the files.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from pathlib import Path

__all__ = ["make_private_folder", "replace_private", "swap_in_folder", "sync", "write_private"]

_FILE_MODE = 0o600
_FOLDER_MODE = 0o700


def make_private_folder(path: Path) -> None:
    """Make the folder ``path``; those above it must be there.

    Raises:
        OSError: it cannot be made, or is there already.
    """
    path.mkdir(mode=_FOLDER_MODE)
    path.chmod(_FOLDER_MODE)


def write_private(path: Path, data: bytes) -> None:
    """Make the file ``path``; it may be empty after a loss of power.

    Raises:
        OSError: it cannot be made, or is there already.
    """
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    with os.fdopen(os.open(path, flags, _FILE_MODE), "wb") as file:
        os.fchmod(file.fileno(), _FILE_MODE)
        file.write(data)


def replace_private(path: Path, data: bytes) -> None:
    """Put ``data`` in the place of the file ``path``: whole or not at all.

    Raises:
        OSError: it cannot be written.
    """
    draft = _beside(path)
    try:
        write_private(draft, data)
        sync(draft)
        draft.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise
    sync(path.parent)


def swap_in_folder(path: Path, files: dict[str, bytes]) -> None:
    """Put a private folder with ``files`` in the place of ``path``, which need not be there.

    After a loss of power it may be the old one, or hold empty files.

    Raises:
        OSError: it cannot be written.
    """
    draft, old = _beside(path), _beside(path)
    make_private_folder(draft)
    try:
        for name, data in files.items():
            write_private(draft / name, data)
        if path.is_dir():
            path.rename(old)
        draft.rename(path)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _beside(path: Path) -> Path:
    """A name in the same folder that nobody else uses; no identity begins with a dot."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}")


def sync(path: Path) -> None:
    """Have the disk keep the file or, of a folder, the names in it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
