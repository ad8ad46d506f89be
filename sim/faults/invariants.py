"""What must hold of a whole fleet in virtual time, after every step and at the end.

Beside the invariants of the messages (sim.faults.message_log):

- *raises*, *never rests*: no core raises, or is busy without time passing;
- *impossible*: no agent decides anything that its state has no transition for;
- *suspects without link*: no process gives another up while its own link is down;
- *claimed twice*: once everything has been calm for `SETTLED_S`, no two living UAVs that can
  talk to each other claim one task for longer than that;
- *disagree*: and each knows what the others claim, the epoch in force and the board;
- *two coordinators*: and only one of them coordinates;
- *winners differ*: whenever two have equal registers, they see the same states and winners;
- *disobeys*: no agent that knows of it takes tasks in an aborted mission, or though the
  operator's last word to its UAV was to hold or to come home;
- *task lost*: in the end each task that was posted, or added by the operator, is done, failed,
  withdrawn, or open with no UAV able to do it that knew of it before it left, and of a mission
  that had begun, and came home of its own accord; or the operator added it, or took the zone
  over it away, too late, when the coordinator ended the mission. Who found no way there, or home,
  while somebody was lost or not heard (`sim.faults.shut_air`), or whose battery was used up in a
  hold, was not able to do it;
- *not home*: in the end every living agent has come home, as long as anybody knows of a mission;
- *too near*: no two UAVs in the air are nearer to each other than the mission's separation, less
  how far one of them may be from where it believes to be;
- in the field those of `sim.faults.field_judge`, but for batteries of UAVs whose agents were no
  longer at work, or stopped by the operator; there a task is not lost that nobody could have done;
- *miscounted*: the observer knows the visits of every UAV that left in calm, invents none, and
  counts as duplicates all that it knows of, and no more than there were.

UAVs that were cut off or died may have done what nobody could hear of, and one that forgot it
cannot tell of it later; nothing is claimed about the counting of that.
"""

from __future__ import annotations

import itertools
import traceback
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import replace

from agent.core.agent_core import IMPOSSIBLE, AgentCore
from agent.core.interface import GoTo
from agent.core.time_limits import ANOTHER_WAY
from coordinator.core.active import CoordinatorCore
from coordinator.core.standby import StandbyCore
from coordinator.mission_view.mission_state import MissionState
from sim.faults.drawn_zones import DrawnZone, ordered_anew_s
from sim.faults.field_judge import REACTION_S, Chances, FieldJudge
from sim.faults.injector import FaultInjector
from sim.faults.message_log import MessageLog, Violation
from sim.faults.out_of_hearing import LOOK_EVERY_S, OutOfHearing
from sim.faults.shut_air import ShutAir
from sim.world.closest_approach import closest_approach
from sim.world.engine import Process
from sim.world.rough_network import RoughNetwork
from sim.world.virtual_world import World
from swarm.model import Task, TaskId, Zone
from swarm.protocol.board import TaskState, holders
from swarm.protocol.events import LogLine
from swarm.protocol.messages import CommandKind, Message, MissionPhase, PlanEpoch
from swarm.protocol.operator_commands import abort_command, newest_command, zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, StatusPhase

SETTLED_S = 5.0
"""Calm for this long, the fleet must agree."""
STEPS_AT_ONCE = 3000
"""More steps of all processes without time passing are a loop."""
_LATE_S = 2.0
"""What is forgiven of windows: clocks jump, and words are late."""
_NEAR_M = 1e-3
"""What is forgiven of distances."""
TELEMETRY_S = 0.2
"""Agents hear that often where their vehicles are [s]."""
_SPENT = "its battery "
"""So begins why an agent brings its UAV home before that falls."""
_IN_FLIGHT = (StatusPhase.FLYING, StatusPhase.SERVING)


class InvariantChecker:
    """Watches one world (`sim.world.settings.WorldListener`); the first breach ends the run.

    Args:
        astray_m: how far UAVs are at most from where they believe to be [m].
    """

    _world: World
    _network: RoughNetwork
    _injector: FaultInjector

    def __init__(self, astray_m: float = 0.0) -> None:
        self._astray_m = astray_m
        self.message_log = MessageLog()
        self._lives: dict[Process, int] = {}
        self._changed_s: dict[str, float] = {}
        self._refused_s: dict[str, list[float]] = defaultdict(list)
        """By UAV: when its vehicle would not obey [s]."""
        self._used_up: set[str] = set()
        """UAVs whose battery was used up while the operator held them."""
        self._steps = 0
        self._steps_at_s = 0.0
        self._left_in_calm: set[str] = set()
        self._left_undone: dict[str, set[str]] = {}
        """By UAV that takes no further part: the tasks it knew of that were on the board."""
        self._known_at_the_end: dict[str, set[str]] = {}
        """By coordinator's process: tasks that it knew of when it first said the mission over."""
        self._zones_at_the_end: set[str] = set()
        """Zones that one of them took to be in force then."""
        self._shared_since_s: dict[tuple[Process, Process, str], float] = {}

    @property
    def broken(self) -> Violation | None:
        """The first invariant that did not hold."""
        return next(iter(self.message_log.broken), None)

    def attend(self, world: World, network: RoughNetwork, injector: FaultInjector) -> None:
        """Watch this world, which has not begun."""
        self._world, self._network, self._injector = world, network, injector
        self.shut_air = ShutAir(world, network, injector)
        self._out_of_hearing = OutOfHearing(world, network, SETTLED_S)
        self._zone_known_s: dict[str, dict[str, float]] = {}
        """By zone drawn in flight: since when each UAV's agent knows of it, or later [s]."""
        world.queue.at(LOOK_EVERY_S, self._look)

    # -- while it runs ----------------------------------------------------------------

    def said(self, process: Process, message: Message) -> None:
        """``process`` publishes ``message``."""
        now_s, message_log = self._now_s, self.message_log
        life = self._lives.setdefault(process, len(self._lives))
        self._changed_s[process.name] = now_s
        alone = self._network.is_alone(process)
        message_log.said(now_s, process.name, life, message, unheard=alone)
        self._note_what_is_left(process, message)
        self._stop_if_broken()

    def _note_what_is_left(self, process: Process, message: Message) -> None:
        """What somebody leaves undone whose word ends the mission, for itself or for all."""
        core = process.core
        match message.body:
            case Claim(phase=ClaimPhase.OUT) if isinstance(core, AgentCore):
                if process.name not in self._left_undone:
                    self._left_undone[process.name] = _on_board(core.replica)
                    self.shut_air.left(process)
            case Claim():
                self._left_undone.pop(process.name, None)
            case PlanEpoch(phase=MissionPhase.ENDED) if isinstance(
                core, CoordinatorCore | StandbyCore
            ):
                if process.name not in self._known_at_the_end:
                    self._known_at_the_end[process.name] = _on_board(core.replica)
                    self._zones_at_the_end |= {z.id for z in zones_in_force(core.replica)}
            case _:
                pass

    def stepped(self, process: Process) -> None:
        """``process`` has made a step."""
        now_s = self._now_s
        self._steps = self._steps + 1 if now_s == self._steps_at_s else 0
        self._steps_at_s = now_s
        if self._steps > STEPS_AT_ONCE:
            self._break("never rests", f"{process.name} steps on and on without time passing")
        if process.over and self._calm_for_s > SETTLED_S:
            self._left_in_calm.add(process.name)

    def raised(self, process: Process, fault: Exception) -> None:
        """The core of ``process`` has raised."""
        where = traceback.extract_tb(fault.__traceback__)[-1]
        place = f"{where.filename.rpartition('/')[2]}:{where.lineno}"
        self._break("raises", f"{process.name}: {type(fault).__name__}: {fault} ({place})")

    def refused(self, process: Process, order: GoTo) -> None:
        """The vehicle of ``process`` will not obey."""
        self._refused_s[process.name].append(self._now_s)
        if order.task is not None:
            self.message_log.refused(process.name, order.task)

    def noted(self, process: Process, note: LogLine) -> None:
        """``process`` has written a line into its log."""
        if note.text == IMPOSSIBLE:
            self._break("impossible", f"{process.name}: {note.fields}")
        if note.text == "lost":
            self.message_log.missed(process.name)
        released = note.fields.get("task") if note.text == "released" else None
        track, told = self._world.tracks.get(process.name), note.fields.get("reason")
        anew = told == ANOTHER_WAY and track is not None and track.stood_until(self._now_s)
        if released is not None and (anew or not self._can_go_on(process, str(released))):
            self.message_log.gave_up(process.name, str(released))
        if note.text == "no way" and "task" in note.fields:
            self.message_log.refused(process.name, str(note.fields["task"]))
        self.shut_air.noted(process, note)
        is_spent = note.text == "returning" and str(note.fields["reason"]).startswith(_SPENT)
        used_up = is_spent and _is_held(process)
        if used_up:
            self._used_up.add(process.name)
        if used_up or note.text == "lands where it is":
            self.message_log.gave_up(process.name, str(note.fields.get("task")))
        if note.text == "turns aside":
            self.message_log.turned_aside(self._now_s, process.name, str(note.fields["task"]))
            self._stop_if_broken()
        if note.text == "lost" and not process.linked:
            text = f"{process.name} gives {note.fields['writer']} up while its own link is down"
            self._break("suspects without link", text)

    def _can_go_on(self, process: Process, task: str) -> bool:
        """Whether constraints still allow the UAV of ``process`` the task that it leaves.

        From where its vehicle truly is, as slowly as it truly flies, on what is truly left of its
        battery, round the zones that its agent knows of. In a plain mission nothing forbids a task.
        """
        world, core, seen = self._world, process.core, self._world.seen(process.name)
        if world.mission.is_plain or seen is None or not isinstance(core, AgentCore):
            return True
        tasks = {str(each.id): each for each in (*world.mission.tasks, *self._added())}
        zones = tuple(zone.zone() for zone in zones_in_force(core.replica))
        mission = replace(world.mission, tasks=tuple(tasks.values()), zones=zones)
        flaws = self._injector.flaws
        chances = Chances(mission, world.zero_s or 0.0, slack_s=_LATE_S, flaws=flaws)
        return task not in tasks or chances.can_go_on(seen, process.name, task)

    def _look(self) -> None:
        if self._world.alive:
            self._world.queue.after(LOOK_EVERY_S, self._look)
        agents = [(p, core) for p, core in self._living() if isinstance(core, AgentCore)]
        self._note_known_zones(agents)
        if any(base.slots is not None for base in self._world.mission.bases):
            self._out_of_hearing.look()
        for process, _ in agents:
            self.shut_air.look(process)
        self._look_for_disobedience(agents)
        self._look_for_shared_tasks(agents)
        self._look_for_equal_registers(agents)
        if self._calm_for_s > SETTLED_S:
            self._look_for_disagreement(agents)
            self._look_for_two_coordinators()
        self._stop_if_broken()

    def _note_known_zones(self, agents: list[tuple[Process, AgentCore]]) -> None:
        if not self._injector.drawn:
            return
        for process, core in agents:
            for zone in zones_in_force(core.replica):
                known_s = self._zone_known_s.setdefault(zone.id, {})
                known_s.setdefault(process.name, self._now_s)

    def _look_for_disobedience(self, agents: list[tuple[Process, AgentCore]]) -> None:
        for process, core in agents:
            word = newest_command(core.replica, core.uav)
            resumed = word is None or word[1].kind is CommandKind.RESUME
            if core.claim is not None and (abort_command(core.replica) is not None or not resumed):
                kind = "abort" if word is None else word[1].kind
                self._break("disobeys", f"{process.name} is {core.phase} after {kind}")

    def _look_for_shared_tasks(self, agents: list[tuple[Process, AgentCore]]) -> None:
        now_s, shared = self._now_s, set()
        for (one, core), (other, rival) in itertools.combinations(agents, 2):
            task = core.claim.task if core.claim is not None else None
            same = rival.claim is not None and rival.claim.task == task
            if task is not None and same and self._network.joined(one, other):
                shared.add((one, other, task))
        for key in shared:
            since_s = self._shared_since_s.setdefault(key, now_s)
            if min(now_s - since_s, self._calm_for_s) > SETTLED_S:
                one, other, task = key
                text = f"{one.name} and {other.name} both claim {task} since {since_s:.2f} s"
                self._break("claimed twice", text)
        for key in self._shared_since_s.keys() - shared:
            del self._shared_since_s[key]

    def _look_for_equal_registers(self, agents: list[tuple[Process, AgentCore]]) -> None:
        known = {process: list(core.replica.messages()) for process, core in agents}
        for (one, core), (other, peer) in itertools.combinations(agents, 2):
            mine, its = core.replica, peer.replica
            if mine.claims == its.claims and known[one] == known[other]:
                states = _task_states(core), _task_states(peer)
                if holders(mine.claims) != holders(its.claims) or states[0] != states[1]:
                    text = f"{one.name} and {other.name} know the same and see it differently"
                    self._break("winners differ", text)

    def _look_for_disagreement(self, agents: list[tuple[Process, AgentCore]]) -> None:
        settled_s = self._now_s - SETTLED_S
        for (one, core), (other, peer) in itertools.permutations(agents, 2):
            quiet = self._changed_s.get(other.name, 0.0) < settled_s
            if quiet and self._network.joined(one, other):
                known = core.replica.claims.get(other.name)
                if known != peer.replica.claims.get(other.name):
                    self._break("disagree", f"{one.name} takes {other.name} to claim {known}")

    def _look_for_two_coordinators(self) -> None:
        at_work = [process for process, core in self._living() if _coordinates(core)]
        for one, other in itertools.combinations(at_work, 2):
            if self._network.joined(one, other):
                self._break("two coordinators", f"{one.name} and {other.name} both coordinate")

    # -- in the end -------------------------------------------------------------------

    def conclude(self) -> None:
        """Judge what has come of it."""
        if self.broken is None:
            self._look_for_the_missing()
        if self.broken is None:
            self._look_for_lost_tasks()
        if self.broken is None:
            self._look_at_the_count()
        if self.broken is None and not self._world.mission.is_plain:
            self._look_at_the_flights()
            self._look_at_the_distances()

    def _look_for_the_missing(self) -> None:
        living = [(process, core) for process, core in self._living() if process.writer is not None]
        left = [process.name for process, core in living if isinstance(core, AgentCore)]
        # Who has forgotten all and finds nobody who knows of a mission waits for one.
        if left and any(core.replica.brief is not None for _, core in living):
            self._break("not home", f"{', '.join(left)} still there")

    def _look_for_lost_tasks(self) -> None:
        message_log, world = self.message_log, self._world
        settled = message_log.done | message_log.failed | message_log.withdrawn
        home = [
            uav
            for uav in world.mission.uavs
            if world.finished.get(uav.id) == 0
            and not message_log.sent_home(uav.id)
            and uav.id not in self._used_up | self.shut_air.landed
        ]
        to_do = {
            uav: self._left_undone.get(uav, _on_board(core.replica))
            for uav, core in world.agents.items()
            if core.replica.epoch is not None
        }
        added = self._added()
        added_ids = {str(task.id) for task in added}
        known_at_the_end = set[str]().union(*self._known_at_the_end.values())
        tasks = [task for task in world.mission.tasks if task.id in message_log.posted]
        for task in (*tasks, *added):
            unheard = task.id in added_ids and task.id not in known_at_the_end
            if task.id in settled or (message_log.ended and unheard):
                continue
            able = [
                str(uav.id)
                for uav in home
                if world.mission.success(uav, task) > 0.0
                and task.id in to_do.get(uav.id, ())
                and (uav.id, task.id) not in world.refuses
                and not self.shut_air.keeps_from(uav.id, task.id)
            ]
            if able and not world.mission.is_plain:
                able = self._able_in_field(able, task)
            if able:
                text = f"{task.id} is open, though {', '.join(able)} could have done it"
                self._break("task lost", text)

    def _able_in_field(self, uavs: list[str], task: Task) -> list[str]:
        """Those of ``uavs`` that could have done ``task`` when they were sent home."""
        world, able = self._world, list[str]()
        known = {each.id: each for each in (*world.mission.tasks, task)}
        for uav, seen in world.flight_log.last_seen.items():
            if uav in uavs:
                zones = (*world.mission.zones, *self._drawn_over(uav, seen.at_s))
                mission = replace(world.mission, tasks=tuple(known.values()), zones=zones)
                flaws = [flaw for flaw in self._injector.flaws if flaw.since_s <= seen.at_s]
                blocked = self._blocked(seen.at_s)
                chances = Chances(mission, world.zero_s or 0.0, blocked=blocked, flaws=flaws)
                able += chances.could_do({uav: seen}, [task.id]).get(task.id, [])
        return able

    def _added(self) -> list[Task]:
        """What the operator has added, and no coordinator posted."""
        posted, ordered = self.message_log.posted, self.message_log.ordered
        return [
            Task(TaskId(task), order.position_enu_m, 0.0)
            for task, order in ordered.items()
            if task not in posted
        ]

    def _blocked(self, at_s: float) -> set[str]:
        """Bases on all of whose slots lost UAVs stood then, until a person takes them away."""
        stands = Counter(
            stay.base
            for stay in self._world.flight_log.stays
            if stay.begin_s <= at_s < stay.end_s and self.shut_air.is_lost(stay.uav)
        )
        return {
            base.id
            for base in self._world.mission.bases
            if base.slots is not None and stands[base.id] >= base.slots
        }

    def _drawn_over(self, uav: str, at_s: float) -> Iterator[Zone]:
        """Zones drawn in flight that may have kept ``uav`` from what it left undone then."""
        last = {zone.id for zone in zones_in_force(self._world.agents[uav].replica)}
        last |= self._zones_at_the_end
        for drawn in self._injector.drawn:
            if drawn.since_s <= at_s <= drawn.until_s + SETTLED_S or drawn.zone.id in last:
                yield drawn.zone

    def _look_at_the_flights(self) -> None:
        zones = [DrawnZone(zone) for zone in self._world.mission.zones]
        for drawn in self._injector.drawn:
            known_s = self._zone_known_s.get(drawn.zone.id, {})
            heed = {
                uav: ordered_anew_s(s, self._refused_s[uav], REACTION_S)
                for uav, s in known_s.items()
                if uav not in self._injector.left_alone
            }
            zones.append(replace(drawn, known_s=heed))
        flaws = self._injector.flaws
        known = {"stale_s": TELEMETRY_S, "astray_m": self._astray_m}
        unheard = self._out_of_hearing.all_along
        judge = FieldJudge(self._world, _LATE_S, flaws=flaws, unheard=unheard, **known)
        for invariant, text in judge.complaints(zones):
            uav = text.partition(" ")[0]
            if not (invariant == "fell" and uav in self._injector.left_alone):
                self._break(invariant, text)

    def _look_at_the_distances(self) -> None:
        asked_m = self._world.mission.separation_m
        nearest = None if asked_m is None else closest_approach(self._world.tracks)
        if nearest is None or asked_m is None:
            return
        least_m = asked_m - self._astray_m
        if nearest.distance_m < least_m - _NEAR_M:
            one, other = nearest.uavs
            text = (
                f"{one} and {other} are {nearest.distance_m:.2f} m from each other at "
                f"{nearest.at_s:.2f} s, not {least_m:g} m"
            )
            self._break("too near", text)

    def _look_at_the_count(self) -> None:
        mission_state, true = self._world.mission_state, self.message_log.visits
        outcomes = mission_state.replica.outcomes.items()
        known = {k: o.completed_s for k, o in outcomes if o.result is AttemptResult.DONE}
        for key, completed_s in known.items():
            if completed_s not in true[key]:
                self._break("miscounted", f"{key[0]} never visited {key[1]} at {completed_s:.3f} s")
        for uav, task in sorted(true.keys() - known.keys()):
            if uav in self._left_in_calm and not self._is_forgotten(uav, task):
                self._break("miscounted", f"nobody knows that {uav} visited {task}")
        told = mission_state.result().duplicate_visits
        least, most = len(known) - len({task for _, task in known}), self.message_log.duplicates
        if not least <= told <= most:
            self._break("miscounted", f"{told} duplicates told, not {least} to {most}")

    def _is_forgotten(self, uav: str, task: str) -> bool:
        """Whether an earlier life did ``task``, nobody heard of it, and the last does not know."""
        last_life = self._lives.get(self._world.processes[uav])
        return self.message_log.unheard.get((uav, task), last_life) != last_life

    # -- pieces -----------------------------------------------------------------------

    def _living(
        self,
    ) -> Iterator[tuple[Process, AgentCore | CoordinatorCore | StandbyCore | MissionState]]:
        """Processes that run, or will go on, with their cores."""
        for process in self._world.processes.values():
            if not process.over and process not in self._injector.held_for_good:
                core = process.core
                if isinstance(core, AgentCore | CoordinatorCore | StandbyCore | MissionState):
                    yield process, core

    @property
    def _calm_for_s(self) -> float:
        return self._injector.calm_for_s

    @property
    def _now_s(self) -> float:
        return self._world.queue.now_s()

    def _break(self, invariant: str, text: str) -> None:
        self.message_log.broken.append(Violation(self._now_s, invariant, text))
        self._stop_if_broken()

    def _stop_if_broken(self) -> None:
        if self.broken is not None:
            self._world.queue.stop()


def _task_states(core: AgentCore) -> dict[str, TaskState]:
    """What the agent itself makes of its registers."""
    return core._mission_view.board.states  # noqa: SLF001 - a look inside is the point


def _on_board(replica: Replica) -> set[str]:
    return {task for task, entry in replica.board.items() if not entry.withdrawn}


def _is_held(process: Process) -> bool:
    """Whether the operator's last word to the UAV of ``process`` was to hold."""
    core = process.core
    word = newest_command(core.replica, core.uav) if isinstance(core, AgentCore) else None
    return word is not None and word[1].kind is CommandKind.HOLD


def _coordinates(core: object) -> bool:
    if isinstance(core, StandbyCore):
        return core.coordinator is not None
    return isinstance(core, CoordinatorCore)
