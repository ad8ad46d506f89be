"""What registers say along a planned run of the field's problem, if all goes as planned."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from agent.core.decision import DecisionTurn
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.ways import task_nodes
from swarm.kernels.field import FieldRuleCode, FieldRuns, fly_lists, run_rule
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.board import TaskBoard
from swarm.protocol.field_messages import BaseSpec, ZoneSpec
from swarm.protocol.messages import Body, Message, MissionConfig, TaskEntry, UavSpec
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import AttemptResult, BaseStage, Claim, ClaimPhase, Outcome
from tests.support.builders import MISSION, epoch, message

IDLE = Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0)


@dataclass(frozen=True, slots=True)
class Moment:
    """Somebody's turn."""

    turn: DecisionTurn
    board: TaskBoard
    decision: int | None
    """Which one of the run it takes then; None: it goes home."""
    said: tuple[Message, ...]
    """All that the board knows."""


class PlannedRun:
    """A run by a rule, and what is said along it.

    Args:
        mission: what it is about.
        problem: of that mission.
        rule: by which all decide.
        sequence: UAVs by priority.
        said_rule: what the epoch says, if it is to be another one.
    """

    def __init__(
        self,
        mission: Mission,
        problem: FieldProblem,
        rule: FieldRuleCode,
        sequence: list[int],
        said_rule: str = "greedy",
    ) -> None:
        self._said_rule = said_rule
        self._mission = mission
        self._problem = problem
        self._sequence = tuple(str(problem.uav_ids[uav]) for uav in sequence)
        state = FieldState.at_start(problem, sequence)
        self._rank = state.rank
        self.runs: FieldRuns = run_rule(problem.kernel, state, rule)
        lists = self.runs.lists(problem.n_uav)
        flown = fly_lists(problem.kernel, state, lists)
        assert flown.feasible
        first = np.cumsum([0, *(len(items) for items in lists)])
        taken = [0] * problem.n_uav
        self._times_s: list[list[float]] = []
        """Of each decision, as it was flown."""
        self._of: list[list[int]] = [[] for _ in lists]
        """Decisions of each UAV."""
        for k, uav in enumerate(self.runs.uavs.tolist()):
            self._times_s.append(flown.times_s[first[uav] + taken[uav]].tolist())
            self._of[uav].append(k)
            taken[uav] += 1

    def moments(self) -> Iterator[Moment]:
        """Every turn in its order."""
        turns = [
            (float(self.runs.decided_s[k]), int(self._rank[uav]), uav, k)
            for k, uav in enumerate(self.runs.uavs.tolist())
        ]
        for uav, of in enumerate(self._of):
            end_s = self._times_s[of[-1]][3] if of else 0.0
            turns.append((end_s, int(self._rank[uav]), uav, -1))
        for now_s, _, uav, k in sorted(turns):
            made = {
                each for at_s, rank, _, each in turns if (at_s, rank) < (now_s, self._rank[uav])
            }
            yield self._moment(uav, now_s, made - {-1}, None if k < 0 else k)

    def _moment(self, uav: int, now_s: float, made: set[int], decision: int | None) -> Moment:
        problem = self._problem
        replica = Replica()
        said: list[tuple[str, Body]] = [(COORDINATOR, brief_of(self._mission))]
        said += [(COORDINATOR, body) for body in entries_of(self._mission)]
        said.append((COORDINATOR, epoch(*self._sequence, rule=self._said_rule)))
        awaited = set()
        for other in range(problem.n_uav):
            name = str(problem.uav_ids[other])
            past = [k for k in self._of[other] if k in made]
            said += [(name, outcome) for outcome in self._outcomes(past, other, now_s, uav)]
            claim = self._claim(past[-1], other, now_s) if past else IDLE
            over = bool(past) and self._times_s[past[-1]][3] <= now_s
            if not past and now_s == 0.0:
                awaited.add(name)
            if over and (len(past) == len(self._of[other]) or other == uav):
                # It goes home, or it is the one that decides.
                claim = replace(IDLE, decided_s=now_s)
                if now_s == self._times_s[past[-1]][3] and other != uav:
                    awaited.add(name)  # in this very moment it is about to find nothing
                    claim = self._freed(past, other)
            said.append((name, claim))
        messages = tuple(
            message(writer, body, counter) for counter, (writer, body) in enumerate(said, 1)
        )
        for each in messages:
            replica.join(each)
        past = [k for k in self._of[uav] if k in made]
        turn = self._turn(uav, past, now_s, awaited)
        return Moment(turn, TaskBoard(replica, MISSION), decision, messages)

    def _turn(self, uav: int, past: list[int], now_s: float, awaited: set[str]) -> DecisionTurn:
        problem = self._problem
        node, landed_at = uav, None
        if past:
            item = int(self.runs.items[past[-1]])
            if item < 0:
                node, landed_at = problem.n_uav - 1 - item, str(problem.base_ids[-1 - item])
            else:
                node = task_nodes(problem, item >> 1, backwards=bool(item & 1))[1]
        assert problem.network is not None
        east_m, north_m, up_m = problem.network.node_enu_m[node].tolist()
        name = str(problem.uav_ids[uav])
        return DecisionTurn(
            uav=name,
            now_s=now_s,
            decided_s=now_s,
            place_enu_m=(east_m, north_m, up_m),
            credible={str(other) for other in problem.uav_ids} - {name},
            awaited=awaited - {name},
            patience_s=0.5,
            excluded=(),
            sortie_end_s=math.inf if landed_at is not None else self._sortie_end_s(uav, past),
            landed_at=landed_at,
        )

    def _sortie_end_s(self, uav: int, past: list[int]) -> float:
        """Of who is in the air after those decisions."""
        for k, before in zip(past[:0:-1], past[-2::-1], strict=True):
            if self.runs.items[before] < 0:
                return self._times_s[k][0] + float(self._problem.full_s[uav])
        return float(self._problem.first_s[uav])

    def _outcomes(self, past: list[int], uav: int, now_s: float, who: int) -> Iterator[Outcome]:
        """Of tasks that are done; the last one's as the UAV's next word."""
        for k in past:
            item, end_s = int(self.runs.items[k]), self._times_s[k][3]
            if item < 0 or end_s > now_s or (k == past[-1] and end_s == now_s and uav != who):
                continue
            task = item >> 1
            backwards = bool(item & 1) if self._problem.is_line[task] else None
            name = self._problem.task_ids[task]
            yield Outcome(name, AttemptResult.DONE, 1, end_s, backwards)

    def _freed(self, past: list[int], uav: int) -> Claim:
        return self._claim(past[-1], uav, self._times_s[past[-1]][3])

    def _claim(self, k: int, uav: int, now_s: float) -> Claim:
        """What a UAV says between a decision and the next one."""
        problem, item = self._problem, int(self.runs.items[k])
        decided_s = float(self.runs.decided_s[k])
        rank = int(self._rank[uav])
        phase = ClaimPhase.PROPOSED if decided_s == now_s else ClaimPhase.HELD
        depart_s, arrive_s, begin_s, end_s = self._times_s[k]
        past = [each for each in self._of[uav] if each <= k]
        before = int(self.runs.items[past[-2]]) if len(past) > 1 else 0
        sortie_end_s = self._sortie_end_s(uav, past)
        if item < 0:
            if now_s < arrive_s:
                stage = BaseStage.APPROACHING
            else:
                stage = BaseStage.WAITING if now_s < begin_s else BaseStage.LANDED
            ready_s = end_s if stage is BaseStage.LANDED else float(self.runs.times_s[k, 3])
            return Claim(
                phase,
                None,
                decided_s,
                rank,
                ready_s,
                base=problem.base_ids[-1 - item],
                stage=stage,
                arrives_s=arrive_s,
                sortie_end_s=None if stage is BaseStage.LANDED else _finite(sortie_end_s),
            )
        task = item >> 1
        claim = Claim(
            phase,
            problem.task_ids[task],
            decided_s,
            rank,
            end_s,
            sortie_end_s=_finite(sortie_end_s),
            reversed=bool(item & 1) if problem.is_line[task] else None,
        )
        if before < 0 and now_s < depart_s:
            base = problem.base_ids[-1 - before]
            claim = replace(claim, base=base, stage=BaseStage.LANDED, departs_s=depart_s)
        return claim


def brief_of(mission: Mission) -> MissionConfig:
    """What the coordinator says of a mission in the field, in layers as by default."""
    layers = FlightLayers()
    return MissionConfig(
        horizon_s=mission.horizon_s,
        success_default=mission.success_default,
        survival_default=mission.survival_default,
        reattempt_failed=mission.reattempt_failed,
        run=1,
        origin=(47.0, 8.0, 400.0),
        uavs=tuple(
            UavSpec(
                uav.id,
                uav.position_enu_m,
                uav.speed_m_s,
                dict(uav.success),
                dict(uav.survival),
                uav.kind,
                layers.layer_m(index),
                uav.acceleration_m_s2,
                uav.airspeed_m_s,
                uav.endurance_s,
                uav.reserve_frac,
                uav.charge_frac,
            )
            for index, uav in enumerate(mission.uavs)
        ),
        bases=tuple(map(BaseSpec.of, mission.bases)),
        zones=tuple(map(ZoneSpec.of, mission.zones)),
        wind_enu_m_s=mission.wind_enu_m_s,
        zone_margin_m=mission.zone_margin_m,
        band_m=mission.band_m,
    )


def entries_of(mission: Mission) -> list[TaskEntry]:
    """The mission's tasks as its board has them."""
    return [
        TaskEntry(
            task.id,
            number,
            task.position_enu_m,
            task.value,
            task.service_s,
            task.kind,
            False,
            due_s=task.due_s,
            opens_s=task.opens_s,
            closes_s=task.closes_s,
            path_enu_m=task.path_enu_m,
            height_m=task.height_m,
        )
        for number, task in enumerate(mission.tasks)
    ]


def _finite(time_s: float) -> float | None:
    return time_s if math.isfinite(time_s) else None
