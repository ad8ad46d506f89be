"""What is told to a page: whole at first, then what has changed; README.md has the words.

`Feed.look` takes in what its source knows, `Feed.frame` tells it to a client that has seen all up
to some look, however long ago; clients that are in step share one text.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import takewhile

import swarm
from coordinator.dashboard.baseline import Baseline, baseline_of
from coordinator.dashboard.row_values import (
    approach_values,
    choice_values,
    conflict_values,
    mission_text,
    rounded,
    uav_values,
    ways_values,
)
from coordinator.dashboard.rows import AppendOnlyTable, RowTable, as_text
from coordinator.dashboard.source import DashboardSource
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.results import Progress, progress_of
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, task_stands
from coordinator.mission_view.uav_state import FleetStates
from coordinator.mission_view.wording import (
    clean,
    why_left_out,
)
from swarm.allocation.problem import Problem
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.messages import MissionConfig
from swarm.protocol.operator_commands import (
    abort_command,
    in_force,
    zone_edits,
    zones_in_force,
)

PROTOCOL = 2
_STORY, _CHOICES, _CURVE, _COMMANDS = 500, 300, 600, 200
_MEASURES = 8
"""Flights of which it is remembered how they began."""
_QUIET_LOOKS = 5
"""A row of which only the silence has grown is sent after so many looks."""


@dataclass(frozen=True, slots=True)
class PageSettings:
    """What the page is told of itself."""

    token: bool = False
    tiles: str | None = None
    tiles_credit: str = ""


class Feed:
    """Tells clients what a source knows."""

    def __init__(self, source: DashboardSource, display: PageSettings) -> None:
        self._source = source
        self._display = display
        self.seq = 0
        """Number of the newest look."""
        self.mission: str | None = None
        """The ``mission`` message; None while there is none."""
        self.mission_seq = 0
        self._whole_since = 1
        """Who has seen nothing since that look is told everything."""
        self._mission_state: MissionState | None = None
        self._brief: MissionConfig | None = None
        self._head: dict[str, object] = {}
        self._uavs, self._tasks = RowTable("id", but="silent_s"), RowTable("id")
        self._lists, self._zones = RowTable("uav"), RowTable("id")
        self._story = AppendOnlyTable(_STORY)
        self._told = 0
        self._choices = AppendOnlyTable(_CHOICES)
        self._chosen = 0
        self._last_choice: object = None
        self._progress: Progress | None = None
        self._progress_version = (-1, -1)
        self._curve_seqs: list[int] = []
        """As of which look each point is there."""
        self._measures: dict[tuple[str, int], Baseline] = {}
        """By mission and run."""
        self._commands = RowTable("n", keep=_COMMANDS)
        self._frames: dict[int | None, str] = {}
        """Of the newest look, by what the client has seen."""

    # -- what is told -----------------------------------------------------------------

    def hello(self) -> str:
        """The first message to everyone."""
        player = self._source.player
        return as_text(
            {
                "type": "hello",
                "protocol": PROTOCOL,
                "version": swarm.__version__,
                "kind": "live" if player is None else "replay",
                "commands": self._source.orders is not None,
                "token": self._display.token,
                "tiles": self._display.tiles,
                "tiles_credit": self._display.tiles_credit,
                "duration_s": None if player is None else player.duration_s,
            }
        )

    def frame(self, since: int | None) -> str:
        """All that has changed after look number ``since``; everything for None."""
        if since is not None and since < self._whole_since:
            since = None
        if since not in self._frames:
            self._frames[since] = self._frame(since)
        return self._frames[since]

    @property
    def progress(self) -> Progress | None:
        """What had been done at the newest look."""
        return self._progress

    @property
    def measure(self) -> Baseline | None:
        """What the mission is measured by; None where nothing is known of its beginning."""
        if self._mission_state is None or self._brief is None:
            return None
        return self._measures.get((self._mission_state.mission.name, self._brief.run))

    def _frame(self, since: int | None) -> str:
        after = -1 if since is None else since
        head = as_text({"type": "frame", "whole": since is None, "seq": self.seq, **self._head})
        parts = {
            "uavs": self._uavs.after(after),
            "tasks": self._tasks.after(after),
            "lists": self._lists.after(after),
            "zones": self._zones.after(after),
            "story": self._story.after(after),
            "choices": self._choices.after(after),
            "objective_curve": self._curve_after(after),
            "commands": self._commands.after(after),
        }
        body = ",".join(f'"{name}":[{",".join(rows)}]' for name, rows in parts.items())
        return f"{head[:-1]},{body}}}"

    def _curve_after(self, seq: int) -> list[str]:
        if self._progress is None:
            return []
        curve = self._progress.curve
        first = next((n for n, at in enumerate(self._curve_seqs) if at > seq), len(curve))
        points = curve[first:]
        step = -(-len(points) // _CURVE) or 1
        thinned = points[::-step][::-1]  # the newest is always there
        return [f"[{time_s:.3f},{objective:.4f}]" for time_s, objective in thinned]

    # -- what is known ----------------------------------------------------------------

    def look(self) -> None:
        """Take in what the source knows now."""
        self.seq += 1
        self._frames.clear()
        now_s = self._source.now_s()
        for given in list(self._source.commands)[-_COMMANDS:]:
            row: dict[str, object] = {"n": given.n, "text": clean(given.text)}
            row |= {"state": given.state, "result": clean(given.result)}
            self._commands.put(row, self.seq)
        mission_state = self._source.mission_state
        brief = None if mission_state is None else mission_state.replica.brief
        if mission_state is not self._mission_state or brief is not self._brief:
            self._begin(mission_state, brief)
        self._head = self._head_of(mission_state, now_s)
        if mission_state is None:
            return
        news = mission_state.told_since(self._told)
        for number, happening in enumerate(news, mission_state.told - len(news) + 1):
            row = {
                "n": number,
                "mission_s": rounded(happening.mission_s, 3),
                "text": clean(happening.text),
                "trouble": happening.is_trouble,
            }
            self._story.add(as_text(row), self.seq)
        self._told = mission_state.told
        self._look_at_choices(mission_state)
        if brief is not None:
            self._look_at_uavs(mission_state, brief, now_s)
            self._look_at_zones(mission_state)

    def _begin(self, mission_state: MissionState | None, brief: MissionConfig | None) -> None:
        """Another mission, or the same in other words: everything is told anew."""
        if mission_state is not self._mission_state:
            self._story.clear()
            self._choices.clear()
            self._told, self._chosen, self._last_choice = 0, 0, None
        self._mission_state, self._brief = mission_state, brief
        for table in (self._uavs, self._tasks, self._lists, self._zones):
            table.clear()
        self._progress, self._progress_version, self._curve_seqs = None, (-1, -1), []
        self._whole_since, self.mission_seq = self.seq, self.seq
        self.mission = None
        if mission_state is not None and brief is not None:
            self.mission = mission_text(mission_state.mission.name, brief)

    def _look_at_choices(self, mission_state: MissionState) -> None:
        """Take in those that have come since: the observer forgets old ones."""
        new = list(
            takewhile(lambda told: told is not self._last_choice, reversed(mission_state.choices))
        )
        for told in reversed(new):
            self._chosen += 1
            uav, _, choice = told
            self._choices.add(as_text(choice_values(self._chosen, uav, choice)), self.seq)
            self._last_choice = told

    def _head_of(self, mission_state: MissionState | None, now_s: float) -> dict[str, object]:
        head: dict[str, object] = {"mission_s": None, "phase": None, "link": self._source.link}
        epoch = plan = None
        counts = dict.fromkeys((TaskState.OPEN.value, TAKEN, LEFT_OUT, *list(TaskState)[1:]), 0)
        dropped = Counter[str]()
        present = set[str]()
        if mission_state is not None and mission_state.replica.brief is not None:
            self._look_at_tasks(mission_state, mission_state.replica.brief, counts)
            epoch = mission_state.replica.epoch
            plan = self._look_at_plan(mission_state)
            present = mission_state.present
            dropped = sum(mission_state.dropped.values(), dropped)
            head["mission_s"] = rounded(mission_state.mission_s(now_s), 3)
            head["phase"] = mission_state.phase
        fleet = () if self._brief is None else (uav.id for uav in self._brief.uavs)
        player = self._source.player
        return head | {
            "epoch": None if epoch is None else epoch.number,
            "reason": "" if epoch is None else clean(epoch.reason),
            "rule": None if epoch is None else epoch.rule,
            "sequence": [] if epoch is None else epoch.sequence,
            "objective": rounded(0.0 if self._progress is None else self._progress.objective, 4),
            "plan": {
                "objective": None if plan is None else rounded(plan.objective, 4),
                "bound": None if plan is None else rounded(plan.bound, 4),
            },
            "coordinator": COORDINATOR in present,
            "aborted": mission_state is not None
            and abort_command(mission_state.replica) is not None,
            "nearest": {
                "now": None
                if mission_state is None
                else approach_values(mission_state.nearest_now(now_s)),
                "so_far": None if mission_state is None else approach_values(mission_state.nearest),
            },
            "conflicts": []
            if mission_state is None
            else [conflict_values(each) for each in mission_state.conflicts(now_s)],
            "counts": counts,
            "dropped": dict(dropped.most_common()),
            "dropped_here": dict(self._source.dropped),
            "others": sorted(present - {COORDINATOR, *fleet}),
            "recording": None
            if player is None
            else {
                "t_s": rounded(player.state.t_s, 2),
                "playing": player.state.playing,
                "speed": player.state.speed,
            },
        }

    def _look_at_plan(self, mission_state: MissionState) -> Baseline | None:
        measure = self.measure
        if measure is None and self._brief is not None:
            measure = baseline_of(mission_state.replica, mission_state.mission.name)
            if measure is not None:
                self._measures[mission_state.mission.name, self._brief.run] = measure
                if len(self._measures) > _MEASURES:
                    self._measures.pop(next(iter(self._measures)))
        return measure

    def _look_at_tasks(
        self, mission_state: MissionState, brief: MissionConfig, counts: dict[str, int]
    ) -> None:
        replica, board = mission_state.replica, mission_state.board
        version = replica.board_version, replica.task_version
        problem = board.problem
        if problem is not None and version != self._progress_version:
            self._look_at_progress(problem, mission_state)
            self._progress_version = version
        completed = {} if self._progress is None else self._progress.completed
        holders, left_out = mission_state.holders, mission_state.left_out
        for task, state in board.states.items():
            holder = holders.get(task)
            done = completed.get(task)
            taken, why = holder is not None, left_out.get(task)
            counts[task_stands(state, taken=taken, left_out=why is not None)] += 1
            entry = replica.board[task]
            self._tasks.put(
                {
                    "id": task,
                    "position": entry.position_enu_m,
                    "value": entry.value,
                    "service_s": entry.service_s,
                    "kind": entry.kind,
                    "path": entry.path_enu_m,
                    "opens_s": entry.opens_s,
                    "closes_s": entry.closes_s,
                    "due_s": entry.due_s,
                    "height_m": entry.height_m,
                    "state": state,
                    "taken": taken,
                    "left_out": why,
                    "why": None if why is None else why_left_out(why),
                    "uav": holder if done is None else done[0],
                    "completed_s": None if done is None else rounded(done[1], 3),
                    "by": "scenario" if replica.ordered(task) is None else "operator",
                },
                self.seq,
            )
        epoch = replica.epoch
        planned = {} if epoch is None else epoch.routes
        flown = {} if self._progress is None else self._progress.flown
        ways = mission_state.ways(self._source.now_s())
        for uav in brief.uavs:
            row: dict[str, object] = {
                "uav": uav.id,
                "planned": planned.get(uav.id, ()),
                "flown": tuple(flown.get(uav.id, ())),
            }
            if uav.id in ways:
                row["ways"] = ways_values(ways[uav.id])
            self._lists.put(row, self.seq)

    def _look_at_progress(self, problem: Problem, mission_state: MissionState) -> None:
        before = [] if self._progress is None else self._progress.curve
        entries = mission_state.replica.board.values()
        due_s = {entry.task: entry.due_s for entry in entries if entry.due_s is not None}
        self._progress = progress_of(problem, mission_state.replica.outcomes, due_s)
        curve = self._progress.curve
        if curve[: len(before)] != before:
            # Somebody has told late of what was done early: the page draws it all again.
            self._whole_since, before = self.seq, []
        self._curve_seqs[len(before) :] = [self.seq] * (len(curve) - len(before))

    def _look_at_uavs(
        self, mission_state: MissionState, brief: MissionConfig, now_s: float
    ) -> None:
        commands = in_force(mission_state.replica)
        states = FleetStates(mission_state, now_s)
        for uav in brief.uavs:
            command = commands.get(uav.id)
            kind = None if command is None else command.kind
            row = uav_values(states.of(uav.id), kind, self._source.speedup)
            self._uavs.put(row, self.seq)
            self._uavs.touch(row, self.seq, _QUIET_LOOKS)

    def _look_at_zones(self, mission_state: MissionState) -> None:
        replica = mission_state.replica
        edits = zone_edits(replica)
        drawn = {zone.id: zone for zone in zones_in_force(replica)}
        gone = {name: edit.zone for name, edit in edits.items() if edit.withdrawn}
        for name, zone in (gone | drawn).items():
            row = {
                "id": name,
                "polygon": zone.polygon_enu_m,
                "holes": zone.holes_enu_m,
                "floor_m": zone.floor_m,
                "ceiling_m": zone.ceiling_m,
                "inclusive": zone.inclusive,
                "by": "operator" if name in edits else "scenario",
                "withdrawn": name not in drawn,
            }
            self._zones.put(row, self.seq)
