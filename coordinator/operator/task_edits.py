"""A task that the operator adds or withdraws: what is to be said, and what has come of it.

An edit is a register like any other, so it has arrived where somebody's answer shows it: everyone
who is there is asked until all have confirmed it. Whoever is out of reach learns of it later from
those who know.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, fields, replace
from statistics import median
from typing import Final

from coordinator.core.publication import task_entry_of
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.wording import listed
from coordinator.operator.commands import RequestHandler, RequestResult, RequestVerdict
from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84
from swarm.model.ids import ID_RULE, valid_id
from swarm.protocol.board import TaskState
from swarm.protocol.encoding import FIELD_DEFAULTS
from swarm.protocol.fields import MAX_COUNT, Point
from swarm.protocol.messages import Message, MissionConfig, TaskEdit, TaskEntry
from swarm.protocol.timing import Timing

FARTHEST_M: Final = 1e8
MOST_VALUE: Final = 1e12
LONGEST_S: Final = 1e9
"""As far as a message can say it: `swarm.protocol.fields`."""
MOST_POINTS: Final = 120
"""Of a line: as many as a message has room for, beside the longest of everything else."""
OWN_PREFIX: Final = "op"
"""Of ids that are not chosen by hand. They differ from a scenario's: the next free one in its
manner might be that of a task which is yet to appear, and this one would take its place."""


@dataclass(frozen=True, slots=True)
class Wgs84:
    """A place on the earth.

    Raises:
        ValueError: there is no such place, or it is too high.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float | None = None
    """Height above mean sea level [m]; None for that of the mission's origin."""

    def __post_init__(self) -> None:
        _require("latitude", self.lat_deg, -90.0, 90.0)
        _require("longitude", self.lon_deg, -180.0, 180.0)
        if self.alt_m is not None:
            _require("altitude", self.alt_m, -1e7, 1e7)

    def enu_m(self, origin: Origin) -> Point:
        """The same place in the frame of the mission [m; east, north, up]."""
        alt_m = origin.alt_m if self.alt_m is None else self.alt_m
        return enu_from_wgs84(origin, self.lat_deg, self.lon_deg, alt_m)


@dataclass(frozen=True, slots=True)
class NewTask:
    """A task to be added.

    Raises:
        ValueError: something is out of bounds; says what, and what would be right.
    """

    place: Point | Wgs84 | None
    """[m; east, north, up from the mission's origin], or on the earth; None of a line."""
    task: str | None = None
    """Id; None for the next free one."""
    value: float | None = None
    """m_i of eq. 1; None for the median of the board's, 1 while that is empty."""
    service_s: float = 0.0
    kind: str | None = None
    reason: str = ""
    due_s: float | None = None
    """Mission time by which it ends, or it is worth nothing [s]."""
    opens_s: float = 0.0
    """Mission time before which work on the spot does not begin [s]."""
    closes_s: float | None = None
    """Mission time after which work on the spot does not begin [s]."""
    path: tuple[Point | Wgs84, ...] = ()
    """Points of a line, as places are given; empty of a place."""
    height_m: float | None = None
    """Where it is flown [m above the mission's origin]; None: in the UAV's own layer."""

    def __post_init__(self) -> None:
        if (self.place is None) == (not self.path) or len(self.path) == 1:
            raise ValueError("a task has either a place, or a line of two points or more")
        for place in self.path if self.place is None else (self.place,):
            for metres in () if isinstance(place, Wgs84) else place:
                _require("position", metres, -FARTHEST_M, FARTHEST_M)
        if self.value is not None:
            _require("value", self.value, 0.0, MOST_VALUE)
        _require("time on the spot", self.service_s, 0.0, LONGEST_S)
        if self.height_m is not None:
            _require("height", self.height_m, -FARTHEST_M, FARTHEST_M)
        limits = (("due", self.due_s), ("opening", self.opens_s), ("closing", self.closes_s))
        for what, time_s in limits:
            if time_s is not None:
                _require(f"{what} time", time_s, 0.0, LONGEST_S)
        if self.closes_s is not None and self.closes_s < self.opens_s:
            raise ValueError(f"it closes at {self.closes_s:g} s, before it opens")
        if self.due_s is not None and self.due_s <= self.opens_s:
            raise ValueError(f"it is due by {self.due_s:g} s, before it opens")
        if len(self.path) > MOST_POINTS:
            raise ValueError(
                f"its line has {len(self.path)} points, and a message has room for {MOST_POINTS}"
            )
        for what, text in (("id", self.task), ("kind", self.kind)):
            if text is not None and not valid_id(text):
                raise ValueError(f"{what} {text!r} is not {ID_RULE}")

    def __str__(self) -> str:
        return "add a task" if self.task is None else f"add task {self.task}"


@dataclass(frozen=True, slots=True)
class TaskWithdrawal:
    """A task to be taken off the board."""

    task: str
    reason: str = ""

    def __str__(self) -> str:
        return f"withdraw task {self.task}"


class TaskEditHandler(RequestHandler[NewTask | TaskWithdrawal, TaskEdit]):
    """One task order, and what comes of it."""

    def __init__(
        self,
        wish: NewTask | TaskWithdrawal,
        mission_state: MissionState,
        timing: Timing,
        patience_s: float,
        given_s: float | None = None,
    ) -> None:
        super().__init__(wish, mission_state, patience_s)
        self._given_s = given_s
        """Mission time at which it was given [s]; None before the start."""
        self.entry: TaskEdit | None = None
        """What is said; None when nothing could be."""
        self._look_s = 2.0 * timing.patience_s
        """How long to look for who takes a new task, once all know of it."""
        self._look_until_s = math.inf

    # -- what to say --------------------------------------------------------------------

    def body(self, brief: MissionConfig) -> TaskEdit | RequestVerdict:
        """What to say; or why it cannot be said."""
        if self._is_over:
            return RequestVerdict.bad("the mission has ended: nothing is taken up any more")
        if isinstance(self._wish, NewTask):
            found = self._addition(self._wish, brief)
        else:
            found = self._withdrawal(self._wish)
        if isinstance(found, RequestVerdict):
            return found
        self.entry = task_edit_of(found, brief.run, self._wish.reason)
        return self.entry

    def _addition(self, wish: NewTask, brief: MissionConfig) -> TaskEntry | RequestVerdict:
        board, scenario = self._mission_state.replica.board, self._in_scenario
        if wish.task is not None and (wish.task in board or wish.task in scenario):
            states = self._mission_state.board.states
            state = states[wish.task].value if wish.task in board else "yet to appear"
            text = f"{wish.task} is {state}: give another id, or none"
            return RequestVerdict(RequestResult.TAKEN_ID, text)
        for what, limit_s in (("due by", wish.due_s), ("closed from", wish.closes_s)):
            if limit_s is not None and limit_s <= (self._given_s or 0.0):
                past = f"{limit_s:g} s, and the mission is at {self._given_s or 0.0:.1f} s"
                return RequestVerdict.bad(f"it would be {what} {past}")
        values = [entry.value for entry in board.values() if not entry.withdrawn]
        origin = Origin(*brief.origin)
        places = wish.path if wish.place is None else (wish.place,)
        points = tuple(
            place.enu_m(origin) if isinstance(place, Wgs84) else place for place in places
        )
        return TaskEntry(
            task=wish.task or next_id(self._used_ids),
            number=self._next_number,
            position_enu_m=points[0],
            value=wish.value if wish.value is not None else median(values) if values else 1.0,
            service_s=wish.service_s,
            kind=wish.kind,
            withdrawn=False,
            due_s=wish.due_s,
            opens_s=wish.opens_s,
            closes_s=wish.closes_s,
            path_enu_m=points if wish.path else (),
            height_m=wish.height_m,
        )

    def _withdrawal(self, wish: TaskWithdrawal) -> TaskEntry | RequestVerdict:
        board = self._mission_state.replica.board
        entries = {
            task.id: task_entry_of(task, number)
            for number, task in enumerate(self._mission_state.mission.tasks)
        } | board
        entry, state = entries.get(wish.task), self._mission_state.board.states.get(wish.task)
        if entry is None:
            return RequestVerdict(
                RequestResult.UNKNOWN_TASK,
                f"the board holds {listed(sorted(board), 12) or 'no task'}",
            )
        if state in (TaskState.DONE, TaskState.WITHDRAWN):
            return RequestVerdict.bad(f"{wish.task} is {state} already")
        return replace(entry, withdrawn=True)

    # -- what comes of it ---------------------------------------------------------------

    def apart(self, said: Message) -> TaskEdit | None:
        """Our task under another id, if another operator's new one has come under the same.

        That happens to who adds tasks at the same moment. Theirs counts, as it has the greater
        stamp; ours moves on, as nobody has chosen its id. None if that is not so: what
        somebody has made of our own task since is their word about it.
        """
        ours, known = self.entry, self._mission_state.replica.known(said)
        if not isinstance(self._wish, NewTask) or self._wish.task is not None:
            return None
        if ours is None or known is None or known.stamp == said.stamp:
            return None
        theirs = known.body
        if not isinstance(theirs, TaskEdit) or theirs.withdrawn:
            return None
        if theirs.position_enu_m == ours.position_enu_m:
            return None
        self.entry = replace(ours, task=next_id(self._used_ids), number=self._next_number)
        return self.entry

    def next_deadline_s(self) -> float | None:
        """When `judge` may find that it has looked for long enough."""
        return None if math.isinf(self._look_until_s) else self._look_until_s

    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        order, known = self.entry, self._mission_state.replica.known(said)
        if order is None or known is None:
            return None
        if known.stamp != said.stamp:
            other = known.body
            gone = isinstance(other, TaskEdit) and other.withdrawn
            did = f"{'withdrawn' if gone else 'changed'} {order.task}"
            return RequestVerdict.bad(f"another operator has {did} meanwhile")
        if self._is_over and (verdict := self._in_the_end(order)) is not None:
            return verdict
        silent = sorted(self._expected - self.known_to)
        everyone = not silent and bool(self.known_to)
        if not (everyone or late):
            self._look_until_s = math.inf
            return None
        if not self.known_to:
            text = f"nobody has confirmed it within {self._patience_s:g} s"
            return RequestVerdict.bad(f"{order.task}: {text}")
        verdict = self._gone(order) if order.withdrawn else self._taken(order, now_s, late)
        if verdict is None and late:
            text = ", ".join(self._claimants)
            return RequestVerdict.bad(f"{text} still claims {order.task}")
        if verdict is None or not silent:
            return verdict
        unsure = f"{', '.join(silent)} {'have' if len(silent) > 1 else 'has'} not confirmed it yet"
        return RequestVerdict(verdict.result, f"{verdict.text}; {unsure}")

    def _in_the_end(self, order: TaskEdit) -> RequestVerdict | None:
        """What is told when the mission has ended, maybe for what was ordered."""
        if order.withdrawn:
            return self._gone(order)
        if self._mission_state.board.states.get(order.task) is TaskState.DONE:
            return RequestVerdict.good(f"{order.task} was added and is done")
        text = f"the mission has ended meanwhile: nothing more comes of {order.task}"
        return RequestVerdict.bad(text)

    def _taken(self, order: TaskEdit, now_s: float, late: bool) -> RequestVerdict | None:
        """What is told of a task that is on the board; None to look a little longer."""
        state, uav = self._mission_state.board.states.get(order.task), self.uav
        mission_s = self._mission_state.mission_s(now_s)
        somebody_can = self._able(self._expected, mission_s)
        if uav is None and state is TaskState.OPEN and somebody_can and not late:
            if math.isinf(self._look_until_s):
                self._look_until_s = now_s + self._look_s
            if now_s < self._look_until_s:
                return None
        verdict, what = RequestVerdict.good, "nobody has taken it yet"
        if uav is not None:
            what = f"{uav} flies there"
        elif state is not TaskState.OPEN:
            what = f"it is {state}"
        elif not self._able(self._fleet):
            what = "but no UAV is capable of it: the success of each there is 0"
        elif not self._able(self._fleet, mission_s):
            what = "but no UAV can do it in time, or with its battery, or come there"
        elif not somebody_can:
            verdict = RequestVerdict.bad
            what = "but nobody who could do it takes part any more"
        return verdict(f"{order.task} is on the board, worth {order.value:g}; {what}")

    def _gone(self, order: TaskEdit) -> RequestVerdict | None:
        """What is told of a task that is off the board; None while somebody claims it."""
        if self._mission_state.board.states.get(order.task) is TaskState.DONE:
            return RequestVerdict.bad(f"{order.task} was done before it could be withdrawn")
        if self._claimants:
            return None
        return RequestVerdict.good(f"{order.task} is withdrawn")

    @property
    def _in_scenario(self) -> set[str]:
        return {task.id for task in self._mission_state.mission.tasks}

    @property
    def _used_ids(self) -> set[str]:
        """Ids that no new task may have."""
        replica = self._mission_state.replica
        return self._in_scenario | replica.board.keys() | replica.task_orders.keys()

    @property
    def _next_number(self) -> int:
        """The place at the end of the board."""
        board = self._mission_state.replica.board.values()
        return min(max((entry.number for entry in board), default=-1) + 1, MAX_COUNT)

    @property
    def task(self) -> str | None:
        """Id of the task; None as long as it has none."""
        return self._wish.task if self.entry is None else self.entry.task

    @property
    def told(self) -> dict[str, object]:
        """What it says of its task, who has confirmed it, and who has taken it."""
        told: dict[str, object] = {
            "task": self.task,
            "uav": self.uav,
            "known_to": sorted(self.known_to),
        }
        if (entry := self.entry) is None:
            return told
        return (
            told
            | {
                "position": list(entry.position_enu_m),
                "value": entry.value,
                "service_s": entry.service_s,
                "kind": entry.kind,
            }
            | {
                name: [list(point) for point in limit] if name == "path_enu_m" else limit
                for name, default in FIELD_DEFAULTS[TaskEdit].items()
                if (limit := getattr(entry, name)) != default
            }
        )

    @property
    def uav(self) -> str | None:
        """Who is on its way to the task or serves it."""
        return None if self.task is None else self._mission_state.holders.get(self.task)

    @property
    def _claimants(self) -> list[str]:
        claims = self._mission_state.replica.claims.items()
        there = self._mission_state.present
        return sorted(u for u, claim in claims if claim.task == self.task and u in there)

    def _able(self, uavs: Collection[str], mission_s: float | None = None) -> bool:
        """Whether one of ``uavs`` is capable of the task; in the field, from ``mission_s`` on."""
        board = self._mission_state.board
        field = board.field_problem
        if field is not None and mission_s is not None:
            from swarm.protocol.field_board import doable_in_field  # plain missions never load it

            return self.task in doable_in_field(field, board, uavs, mission_s)
        problem = board.problem
        if problem is None:
            return False
        capable = zip(problem.task_ids, problem.capable.T, strict=True)
        column = next((able for task, able in capable if task == self.task), None)
        rows = [row for row, uav in enumerate(problem.uav_ids) if uav in uavs]
        return column is not None and bool(column[rows].any())


def task_edit_of(entry: TaskEntry, run: int, reason: str = "") -> TaskEdit:
    """The order that puts ``entry`` on the board, in the flight of that ``run``."""
    values = {each.name: getattr(entry, each.name) for each in fields(entry)}
    return TaskEdit(**values, run=run, reason=reason)


def next_id(taken: set[str]) -> str:
    """The next free id for a task that was given none."""
    number = 1
    while f"{OWN_PREFIX}{number}" in taken:
        number += 1
    return f"{OWN_PREFIX}{number}"


def _require(what: str, number: float, least: float, most: float) -> None:
    if not least <= number <= most:
        raise ValueError(f"{what} must be within {least:g}..{most:g}, not {number:g}")
