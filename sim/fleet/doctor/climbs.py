"""Whether legs over hills take longer than planned, where vehicles climb slower than they fly.

Plans count a leg's length in space ÷ cruise speed. Firmware takes for each straight piece the
longer of its way on the map ÷ cruise speed and its height ÷ a limit of its own: ArduPilot,
kinematic_limit in libraries/AP_Math/control.cpp; PX4 alike in its PositionSmoothing. Looked at are
ways from starts to tasks and back. Leaves out: which of them a plan has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from sim.fleet.doctor.finding import CheckFinding, fine, warns
from swarm.allocation.field import FieldProblem
from swarm.model import Mission

_CLIMB_M_S, _SINK_M_S = 2.5, 1.5
"""The lower ones of what both firmwares do by default: ArduPilot's WP_SPD_UP and WP_SPD_DN, PX4's
MPC_Z_V_AUTO_UP (3 m/s) and MPC_Z_V_AUTO_DN."""
_MUCH = 1.05
"""Longer by less is not worth a word."""
_MOST_TASKS = 200
"""That are looked at."""


def check_climbs(mission: Mission, problem: FieldProblem) -> Iterator[CheckFinding]:
    """How much longer the worst leg takes; nothing where nobody looks at the ground."""
    if mission.terrain is None or not problem.n_task or not problem.n_uav:
        return
    worst, steepest_deg, bears_m_s = 1.0, 0.0, math.inf
    for uav in {kind: row for row, kind in enumerate(problem.kind.tolist())}.values():
        speed_m_s = mission.uavs[uav].speed_m_s
        for path_m in _ways(problem, uav):
            step_m = np.diff(path_m, axis=0)
            flat_m, rise_m = np.hypot(step_m[:, 0], step_m[:, 1]), step_m[:, 2]
            limit_m_s = np.where(rise_m > 0.0, _CLIMB_M_S, _SINK_M_S)
            takes_s = np.maximum(flat_m / speed_m_s, np.abs(rise_m) / limit_m_s).sum()
            worst = max(worst, takes_s * speed_m_s / np.hypot(flat_m, rise_m).sum())
            slope = np.abs(rise_m) / np.maximum(flat_m, 1e-9)
            steepest_deg = max(steepest_deg, math.degrees(math.atan(slope.max())))
            bears_m_s = min(bears_m_s, float((limit_m_s / np.maximum(slope, 1e-9)).min()))
    about = f"ways to tasks and back slope by up to {steepest_deg:.0f}°"
    limits = f"climb at {_CLIMB_M_S:g} and sink at {_SINK_M_S:g} m/s"
    if worst <= _MUCH:
        yield fine("ground", f"{about}, which vehicles that {limits} fly as fast as planned")
        return
    text = f"{about}: vehicles that {limits} take up to {worst:.2f} times as long as planned"
    remedy = f"give a speed_m_s of {math.floor(10.0 * bears_m_s) / 10.0:g}, or set them faster"
    yield warns("ground", text, remedy)


def _ways(problem: FieldProblem, uav: int) -> Iterator[npt.NDArray[np.float64]]:
    """(k, 3) corners [m; ENU] of that UAV's ways from its start to tasks, and from there back."""
    network = problem.network
    for task in range(min(problem.n_task, _MOST_TASKS) if network is not None else 0):
        first, last = problem.enter[task].tolist()
        for begin, end in ((uav, first), (last, uav)):
            path_m = None if network is None else network.flown_between_m(uav, begin, end)
            if path_m is not None and len(path_m) > 1 and math.dist(path_m[0], path_m[-1]) > 0.0:
                yield path_m
