"""By when one UAV must have begun what it is about to do, and by when it must head home.

Windows, due times and what is left of the battery, worked out from the same tables as decisions.
Leaves out: what follows when it is too late (agent.core.field_tasking).
"""

from __future__ import annotations

import math
from typing import Final

from agent.core.context import AgentContext, AgentPart
from agent.core.energy import TOLERANCE_S, SortieClock
from agent.core.flights import Flights, HomeFlight
from agent.core.states import PAUSED_BY_OPERATOR, AgentState
from swarm.allocation import field
from swarm.protocol.messages import TaskEntry
from swarm.protocol.uav_messages import Claim

WITHOUT_AIM: Final = PAUSED_BY_OPERATOR | {AgentState.IDLE}
"""In the air, it stands by nothing there: its way home is all that its battery is for."""
_AMPLE_FRAC: Final = 0.5
"""With more charge than that above its reserve, it need not look how far its home is."""
ANOTHER_WAY: Final = "zones make the way another one"
"""Why a UAV on the ground leaves its task for any other: it has not begun to fly there."""


class TimeLimits(AgentPart):
    """What one UAV's time is limited by.

    Args:
        flights: knows the ways and how long they take.
        sortie: knows how long the UAV may stay in the air.
    """

    def __init__(self, context: AgentContext, flights: Flights, sortie: SortieClock) -> None:
        super().__init__(context)
        self._flights = flights
        self._sortie = sortie

    def latest_begin_s(self, task: TaskEntry, claim: Claim) -> float:
        """Mission time by which the work must have begun: window, due time and battery [s]."""
        backwards = bool(claim.reversed)
        takes_s = self._flights.line_s(task.task, backwards=backwards) + task.service_s
        if math.isinf(takes_s):  # a zone lies over its line
            return -math.inf
        ends_s = self._sortie.end_s - self._home_s(task, claim)
        if task.due_s is not None:
            ends_s = min(ends_s, task.due_s)
        closes_s = math.inf if task.closes_s is None else task.closes_s
        return min(closes_s, ends_s - takes_s)

    def too_late_at_s(self, task: TaskEntry, claim: Claim, now_s: float) -> float | None:
        """When that is on the own clock, the tolerance passed; None: never."""
        latest_s = self.latest_begin_s(task, claim) - self._mission_view.mission_s(now_s)
        return None if math.isinf(latest_s) else now_s + latest_s + 2.0 * TOLERANCE_S

    def ends_s(self, task: TaskEntry, claim: Claim, arrives_s: float) -> float:
        """Mission time at which the task is done by who is there then [s]."""
        line_s = self._flights.line_s(task.task, backwards=bool(claim.reversed))
        return max(arrives_s, task.opens_s) + line_s + task.service_s

    def upset(
        self, task: TaskEntry, claim: Claim, way: field.Way | None, mission_s: float | None
    ) -> str | None:
        """Why what is claimed is not to be done as it was claimed, now that zones have changed.

        Args:
            task: it.
            claim: of it.
            way: the way there now; None: there is none.
            mission_s: now, in the air; None: it stands at a base until it is to take off.
        """
        if way is None:
            return "zones leave no way"
        if mission_s is not None:
            begins_s = max(mission_s + way.duration_s, task.opens_s)
            in_time = begins_s <= self.latest_begin_s(task, claim) + TOLERANCE_S
            return None if in_time else "zones make the way too long"
        # On the ground it may as well depart at another time, or do something else.
        ends_s = self.ends_s(task, claim, (claim.departs_s or 0.0) + way.duration_s)
        if abs(ends_s - claim.completion_s) > TOLERANCE_S:
            return ANOTHER_WAY
        end_s = math.inf if claim.sortie_end_s is None else claim.sortie_end_s
        lasts = ends_s + self._home_s(task, claim) <= end_s + TOLERANCE_S
        return None if lasts else "zones make the way home too long"

    def lasts(self, task: TaskEntry, claim: Claim) -> bool:
        """Whether the battery lasts until the UAV is home from what it claims."""
        home_at_s = claim.completion_s + self._home_s(task, claim)
        return home_at_s <= self._sortie.end_s + TOLERANCE_S

    def leaves_at_s(self, home: HomeFlight | None, stands: bool, now_s: float) -> float | None:
        """When the UAV has to head ``home`` from where it is, on the own clock; None: never.

        Only who stands by nothing in the air has to: other ways home are reckoned with already.
        Above a base it has nowhere to go, and lands before its sortie ends, beside the slots if
        need be.
        """
        end_s, state = self._sortie.end_s, self._machine.state
        if math.isinf(end_s) or not self._mission_view.running or stands:
            return None
        end_at_s = now_s + end_s - self._mission_view.mission_s(now_s)
        if state is AgentState.ABOVE_BASE:
            return end_at_s - self._flights.land_s
        if state not in WITHOUT_AIM:
            return None
        return None if home is None else end_at_s - home.duration_s - self._timing.patience_s

    @property
    def is_used_up(self) -> bool:
        """Whether, while no mission runs, its charge is down to its reserve and its way home.

        No time is counted then: a coordinator may have died before everybody was in the air, or
        the word that the mission runs be lost.
        """
        me, told = self._mission_view.me, self._mission_view.telemetry
        if self._mission_view.running or self._machine.state not in WITHOUT_AIM:
            return False
        if me is None or me.endurance_s is None or told is None or told.battery_frac is None:
            return False
        left_frac = told.battery_frac - me.reserve_frac
        if left_frac > _AMPLE_FRAC:
            return False
        home = self._flights.way_home()
        home_s = self._timing.patience_s + (0.0 if home is None else home.duration_s)
        return left_frac * me.endurance_s <= home_s * self._flights.meter.cautious_drain_frac

    def _home_s(self, task: TaskEntry, claim: Claim) -> float:
        """From where the task ends [s]."""
        nodes = self._flights.nodes(task.task, backwards=bool(claim.reversed))
        return 0.0 if nodes is None else self._flights.home_s(nodes[1])
