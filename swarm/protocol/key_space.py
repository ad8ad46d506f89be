"""Key expressions of one mission; every register key has exactly one writer.

``swarm/<mission>/…``: ``brief``, ``plan`` and ``board/<task>`` are written by the
coordinator, ``uav/<id>/…`` by that UAV's agent, ``operator/<target>``,
``operator/task/<task>``, ``operator/start/<uav>``, ``operator/zone/<zone>`` and
``operator/ready/<uav>`` by the operator, ``roster`` by the mission authority;
``alive/<id>`` holds the liveliness token of a process and ``state/<id>`` answers what that
process knows.
"""

from __future__ import annotations

from dataclasses import dataclass

from swarm.model.ids import AUTHORITY, COORDINATOR, OPERATOR, require_id, valid_id

ANY_TOKEN = "swarm/*/alive/*"  # noqa: S105 - a key expression, nothing secret
"""Liveliness tokens of all missions on the bus."""


def mission_of_token(key: str) -> str | None:
    """The mission that the token ``key`` shows somebody to fly; None if it is no token."""
    match key.split("/"):
        case ["swarm", mission, "alive", _] if valid_id(mission):
            return mission
        case _:
            return None


@dataclass(frozen=True, slots=True)
class KeySpace:
    """All keys of one mission.

    Raises:
        ValueError: the mission name is not a valid id.
    """

    mission: str

    def __post_init__(self) -> None:
        require_id(self.mission, "mission name")

    @property
    def root(self) -> str:
        """Prefix of every key of the mission."""
        return f"swarm/{self.mission}"

    @property
    def brief(self) -> str:
        """Fleet, horizon and defaults."""
        return f"{self.root}/brief"

    @property
    def plan(self) -> str:
        """The current epoch."""
        return f"{self.root}/plan"

    @property
    def roster(self) -> str:
        """Who belongs to the mission, by the word of its authority."""
        return f"{self.root}/roster"

    def board(self, task: str) -> str:
        """One task of the task board; ``*`` for all."""
        return f"{self.root}/board/{task}"

    def claim(self, uav: str) -> str:
        """What a UAV is about to do; ``*`` for all."""
        return f"{self.root}/uav/{uav}/claim"

    def claim_to(self, uav: str, other: str) -> str:
        """Where a UAV says its claim to one other alone; ``*`` for all."""
        return f"{self.claim(uav)}/{other}"

    def outcome(self, uav: str, task: str) -> str:
        """How a UAV's attempt at a task ended; ``*`` for all."""
        return f"{self.root}/uav/{uav}/outcome/{task}"

    def calibration(self, uav: str) -> str:
        """How a UAV flies, by what was measured; ``*`` for all."""
        return f"{self.root}/uav/{uav}/calibration"

    def status(self, uav: str) -> str:
        """Where a UAV is and how it does; ``*`` for all."""
        return f"{self.root}/uav/{uav}/status"

    def operator(self, target: str) -> str:
        """The operator's newest command to a UAV, or to the fleet; ``*`` for all."""
        return f"{self.root}/operator/{target}"

    def operator_task(self, task: str) -> str:
        """A task that the operator has added or withdrawn; ``*`` for all."""
        return f"{self.root}/operator/task/{task}"

    def operator_start(self, uav: str) -> str:
        """That the mission may start without a UAV; ``*`` for all."""
        return f"{self.root}/operator/start/{uav}"

    def operator_zone(self, zone: str) -> str:
        """A zone that the operator has drawn or taken away; ``*`` for all."""
        return f"{self.root}/operator/zone/{zone}"

    def operator_ready(self, uav: str) -> str:
        """That a UAV on the ground may start again; ``*`` for all."""
        return f"{self.root}/operator/ready/{uav}"

    def choice(self, uav: str) -> str:
        """Why a UAV took a task; ``*`` for all."""
        return f"{self.root}/uav/{uav}/choice"

    def near(self, uav: str, east: int | str, north: int | str) -> str:
        """Where a UAV in that cell of the sky is, for those near it; ``*`` for all."""
        return f"{self.root}/uav/{uav}/near/{east}/{north}"

    def alive(self, writer: str) -> str:
        """Liveliness token of a process; ``*`` for all."""
        return f"{self.root}/alive/{writer}"

    def state(self, writer: str) -> str:
        """Where a process answers with the registers it answers for; ``*`` for all."""
        return f"{self.root}/state/{writer}"

    def register_of(self, key: str) -> str:
        """The key of the register that is told of on ``key``: claims may be said to one alone."""
        if "/claim/" not in key:
            return key
        match key.removeprefix(f"{self.root}/").split("/"):
            case ["uav", uav, "claim", _]:
                return self.claim(uav)
            case _:
                return key

    def writer_of(self, key: str) -> str | None:
        """Whose register ``key`` is; None if it is none of this mission."""
        match key.removeprefix(f"{self.root}/").split("/"):
            case ["brief"] | ["plan"] | ["board", _]:
                return COORDINATOR
            case ["operator", _] | ["operator", "task" | "start" | "zone" | "ready", _]:
                return OPERATOR
            case ["roster"]:
                return AUTHORITY
            case ["uav", writer, _] | ["uav", writer, "outcome" | "claim", _]:
                return writer
            case ["uav", writer, "near", _, _]:
                return writer
            case _:
                return None

    def writer_of_token(self, key: str) -> str | None:
        """The writer whose token ``key`` is; None if it is no token of this mission."""
        prefix = self.alive("")
        writer = key.removeprefix(prefix)
        return writer if key.startswith(prefix) and writer and "/" not in writer else None
