"""Registers of a mission that runs, as the coordinator's replica holds them."""

from __future__ import annotations

from coordinator.planner.online import Situation
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.messages import Body, MissionPhase, TaskEntry
from swarm.protocol.registers import Replica
from tests.support.builders import IDLE, MISSION, brief_of, entries_of, epoch, message


class RunningMission:
    """``mission`` as told on the bus: everybody is airborne, idle and heard of.

    Args:
        mission: its tasks, pop-ups excepted, are on the board.
    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self.replica = Replica()
        self.board = TaskBoard(self.replica, MISSION)
        self.credible = {str(uav.id) for uav in mission.uavs}
        self._said = 0
        self.say(COORDINATOR, brief_of(mission))
        for task, entry in zip(mission.tasks, entries_of(mission), strict=True):
            if task.appears_s == 0.0:
                self.say(COORDINATOR, entry)
        self.say(COORDINATOR, epoch(*sorted(self.credible), phase=MissionPhase.RUNNING))
        for uav in sorted(self.credible):
            self.say(uav, IDLE)

    def say(self, writer: str, body: Body) -> RunningMission:
        self._said += 1
        self.replica.join(message(writer, body, self._said))
        return self

    def post(self, entry: TaskEntry) -> RunningMission:
        return self.say(COORDINATOR, entry)

    def lose(self, uav: str) -> RunningMission:
        self.credible.discard(uav)
        return self

    def at(self, mission_s: float) -> Situation:
        situation = Situation.of(self.board, self.credible, mission_s)
        assert situation is not None
        return situation
