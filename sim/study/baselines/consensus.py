"""Phase 2 of CBBA: what a UAV believes after hearing what another believes.

The action rules of Table I in Choi, Brunet and How 2009 (doi:10.1109/TRO.2009.2022423), for any
network and for many receivers and all tasks at once. Equal bids go to the smaller UAV index.
Leaves out: bids (`sim.study.baselines.cbba`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swarm.allocation.problem import BoolArray, FloatArray, IntArray

__all__ = ["NOBODY", "NO_BID", "Beliefs", "hear"]

NOBODY = -1
"""Winner of a task for which no bid is known."""
NO_BID = -np.inf
"""Bid for such a task. The paper has 0, and tasks not worth it stay behind; eq. 1 wants all."""


@dataclass(frozen=True, slots=True, eq=False)
class Beliefs:
    """What every UAV believes; row i is UAV i's."""

    winner: IntArray
    """(n_uav, n_task) z: who wins each task; `NOBODY` if none."""
    bid: FloatArray
    """(n_uav, n_task) y: the winner's bid [value·s]; `NO_BID` if none."""
    heard: IntArray
    """(n_uav, n_uav) s: the round of the newest information about each UAV."""

    @classmethod
    def blank(cls, n_uav: int, n_task: int) -> Beliefs:
        """Nobody has bid, nobody has been heard."""
        return cls(
            np.full((n_uav, n_task), NOBODY, dtype=np.int64),
            np.full((n_uav, n_task), NO_BID),
            np.zeros((n_uav, n_uav), dtype=np.int64),
        )

    def copy(self) -> Beliefs:
        """Independent arrays."""
        return Beliefs(self.winner.copy(), self.bid.copy(), self.heard.copy())


def hear(beliefs: Beliefs, said: Beliefs, sender: int, receivers: IntArray, now: int) -> None:
    """Let ``receivers`` take in one message of ``sender``.

    Args:
        beliefs: changed in place.
        said: what was believed when the message was sent.
        sender: index of a UAV, not among the receivers.
        receivers: (k,) indices.
        now: number of this round; timestamps of direct contact.
    """
    own = receivers[:, None]
    mine, my_bid = beliefs.winner[receivers], beliefs.bid[receivers]
    theirs, their_bid = said.winner[sender], said.bid[sender]
    better = (their_bid > my_bid) | ((their_bid == my_bid) & (theirs < mine))

    news = said.heard[sender] > beliefs.heard[receivers]  # (k, n_uav): s_km > s_im
    stale = said.heard[sender] < beliefs.heard[receivers]
    # a winner that is nobody points anywhere; every use below asks for somebody first
    news_of_mine = np.take_along_axis(news, np.maximum(mine, 0), axis=1)
    news_of_theirs = news[:, theirs]
    stale_of_theirs = stale[:, theirs]

    i_win, sender_wins, nobody = mine == own, mine == sender, mine == NOBODY
    third = ~(i_win | sender_wins | nobody)
    says_self, says_nobody = theirs == sender, theirs == NOBODY
    says_me = theirs == own
    says_third = ~(says_self | says_nobody | says_me)
    same, other = third & (mine == theirs), third & (mine != theirs)

    update: BoolArray = says_self & (
        (i_win & better) | sender_wins | (third & (news_of_mine | better)) | nobody
    )
    reset: BoolArray = says_me & (sender_wins | (third & news_of_mine))
    update |= (
        says_third
        & news_of_theirs
        & ((i_win & better) | sender_wins | same | (other & (news_of_mine | better)) | nobody)
    )
    reset |= says_third & sender_wins & ~news_of_theirs
    reset |= says_third & other & news_of_mine & stale_of_theirs
    update |= says_nobody & (sender_wins | (third & news_of_mine))

    beliefs.winner[receivers] = np.where(update, theirs, np.where(reset, NOBODY, mine))
    beliefs.bid[receivers] = np.where(update, their_bid, np.where(reset, NO_BID, my_bid))
    beliefs.heard[receivers] = np.maximum(beliefs.heard[receivers], said.heard[sender])
    beliefs.heard[receivers, sender] = now
