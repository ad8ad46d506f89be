"""Decision rules of the user's own: a function from a UAV's turn to the task that it takes.

Every UAV works out what those before it are going to decide, so a rule must give the same answer
for the same turn, in whatever process.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from swarm.allocation.lower_level import Decision, TeamState
from swarm.allocation.problem import FloatArray, IntArray, Problem
from swarm.model import Mission, Task, TaskId, UavId


@dataclass(frozen=True, eq=False)
class Turn:
    """One UAV's turn to decide: where it stands, and what is open to it."""

    problem: Problem
    """The mission as arrays, as far as it is known by now."""
    state: TeamState
    """Where the whole team stands."""
    row: int
    """Of the UAV that decides, in those arrays."""
    kinds: Mapping[TaskId, str | None]
    """What kind of task each is, where that is known."""

    @property
    def uav(self) -> UavId:
        """Who decides."""
        return self.problem.uav_ids[self.row]

    @property
    def now_s(self) -> float:
        """Mission time: when the UAV has become free [s]."""
        return float(self.state.free_s[self.row])

    @property
    def position_enu_m(self) -> tuple[float, float, float]:
        """Where it is then [m; east, north, up from the mission origin]."""
        east_m, north_m, up_m = self.state.place_enu_m[self.row].tolist()
        return east_m, north_m, up_m

    @cached_property
    def open(self) -> tuple[Task, ...]:
        """Tasks that nobody has taken and this UAV is capable of; never empty."""
        problem = self.problem
        columns = (self.state.open & problem.capable[self.row]).nonzero()[0].tolist()
        return tuple(self._task(column) for column in columns)

    def travel_s(self, task: Task) -> float:
        """How long this UAV flies to ``task`` from where it is [s]."""
        return float(self._travel_s[self._column(task)])

    def completion_s(self, task: Task) -> float:
        """Mission time at which it would have done ``task`` [s]."""
        column = self._column(task)
        return float((self.now_s + self._travel_s[column]) + self.problem.service_s[column])

    def gain(self, task: Task) -> float:
        """What eq. 1 gives for doing ``task`` next: p·S·m·(D − t) [value·s]."""
        weight = self.problem.weight[self.row, self._column(task)]
        left_s = self.problem.horizon_s - self.completion_s(task)
        return float(self.state.survived[self.row] * weight * left_s)

    def index(self, task: Task | None) -> int | None:
        """The column of ``task``; None for none.

        Raises:
            ValueError: it is not open to this UAV.
        """
        if task is None:
            return None
        column = self._columns.get(getattr(task, "id", None))
        if column is None or not (self.state.open & self.problem.capable[self.row])[column]:
            raise ValueError(f"a rule must give one of turn.open or None, not {task!r}")
        return column

    @cached_property
    def _columns(self) -> dict[object, int]:
        return {task: column for column, task in enumerate(self.problem.task_ids)}

    @cached_property
    def _travel_s(self) -> FloatArray:
        return self.problem.travel_s(self.row, self.state.place_enu_m[self.row])

    def _column(self, task: Task) -> int:
        return self._columns[task.id]

    def _task(self, column: int) -> Task:
        problem = self.problem
        east_m, north_m, up_m = problem.task_enu_m[column].tolist()
        name = problem.task_ids[column]
        return Task(
            id=name,
            position_enu_m=(east_m, north_m, up_m),
            value=float(problem.value[column]),
            service_s=float(problem.service_s[column]),
            kind=self.kinds.get(name),
        )


DecisionRule = Callable[[Turn], Task | None]
"""One of ``turn.open``, or None to take nothing for now; the same for the same turn."""


@dataclass(frozen=True, slots=True)
class FunctionRule:
    """A user's function as a rule; see `swarm.allocation.Rule`."""

    function: DecisionRule
    kinds: Mapping[TaskId, str | None]
    """What kind of task each is, where that is known."""

    @classmethod
    def of(cls, function: DecisionRule, mission: Mission) -> FunctionRule:
        """The rule, for that mission.

        Raises:
            ValueError: ``function`` is none.
        """
        if not callable(function):
            raise ValueError(f"a decision rule must be a function of a Turn, not {function!r}")  # noqa: TRY004 - one kind of error for all wrong input
        return cls(function, {task.id: task.kind for task in mission.tasks})

    @property
    def name(self) -> str:
        """What the function is called."""
        return str(getattr(self.function, "__name__", type(self.function).__name__))

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """What the function takes; ``rank`` plays no part.

        Raises:
            ValueError: it has taken what it cannot.
        """
        del rank
        if not (state.open & problem.capable[uav]).any():
            return None
        turn = Turn(problem, state.copy(), uav, self.kinds)  # whoever keeps it keeps this moment
        chosen = self.function(turn)
        task = turn.index(chosen)
        if chosen is None or task is None:
            return None
        return Decision.of(problem, state, uav, task, turn.gain(chosen))
