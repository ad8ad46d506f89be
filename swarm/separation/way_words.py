"""What one word about a way tells beyond another, and whom.

Of what air a UAV takes all that others must know is told to all; the rest waits for its next word,
or is told to those alone whom it concerns: see README.md.
"""

from __future__ import annotations

from dataclasses import replace

from swarm.protocol.uav_messages import Claim, ClaimedWay


def adds_nothing(now: ClaimedWay | None, said: ClaimedWay | None) -> bool:
    """Whether ``now`` tells nothing beyond what was ``said``, but for grants.

    Who was granted something is told so by itself; and a grant of a request that is over may be
    left out, and is worth nothing where it is not.
    """
    if now is None or said is None or now is said:
        return now is said
    return replace(now, grants=said.grants) == said


def grants_alone(uav: str, now: Claim, before: Claim) -> bool:
    """Whether ``now`` tells nothing beyond ``before`` but of grants to others than ``uav``."""
    way, known = now.way, before.way
    if way is None or known is None or way.number != known.number or now.phase != before.phase:
        return False
    if way.grants.get(uav) != known.grants.get(uav):
        return False
    return replace(now, way=replace(way, grants=known.grants)) == before


def ends_like(now: ClaimedWay, said: ClaimedWay) -> bool:
    """Whether ``now`` is what was ``said``, or its end, and maybe flown by now.

    What others take for taken by what was said is then no less than what is taken now: who has
    granted a request knows that it may be flown.
    """
    path = said.path_enu_m[max(0, len(said.path_enu_m) - len(now.path_enu_m)) :]
    told = replace(said, path_enu_m=path, flies=said.flies or now.flies, shift_m=now.shift_m)
    return bool(path) and adds_nothing(now, told)
