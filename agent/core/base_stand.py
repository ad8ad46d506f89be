"""Where one UAV stands until its way up is granted, as its claims tell it.

By its own books a UAV has left its base once it has decided to; others are to know that it holds
its slot until it really takes off.
"""

from __future__ import annotations

from dataclasses import replace

from swarm.protocol.uav_messages import BaseStage, Claim


class BaseStand:
    """The base at which a UAV waits for its way up."""

    def __init__(self) -> None:
        self._at: tuple[str, BaseStage] | None = None
        self._left = False
        """Whether it has taken off from there since it last said anything."""

    @property
    def waits(self) -> bool:
        """Whether it stands at a base that it has been sent off from, or is to be."""
        return self._at is not None

    def wait(self, claim: Claim | None) -> None:
        """It waits for its way up, perhaps at a base, by its own last word."""
        stands = claim is not None and claim.stage in (BaseStage.LANDED, BaseStage.PARKED)
        if stands and claim is not None and claim.base and claim.stage:
            self._at = claim.base, claim.stage

    def leave(self) -> None:
        """It takes off now."""
        self._left |= self._at is not None
        self._at = None

    def told(self, claim: Claim, mission_s: float) -> Claim:
        """``claim`` of who holds its slot until it really takes off."""
        if self._at is None or claim.base is not None:
            return claim
        base, stage = self._at
        departs_s = claim.departs_s if claim.task is None else mission_s
        return replace(claim, base=base, stage=stage, departs_s=departs_s)

    def left(self, claim: Claim, sortie_end_s: float) -> Claim:
        """``claim``, as it is once it has taken off; told once for each time.

        Args:
            claim: its last one.
            sortie_end_s: by when it must have landed now [s mission time].
        """
        left, self._left = self._left, False
        if not left or claim.task is None or claim.departs_s is None:
            return claim
        until_s = claim.sortie_end_s and sortie_end_s
        return replace(claim, base=None, stage=None, departs_s=None, sortie_end_s=until_s)
