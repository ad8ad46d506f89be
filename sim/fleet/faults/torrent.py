"""A hostile agent with valid keys that says as much as it can, as a process of its own.

::

    python -m sim.fleet.faults.torrent --keys DIR --mission NAME --connect ENDPOINT --rate-hz 10000

A third of it are its own claims, genuinely signed, and repeated for ever; a third the same with
signatures that are none, each of which costs whoever looks at it a check; a third claims of
others. Every second it tells how much it has sent, as a line of JSON.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import secrets
import signal
import sys
from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path

import zenoh

from swarm.bus.tls import secure
from swarm.bus.zenoh_session import close_session, open_session, session_config
from swarm.identity import Identity, load_identity
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.seal import SIGNATURE_BYTES, Seal, open_envelope, seal_of
from swarm.protocol.uav_messages import Claim, ClaimPhase
from swarm.runtime.clock import SystemClock

_GENUINE = 2000
"""Its own claims that are signed beforehand."""
_TURN_S = 0.01
"""Between two handfuls."""
_TOLD_S = 1.0
"""Between two lines."""
_LEASE_S = 2.0
_LIMIT_S = 10.0
"""For opening and closing."""


def torrent(mission: str, seal: Seal, others: Sequence[str]) -> Iterator[tuple[str, bytes]]:
    """Key and payload of one message after the other, of the three kinds in turn, for ever."""
    keys = KeySpace(mission)
    body = Claim(ClaimPhase.HELD, "t1", 1.0, 0, 2.0)
    said = [Message(mission, seal.name, Stamp(1, n), body) for n in range(1, _GENUINE + 1)]
    genuine = cycle([seal.wrap(encode(each)) for each in said])
    for other in cycle(others):
        honest = next(genuine)
        opened = open_envelope(honest)
        signature = b"" if opened is None else opened.signature
        forged = honest.replace(signature, secrets.token_bytes(SIGNATURE_BYTES))
        yield keys.claim(seal.name), honest
        yield keys.claim(seal.name), forged
        yield keys.claim(other), forged


async def _pour(identity: Identity, options: argparse.Namespace, ended: list[int]) -> None:
    seal = seal_of(identity)
    if seal is None:
        return
    config = session_config("client", listen=[], connect=options.connect, lease_s=_LEASE_S)
    secure(config, identity, "client", identity.roster)
    messages = torrent(identity.mission, seal, options.other)
    session = await open_session(config, timeout_s=_LIMIT_S)
    try:
        clock = SystemClock()
        begin_s = told_s = clock.now_s()
        sent = 0
        while not ended:
            now_s = clock.now_s()
            for _ in range(round(options.rate_hz * (now_s - begin_s)) - sent):
                key, payload = next(messages)
                session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
                sent += 1
            if now_s - told_s >= _TOLD_S:
                told_s = now_s
                sys.stdout.write(json.dumps({"sent": sent, "wall_s": now_s - begin_s}) + "\n")
                sys.stdout.flush()
            await asyncio.sleep(_TURN_S)
    finally:
        close_session(session, limit_s=_LIMIT_S)


def main(words: Sequence[str]) -> int:
    """Flood until SIGTERM."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--keys", type=Path, required=True)
    parser.add_argument("--mission", required=True)
    parser.add_argument("--connect", action="append", required=True)
    parser.add_argument("--rate-hz", type=float, required=True)
    parser.add_argument("--other", action="append", required=True)
    options = parser.parse_args(words)
    ended: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: ended.append(number))
    asyncio.run(_pour(load_identity(options.keys, mission=options.mission), options, ended))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
