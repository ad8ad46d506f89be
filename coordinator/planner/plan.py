"""From a mission to a plan: choose the method, bound the work, prove what can be proven.

Pop-ups (tasks with ``appears_s > 0``) are unknown to a plan. Leaves out: scenario files,
printing and drawing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordinator.planner.bound import upper_bound
from coordinator.planner.exact import estimated_s, optimum
from coordinator.planner.methods import METHODS, ONLINE_METHODS
from coordinator.planner.routes import Progress, guided_plan
from coordinator.planner.sequence import EXHAUSTIVE_UAVS, SearchLimits, best_sequence
from coordinator.planner.stop import Limit, ShouldStop, after_time, never
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.allocation.rules import EXACT_TASKS
from swarm.clock import Clock
from swarm.errors import Fault, InputError
from swarm.model import Mission, Plan
from swarm.suggest import instead

__all__ = ["METHODS", "ONLINE_METHODS", "check_online_method", "make_plan"]

_PROOF_S = 1.0
"""The optimum is proven beside any method when that is estimated to take at most this long."""
_EXHAUSTIVE_DECISIONS = 3_000_000
"""Decisions all first rounds together may take to be tried one by one: some seconds."""
_LOCAL_DECISIONS = 600_000
"""The same for the local search: a second or two."""
_MODEST_ROUNDS = 60
"""First rounds of some UAVs that modest planning holds at once: those of small fleets."""
_MODEST_EVALUATIONS = 200
"""Evaluations of a modest local search."""
_LONG_LOOKAHEAD_WORK = 60_000
"""Evaluations × tasks² of lookahead where its tours are long: a few seconds."""


def make_plan(
    mission: Mission,
    method: str,
    *,
    clock: Clock,
    seed: int = 0,
    stop: ShouldStop | None = None,
    progress: Progress | None = None,
    bound_s: float | None = None,
    threads: int | None = None,
    modest: bool = False,
) -> Plan:
    """Plan a mission.

    With the same seed and without a limit in time the same plan comes out every time.

    Args:
        mission: what to plan; its pop-ups are left out.
        method: one of `METHODS`.
        clock: measures the elapsed time; nothing is decided by it.
        seed: of ``guided`` and of the local search, which only large fleets need.
        stop: ends the search for a sequence or for lists; None means after a few seconds' worth of
            work.
        progress: told the evaluations or iterations and the best J so far, again and again.
        bound_s: work out an upper bound on J for about this long where the optimum is not proven
            [s]; not at all when None.
        threads: at most this many; as many as there are processors when None. Changes nothing but
            speed.
        modest: spend little on the search for a sequence, for studies of many missions; costs
            some 0.1 % of J at 10 × 50 and saves most of the time.

    Returns:
        The plan. Its sequence is None for ``exact``, which has none.

    Raises:
        ValueError: there is no such method.
        ProblemTooLargeError: method ``exact`` on a mission too large for it.
    """
    if method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, not {method!r}")
    begin_s = clock.now_s()
    problem = Problem.from_mission(mission.known_at_start())
    sequence: tuple[int, ...] | None = None
    evaluations = 0
    proven: float | None = None
    routes: Sequence[Sequence[int]]
    if method == "exact":
        routes = optimum(problem, threads=threads).routes
        proven = evaluate(problem, routes)[0]
    elif method == "guided":
        guided = guided_plan(problem, seed=seed, stop=stop, progress=progress, threads=threads)
        routes, sequence, evaluations = guided.routes, guided.sequence, guided.iterations
        if estimated_s(problem) <= _PROOF_S:
            proven = evaluate(problem, optimum(problem, threads=threads).routes)[0]
    else:
        search = best_sequence(
            problem,
            rule := rule_by_name(method),
            np.random.default_rng(seed),
            never if stop is None else stop,
            limits=_limits(problem, method, stopped=isinstance(stop, Limit), modest=modest),
            progress=progress,
            threads=threads,
        )
        sequence, evaluations = search.sequence, search.evaluations
        routes, _ = run(problem, TeamState.at_start(problem), rank_of(sequence), rule)
        if estimated_s(problem) <= _PROOF_S:
            proven = evaluate(problem, optimum(problem, threads=threads).routes)[0]
    objective, completion_s = evaluate(problem, routes)
    if proven is not None:
        proven = max(proven, objective)  # the same lists summed in another order may be 1e-15 off
    bound: float | None = None
    if proven is None and bound_s is not None:
        bound = upper_bound(problem, routes, after_time(clock, bound_s), threads=threads).objective
    return Plan(
        scenario=mission.name,
        method=method,
        routes={
            uav: tuple(problem.task_ids[task] for task in route)
            for uav, route in zip(problem.uav_ids, routes, strict=True)
        },
        objective=objective,
        completion_s={
            problem.task_ids[task]: float(completion_s[task]) for route in routes for task in route
        },
        sequence=None if sequence is None else tuple(problem.uav_ids[uav] for uav in sequence),
        optimum=proven,
        evaluations=evaluations,
        elapsed_s=clock.now_s() - begin_s,
        seed=seed,
        bound=bound,
    )


def check_online_method(method: str) -> None:
    """Refuse a method whose rule agents cannot follow by themselves.

    Raises:
        InputError: `exact`, which has no rule, or no method at all.
    """
    if method not in ONLINE_METHODS:
        problem = "has no decision rule to fly by" if method in METHODS else "no such method"
        remedy = instead(method, ONLINE_METHODS)
        raise InputError(Fault("--method", method, problem, remedy))


def _limits(problem: Problem, method: str, *, stopped: bool, modest: bool) -> SearchLimits:
    """What is cheap here; with ``stopped`` the caller's limit alone ends the local search."""
    if modest:
        usual = _limits(problem, method, stopped=False, modest=False).local_evaluations
        return SearchLimits(
            partial_rounds=_MODEST_ROUNDS,
            local_evaluations=min(_MODEST_EVALUATIONS, usual or _MODEST_EVALUATIONS),
        )
    n_task = max(1, problem.n_task)
    if method == "lookahead" and n_task > EXACT_TASKS:
        few = max(2, min(300, _LONG_LOOKAHEAD_WORK // n_task**2))
        return SearchLimits(
            first_rounds=few,
            first_rounds_large_fleet=few,
            decisions=2 * few,
            local_evaluations=None if stopped else few,
        )
    local = max(100, _LOCAL_DECISIONS // n_task)
    return SearchLimits(
        first_rounds=max(local, _EXHAUSTIVE_DECISIONS // n_task),
        first_rounds_large_fleet=local,
        partial_rounds=60_000 if problem.n_uav <= EXHAUSTIVE_UAVS else 4_000,
        local_evaluations=None if stopped else local,
    )
