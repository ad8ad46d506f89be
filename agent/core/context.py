"""What the parts of one agent's core share: state, knowledge, and what they are about to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from agent.core.airway import Airway
from agent.core.announcer import Announcer
from agent.core.interface import Action, VehicleOrder
from agent.core.mission_view import MissionView, Peers
from agent.core.states import AgentStateMachine
from agent.core.verticals import Verticals
from swarm.protocol.events import LogLine, Publish
from swarm.protocol.messages import Body
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import Claim

if TYPE_CHECKING:
    from agent.core.field_decision import FieldRule, FieldRuleMaker


def usual_field_rule(name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule | None:
    """As `agent.core.field_decision.field_rule_of`, which plain missions never load."""
    from agent.core.field_decision import field_rule_of

    return field_rule_of(name, routes)


@dataclass(frozen=True, slots=True)
class AgentContext:
    """One agent, as all its parts see it."""

    uav: str
    timing: Timing
    """Timers, in the seconds of ``now_s``."""
    replica: Replica
    """The shared registers."""
    mission_view: MissionView
    peers: Peers
    announcer: Announcer
    machine: AgentStateMachine
    make_field_rule: FieldRuleMaker
    """What it decides by in an epoch where the field's constraints count."""
    path_clearance_m: float = 0.0
    """How much farther than their margin ways lead past zones [m]."""
    verticals: Verticals | None = None
    """How its vehicle lands and climbs; None where that takes no time."""
    actions: list[Action] = field(default_factory=list)
    """What has come of the step so far, in order."""
    airway: Airway = field(init=False)
    """Lets the vehicle go where it meets nobody of its fleet."""

    def __post_init__(self) -> None:
        own = self.uav, self.timing, self.replica, self.mission_view, self.peers, self.actions
        object.__setattr__(self, "airway", Airway(*own))
        # Who brings a rule for missions in the field wants it asked wherever more is kept to.
        self.mission_view.board.all_in_field = self.make_field_rule is not usual_field_rule


class AgentPart:
    """A part of an agent's core."""

    def __init__(self, context: AgentContext) -> None:
        self._uav = context.uav
        self._timing = context.timing
        self._replica = context.replica
        self._mission_view = context.mission_view
        self._peers = context.peers
        self._announcer = context.announcer
        self._machine = context.machine
        self._make_field_rule = context.make_field_rule
        self._actions = context.actions
        self._airway = context.airway

    def _say(self, body: Body) -> None:
        """State the new content of an own register, or what is none: status and choice."""
        said = self._airway.told(body) if isinstance(body, Claim) else body
        self._actions.append(self._announcer.say(said))

    def _is_own_claim(self, action: Action) -> bool:
        """Whether the action says the own claim as it is, to everybody."""
        claimed = self._announcer.claimed
        return isinstance(action, Publish) and action.message is claimed and action.to is None

    @property
    def _speaks(self) -> bool:
        """Whether this step says the own claim."""
        return any(map(self._is_own_claim, self._actions))

    def _restate(self, claim: Claim) -> None:
        """State the own claim anew, in one word with what this step was to say of it before."""
        kept = [action for action in self._actions if not self._is_own_claim(action)]
        unheard = len(kept) < len(self._actions)
        self._actions[:] = kept
        self._actions.append(self._announcer.say(self._airway.told(claim), instead=unheard))

    def _log(self, text: str, **fields: object) -> None:
        self._actions.append(LogLine(text, fields))

    def _order(
        self,
        order: VehicleOrder,
        *,
        own_height: bool = False,
        fixed: bool = False,
        takes_s: float | None = None,
    ) -> None:
        """Let the vehicle obey; `Airway.order` says what the rest means."""
        self._airway.order(order, own_height=own_height, fixed=fixed, takes_s=takes_s)
