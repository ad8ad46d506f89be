"""Puts an installation's files onto a machine: users, folders, owners, modes.

A file is written beside its place and renamed into it, and left alone when it is right
already. What is below the state's folder belongs to the services: a link that one of them has
put there is not followed, or it could have any file of the machine given to it.
"""

from __future__ import annotations

import os
import secrets
import shutil
import subprocess
from collections.abc import Sequence
from enum import Enum
from pathlib import Path, PurePosixPath

from swarm.install.installation import File, Installation
from swarm.install.services import STATE, SYSUSERS_FILE, placed
from swarm.runtime.errors import Fault, InputError

_FOLDER_MODE, _STATE_MODE = 0o755, 0o700


class FileOutcome(Enum):
    """What became of a file."""

    WRITTEN = "written"
    REPLACED = "replaced"
    UNCHANGED = "unchanged"


class TargetMachine:
    """The machine that services are installed on.

    ``root`` is its file system, if that is not this one's; ``is_root`` whether this process may
    make users and give files away.
    """

    def __init__(self, root: Path | None, *, is_root: bool) -> None:
        self._root = root
        self._is_root = is_root

    @property
    def runs_systemd(self) -> bool:
        """Whether systemd starts the services of this very machine."""
        return self._root is None and Path("/run/systemd/system").is_dir()

    def install(self, installation: Installation) -> list[tuple[File, FileOutcome]]:
        """Put everything in its place.

        Raises:
            InputError: this process may not, or the users cannot be made.
        """
        if self._root is None and not self._is_root:
            problem, remedy = "only root may install services", "put sudo before the command"
            raise InputError(Fault("swarm install", "", problem, remedy))
        try:
            done = []
            for file in installation.files:
                if file.owner is not None and self._is_root:
                    self._make_user(file.owner)
                done.append((file, self._put(file)))
            if self._is_root:
                self._make_user(installation.service.kind.user)
            self._make_folder(installation.service.state_folder, installation.service.kind.user)
        except OSError as error:
            place = error.filename or "swarm install"
            problem = f"cannot be written ({error.strerror or error})"
            raise InputError(Fault(str(place), "", problem, "see to it and try again")) from error
        return done

    def _put(self, file: File) -> FileOutcome:
        path = placed(self._root, file.path)
        self._make_folder(file.path.parent, file.owner)
        there = path.read_bytes() if path.is_file() and not path.is_symlink() else None
        if there == file.content:
            self._set_right(path, file.mode, file.owner)
            return FileOutcome.UNCHANGED
        draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            with os.fdopen(
                os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb"
            ) as new:
                new.write(file.content)
                new.flush()
                self._give(new.fileno(), file.owner)
                os.fchmod(new.fileno(), file.mode)
                os.fsync(new.fileno())
            draft.replace(path)
        except OSError:
            draft.unlink(missing_ok=True)
            raise
        return FileOutcome.WRITTEN if there is None else FileOutcome.REPLACED

    def _make_folder(self, folder: PurePosixPath, owner: str | None) -> None:
        """Make a folder with those above it; what is below the state's is its owner's alone."""
        private = STATE in folder.parents
        for above in reversed(folder.parents):
            if not placed(self._root, above).exists():
                self._make_folder(above, owner if STATE in above.parents else None)
        path = placed(self._root, folder)
        if not path.exists():
            path.mkdir(mode=_STATE_MODE if private else _FOLDER_MODE)
            path.chmod(_STATE_MODE if private else _FOLDER_MODE)
        if private:
            self._set_right(path, _STATE_MODE, owner)

    def _set_right(self, path: Path, mode: int, owner: str | None) -> None:
        """Set mode and owner of what is at ``path`` itself.

        Raises:
            OSError: it is a link.
        """
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
        try:
            os.fchmod(handle, mode)
            self._give(handle, owner)
        finally:
            os.close(handle)

    def _give(self, handle: int, owner: str | None) -> None:
        """To its owner, whom the machine knows by name; only root can."""
        if not self._is_root:
            return
        user, group = (0, 0) if owner is None else self._ids(owner) or (0, 0)
        os.fchown(handle, user, group)

    def _ids(self, name: str) -> tuple[int, int] | None:
        """User and group of that name; None if there is no such user."""
        try:
            lines = placed(self._root, PurePosixPath("/etc/passwd")).read_text("utf-8").splitlines()
        except FileNotFoundError:
            return None
        for line in lines:
            user, _, rest = line.partition(":")
            if user == name:
                fields = rest.split(":")
                return int(fields[1]), int(fields[2])
        return None

    def _make_user(self, name: str) -> None:
        if self._ids(name) is not None:
            return
        at_root = [] if self._root is None else [f"--root={self._root}"]
        commands: tuple[Sequence[str], ...] = (
            ("systemd-sysusers", *at_root, SYSUSERS_FILE.name),
            (
                "useradd",
                *([] if self._root is None else ["--prefix", str(self._root)]),
                *("--system", "--user-group", "--no-create-home", "--home-dir", "/"),
                *("--shell", "/usr/sbin/nologin", name),
            ),
        )
        said = "there is neither systemd-sysusers nor useradd"
        for program, *arguments in commands:
            found = shutil.which(program, path=f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin")
            if found is None:
                continue
            run = subprocess.run(  # noqa: S603 - a system tool, with fixed words
                [found, *arguments], check=False, capture_output=True, text=True
            )
            if self._ids(name) is not None:
                return
            said = f"{program}: {' '.join(run.stderr.split()) or f'exit status {run.returncode}'}"
        problem, remedy = f"cannot be made ({said})", "make that system user, and try again"
        raise InputError(Fault(f"user {name}", "", problem, remedy))
