"""Tables I and II: the optimum, the worst plan, and every sequence by every rule.

Also what the paper prints, what has been checked before, and how a figure is held against them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import permutations

from coordinator.planner.exact import optimum, worst_value
from coordinator.planner.plan import make_plan
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.model import Mission, Plan
from swarm.runtime.clock import Clock


@dataclass(frozen=True, slots=True)
class Printed:
    """A figure and how many of its decimals are printed."""

    value: float
    decimals: int

    def agrees(self, ours: float) -> bool:
        """Whether ``ours`` rounds to the printed digits; either neighbour at a tie."""
        return abs(ours - self.value) <= 0.5 * 10.0**-self.decimals + 1e-9

    def __str__(self) -> str:
        return f"{self.value:.{self.decimals}f}"


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that must come out right."""

    name: str
    ours: str
    expected: str
    ok: bool


def printed_check(name: str, ours: float, expected: Printed) -> Check:
    """Whether ``ours`` is ``expected`` to its printed digits."""
    return Check(name, f"{ours:.{expected.decimals}f}", str(expected), expected.agrees(ours))


@dataclass(frozen=True, slots=True)
class PaperFigures:
    """What the paper reports; shown beside ours."""

    optimum: Printed = Printed(120.3, 1)
    """Table II [value·s]."""
    hierarchical: Printed = Printed(110.7, 1)
    """Table II: the plan of its two-level hierarchy [value·s]."""
    normalised: Mapping[str, Printed] = field(
        default_factory=lambda: {"greedy": Printed(0.88, 2), "lookahead": Printed(0.85, 2)}
    )
    """Average over 50 random problems; worst plan 0, optimum 1."""


@dataclass(frozen=True, slots=True)
class Expectations:
    """Figures that must come out; deviating from one fails the reproduction.

    J is in value·s, sequences and lists are in the paper's numbers, from 1.
    """

    paper: PaperFigures = PaperFigures()
    optimum: Printed = Printed(120.3335, 4)
    optimal_lists: tuple[tuple[int, ...], ...] = ((2, 3, 1), (6, 8, 7), (4, 5))
    worst: Printed = Printed(-141.8787, 4)
    greedy: Mapping[tuple[int, ...], Printed] = field(
        default_factory=lambda: {
            (1, 2, 3): Printed(116.1364, 4),
            (1, 3, 2): Printed(118.4939, 4),
            (2, 1, 3): Printed(104.2051, 4),
            (2, 3, 1): Printed(113.6739, 4),
            (3, 1, 2): Printed(118.4939, 4),
            (3, 2, 1): Printed(113.6739, 4),
        }
    )
    """By priority sequence."""
    lookahead: Mapping[tuple[int, ...], Printed] = field(
        default_factory=lambda: {(3, 1, 2): Printed(115.4152, 4)}
    )
    """The best sequence; the others are below it."""
    guided: Printed = Printed(120.3335, 4)
    optimum_at_horizon: Mapping[float, Printed] = field(
        default_factory=lambda: {
            6.0: Printed(155.53, 2),
            7.0: Printed(190.99, 2),
            8.0: Printed(226.99, 2),
            10.0: Printed(298.99, 2),
        }
    )
    """By D [s]."""
    normalised_at_least: Mapping[str, float] = field(
        default_factory=lambda: {"greedy": 0.96, "guided": 0.999}
    )
    """Average over the random problems that the 95 % interval must reach."""


RULES = ("greedy", "lookahead")


@dataclass(frozen=True, slots=True)
class SequenceValue:
    """What the lower level makes of one priority sequence."""

    rule: str
    sequence: tuple[int, ...]
    """UAV numbers as in the paper, from 1, first decider first."""
    objective: float
    """J [value·s]."""
    lists: tuple[tuple[int, ...], ...]
    """Task numbers as in the paper, from 1, per UAV."""


@dataclass(frozen=True, slots=True)
class TableResults:
    """Table I and II as they come out here."""

    mission: Mission
    plans: Mapping[str, Plan]
    """By method: greedy and lookahead by their best sequence, guided, exact."""
    worst: float
    """J of the worst lists that hold all tasks [value·s]."""
    sequences: tuple[SequenceValue, ...]
    optimum_at_horizon: Mapping[float, float]
    """J of the optimum by D [s]."""

    def of_rule(self, rule: str) -> list[SequenceValue]:
        """All sequences by ``rule``."""
        return [each for each in self.sequences if each.rule == rule]

    def best(self, rule: str) -> SequenceValue:
        """The sequence that the planner chooses, which is the first of the best."""
        return max(self.of_rule(rule), key=lambda each: each.objective)

    def lists(self, method: str) -> tuple[tuple[int, ...], ...]:
        """Task numbers from 1 per UAV, of the plan by ``method``."""
        number = {task.id: i + 1 for i, task in enumerate(self.mission.tasks)}
        routes = self.plans[method].routes
        return tuple(tuple(number[t] for t in routes[uav.id]) for uav in self.mission.uavs)

    def nearest(self, figure: Printed) -> SequenceValue:
        """The sequence and rule whose J comes closest to ``figure``."""
        return min(self.sequences, key=lambda each: abs(each.objective - figure.value))

    def checks(self, expected: Expectations) -> list[Check]:
        """Every checked figure of the tables."""
        best = self.plans["exact"].objective
        found = [
            printed_check("Table II optimum (paper)", best, expected.paper.optimum),
            printed_check("Table II optimum", best, expected.optimum),
            _lists_check("Table II optimal lists", self.lists("exact"), expected.optimal_lists),
            printed_check("Table II worst plan", self.worst, expected.worst),
            printed_check("guided", self.plans["guided"].objective, expected.guided),
        ]
        for rule, figures in (("greedy", expected.greedy), ("lookahead", expected.lookahead)):
            values = {each.sequence: each.objective for each in self.of_rule(rule)}
            for sequence, figure in figures.items():
                name = f"{rule}, sequence ({','.join(map(str, sequence))})"
                found.append(printed_check(name, values[sequence], figure))
            highest = max(figures.values(), key=lambda figure: figure.value)
            plan = self.plans[rule].objective
            found.append(printed_check(f"{rule}, best sequence", plan, highest))
        for horizon_s, figure in expected.optimum_at_horizon.items():
            name = f"optimum at D = {horizon_s:g} s"
            found.append(printed_check(name, self.optimum_at_horizon[horizon_s], figure))
        return found

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "optimum": self.plans["exact"].objective,
            "worst": self.worst,
            "plans": {
                method: {
                    "objective": plan.objective,
                    "sequence": plan.sequence,
                    "routes": dict(plan.routes),
                }
                for method, plan in self.plans.items()
            },
            "sequences": [asdict(each) for each in self.sequences],
            "optimum_at_horizon": [
                {"horizon_s": horizon_s, "optimum": value}
                for horizon_s, value in self.optimum_at_horizon.items()
            ],
        }


def reproduce_tables(mission: Mission, expected: Expectations, *, clock: Clock) -> TableResults:
    """Work out Table II, and what else ``expected`` names, from the mission of Table I."""
    problem = Problem.from_mission(mission)
    return TableResults(
        mission=mission,
        plans={
            method: make_plan(mission, method, clock=clock)
            for method in (*RULES, "guided", "exact")
        },
        worst=worst_value(problem),
        sequences=tuple(
            _by_sequence(problem, rule, sequence)
            for rule in RULES
            for sequence in permutations(range(problem.n_uav))
        ),
        optimum_at_horizon={
            horizon_s: optimum(
                Problem.from_mission(replace(mission, horizon_s=horizon_s))
            ).objective
            for horizon_s in expected.optimum_at_horizon
        },
    )


def lists_text(lists: tuple[tuple[int, ...], ...]) -> str:
    """Lists as the paper writes them: (2 3 1)(6 8 7)(4 5)."""
    return "".join(f"({' '.join(str(task) for task in tasks)})" for tasks in lists)


def _by_sequence(problem: Problem, rule: str, sequence: tuple[int, ...]) -> SequenceValue:
    routes, _ = run(problem, TeamState.at_start(problem), rank_of(sequence), rule_by_name(rule))
    return SequenceValue(
        rule=rule,
        sequence=tuple(uav + 1 for uav in sequence),
        objective=evaluate(problem, routes)[0],
        lists=tuple(tuple(task + 1 for task in route) for route in routes),
    )


def _lists_check(
    name: str, ours: tuple[tuple[int, ...], ...], expected: tuple[tuple[int, ...], ...]
) -> Check:
    return Check(name, lists_text(ours), lists_text(expected), ours == expected)
