"""What everything shares that commands one vehicle: who is heard, and how to speak to it.

Leaves out: what is said and why (agent.mavlink.duty).
"""

from __future__ import annotations

from agent.mavlink.codec import MavlinkCodec
from agent.mavlink.commands import Commands
from agent.mavlink.config import BridgeConfig, CommandStyle
from agent.mavlink.contact import Contact
from agent.mavlink.events import Action, Send
from agent.mavlink.flavours import Flavour
from agent.mavlink.guards import Guards
from agent.mavlink.lent_parameter import LentParameter
from agent.mavlink.messages import Outbound
from agent.mavlink.signing import Signing
from agent.mavlink.standing_mission import StandingMission
from agent.mavlink.state import VehicleState
from agent.mavlink.whereabouts import Whereabouts
from agent.vehicle import Report

__all__ = ["Seat"]


class Seat:
    """One vehicle, as far as it is heard; and what was made of it in the step under way.

    Args:
        config: its settings.
    """

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.contact = Contact(config.system_id)
        self.codec = MavlinkCodec(
            config.system_id,
            source_system_id=config.ground_system_id,
            source_component_id=config.ground_component_id,
            signing=signing,
            peer_silence_s=config.peer_silence_s,
        )
        self.commands = Commands(config.commands)
        self.vehicle = VehicleState()
        self.guards = Guards(config)
        self.whereabouts = Whereabouts()
        self.flavour: Flavour | None = None
        self.mission: StandingMission | None = None
        """What stands on the vehicle; None if missions are not our way to command it."""
        self.lent: LentParameter | None = None
        """What is another parameter during a flight; None if nothing is."""
        self.now_s = 0.0
        self._actions: list[Action] = []

    @property
    def silent(self) -> bool:
        """Whether it has not been heard for too long."""
        at_s = self.vehicle.silent_at_s(self.config.silence_timeout_s)
        return at_s is not None and self.now_s >= at_s

    def missing(self) -> str | None:
        """Why there is no vehicle to command yet; None if there is one."""
        return self.contact.missing(
            self.vehicle.heartbeat,
            self.flavour,
            silent=self.silent,
            distrusted=self.codec.distrusted,
        )

    def meet(self, flavour: Flavour | None) -> None:
        """Speak to it as to that kind of vehicle."""
        self.flavour = flavour
        lending = None
        if flavour is not None:
            self.commands.acknowledged_twice = flavour.acknowledged_twice
            lending = flavour.lending
        self.lent = None
        if lending is not None and self.config.raises_jerk:
            self.lent = LentParameter(lending, self.config)
        self.forget_mission()

    def forget_mission(self) -> None:
        """Know nothing of what stands on the vehicle."""
        self.mission = (
            StandingMission(self.config, self.commands, self.flavour)
            if self._by_missions and self.flavour is not None
            else None
        )

    @property
    def _by_missions(self) -> bool:
        return self.config.command is CommandStyle.MISSION

    def flies_for_us(self, custom_mode: int) -> bool:
        """Whether that mode is our doing, as far as targets go."""
        if self.mission is not None:
            return self.mission.expects(custom_mode, self.now_s)
        return self.flavour is not None and self.flavour.is_commanded(custom_mode)

    def flies_unknown_mission(self) -> bool:
        """Whether the vehicle flies a mission of which it is not known whose it is."""
        heartbeat = self.vehicle.heartbeat
        return (
            self.flavour is not None
            and self.mission is not None
            and heartbeat is not None
            and heartbeat.armed
            and self.flavour.is_mission(heartbeat.custom_mode)
            and self.mission.is_ours is None
            and not self.flies_for_us(heartbeat.custom_mode)
        )

    def in_its_words(self, failure: str) -> str:
        """A failure, and what the autopilot has said about it lately."""
        text = self.vehicle.telling_warning(self.now_s)
        return f"{failure}: {text}" if text and text not in failure else failure

    def say(self, *messages: Outbound) -> None:
        """To the vehicle."""
        self._actions += [Send(self.codec.encode(message)) for message in messages]

    def report(self, report: Report) -> None:
        """To whoever gave the orders."""
        self._actions.append(report)

    def take_actions(self) -> list[Action]:
        """What was said and reported, in order, once."""
        actions, self._actions = self._actions, []
        return actions

    def forget_vehicle(self) -> None:
        """The autopilot began anew: nothing is known of it any more."""
        self.vehicle = VehicleState()
        self.guards = Guards(self.config)
        self.whereabouts = Whereabouts()
        self.flavour = self.mission = self.lent = None
        self.commands.cancel_all()
