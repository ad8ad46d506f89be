"""Whether a mission of the field can be flown as it is written: batteries, bases, zones, tasks.

A file that is sound may still ask for what nobody can do. Leaves out: which list each UAV would
fly (swarm plan), and whether the vehicles are what the scenario says of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from coordinator.mission_view.area_report import facts_in_words
from coordinator.planner.schedule_report import around
from sim.fleet.doctor.climbs import check_climbs
from sim.fleet.doctor.finding import CheckFinding, fails, fine, warns
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.network import TooManyLegsError
from swarm.kernels.field_alone import earliest_alone
from swarm.model import Mission, Uav
from swarm.model.layers import layers_over
from swarm.survey.facts import area_facts

_TAKEOFF_S = 60.0
"""In the air before mission time 0, which no plan counts: the climb, and the wait for the others
(`swarm coordinator --hover-s`)."""
_MOST_NAMED = 6
_MOST_BLUR_PX = 1.5
"""Of a picture; more is seen in what is made of it."""


def check_field(mission: Mission) -> list[CheckFinding]:
    """What there is to say of the field's constraints; nothing of a plain mission."""
    if mission.is_plain:
        return []
    # What appears later is not begun before.
    tasks = [replace(task, opens_s=max(task.opens_s, task.appears_s)) for task in mission.tasks]
    try:
        problem = FieldProblem.from_mission(mission, tasks=tasks)
    except TooManyLegsError as error:
        return [fails("field", str(error), "leave some out, or fly it in parts")]
    return [
        *_energy(mission),
        *_bases(mission, problem),
        *_zones(mission, problem),
        *check_climbs(mission, problem),
        *_tasks(mission, problem),
        *_areas(mission),
    ]


def _energy(mission: Mission) -> Iterator[CheckFinding]:
    """Whether batteries last for anything at all."""
    limited = [uav for uav in mission.uavs if uav.endurance_s is not None]
    if not limited:
        return
    spent = [uav.id for uav in limited if _usable_s(uav, uav.charge_frac) <= 0.0]
    short = [uav.id for uav in limited if 0.0 < _usable_s(uav, uav.charge_frac) <= _TAKEOFF_S]
    if spent:
        text = f"{_named(spent)} may not fly at all: the charge is no more than the reserve"
        yield fails("energy", text, "give a higher charge_frac, or a smaller reserve_frac")
    if short:
        text = (
            f"{_named(short)} may fly for {_TAKEOFF_S:g} s or less, which the climb and the wait "
            "for the others can take before the mission starts"
        )
        yield warns("energy", text, "give a higher charge_frac, or land it at a base first")
    if not spent and not short:
        least = min(limited, key=lambda uav: _usable_s(uav, uav.charge_frac))
        text = f"{least.id} has the least: {_usable_s(least, least.charge_frac):.0f} s of flight"
        yield fine("energy", f"{text}, {_usable_s(least, 1.0):.0f} s on a full battery")


def _usable_s(uav: Uav, charge_frac: float) -> float:
    """Time in the air without the reserve [s]."""
    return 0.0 if uav.endurance_s is None else (charge_frac - uav.reserve_frac) * uav.endurance_s


def _areas(mission: Mission) -> Iterator[CheckFinding]:
    """What lines of areas cover if all are flown, and what their pictures are worth."""
    for area, facts in zip(
        mission.areas, area_facts(mission, [task.id for task in mission.tasks]), strict=True
    ):
        text = "; ".join(facts_in_words(facts))
        yield fine("areas", f"{area.id} {text}")
        if facts.blur_px is not None and facts.blur_px > _MOST_BLUR_PX:
            remedy = "fly slower or higher, or give the camera's exposure_s if it is shorter"
            yield warns(
                "areas", f"{area.id}: pictures are blurred by {facts.blur_px:.1f} px", remedy
            )


def _bases(mission: Mission, problem: FieldProblem) -> Iterator[CheckFinding]:
    """Whether who needs a swap has somewhere to go."""
    limited = [uav for uav in range(problem.n_uav) if np.isfinite(problem.full_s[uav])]
    if not mission.bases:
        if limited:
            names = [problem.uav_ids[uav] for uav in limited]
            text = f"none, so {_named(names)} lands for good when its battery is used up"
            remedy = "add [[base]] where batteries are to be swapped, if that is not meant"
            yield warns("bases", text, remedy)
        return
    reach = np.isfinite(_leg_from_start_s(problem))
    unreached = [base for number, base in enumerate(problem.base_ids) if not reach[:, number].any()]
    cut_off = [problem.uav_ids[uav] for uav in limited if not reach[uav].any()]
    if unreached:
        text = f"nobody gets to {_named(unreached)} on what is in its battery at the start"
        yield warns("bases", text, "move it, or leave it out")
    if cut_off:
        text = f"{_named(cut_off)} gets to no base on what is in its battery at the start"
        yield warns("bases", text, "add a base that is nearer, or charge it")
    if not unreached and not cut_off:
        slots = ", ".join(
            f"{base.id} ({'any number' if base.slots is None else base.slots} at a time, "
            f"{base.swap_s:g} s)"
            for base in mission.bases
        )
        yield fine("bases", slots)


def _leg_from_start_s(problem: FieldProblem) -> npt.NDArray[np.float64]:
    """(n_uav, n_base) flight from the start to each base; infinite if it takes too long [s]."""
    bases = slice(problem.n_uav, problem.n_uav + problem.n_base)
    legs_s = np.array(
        [problem.leg_s[problem.kind[uav], uav, bases] for uav in range(problem.n_uav)]
    ).reshape(problem.n_uav, problem.n_base)
    return np.where(legs_s <= problem.first_s[:, None], legs_s, np.inf)


def _zones(mission: Mission, problem: FieldProblem) -> Iterator[CheckFinding]:
    """Whether zones concern somebody, and shut nobody in."""
    if not mission.zones:
        return
    layers = layers_over(mission.terrain)
    heights_m = [
        layers.layer_of_m(uav.vehicle, number) + uav.position_enu_m[2]
        for number, uav in enumerate(mission.uavs)
    ]
    bounds_m = [mission.band_m] if mission.band_m else [(up_m, up_m) for up_m in heights_m]
    idle = [zone.id for zone in mission.zones if not any(zone.concerns(*pair) for pair in bounds_m)]
    if idle:
        text = f"nobody flies as high, or as low, as {_named(idle)}: over starts, at least"
        yield warns("zones", text, "look at its floor_m and ceiling_m, and at the layers")
    places = slice(problem.n_uav + problem.n_base, None)
    shut_in = [
        name
        for uav, name in enumerate(problem.uav_ids)
        if problem.n_task and not np.isfinite(problem.leg_s[problem.kind[uav], uav, places]).any()
    ]
    if shut_in:
        text = f"{_named(shut_in)} is shut in: zones leave no way to any task"
        yield fails("zones", text, "move its start, or open a way")
    if not idle and not shut_in:
        margin = f", and paths stay {mission.zone_margin_m:g} m away" * bool(mission.zone_margin_m)
        yield fine("zones", f"{_named([zone.id for zone in mission.zones])}{margin}")


def _tasks(mission: Mission, problem: FieldProblem) -> Iterator[CheckFinding]:
    """Whether somebody could do each task as its only one."""
    alone_s = earliest_alone(problem.kernel, FieldState.at_start(problem))
    can: npt.NDArray[np.bool_] = np.any(np.isfinite(alone_s), axis=0)
    hopeless = [task for task, able in zip(mission.tasks, can, strict=True) if not able]
    if hopeless:
        text = f"nobody can do {_named(task.id for task in hopeless)}, not even as the only task"
        remedy = "look at its windows, at zones and ways home, and at what batteries allow"
        yield warns("tasks", text, remedy)
        return
    yield fine("tasks", f"somebody can do each{around(mission).replace(chr(10), ': ')}")


def _named(names: Iterable[str]) -> str:
    named: Sequence[str] = tuple(names)
    more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
    return ", ".join(named[:_MOST_NAMED]) + more
