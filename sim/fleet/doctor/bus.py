"""Whether the bus can be reached, who is there, and how fast they answer.

Looks on and asks; shows no token, and nobody flies any differently for it.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.fleet.doctor.finding import CheckFinding, fails, fine, warns
from sim.fleet.doctor.probes import look_at_port
from swarm.bus.config import (
    BusConfig,
    ClientTopology,
    FileTopology,
    MeshTopology,
    bus_config,
    is_encrypted,
)
from swarm.bus.loopback import free_loopback_endpoints
from swarm.bus.port import Bus, LinkUp, Query, TokenSeen
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.protocol.key_space import ANY_TOKEN, KeySpace, mission_of_token
from swarm.protocol.sync import NONCE_BYTES, encode_question
from swarm.runtime.errors import SwarmError

DIAL_S = 2.0
"""How long a connection may take before it is given up [wall s]."""
LOOPBACK_S = 10.0
"""How long a session on loopback may take to answer before it is said not to work [wall s]."""
SETTLE_S = 0.6
"""How long tokens are waited for once there is a session [wall s]."""
ANSWER_S = 1.0
"""How long answers are waited for [wall s]."""
SLOW_S = 0.25
"""Round trip from which on `--link bad` suits better [s]."""
_ADDRESS = re.compile(r"(tcp|tls|ws|quic)/(\[[^\]]+\]|[^:]+):(\d+)")
_START_ROUTER = "start one there: swarm router --listen tcp/0.0.0.0:{port} --unencrypted"
_START_SECURE_ROUTER = "start one there: swarm router --keys DIR --listen tls/0.0.0.0:{port}"


@dataclass(frozen=True, slots=True)
class DialResult:
    """What came of a connection to an endpoint."""

    endpoint: str
    took_s: float
    problem: str | None
    """Why there is none; None if there was."""


@dataclass(frozen=True, slots=True)
class BusView:
    """What there is on the bus."""

    linked: bool
    """Whether there is anybody at all."""
    missions: tuple[str, ...]
    writers: tuple[str, ...]
    """Who shows a token in the mission asked for, or in the only one."""
    answers: int
    round_trip_s: float | None
    """Until the first answer."""


async def check_zenoh() -> CheckFinding:
    """Whether Zenoh works at all: one session on loopback asks another."""
    loop = asyncio.get_running_loop()
    (endpoint,) = free_loopback_endpoints(1, np.random.default_rng())
    key = "swarm/doctor/state/self"
    try:
        one = await open_zenoh_bus(bus_config("mesh", endpoint, ()), timeout_s=DIAL_S)
        with contextlib.closing(one):
            (own,) = free_loopback_endpoints(1, np.random.default_rng())
            other = await open_zenoh_bus(bus_config("mesh", own, (endpoint,)), timeout_s=DIAL_S)
            with contextlib.closing(other):
                one.serve(key)
                answering = loop.create_task(_answer(one))
                await _linked(other, DIAL_S)
                asked_s = loop.time()
                # The news that somebody serves the key may be on its way still.
                answers = await _until_answered(other, key)
                answering.cancel()
    except (OSError, SwarmError) as fault:
        return fails("zenoh", f"no session on loopback: {fault}", "let the firewall pass loopback")
    if not answers:
        return fails("zenoh", "a session on loopback gets no answer", "install eclipse-zenoh anew")
    return fine("zenoh", f"works on loopback, round trip {_ms(answers[0] - asked_s)}")


async def _answer(bus: Bus) -> None:
    while True:
        await bus.inbox.wait()
        for event in bus.inbox.take():
            if isinstance(event, Query):
                event.reply(b"here")


async def _until_answered(bus: Bus, key: str) -> list[float]:
    """When answers came [s of the loop]; asked for a while, as a busy machine is slow to answer."""
    loop = asyncio.get_running_loop()
    until_s = loop.time() + LOOPBACK_S
    while (left_s := until_s - loop.time()) > 0.0:
        answers = await bus.query(key, timeout_s=min(left_s, DIAL_S))
        if answers:
            return [answer.arrived_s for answer in answers]
        await asyncio.sleep(0.05)
    return []


async def check_bus(
    config: BusConfig, mission: str | None, *, asked_for: bool
) -> list[CheckFinding]:
    """Whether the bus of that seat can be reached, and who is there.

    ``mission`` should be flown there; None for whatever there is. Unless it was ``asked_for``, the
    bus need not be there.
    """
    findings = []
    topology = config.topology
    if isinstance(topology, MeshTopology):
        findings.append(_check_listen(topology.listen))
    dialed = await asyncio.gather(*(dial(endpoint) for endpoint in _dialed(config)))
    reached = [each for each in dialed if each.problem is None]
    if isinstance(topology, ClientTopology) and not reached and not asked_for and mission is None:
        text = f"no router at {topology.routers[0]}; swarm run starts its own"
        return [fine("bus", text)]
    enough = bool(reached) and isinstance(topology, ClientTopology)
    findings += [judge_dial(each, enough=enough) for each in dialed]
    if isinstance(topology, FileTopology):
        findings.append(fine("bus", f"as {topology.path} says"))
    elif dialed and not reached:
        return findings  # a session would only wait for what is not there
    try:
        bus = await open_zenoh_bus(config, timeout_s=2.0 * DIAL_S)
    except SwarmError as fault:
        remedy = "see that a router runs there, and lets this machine and its keys in"
        return [*findings, fails("session", str(fault), remedy)]
    with contextlib.closing(bus):
        found = await _look(bus, mission, config.mission)
    return [*findings, *check_session(found, mission)]


def judge_dial(reached: DialResult, *, enough: bool) -> CheckFinding:
    """Whether an endpoint accepts connections; where others do that may be ``enough``."""
    what = f"bus {reached.endpoint}"
    if reached.problem is None:
        return fine(what, f"accepts connections, after {_ms(reached.took_s)}")
    port = reached.endpoint.rpartition(":")[2]
    start = _START_SECURE_ROUTER if is_encrypted(reached.endpoint) else _START_ROUTER
    remedy = f"see that this machine reaches it, or {start.format(port=port)}"
    return (warns if enough else fails)(what, reached.problem, remedy)


def check_session(found: BusView, mission: str | None) -> list[CheckFinding]:
    """Who is on the bus, and how fast they answer."""
    if not found.linked:
        text = "nobody is linked to this process"
        remedy = "start the others, and see that one of every two dials the other's --listen"
        return [warns("session", text, remedy)]
    missions = ", ".join(found.missions) or "no mission yet"
    findings = [fine("session", f"open; missions there: {missions}")]
    if mission is not None and mission not in found.missions:
        remedy = "start its coordinator and agents on this bus, or correct --mission"
        findings.append(fails("mission", f"nobody flies {mission} here", remedy))
    if found.writers:
        findings.append(fine("tokens", f"{len(found.writers)} there: {', '.join(found.writers)}"))
        if found.round_trip_s is None:
            remedy = "see swarm status who hangs, and the load of their machines"
            findings.append(warns("round trip", f"no answer within {ANSWER_S:g} s", remedy))
        else:
            text = f"first of {found.answers} answers after {_ms(found.round_trip_s)}"
            if found.round_trip_s > SLOW_S:
                remedy = "start every process of the mission with --link bad"
                findings.append(warns("round trip", text, remedy))
            else:
                findings.append(fine("round trip", text))
    return findings


async def dial(endpoint: str) -> DialResult:
    """Connect to an endpoint and hang up; what is not TCP only a session can try."""
    loop = asyncio.get_running_loop()
    match = _ADDRESS.fullmatch(endpoint.partition("?")[0].partition("#")[0])
    if match is None or match[1] == "quic":
        return DialResult(endpoint, 0.0, None)
    began_s = loop.time()
    try:
        async with asyncio.timeout(DIAL_S):
            _, writer = await asyncio.open_connection(match[2].strip("[]"), int(match[3]))
    except TimeoutError:
        return DialResult(endpoint, DIAL_S, f"no answer within {DIAL_S:g} s")
    except OSError as fault:
        problem = "nobody listens there" if isinstance(fault, ConnectionRefusedError) else ""
        return DialResult(endpoint, loop.time() - began_s, problem or fault.strerror or str(fault))
    took_s = loop.time() - began_s
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()
    return DialResult(endpoint, took_s, None)


async def _look(bus: Bus, mission: str | None, only: str | None) -> BusView:
    """What there is to see; with keys only their mission is."""
    loop = asyncio.get_running_loop()
    bus.watch_tokens(ANY_TOKEN if only is None else KeySpace(only).alive("*"))
    linked, tokens = False, set[str]()
    until_s = loop.time() + SETTLE_S
    while (left_s := until_s - loop.time()) > 0.0:
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(left_s):
                await bus.inbox.wait()
        for event in bus.inbox.take():
            linked = linked or isinstance(event, LinkUp)
            if isinstance(event, TokenSeen):
                tokens.add(event.key)
    missions = sorted({name for token in tokens if (name := mission_of_token(token))})
    looked_at = mission or only or (missions[0] if len(missions) == 1 else None)
    if looked_at is None or looked_at not in missions:
        return BusView(linked, tuple(missions), (), 0, None)
    keys = KeySpace(looked_at)
    writers = sorted(name for token in tokens if (name := keys.writer_of_token(token)))
    asked_s = loop.time()
    question = encode_question({}, secrets.token_bytes(NONCE_BYTES), bus.seal)
    answers = await bus.query(keys.state("*"), question, timeout_s=ANSWER_S)
    first_s = min((answer.arrived_s for answer in answers), default=None)
    round_trip_s = None if first_s is None else first_s - asked_s
    return BusView(linked, tuple(missions), tuple(writers), len(answers), round_trip_s)


async def _linked(bus: Bus, limit_s: float) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(limit_s):
            while True:
                await bus.inbox.wait()
                if any(isinstance(event, LinkUp) for event in bus.inbox.take()):
                    return


def _dialed(config: BusConfig) -> Sequence[str]:
    match config.topology:
        case ClientTopology(routers):
            return routers
        case MeshTopology(_, dial_):
            return dial_
        case _:
            return ()


def _check_listen(endpoint: str) -> CheckFinding:
    match = _ADDRESS.fullmatch(endpoint.partition("?")[0].partition("#")[0])
    if match is None:
        return fine("bus", f"listens at {endpoint}")
    host, port, datagrams = match[2].strip("[]"), int(match[3]), match[1] == "quic"
    return look_at_port("bus", endpoint, host, port, datagrams=datagrams)


def _ms(duration_s: float) -> str:
    return f"{1e3 * duration_s:.1f} ms"
