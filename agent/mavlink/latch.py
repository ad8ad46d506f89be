"""To whom a listening link belongs: of all that send to it, the one who speaks for the vehicle.

Whatever does not prove to be the configured autopilot's binds the link to nobody, and keeps
it bound to nobody. Proof is a frame of that autopilot; with a signing key, one that was
believed for its signature. While the peer gives proof, what others send is dropped, so that
who cannot take the link cannot disturb it either. It moves

- at once to whoever gives proof by a signature: only the vehicle can, from wherever it is
  heard now (a radio that rebooted, another port of a NAT);
- without a key to whoever gives proof after the peer has given none for a while: who is
  first to forge the vehicle's frames is not told from it.

Leaves out: frames (agent.mavlink.framing) and sockets (agent.mavlink.link).
"""

from __future__ import annotations

import math
from collections.abc import Hashable

__all__ = ["PeerLatch"]


class PeerLatch:
    """The peer of one link.

    Args:
        silence_s: after so long without proof of the peer, another's counts.
        signed: whether proof is a signature.
    """

    def __init__(self, silence_s: float, *, signed: bool) -> None:
        self._silence_s = silence_s
        self._signed = signed
        self._proved_s = -math.inf
        self.peer: Hashable | None = None
        """Whom to answer; None while nobody has given proof."""
        self.strangers = 0
        """Pieces dropped because somebody else than the peer sent them."""

    def admits(self, source: Hashable, now_s: float, *, proof: bool) -> bool:
        """Whether to listen to what ``source`` sent at ``now_s``; remembers it if it is proof."""
        deserted = self.peer is None or now_s - self._proved_s > self._silence_s
        mine = source == self.peer
        if proof and (mine or deserted or self._signed):
            self.peer, self._proved_s = source, now_s
            return True
        if mine or deserted:  # another vehicle is heard as such, and never commanded
            return True
        self.strangers += 1
        return False

    def excuse_silence(self, now_s: float) -> None:
        """Nobody was listened to: the peer's silence counts from now on."""
        if self.peer is not None:
            self._proved_s = max(self._proved_s, now_s)

    def forget(self) -> None:
        """The link is a new one."""
        self.peer = None
