"""The states of an agent and the transitions between them: everything about them is in this file.

An agent is in exactly one `AgentState`. It leaves it by a `Trigger` that `TRANSITIONS` has an entry
for, and by nothing else. What comes from outside may come at any time, so where the table has no
entry for it nothing follows; a decision of its own that has none is a bug, and dropped and told
(see `AgentStateMachine`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from swarm.protocol.timing import earliest
from swarm.protocol.uav_messages import StatusPhase


class AgentState(Enum):
    """What an agent is about."""

    SYNCING = "asks the others what they know; has not acted in this life"
    PREPARING = "gets its vehicle into the air and under command"
    RESUMING = "stands by an earlier life's claim until its vehicle is under command again"
    WAITING = "has no task any more, and its vehicle is not under command again yet"
    IDLE = "is free: decides, or has found nothing to do"
    FLYING = "flies to the task that it claims"
    SERVING = "is at the task that it claims, until the service is over"
    FLYING_TO_BASE = "flies to the base that it claims"
    ABOVE_BASE = "waits above the base that it claims, until a slot is free"
    BESIDE_SLOTS = "stands beside the slots of the base that it claims, until one is free"
    SWAPPING = "is on a slot of the base that it claims, until its battery is full"
    READY_ON_GROUND = "stands at a base with a full battery, and is free"
    DEPARTING = "stands at a base until it is to take off for the task that it claims"
    PAUSED = "stopped by the operator; takes part again when told to resume"
    PAUSED_HOMEBOUND = "stopped by the operator; all that is left to do is to fly home"
    RETURNING_VIA_START = "flies to its start in its own layer, then returns to launch and lands"
    RETURNING = "returns to launch from where it is and lands"
    OUT = "its vehicle is not its own to command any more; waits for what is heard of it"
    HOME = "its vehicle has landed: the process ends"
    LEFT = "its vehicle was given up, and nothing is left to wait for: the process ends"
    YIELDED = "another process flies this UAV: this one ends without a word"

    # By which one it is: an Enum's own hash, that of the name, is Python code, and every step looks
    # some twenty times for its state among others.
    __hash__ = object.__hash__


class Trigger(Enum):
    """What takes an agent from one state to the next."""

    SYNCED = "it knows what everyone knows, and its UAV is in the brief"
    CLAIM_RECOVERED = "an earlier life of it claimed a task, and the mission runs"
    VEHICLE_READY = "the vehicle is in the air and takes targets"
    DECIDED = "it has chosen a task"
    DIVERTED = "it has chosen a better task on the way to one"
    BASE_CHOSEN = "it has chosen a base"
    ARRIVED = "the vehicle is at the task, or above the base"
    SERVED = "the service is over, the attempt done or failed"
    SLOT_FREE = "the base has a slot for it"
    COMES_DOWN = "its battery is used up, and no slot free: it lands, or stands, beside them"
    SWAPPED = "its battery is full"
    DEPARTED = "it takes off for the task that it claims"
    STANDS_AT_BASE = "it stands at a base still: by an earlier life, a hold, or an order refused"
    CLAIM_LOST = "the task or base is no more to be had, somebody else's, or refused by the vehicle"
    HOLD = "the operator stops it"
    RESUME = "the operator lets it go on"
    MISSION_OVER = "the mission has ended while the operator holds it"
    RETURN = "it is to fly home, and there is time to do so in its own layer"
    RETURN_AT_ONCE = "it is to fly home from where it is"
    LANDED = "the vehicle is on the ground, and disarmed"
    HANDED_OVER = "the vehicle is somebody else's, or does not obey"
    EXPLAINED = "more is known of the vehicle that was handed over"
    HEARD_AGAIN = "the vehicle was only silent, and obeys again"
    DISMISSED = "nobody will need it any more, or it is told to stop"
    SUPERSEDED = "another process with this UAV's name keeps it"


_S, _T = AgentState, Trigger

# From any state in which the vehicle is or may become its own.
_TAKING_PART: Final[Mapping[Trigger, AgentState]] = {
    _T.HOLD: _S.PAUSED,
    _T.RETURN: _S.RETURNING_VIA_START,
    _T.RETURN_AT_ONCE: _S.RETURNING,
    _T.HANDED_OVER: _S.OUT,
    _T.SUPERSEDED: _S.YIELDED,
}
# On the way home; held there, home is still all that is left to fly to.
_GOING_HOME: Final[Mapping[Trigger, AgentState]] = {
    _T.HOLD: _S.PAUSED_HOMEBOUND,
    _T.LANDED: _S.HOME,
    # It was told to come home; nobody here can see whether it does.
    _T.HANDED_OVER: _S.LEFT,
    _T.SUPERSEDED: _S.YIELDED,
}

TRANSITIONS: Final[Mapping[AgentState, Mapping[Trigger, AgentState]]] = {
    _S.SYNCING: {
        **_TAKING_PART,
        _T.SYNCED: _S.PREPARING,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.PREPARING: {
        **_TAKING_PART,
        _T.CLAIM_RECOVERED: _S.RESUMING,
        _T.VEHICLE_READY: _S.IDLE,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.RESUMING: {
        **_TAKING_PART,
        _T.VEHICLE_READY: _S.FLYING,
        _T.CLAIM_LOST: _S.WAITING,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.WAITING: {
        **_TAKING_PART,
        _T.VEHICLE_READY: _S.IDLE,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.IDLE: {**_TAKING_PART, _T.DECIDED: _S.FLYING, _T.BASE_CHOSEN: _S.FLYING_TO_BASE},
    _S.FLYING: {
        **_TAKING_PART,
        _T.ARRIVED: _S.SERVING,
        _T.DIVERTED: _S.FLYING,
        _T.CLAIM_LOST: _S.IDLE,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.SERVING: {**_TAKING_PART, _T.SERVED: _S.IDLE, _T.CLAIM_LOST: _S.IDLE},
    _S.FLYING_TO_BASE: {
        **_TAKING_PART,
        _T.ARRIVED: _S.ABOVE_BASE,
        _T.CLAIM_LOST: _S.IDLE,
        _T.STANDS_AT_BASE: _S.SWAPPING,
    },
    _S.ABOVE_BASE: {
        **_TAKING_PART,
        _T.SLOT_FREE: _S.SWAPPING,
        _T.COMES_DOWN: _S.BESIDE_SLOTS,
        _T.CLAIM_LOST: _S.IDLE,
    },
    _S.BESIDE_SLOTS: {**_TAKING_PART, _T.SLOT_FREE: _S.SWAPPING},
    _S.SWAPPING: {
        **_TAKING_PART,
        _T.SWAPPED: _S.READY_ON_GROUND,
        _T.COMES_DOWN: _S.BESIDE_SLOTS,
        _T.CLAIM_LOST: _S.IDLE,
    },
    _S.READY_ON_GROUND: {
        **_TAKING_PART,
        _T.DECIDED: _S.DEPARTING,
        _T.BASE_CHOSEN: _S.FLYING_TO_BASE,
    },
    _S.DEPARTING: {
        **_TAKING_PART,
        _T.DEPARTED: _S.FLYING,
        _T.CLAIM_LOST: _S.READY_ON_GROUND,
    },
    _S.PAUSED: {
        **_TAKING_PART,
        _T.RESUME: _S.PREPARING,
        _T.STANDS_AT_BASE: _S.SWAPPING,
        _T.MISSION_OVER: _S.PAUSED_HOMEBOUND,
    },
    _S.PAUSED_HOMEBOUND: {**_TAKING_PART, _T.HOLD: _S.PAUSED_HOMEBOUND, _T.LANDED: _S.HOME},
    _S.RETURNING_VIA_START: {**_GOING_HOME, _T.RETURN_AT_ONCE: _S.RETURNING},
    _S.RETURNING: _GOING_HOME,
    _S.OUT: {
        _T.EXPLAINED: _S.OUT,
        _T.HEARD_AGAIN: _S.RETURNING,
        _T.DISMISSED: _S.LEFT,
        _T.SUPERSEDED: _S.YIELDED,
    },
    _S.HOME: {},
    _S.LEFT: {},
    _S.YIELDED: {},
}
"""Where each trigger leads from each state. The picture in agent/README.md shows the same."""

FROM_OUTSIDE: Final = frozenset(
    {
        _T.VEHICLE_READY,
        _T.ARRIVED,
        _T.SWAPPED,
        _T.HOLD,
        _T.RESUME,
        _T.RETURN,
        _T.RETURN_AT_ONCE,
        _T.LANDED,
        _T.HANDED_OVER,
        _T.EXPLAINED,
        _T.HEARD_AGAIN,
    }
)
"""What the vehicle says and what the operator or the mission wants: it may come late, or twice."""

TAKES_TARGETS: Final = frozenset(
    {
        _S.IDLE,
        _S.FLYING,
        _S.SERVING,
        _S.FLYING_TO_BASE,
        _S.ABOVE_BASE,
        _S.READY_ON_GROUND,
        _S.DEPARTING,
    }
)
"""The vehicle is under command and goes where it is sent, at a base from the ground up."""
BUSY: Final = frozenset({_S.FLYING, _S.SERVING})
"""It does a task that it claims, in the air."""
AT_BASE: Final = frozenset({_S.BESIDE_SLOTS, _S.SWAPPING, _S.READY_ON_GROUND, _S.DEPARTING})
"""The vehicle is on the ground, or about to touch down."""
VISITS_BASE: Final = frozenset({_S.FLYING_TO_BASE, _S.ABOVE_BASE, _S.BESIDE_SLOTS, _S.SWAPPING})
"""It stands by a base that it claims, and by no task."""
FREE: Final = frozenset({_S.WAITING, _S.IDLE, _S.READY_ON_GROUND})
"""It stands by no task; what its claim register names is over, or about to be replaced."""
TAKES_TASKS: Final = TAKES_TARGETS | {_S.RESUMING, _S.WAITING, _S.BESIDE_SLOTS, _S.SWAPPING}
"""Its claim register is the word of this life; in the other states it tells of the past."""
PAUSED_BY_OPERATOR: Final = frozenset({_S.PAUSED, _S.PAUSED_HOMEBOUND})
HEADED_HOME: Final = frozenset({_S.PAUSED_HOMEBOUND, _S.RETURNING_VIA_START, _S.RETURNING})
"""It has said that it takes no further part."""
TERMINAL: Final = frozenset(state for state, exits in TRANSITIONS.items() if not exits)
"""The process ends."""

STATUS_PHASE: Final[Mapping[AgentState, StatusPhase]] = {
    _S.SYNCING: StatusPhase.LEARNING,
    _S.PREPARING: StatusPhase.PREPARING,
    _S.RESUMING: StatusPhase.FLYING,
    _S.WAITING: StatusPhase.IDLE,
    _S.IDLE: StatusPhase.IDLE,
    _S.FLYING: StatusPhase.FLYING,
    _S.SERVING: StatusPhase.SERVING,
    _S.FLYING_TO_BASE: StatusPhase.FLYING,
    _S.ABOVE_BASE: StatusPhase.FLYING,
    _S.BESIDE_SLOTS: StatusPhase.SERVING,
    _S.SWAPPING: StatusPhase.SERVING,
    _S.READY_ON_GROUND: StatusPhase.IDLE,
    _S.DEPARTING: StatusPhase.FLYING,
    _S.PAUSED: StatusPhase.HOLDING,
    _S.PAUSED_HOMEBOUND: StatusPhase.HOLDING,
    _S.RETURNING_VIA_START: StatusPhase.RETURNING,
    _S.RETURNING: StatusPhase.RETURNING,
    _S.OUT: StatusPhase.OUT,
    _S.HOME: StatusPhase.HOME,
    _S.LEFT: StatusPhase.OUT,
    _S.YIELDED: StatusPhase.OUT,
}
"""What the UAV's status calls each state."""


class AgentStateMachine:
    """The state of one agent.

    Args:
        on_impossible: told of each trigger that `TRANSITIONS` has no entry for, though the agent
            decided it itself. A UAV in flight stays in its state then and is not left alone.
    """

    def __init__(self, on_impossible: Callable[[AgentState, Trigger], None]) -> None:
        self.state = AgentState.SYNCING
        self._on_impossible = on_impossible

    @property
    def phase(self) -> StatusPhase:
        """What the status calls the state."""
        return STATUS_PHASE[self.state]

    @property
    def acts(self) -> bool:
        """Whether this life has begun to act; until then, words in its name are of an earlier."""
        return self.state is not AgentState.SYNCING

    @property
    def takes_tasks(self) -> bool:
        """Whether the claim register is the word of this life."""
        return self.state in TAKES_TASKS

    @property
    def has_ended(self) -> bool:
        """Whether the process is to end."""
        return self.state in TERMINAL

    def allows(self, trigger: Trigger) -> bool:
        """Whether anything follows from ``trigger`` in this state."""
        return trigger in TRANSITIONS[self.state]

    def take(self, trigger: Trigger) -> bool:
        """Go where ``trigger`` leads; False if it leads nowhere from here."""
        after = TRANSITIONS[self.state].get(trigger)
        if after is None:
            if trigger not in FROM_OUTSIDE:
                self._on_impossible(self.state, trigger)
            return False
        self.state = after
        return True


# -- what is remembered only while one of these states lasts -----------------------------


@dataclass(slots=True)
class FreePeriod:
    """What a UAV knows of being free, from then until it becomes free again.

    It is made anew at each of these moments, so nothing of it need be undone.
    """

    since_s: float
    """Mission time of that, or since it may decide anew [s]; orders claims of the same time."""
    adrift: bool = False
    """Whether its vehicle still flies to a task that it has lost."""
    strays: bool = False
    """Whether it hovers in a zone that is new, or still flies where new ones may be."""
    to_decide: bool = True
    """Whether anything has changed since it last looked for a task."""
    found_nothing: bool = False
    """Whether it has looked in vain."""
    awaits_peers: bool = False
    """Whether it found nothing because others are to decide first."""
    retry_at_s: float | None = None
    """When it looks again, whatever happens."""


@dataclass(slots=True)
class TaskAttempt:
    """What is going to happen to the task that a UAV claims, and when; made anew for each."""

    held_at_s: float | None = None
    """When the claim turns from proposed to held."""
    awaits_way: bool = False
    """Whether nobody has objected in time, and the claim is held as soon as the UAV departs."""
    ready_by_s: float | None = None
    """Until when the vehicle must be under command again, for an earlier life's claim to last."""
    served_at_s: float | None = None
    """When the service is over."""
    fails: bool = False
    """Whether the attempt is known to fail."""
    departs_at_s: float | None = None
    """When the UAV takes off for it, from the ground."""
    begins_at_s: float | None = None
    """When the work on the spot begins, where that is not at once."""
    too_late_at_s: float | None = None
    """From when on the UAV can't be there in time any more."""

    def next_deadline_s(self) -> float | None:
        """When any of that is due."""
        return earliest(
            self.held_at_s,
            self.served_at_s,
            self.ready_by_s,
            self.departs_at_s,
            self.begins_at_s,
            self.too_late_at_s,
        )
