"""The mission and the other agents, as one agent sees them.

Its UAV's entry and place, the mission clock, what is open; whose claims count, and who may yet
decide first.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum

from agent.core.interface import Telemetry
from swarm.protocol.board import TaskBoard, TaskState, winner
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.fields import Point
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    Body,
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    TaskEdit,
    TaskEntry,
    UavSpec,
)
from swarm.protocol.mission_clock import MissionClock
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome

CARRIED_S = 1.0
"""So long a vehicle is taken to fly on as it last told [s]; then it is where it would be by now."""


class MissionChange(Enum):
    """What a statement changes for an agent that is free to take a task."""

    APPEARANCE = "a task that nobody knew of"
    OPENING = "a task may have opened"
    CLAIM = "somebody's claim, which opens nothing"
    OTHER = "anything else"


class MissionView:
    """The mission in the eyes of the agent of ``uav``."""

    def __init__(self, mission: str, uav: str, replica: Replica) -> None:
        self.board = TaskBoard(replica, mission)
        self.telemetry: Telemetry | None = None
        """The newest of the own vehicle."""
        self.now_s = 0.0
        """Of the step that is under way, on the own clock."""
        self._moved_s = 0.0
        """When the vehicle last told where it is, by the same clock."""
        self.raised_m = 0.0
        """How much higher it flies than in its layer in the brief, where layers are shared [m]."""
        self.waits_on_ground = False
        """Whether it has been sent off from where it stands, and waits there for its way."""
        self._below_m: float | None = None
        """How much lower than the vehicle that place is [m]; None: its layer was not known."""
        self._place_enu_m: Point | None = None
        self._stands_enu_m: Point | None = None
        """Where it stands on the ground, between two flights."""
        self._out_of_layer = False
        """Whether it hovers where a task asks for a height of its own."""
        self._uav = uav
        self._replica = replica
        self.clock = MissionClock()
        self._brief: MissionConfig | None = None
        self._me: UavSpec | None = None
        """The UAV's entry in that brief."""

    # -- the registers --------------------------------------------------------------

    def take_in(self, message: Message) -> MissionChange | None:
        """Join another's statement; gives what it changes, None if it was known."""
        if self.running and self._replica.is_premature(message):
            return None
        before, epoch = self._replica.claims.get(message.writer), self._replica.epoch
        brief = self._replica.brief
        body, board = message.body, self._replica.board
        entry = board.get(body.task) if isinstance(body, TaskEntry | TaskEdit) else None
        if not self._replica.join(message):
            return None
        self.clock.heed(body, brief, epoch)
        match body:
            case TaskEntry(task=task) | TaskEdit(task=task) if entry is None and task in board:
                return MissionChange.APPEARANCE
            case TaskEdit(task=task):
                return MissionChange.OTHER if board.get(task) == entry else MissionChange.OPENING
            case MissionConfig() | TaskEntry() | Outcome(result=AttemptResult.FAILED):
                return MissionChange.OPENING
            case ZoneEdit() | UavReady():
                return MissionChange.OPENING
            case Claim(task=task):
                left = before is not None and before.task != task and self.is_open(before.task)
                if before is not None and before.base is not None:
                    left |= (before.base, before.stage) != (body.base, body.stage)
                return MissionChange.OPENING if left else MissionChange.CLAIM
            case PlanEpoch(number=number) if epoch is None or number != epoch.number:
                return MissionChange.OPENING
            case _:
                return MissionChange.OTHER

    def is_open(self, task: str | None) -> bool:
        """Whether that is a task which is still to be done."""
        return task is not None and self.board.states.get(task) is TaskState.OPEN

    @property
    def unfinished(self) -> bool:
        """Whether any task is open."""
        return self.board.unfinished

    @property
    def running(self) -> bool:
        """Whether the mission has begun, at a known time, and has not ended."""
        epoch = self._replica.epoch
        over = epoch is None or epoch.phase is MissionPhase.ENDED
        return self.clock.is_set and not over

    @property
    def said_to_run(self) -> bool:
        """Whether that is the last word, be the time of the mission known or not."""
        epoch = self._replica.epoch
        return epoch is not None and epoch.phase is MissionPhase.RUNNING

    # -- the mission clock ------------------------------------------------------------

    def mission_s(self, now_s: float) -> float:
        """Mission time [s]; 0 as long as the mission is not known to have begun."""
        return self.clock.mission_s(now_s) or 0.0

    # -- the UAV ----------------------------------------------------------------------

    @property
    def me(self) -> UavSpec | None:
        """The UAV's entry in the brief."""
        brief = self._replica.brief
        if brief is not self._brief:
            self._brief = brief
            fleet = () if brief is None else brief.uavs
            self._me = next((uav for uav in fleet if uav.id == self._uav), None)
        return self._me

    @property
    def place_enu_m(self) -> Point | None:
        """Where the UAV is [m; mission origin], without its height layer; None if not known."""
        return self._place_enu_m if self._stands_enu_m is None else self._stands_enu_m

    @property
    def carried_enu_m(self) -> Point | None:
        """The same at this very step: carried on by the velocity that the vehicle told last.

        Vehicles tell their places a few times a second; whoever compares those of several wants
        them at one instant. None as well before it is known in which layer the UAV flies.
        """
        place_enu_m, telemetry = self.place_enu_m, self.telemetry
        if self.stands or place_enu_m is None:
            return place_enu_m
        if self._below_m is None or telemetry is None:
            return None
        since_s = min(CARRIED_S, self.now_s - self._moved_s)
        east_m, north_m, up_m = (
            here + since_s * speed
            for here, speed in zip(place_enu_m, telemetry.velocity_enu_m_s, strict=True)
        )
        return east_m, north_m, up_m

    @property
    def told_layer_m(self) -> float | None:
        """How much higher than that place it is [m]; None: by its layer in the brief."""
        if self.stands:
            below_m: float | None = 0.0
        else:
            below_m = None if self._below_m is None else self._below_m + self.raised_m
        return None if below_m == self._layer_m else below_m

    def move(self, telemetry: Telemetry) -> None:
        """The vehicle has told where it is."""
        east_m, north_m, up_m = telemetry.position_enu_m
        self.telemetry, self._moved_s = telemetry, self.now_s
        if self.waits_on_ground:  # its next way begins straight above that
            return
        layer_m = 0.0 if self._out_of_layer else self._layer_m
        self._place_enu_m = east_m, north_m, up_m - layer_m
        self._below_m = None if self.me is None else layer_m

    def arrive(self, place_enu_m: Point, *, own_height: bool = False) -> None:
        """The vehicle has reached that place; where exactly it is follows with its next word.

        Args:
            place_enu_m: where that is.
            own_height: the height is that of the flight there, with no layer to come on top.
        """
        self._place_enu_m, self._out_of_layer = place_enu_m, own_height
        self._below_m = 0.0 if own_height else self._layer_m

    def set_off(self) -> None:
        """The vehicle flies on, to wherever."""
        if self._out_of_layer and self._place_enu_m is not None:
            east_m, north_m, up_m = self._place_enu_m
            self._place_enu_m = east_m, north_m, up_m - self._layer_m
            self._below_m = self._layer_m
        self._out_of_layer = False

    def stand(self, place_enu_m: Point) -> None:
        """The vehicle has landed there, where it is whatever height it tells."""
        self._stands_enu_m = place_enu_m

    @property
    def stands(self) -> bool:
        """Whether the vehicle has landed, and not taken off again."""
        return self._stands_enu_m is not None

    def leave_ground(self) -> None:
        """The vehicle takes off from where it stands, straight up."""
        if self._stands_enu_m is not None:
            self._place_enu_m, self._stands_enu_m = self._stands_enu_m, None
            self._below_m = 0.0

    def take_off(self) -> None:
        """The vehicle is in the air; one that has not told where it is hovers at its start."""
        if self._place_enu_m is None and self.me is not None:
            self._place_enu_m = self.me.position_enu_m

    def in_layer(self, point: Point) -> Point:
        """That point in the UAV's own height layer, where it flies."""
        return point[0], point[1], point[2] + self._layer_m

    @property
    def flown_m(self) -> float | None:
        """Height at which it hovers out of its layer [m above the origin]; None: in its layer."""
        place_enu_m = self.place_enu_m
        if place_enu_m is None or self.stands or not self._out_of_layer:
            return None
        return place_enu_m[2]

    @property
    def _layer_m(self) -> float:
        me = self.me
        return 0.0 if me is None else me.layer_m


class Peers:
    """The others, as the agent of ``uav`` sees them."""

    def __init__(self, uav: str, timing: Timing) -> None:
        self.membership = Membership(timing)
        self._uav = uav
        self._patience_s = timing.patience_s
        self._idle_since_s: dict[str, float] = {}
        self._awake_since_s = 0.0
        self._lost: set[str] = set()

    @property
    def credible(self) -> Collection[str]:
        """Others whose claims count."""
        return self.membership.credible - {self._uav}

    def counts(self, uav: str) -> bool:
        """Whether it is one of them."""
        return uav != self._uav and self.membership.is_credible(uav)

    def heard(self, message: Message, replica: Replica, now_s: float) -> bool:
        """Its writer itself has just said so; whether it is thereby there anew.

        One that says less than is known of it does not remember what an earlier life, or
        another process in its place, has said: it cannot answer for that yet.
        """
        anew = self.membership.heard(message.writer, now_s)
        if isinstance(message.body, Claim | PlanEpoch):
            known = replica.known(message)
            if known is None or message.stamp >= known.stamp:
                self.membership.spoke(message.writer)
        return anew

    def back(self, writer: str) -> bool:
        """Whether ``writer`` was lost before; told once for each loss."""
        lost = writer in self._lost
        self._lost.discard(writer)
        return lost

    def lost(self, now_s: float) -> list[tuple[str, str]]:
        """Writers given up by now, each told once, and by what they were missed."""
        lost = self.membership.lost(now_s)
        if not lost:
            return []
        self._lost.update(lost)
        return [(w, "silent" if self.membership.mute(w) else "gone") for w in lost]

    def stated(self, writer: str, body: Body, now_s: float) -> None:
        """There is news of ``writer``: by an outcome or an idle claim it has become free."""
        idle = isinstance(body, Claim) and body.phase is ClaimPhase.IDLE
        if idle or isinstance(body, Outcome):
            self._idle_since_s[writer] = now_s

    def awake(self, now_s: float) -> None:
        """A task may have opened: from now on everyone who is free may decide anew."""
        self._awake_since_s = now_s

    def awaited(self, replica: Replica, now_s: float) -> set[str]:
        """Free others that may still be expected to decide in their turn."""
        return {
            uav
            for uav, claim in replica.claims.items()
            if _is_free(uav, claim, replica)
            and self.counts(uav)
            and now_s < self._patience_ends_s(uav)
        }

    def winner(self, replica: Replica, task: str) -> str | None:
        """Whose claim on ``task`` is the strongest that counts, the own among them."""
        claims = replica.claimants.get(task, {}).items()
        return winner(
            [
                (uav, claim)
                for uav, claim in claims
                if uav == self._uav or self.membership.is_credible(uav)
            ]
        )

    def patience_ends_s(self, replica: Replica, now_s: float) -> float | None:
        """When the first of those awaited will be awaited no longer; None if nobody is."""
        ends_s = [self._patience_ends_s(uav) for uav in self.awaited(replica, now_s)]
        return min(ends_s, default=None)

    def _patience_ends_s(self, uav: str) -> float:
        since_s = max(self._idle_since_s.get(uav, 0.0), self._awake_since_s)
        return since_s + self._patience_s


def _is_free(uav: str, claim: Claim, replica: Replica) -> bool:
    """Idle, or between the outcome of its task and the word of what it takes next."""
    if claim.task is None:
        return claim.phase is ClaimPhase.IDLE
    return (uav, claim.task) in replica.outcomes
