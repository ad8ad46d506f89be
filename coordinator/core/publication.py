"""A mission as the coordinator publishes it: brief, board, epoch and mission time.

What a scenario looks like in these registers and how they differ from its file, when each task is
released to the fleet, and what is said, said again, and said in the place of another coordinator.
What the operator has ordered counts first: a task withdrawn before it appeared is not released any
more.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import takewhile

from coordinator.mission_view.missed import able_alone
from swarm.model import Mission, Origin, Task, Uav
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.board import TaskBoard, TaskState, is_of_field
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, SMALL_LIMIT_BYTES, encode
from swarm.protocol.events import LogLine, Publish
from swarm.protocol.field_messages import AreaSpec, BaseSpec, TerrainSpec, ZoneSpec
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import (
    Body,
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    Stamp,
    TaskEntry,
    UavSpec,
)
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.separation.fleet_layers import fleet_layers_m


def mission_config_of(mission: Mission, layers: FlightLayers, run: int) -> MissionConfig:
    """What the agents need to know of ``mission``."""
    origin: Origin = mission.origin or DEFAULT_ORIGIN
    layers_m = fleet_layers_m(mission, layers)
    return MissionConfig(
        horizon_s=mission.horizon_s,
        success_default=mission.success_default,
        survival_default=mission.survival_default,
        reattempt_failed=mission.reattempt_failed,
        run=run,
        origin=(origin.lat_deg, origin.lon_deg, origin.alt_m),
        uavs=tuple(
            UavSpec(
                id=uav.id,
                position_enu_m=uav.position_enu_m,
                speed_m_s=uav.speed_m_s,
                success=dict(uav.success),
                survival=dict(uav.survival),
                kind=uav.kind,
                layer_m=layer_m,
                acceleration_m_s2=uav.acceleration_m_s2,
                airspeed_m_s=uav.airspeed_m_s,
                endurance_s=uav.endurance_s,
                vehicle=uav.vehicle,
                landing_heading_rad=uav.landing_heading_rad,
                **_shares_of(uav),
            )
            for uav, layer_m in zip(mission.uavs, layers_m, strict=True)
        ),
        bases=tuple(map(BaseSpec.of, mission.bases)),
        zones=tuple(map(ZoneSpec.of, mission.zones)),
        wind_enu_m_s=mission.wind_enu_m_s,
        zone_margin_m=mission.zone_margin_m,
        separation_m=mission.separation_m,
        band_m=mission.band_m,
        areas=tuple(map(AreaSpec.of, mission.areas)),
        terrain=None if mission.terrain is None else TerrainSpec.of(mission.terrain),
    )


def _shares_of(uav: Uav) -> dict[str, float]:
    """Of a battery that ends: of others they mean nothing, and older releases can do without."""
    if uav.endurance_s is None:
        return {}
    return {"reserve_frac": uav.reserve_frac, "charge_frac": uav.charge_frac}


def unsayable(mission: Mission, layers: FlightLayers) -> list[str]:
    """What of ``mission`` no message has room for, a line each; nobody would ever know it."""
    found = []
    size = _longest(mission.name, mission_config_of(mission, layers, MAX_COUNT))
    if size > LARGE_LIMIT_BYTES:
        found.append(
            f"fleet, bases, zones, areas and ground take {size} bytes, and a message has room for "
            f"{LARGE_LIMIT_BYTES}"
        )
    for number, task in enumerate(mission.tasks):
        beyond = 0
        if task.path_enu_m:  # nothing else of a task is long
            beyond = _longest(mission.name, task_entry_of(task, number)) - SMALL_LIMIT_BYTES
        if beyond > 0:
            points = len(task.path_enu_m)
            most = points - math.ceil(beyond / _POINT_BYTES)
            found.append(
                f"the line of task {task.id} has {points} points, and a message has room for {most}"
            )
    return found


_POINT_BYTES = 28
"""Of a point in a message: three numbers of nine bytes, and that they are three."""


def _longest(mission: str, body: Body) -> int:
    """Bytes of a message that says ``body``, whatever its stamp."""
    return len(encode(Message(mission, COORDINATOR, Stamp(MAX_COUNT, MAX_COUNT), body)))


def last_epoch(epoch: PlanEpoch, mission_s: float, reason: str) -> PlanEpoch:
    """The epoch by which the mission ends, after ``epoch``."""
    number, phase = epoch.number + 1, MissionPhase.ENDED
    return replace(epoch, number=number, phase=phase, mission_s=mission_s, reason=reason[:200])


def task_entry_of(task: Task, number: int) -> TaskEntry:
    """``task`` as an entry of the board, its ``number``-th."""
    return TaskEntry(
        task=task.id,
        number=number,
        position_enu_m=task.position_enu_m,
        value=task.value,
        service_s=task.service_s,
        kind=task.kind,
        withdrawn=False,
        due_s=task.due_s,
        opens_s=task.opens_s,
        closes_s=task.closes_s,
        path_enu_m=task.path_enu_m,
        height_m=task.height_m,
        trigger_m=task.trigger_m,
    )


def scenario_differences(mission: Mission, layers: FlightLayers, replica: Replica) -> list[str]:
    """In what the mission that the registers describe is not the one of the scenario file.

    What the operator has ordered about tasks is no difference, nor that a coordinator has
    withdrawn some or posted others, which it does for an operator.
    """
    found = []
    brief = replica.brief
    if brief is not None and brief != mission_config_of(mission, layers, brief.run):
        found.append("fleet, horizon, defaults, bases, zones, areas or wind")
    for number, task in enumerate(mission.tasks):
        entry = replica.posted.get(task.id)
        if entry is not None and replace(entry, withdrawn=False) != task_entry_of(task, number):
            found.append(f"task {task.id}")
    return found


def exit_status(board: TaskBoard, mission: Mission) -> int:
    """0 if every task of ``mission`` has appeared and was done or withdrawn, else 1.

    In the field and in schema 2 a task may be left that has a time by which it is due, or that
    nobody could have done even as its only one.
    """
    closed = {t for t, s in board.states.items() if s in (TaskState.DONE, TaskState.WITHDRAWN)}
    to_come, flown = unreleased_tasks(board.replica, mission), board.mission
    if flown is None or (mission.schema == 1 and not is_of_field(flown)):
        return 0 if closed.issuperset(board.states) and not to_come else 1
    left = [*(task for task in flown.tasks if task.id not in closed), *to_come]
    return 1 if able_alone(flown, [task for task in left if task.due_s is None]) else 0


def unreleased_tasks(replica: Replica, mission: Mission) -> list[Task]:
    """Tasks of ``mission`` that have not appeared yet."""
    return [task for task in mission.tasks if task.id not in replica.board]


ENTRIES_PER_ANNOUNCEMENT = 8
"""Of brief and board, at most."""


class RegisterAnnouncer:
    """The statements of one coordinator, and the mission time that they tell.

    Args:
        incarnation: greater than in any earlier life of this coordinator.
    """

    def __init__(
        self,
        mission: Mission,
        layers: FlightLayers,
        incarnation: int,
        replica: Replica,
        timing: Timing,
    ) -> None:
        self.zero_s: float | None = None
        """When mission time was 0; None while it has not begun, and if it ends without."""
        self._mission = mission
        self._layers = layers
        self._register_writer = RegisterWriter(mission.name, COORDINATOR, incarnation)
        self._replica = replica
        self._announce_s = timing.announce_s
        self._announce_at_s: float | None = None
        self._announced = 0
        self._to_come: list[tuple[int, Task]] = []
        self._to_come_version: int | None = None

    @property
    def incarnation(self) -> int:
        """Of this life of the coordinator."""
        return self._register_writer.incarnation

    def set_zero(self, zero_s: float) -> None:
        """Mission time begins; once it runs it is not set again."""
        self.zero_s = zero_s if self.zero_s is None else self.zero_s

    def mission_s(self, now_s: float) -> float:
        """Mission time [s]; 0 as long as the mission has not begun."""
        return 0.0 if self.zero_s is None else now_s - self.zero_s

    def snapshot(self, messages: Iterable[Message], now_s: float) -> Snapshot:
        """``messages`` as this coordinator's answer."""
        mission_s = None if self.zero_s is None else now_s - self.zero_s
        told = tuple(messages)
        return Snapshot(self._mission.name, COORDINATOR, self.incarnation, mission_s, told)

    def brief(self) -> list[Publish]:
        """Say who flies, unless somebody has."""
        if self._replica.brief is not None:
            return []
        return [self.say(mission_config_of(self._mission, self._layers, self.incarnation))]

    def post(self, now_s: float) -> list[Publish | LogLine]:
        """Put on the board what is due by now; before the start, what has been there all along."""
        actions: list[Publish | LogLine] = []
        for number, task in sorted(self._due(now_s), key=lambda item: item[0]):
            actions.append(self.say(task_entry_of(task, number)))
            if self.zero_s is not None:
                actions.append(LogLine("pop-up posted", {"task": task.id}))
        return actions

    @property
    def more_to_come(self) -> bool:
        """Whether tasks have yet to appear."""
        return bool(self._unreleased)

    @property
    def _unreleased(self) -> list[tuple[int, Task]]:
        """Tasks that have not appeared yet with their numbers, the next one to appear first."""
        if self._to_come_version != self._replica.board_version:
            board, tasks = self._replica.board, self._mission.tasks
            found = [(number, task) for number, task in enumerate(tasks) if task.id not in board]
            self._to_come = sorted(found, key=lambda item: item[1].appears_s)
            self._to_come_version = self._replica.board_version
        return self._to_come

    def _due(self, now_s: float) -> list[tuple[int, Task]]:
        """Those of them whose time has come."""

        def is_due(item: tuple[int, Task]) -> bool:
            appears_s = item[1].appears_s
            # The same sum as the deadline's: another may round to just before it.
            return appears_s == 0.0 or (
                self.zero_s is not None and self.zero_s + appears_s <= now_s
            )

        return list(takewhile(is_due, self._unreleased))

    def merged(self, theirs: Iterable[Message]) -> list[TaskEntry]:
        """What another coordinator of the mission has posted or withdrawn, and this one has not."""
        entries = []
        for message in theirs:
            if isinstance(entry := message.body, TaskEntry):
                known = self._replica.posted.get(entry.task)
                if known is None or (entry.withdrawn and not known.withdrawn):
                    entries.append(entry)
        return entries

    def withdraw(self, task: str) -> list[Publish]:
        """Take ``task`` off the board, if it was posted and is not off already."""
        entry = self._replica.posted.get(task)
        if entry is None or entry.withdrawn:
            return []
        return [self.say(replace(entry, withdrawn=True))]

    def resume(self, left: Replica, now_s: float) -> list[Publish | LogLine]:
        """Say in one's own name what another coordinator, or an earlier life, has ``left``."""
        theirs, epoch = list(left.messages({COORDINATOR})), left.epoch
        self.observe(theirs)
        actions: list[Publish | LogLine] = []
        brief, own = left.brief, self._replica.brief
        if brief is not None and own is not None and own.run != brief.run:
            # Before others take the one that it began for that of who is in charge.
            actions.append(self.say(brief))
        bodies = [m.body for m in theirs if epoch is None or not isinstance(m.body, PlanEpoch)]
        if epoch is not None:
            bodies = [replace(epoch, mission_s=self.mission_s(now_s)), *bodies]
        actions += self.restate(bodies)
        actions.append(LogLine("resumes the mission", {"mission_s": self.mission_s(now_s)}))
        if changed := scenario_differences(self._mission, self._layers, self._replica):
            fields: dict[str, object] = {"differs_in": ", ".join(changed)}
            actions.append(LogLine("the mission is not that of the scenario file", fields))
        return actions

    def say(self, body: Body) -> Publish:
        """State the new content of an own register."""
        message = self._register_writer.say(body)
        self._replica.join(message)
        return Publish(message)

    def observe(self, theirs: Iterable[Message]) -> bool:
        """Speak above ``theirs``, statements from this seat; whether the own were below them."""
        before = self._register_writer.incarnation
        for message in theirs:
            self._register_writer.observe(message.stamp)
        return self._register_writer.incarnation != before

    def restate(self, others: Iterable[Body] = ()) -> list[Publish]:
        """State every own register anew, ``others`` taking the place of the own.

        The epoch comes first: by it others know who is in charge.
        """
        own = self._replica.messages({self._register_writer.writer})
        bodies = {_register(body): body for body in (*(m.body for m in own), *others)}
        ordered = sorted(bodies.values(), key=lambda body: not isinstance(body, PlanEpoch))
        return [self.say(body) for body in ordered]

    def repeat(self, now_s: float) -> list[Publish]:
        """What is due again by now: the epoch with its time, the brief and some of the board.

        Whoever joins asks by itself; this is for what got lost on the way, so a few
        entries at a time are enough and the bus stays quiet on large boards.
        """
        due = self._announce_at_s is not None and self._announce_at_s <= now_s
        if due or self._announce_at_s is None:
            self._announce_at_s = now_s + self._announce_s
        if not due:
            return []
        epoch = self._replica.epoch
        said = [] if epoch is None else [self.say(replace(epoch, mission_s=self.mission_s(now_s)))]
        own = list(self._replica.messages({self._register_writer.writer}))
        rest = [message for message in own if not isinstance(message.body, PlanEpoch)]
        count = min(ENTRIES_PER_ANNOUNCEMENT, len(rest))
        turn = [rest[(self._announced + k) % len(rest)] for k in range(count)]
        self._announced += count
        return said + [Publish(message) for message in turn]

    def hurry(self, now_s: float) -> None:
        """Somebody should hear at once who is in charge."""
        self._announce_at_s = now_s

    def next_deadline_s(self) -> float | None:
        """When `repeat` will next have something to say."""
        return self._announce_at_s

    def next_release_s(self) -> float | None:
        """When the next task appears in a mission that has begun."""
        if self.zero_s is None:
            return None
        return self.zero_s + self._unreleased[0][1].appears_s if self._unreleased else None


def _register(body: Body) -> tuple[type[Body], str | None]:
    """Which of the coordinator's registers ``body`` is the content of."""
    return type(body), body.task if isinstance(body, TaskEntry) else None
