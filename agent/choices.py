"""What one agent says of its choices: what it chose from, and all that each rested on.

It is put together when everything that follows from a choice has been done, so neither the order to
the vehicle nor the claim waits for it. Leaves out: choosing (agent.deciding), and deciding again
from what was said and recorded (sim.redecide).
"""

from __future__ import annotations

from agent.deciding import Turn
from agent.speech import Speech
from swarm.allocation.lower_level import CompiledRule, Decision, Rule, TeamState
from swarm.allocation.problem import IntArray, Problem
from swarm.events import PublishLast
from swarm.state.registers import Replica
from swarm.wire.choice import MAX_CANDIDATES, Basis, Candidate, choice_id
from swarm.wire.digest import combined, fingerprint
from swarm.wire.messages import Choice, Claim, Epoch, Message, Stamp

__all__ = ["Choices", "Witness"]


class Witness:
    """A rule, and the state in which one UAV last decided by it."""

    def __init__(self, rule: Rule, uav: int) -> None:
        self.name = rule.name
        self._rule = rule
        self._uav = uav
        self._state: TeamState | None = None

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """Whatever the rule says."""
        if uav == self._uav:
            self._state = state.copy()
        return self._rule.decide(problem, state, rank, uav)

    def valued(self, problem: Problem, decision: Decision) -> tuple[tuple[int, float], ...]:
        """Tasks that ``decision`` chose from, with their scores: what it took, then best first."""
        found = decision.valued[:MAX_CANDIDATES]
        if not found and self._state is not None and isinstance(self._rule, CompiledRule):
            found = self._rule.valued(problem, self._state, decision.uav, MAX_CANDIDATES)
        return found or ((decision.task, decision.score),)


class Choices:
    """The choices of the agent of ``uav`` in this life of it.

    Args:
        uav: id of the UAV.
        replica: the shared registers.
        speech: what the agent says.
    """

    def __init__(self, uav: str, replica: Replica, speech: Speech) -> None:
        self._uav = uav
        self._replica = replica
        self._speech = speech
        self._number = 0

    @property
    def label(self) -> dict[str, object]:
        """For the log, which choice its lines are about: the last one, if there was any."""
        return {"decision": choice_id(self._uav, self._number)} if self._number else {}

    def made(
        self,
        turn: Turn,
        problem: Problem,
        epoch: Epoch,
        witness: Witness,
        decision: Decision,
        claim: Claim,
        left: str | None,
    ) -> PublishLast:
        """Count a choice that has been made, before it is claimed; what is to be said of it.

        Args:
            turn: who chose, when and where.
            problem: every UAV and every task on the board.
            epoch: in force.
            witness: the rule by which it chose.
            decision: what came of it.
            claim: what the UAV is about to claim.
            left: the task it turned aside from; None when it was free.
        """
        self._number += 1
        head, before = self._replica.heads.get(self._uav), self._speech.claimed
        number = self._number

        def make() -> Message:
            choice = Choice(
                number=number,
                task=problem.task_ids[decision.task],
                left=left,
                chosen_s=turn.now_s,
                epoch=epoch.number,
                rule=epoch.rule,
                rank=claim.rank,
                score=decision.score,
                second_score=decision.second_score,
                certificate=decision.certificate,
                completion_s=decision.completion_s,
                candidates=tuple(
                    Candidate(problem.task_ids[task], score)
                    for task, score in witness.valued(problem, decision)
                ),
                basis=self._basis(turn, head, before),
            )
            return self._speech.say(choice).message

        return PublishLast(make)

    def _basis(self, turn: Turn, head: Stamp | None, before: Message | None) -> Basis:
        """What the choice rested on; of all registers only the own claim has changed since.

        Args:
            turn: who chose, when and where.
            head: of the own statements when it chose.
            before: the own claim register then.
        """
        heads = {**self._replica.heads, self._uav: head}
        claims = [message for message in (before, self._speech.claimed) if message is not None]
        numbers = [*self._replica.digest().values(), *map(fingerprint, claims)]
        claimants = self._replica.claims
        return Basis(
            decided_s=turn.decided_s,
            place_enu_m=turn.place_enu_m,
            patience_s=turn.patience_s,
            credible=tuple(sorted(uav for uav in turn.credible if uav in claimants)),
            awaited=tuple(sorted(turn.awaited)),
            excluded=tuple(sorted(turn.excluded)),
            heads={
                writer: (stamp.incarnation, stamp.counter)
                for writer, stamp in heads.items()
                if stamp is not None
            },
            digest=combined(numbers),
        )
