"""What of each kind of process goes where: unit, user, folders, and options that name files.

The units themselves lie in ``units/``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Final

UNITS: Final = Path(__file__).parent / "units"
"""The units as they are shipped; deploy/systemd shows the same."""
DEFAULT_PROGRAM: Final = PurePosixPath("/opt/peckorder/bin/swarm")
"""The program that the shipped units name."""
FOLDER: Final = PurePosixPath("/etc/peckorder")
STATE: Final = PurePosixPath("/var/lib/peckorder")
SYSTEMD: Final = PurePosixPath("/etc/systemd/system")
SYSUSERS_FILE: Final = PurePosixPath("/etc/sysusers.d/peckorder.conf")


@dataclass(frozen=True, slots=True)
class ServiceKind:
    """One kind of process, as a service."""

    command: str
    """Of the program, such as ``agent``."""
    has_state: bool = False
    """Whether it has an option ``--state``."""
    per_uav: bool = False
    """Whether a machine may run several, one for each UAV."""
    starts_at_boot: bool = True
    """Whether it should run whenever the machine does."""
    secrets: Mapping[str, str] = field(default_factory=dict)
    """Options that name a private file, and how the service's own copy is called."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """Options that may name a file everyone may read, and the suffix of the copy."""

    @property
    def user(self) -> str:
        """Who runs it."""
        return f"peckorder-{self.command}"

    @property
    def unit_file(self) -> str:
        """The unit's file."""
        at = "@" if self.per_uav else ""
        return f"peckorder-{self.command}{at}.service"


KINDS: Final[Mapping[str, ServiceKind]] = {
    kind.command: kind
    for kind in (
        ServiceKind(
            "agent",
            has_state=True,
            per_uav=True,
            secrets={"--signing-key": "mavlink.key"},
            settings={"--bus": ".json5"},
        ),
        ServiceKind(
            "coordinator", has_state=True, starts_at_boot=False, settings={"--bus": ".json5"}
        ),
        ServiceKind("router", settings={"--config": ".json5"}),
        ServiceKind("dashboard", secrets={"--token-file": "token"}, settings={"--bus": ".json5"}),
    )
}


@dataclass(frozen=True, slots=True)
class ServiceInstance:
    """One process on one machine."""

    kind: ServiceKind
    uav: str | None = None
    """Of a kind that runs once for each."""

    @property
    def name(self) -> str:
        """Of its files: ``agent-uav1``, ``router``."""
        return self.kind.command if self.uav is None else f"{self.kind.command}-{self.uav}"

    @property
    def unit(self) -> str:
        """What systemctl calls it."""
        return self.kind.unit_file.replace("@", f"@{self.uav}")

    @property
    def unit_path(self) -> PurePosixPath:
        """Where its unit goes."""
        return SYSTEMD / self.kind.unit_file

    @property
    def drop_in_path(self) -> PurePosixPath:
        """Where goes what only this one needs beyond its unit."""
        return SYSTEMD / f"{self.unit}.d" / "10-serial-port.conf"

    @property
    def options_path(self) -> PurePosixPath:
        """The file with its options."""
        return FOLDER / f"{self.name}.conf"

    @property
    def state_folder(self) -> PurePosixPath:
        """Its own folder: what it remembers, its keys and other secrets."""
        return STATE / self.name

    @property
    def keys_folder(self) -> PurePosixPath:
        """Its keys."""
        return self.state_folder / "keys"


def placed(root: Path | None, path: PurePosixPath) -> Path:
    """Where ``path`` of the machine is for this process, which may see it below ``root``."""
    return Path(path) if root is None else root / path.relative_to("/")
