"""What one step of an agent comes to: in which order it is carried out, and what need not be.

The vehicle comes first, since it waits while keeping and telling take their time.
"""

from __future__ import annotations

from agent.core.interface import Action, GoTo, OrderVehicle
from swarm.protocol.events import PublishLast


def arranged(actions: list[Action]) -> list[Action]:
    """``actions`` in the order in which they are to be carried out.

    Without targets that were given up for another one in the same step: a vehicle would turn, or
    stop, for each of them.
    """
    if len(actions) < 2:
        return actions
    targets = [index for index, action in enumerate(actions) if _is_target(action)]
    given_up = set(targets[:-1])
    kept = [action for index, action in enumerate(actions) if index not in given_up]
    kept.sort(key=_place)
    return kept


def _is_target(action: Action) -> bool:
    return isinstance(action, OrderVehicle) and isinstance(action.order, GoTo)


def _place(action: Action) -> int:
    match action:
        case OrderVehicle():
            return 0
        case PublishLast():
            return 2
        case _:
            return 1
