"""The ways of a fleet in the field, as pictures draw them: flown, being flown, and still ahead.

Round zones, along lines, by way of bases and home, as decisions reckon with them. What was flown
is known by outcomes and landings. Ahead is what a decision made now would have the fleet do: the
lists of the epoch in force, searched anew, with changes of batteries where they need them. Plain
missions have none of this: their ways are straight, and begin and end at tasks.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from coordinator.mission_view.flown_ways import MapPoint
from coordinator.mission_view.observed_flights import ObservedFlights
from swarm.allocation import field
from swarm.allocation.field.rules import item_lists
from swarm.kernels.field import fly_lists
from swarm.kernels.field_search import Effort, optimise_lists
from swarm.model import BaseId, Mission
from swarm.model.plan import ScheduleEntry, at_base
from swarm.protocol.bases import blocking
from swarm.protocol.board import TaskBoard, holders
from swarm.protocol.field_board import field_state
from swarm.protocol.uav_messages import Claim, ClaimPhase

MapPath = tuple[MapPoint, ...]


_ITERATIONS, _EFFORT = 200, Effort(600_000)
"""Of the search from the epoch's lists: about what a decision spends."""


@dataclass(frozen=True, slots=True)
class UavWays:
    """Of one UAV; each begins where the one before ends, and has no points where there is none."""

    flown: MapPath = ()
    """From its start to where it ended its last task or visit to a base."""
    leg: MapPath = ()
    """On to what it is about now, the whole of it."""
    ahead: MapPath = ()
    """From there along its list and home."""


class FleetWays:
    """The ways of one fleet, worked out once per change."""

    def __init__(self, board: TaskBoard, flights: ObservedFlights) -> None:
        self._board = board
        self._flights = flights
        self._problem: field.FieldProblem | None = None
        self._basis: tuple[object, ...] = ()
        self._ways: Mapping[str, UavWays] = {}

    def of(self, present: Collection[str], mission_s: float) -> Mapping[str, UavWays]:
        """By UAV id; none where the mission is plain.

        Args:
            present: UAVs believed alive.
            mission_s: now [s mission time].
        """
        problem, replica = self._board.field_problem, self._board.replica
        mission = self._board.mission
        if problem is None or mission is None:
            return {}
        claims = tuple(replica.claims.items())
        basis = replica.epoch, claims, replica.task_version, frozenset(present)
        if problem is not self._problem or basis != self._basis:
            self._problem, self._basis = problem, basis
            ahead = self._ahead(problem, present, mission_s)
            flown = self._flights.executed_schedule(mission)
            drawing = _WayFinder(mission, problem)
            self._ways = {
                uav: drawing.ways(row, flown.get(uav, ()), replica.claims.get(uav), ahead[row])
                for row, uav in enumerate(problem.uav_ids)
            }
        return self._ways

    def _ahead(
        self, problem: field.FieldProblem, present: Collection[str], mission_s: float
    ) -> list[_Ahead | None]:
        """What UAVs do after what they are about; by row, None of those that take no part."""
        replica = self._board.replica
        claims = {uav: claim for uav, claim in replica.claims.items() if uav in present}
        taken = holders(claims)
        counting = {
            uav: claim
            for uav, claim in claims.items()
            if (claim.base is not None if claim.task is None else taken.get(claim.task) == uav)
        }
        epoch = replica.epoch
        if epoch is None:
            return [None] * problem.n_uav
        state = field_state(
            problem,
            self._board,
            counting,
            present=claims,
            sequence=epoch.sequence,
            blocking=blocking(replica.claims, replica.claims.keys() - claims.keys()),
        )
        for row, uav in enumerate(problem.uav_ids):
            state.active[row] &= uav in claims and claims[uav].phase is not ClaimPhase.OUT
            state.free_s[row] = max(state.free_s[row], mission_s)
        begin = item_lists(problem, epoch.routes)
        found = optimise_lists(
            problem.kernel, state, iterations=_ITERATIONS, effort=_EFFORT, lists=begin, threads=1
        )
        home = fly_lists(problem.kernel, state, found.lists).home.tolist()
        return [
            (found.lists[row], home[row]) if state.active[row] else None
            for row in range(problem.n_uav)
        ]


_Ahead = tuple[Sequence[int], int]
"""Items in order, and the base where they end; -1: at the own start."""


class _WayFinder:
    """Turns what UAVs do into paths."""

    def __init__(self, mission: Mission, problem: field.FieldProblem) -> None:
        self._problem = problem
        self._columns: dict[str, int] = {id_: n for n, id_ in enumerate(problem.task_ids)}
        self._lines = {
            str(task.id): tuple(point[:2] for point in task.path_enu_m) for task in mission.tasks
        }

    def ways(
        self,
        uav: int,
        flown: Sequence[ScheduleEntry],
        claim: Claim | None,
        ahead: _Ahead | None,
    ) -> UavWays:
        """Of one UAV, by its row."""
        here, before = uav, _GrowingPath()
        for entry in flown:
            there = self._item(entry.go, backwards=entry.is_reversed)
            if there is not None:
                here = self._go(before, uav, here, there)
        leg = _GrowingPath()
        goal = None if claim is None else self._goal(claim)
        if claim is not None and claim.phase is ClaimPhase.OUT:
            self._go_home(leg, uav, here, int(self._problem.home[uav, here]))
        elif goal is not None:
            here = self._go(leg, uav, here, goal)
        after = _GrowingPath()
        if ahead is not None:
            items, home = ahead
            for item in items:
                here = self._go(after, uav, here, item)
            self._go_home(after, uav, here, home)
        return UavWays(before.points, leg.points, after.points)

    def _goal(self, claim: Claim) -> int | None:
        """What a UAV is about, as an item; None if that is nothing, or unknown."""
        if claim.task is not None:
            return self._item(claim.task, backwards=bool(claim.reversed))
        return None if claim.base is None else self._item(at_base(BaseId(claim.base)))

    def _item(self, go: str, *, backwards: bool = False) -> int | None:
        bases = [at_base(base) for base in self._problem.base_ids]
        if go in bases:
            return -1 - bases.index(go)
        column = self._columns.get(go)
        return None if column is None else 2 * column + int(backwards)

    def _go(self, path: _GrowingPath, uav: int, here: int, item: int) -> int:
        """Go on to a base, or to a task and along its line; the node where that ends."""
        problem = self._problem
        if item < 0:
            node = problem.n_uav - 1 - item
            path.add(self._corners(uav, here, node))
            return node
        column, backwards = item >> 1, bool(item & 1)
        enter, leave = field.task_nodes(problem, column, backwards=backwards)
        path.add(self._corners(uav, here, enter))
        line = self._lines.get(problem.task_ids[column], ())
        path.add(line[::-1] if backwards else line)
        return leave

    def _go_home(self, path: _GrowingPath, uav: int, here: int, base: int) -> None:
        path.add(self._corners(uav, here, uav if base < 0 else self._problem.n_uav + base))

    def _corners(self, uav: int, begin: int, end: int) -> MapPath:
        corners_m = None if begin == end else self._problem.corners_m(uav, begin, end)
        if corners_m is None:
            return ()
        return tuple((east_m, north_m) for east_m, north_m in corners_m[:, :2].tolist())


class _GrowingPath:
    """Points in order, none of them twice in a row."""

    def __init__(self) -> None:
        self._points: list[MapPoint] = []

    @property
    def points(self) -> MapPath:
        """So far."""
        return tuple(self._points)

    def add(self, points: Iterable[MapPoint]) -> None:
        """Go on along those."""
        for east_m, north_m in points:
            if not self._points or self._points[-1] != (east_m, north_m):
                self._points.append((east_m, north_m))
