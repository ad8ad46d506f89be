"""A rough network on which everything travels in envelopes, and somebody may lie.

Every statement and answer is packed by the codec of who says it and read by one codec that
stands for all who hear it, with real signatures: what that drops, nobody hears. Lies are put
on it as bytes on a key, from nowhere, and reach everyone at once. Leaves out: what the lies
are (tests.chaos.insider), and rosters that differ between processes.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions, Node
from sim.world.rough_network import RoughNetwork
from swarm.protocol.codec import Codec
from swarm.protocol.events import KeysReplaced, MessageReceived, PeerGone
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.seal import Seal


class SealedNetwork(RoughNetwork):
    """Joins seats that believe only what is signed.

    Args:
        queue: virtual time.
        conditions: at its best.
        seed: of every delay and loss.
        mission: mission name.
        seal_of: the seal of each writer; the first one asked for is not yet that of anyone.
        ear: by which all judge what they hear.
    """

    def __init__(
        self,
        queue: EventQueue,
        conditions: NetworkConditions,
        seed: int,
        mission: str,
        seal_of: Callable[[str], Seal],
        ear: Seal,
    ) -> None:
        super().__init__(queue, conditions, seed)
        self.ear = Codec(mission, ear)
        """What everyone hears goes through it; counts what it drops."""
        self.overheard: Callable[[str, bytes], None] = lambda _key, _data: None
        """Told every statement as the bus carries it, and the key it is said on."""
        self.amend: Callable[[str, bytes, bytes], bytes] = lambda _writer, answer, _nonce: answer
        """What becomes of an answer of that writer to the question with that nonce."""
        self._seal_of = seal_of
        self._keys = KeySpace(mission)
        self._codecs: dict[str, Codec] = {}
        self._mission = mission
        self._seal = ear
        self._questions = 0

    def publish(self, sender: Node, message: Message, to: Collection[str] | None = None) -> None:
        """Tell everyone it reaches what is left of ``message`` behind the seals."""
        packed = self._codec(message.writer).pack(message)
        if packed is not None:
            self.overheard(message.key, packed)
            heard = self.ear.decode(message.key, packed)
            if heard is not None:
                super().publish(sender, heard, to)

    def lie(self, key: str, data: bytes) -> None:
        """Somebody puts ``data`` on ``key``; nobody is parted from who lies."""
        heard = self.ear.decode(key, data)
        if heard is not None:
            for seat in list(self._seats):
                if seat.writer != heard.writer:
                    seat.receive(MessageReceived(heard))

    def revoke(self, signed_roster: str) -> None:
        """That roster is in force everywhere from now on."""
        before = self._seal.roster
        self._seal.put_in_force(signed_roster)
        replaced = self._seal.roster.replaced_since(before)
        gone = [name for name in sorted(replaced) if self._seal.roster.entry(name) is None]
        for seat in list(self._seats):
            if seat.writer not in replaced:
                seat.receive(KeysReplaced(replaced))
                for name in gone:
                    seat.receive(PeerGone(name))

    def reissue(self, writer: str, signed_roster: str) -> None:
        """By that roster ``writer`` has new keys, with which its next life begins."""
        self._codecs.pop(writer, None)
        self.revoke(signed_roster)

    def _answer_of(self, seat: Node, *, whole: bool) -> Snapshot | None:
        answer = seat.answer(whole=whole)
        if answer is None:
            return None
        self._questions += 1
        nonce = self._questions.to_bytes(16, "big")
        packed, _ = self._codec(answer.writer).pack_answer(answer, nonce)
        told = self.amend(answer.writer, packed, nonce)
        return self.ear.decode_snapshot(self._keys.state(answer.writer), told, nonce)

    def _codec(self, writer: str) -> Codec:
        codec = self._codecs.get(writer)
        if codec is None:
            codec = self._codecs[writer] = Codec(self._mission, self._seal_of(writer))
        return codec
