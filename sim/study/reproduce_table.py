"""Table I and II: the optimum, the worst plan, and every sequence by every rule.

Leaves out: random problems, and drawing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import permutations

from coordinator.planner.exact import optimum, worst_value
from coordinator.planner.plan import make_plan
from sim.study.reproduce_expected import Check, Expectations, Printed, printed_check
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.clock import Clock
from swarm.model import Mission, Plan

__all__ = ["RULES", "SequenceValue", "TableStudy", "lists_text", "study_table"]

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
class TableStudy:
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
                name = f"{rule}, sequence {_numbers(sequence)}"
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
                    "sequence": None if plan.sequence is None else list(plan.sequence),
                    "routes": {uav: list(route) for uav, route in plan.routes.items()},
                }
                for method, plan in self.plans.items()
            },
            "sequences": [
                {
                    "rule": each.rule,
                    "sequence": list(each.sequence),
                    "objective": each.objective,
                    "lists": [list(tasks) for tasks in each.lists],
                }
                for each in self.sequences
            ],
            "optimum_at_horizon": [
                {"horizon_s": horizon_s, "optimum": value}
                for horizon_s, value in self.optimum_at_horizon.items()
            ],
        }


def study_table(mission: Mission, expected: Expectations, *, clock: Clock) -> TableStudy:
    """Work out Table II, and what else ``expected`` names, from the mission of Table I."""
    problem = Problem.from_mission(mission)
    return TableStudy(
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


def _numbers(sequence: tuple[int, ...]) -> str:
    return f"({','.join(str(uav) for uav in sequence)})"
