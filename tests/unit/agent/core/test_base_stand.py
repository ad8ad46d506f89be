"""Where a UAV says that it stands while it waits for its way up."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.base_stand import BaseStand
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase

STANDS = Claim(ClaimPhase.HELD, None, 40.0, 0, 70.0, base="b0", stage=BaseStage.LANDED)
DECIDED = Claim(ClaimPhase.PROPOSED, "t0", 70.0, 1, 90.0)


@pytest.mark.parametrize("stage", [BaseStage.LANDED, BaseStage.PARKED])
def test_it_stands_as_its_own_last_word_has_it(stage: BaseStage) -> None:
    stand = BaseStand()
    stand.wait(replace(STANDS, stage=stage))

    said = stand.told(DECIDED, 71.0)
    assert (said.base, said.stage, said.departs_s) == ("b0", stage, 71.0)


def test_who_has_left_its_slot_to_others_meanwhile_holds_it_no_longer() -> None:
    """It was refused its way up, found nothing to do, and decides again."""
    stand = BaseStand()
    stand.wait(STANDS)
    stand.wait(stand.told(DECIDED, 71.0))
    assert stand.told(DECIDED, 71.0).stage is BaseStage.LANDED

    stand.wait(replace(STANDS, phase=ClaimPhase.IDLE, stage=BaseStage.PARKED))
    assert stand.told(DECIDED, 85.0).stage is BaseStage.PARKED


def test_who_has_taken_off_stands_nowhere() -> None:
    stand = BaseStand()
    stand.wait(STANDS)
    stand.leave()
    assert not stand.waits
    assert stand.told(DECIDED, 71.0) == DECIDED
