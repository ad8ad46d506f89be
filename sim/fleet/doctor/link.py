"""Listens on the link to an autopilot for a while."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path

from agent.links.link import open_link
from agent.vehicle.config import LinkAddress, SerialAddress, TcpAddress, UdpInAddress, parse_link
from agent.vehicle.signing import Signing, SigningKey
from sim.fleet.doctor.bus import dial
from sim.fleet.doctor.finding import CheckFinding, CheckState, fails
from sim.fleet.doctor.probes import look_at_port
from sim.fleet.doctor.vehicle import ASK_AGAIN_S, VehicleListener
from swarm.runtime.clock import SystemClock, unix_s
from swarm.runtime.errors import Fault, InputError

LISTEN_S = 2.0
"""How long a vehicle that was heard is listened to at least [wall s]."""
_CONDITION_S = 0.05


@dataclass(frozen=True, slots=True)
class VehicleAddress:
    """Where an autopilot is, and its system id."""

    address: LinkAddress
    system_id: int


def parse_vehicle(text: str) -> VehicleAddress:
    """The vehicle of ``URL``, ``URL#SYSID`` or ``URL=SYSID``; without an id it is 1.

    Raises:
        InputError: it is neither.
    """
    url, marked, number = text.replace("=", "#").partition("#")
    if marked and not (number.isascii() and number.isdigit() and 1 <= int(number[:4]) <= 255):
        problem = f"{number!r} is not a whole number within 1..255"
        raise InputError(Fault("--mavlink", text, problem, "give URL#SYSID"))
    return VehicleAddress(parse_link(url), int(number) if marked else 1)


async def check_vehicle(
    vehicle: VehicleAddress, key: SigningKey | None, wait_s: float
) -> list[CheckFinding]:
    """Listen to a vehicle and tell what it says of itself.

    It is waited for ``wait_s`` [wall s] for its heartbeat, and again for it to be ready: who asks
    has often just switched it on. Without ``key`` its frames need not be signed.
    """
    name = str(vehicle.address)
    obstacle = await _obstacle(vehicle.address)
    if obstacle is not None:
        return [obstacle]
    clock = SystemClock()
    listening = VehicleListener(vehicle.system_id, None if key is None else Signing(key, unix_s))

    class Ears:
        """Hears the link."""

        def link_up(self) -> None:
            """It is asked below."""

        def link_down(self) -> None:
            """It opens again by itself."""

        def received(self, data: bytes, source: Hashable | None = None) -> None:
            """Bytes came."""
            listening.receive(data, clock.now_s(), unix_s(), source)
            link.answer(listening.peer)

    link = open_link(vehicle.address, Ears())
    link.start()
    try:
        ask_at_s = clock.now_s()
        heard_at_s: float | None = None
        give_up_at_s = ask_at_s + wait_s
        while (now_s := clock.now_s()) < give_up_at_s:
            if now_s >= ask_at_s:
                ask_at_s = now_s + ASK_AGAIN_S
                for frame in listening.requests():
                    link.send(frame)
            if heard_at_s is None and listening.heard:
                heard_at_s, give_up_at_s = now_s, now_s + max(wait_s, LISTEN_S)
            elif heard_at_s is not None and now_s >= heard_at_s + LISTEN_S and listening.settled:
                break
            await asyncio.sleep(_CONDITION_S)
    finally:
        await link.close()
    return listening.findings(name)


async def _obstacle(address: LinkAddress) -> CheckFinding | None:
    """What keeps the link from being opened; None if nothing does."""
    name = str(address)
    match address:
        case UdpInAddress(host, port):
            found = look_at_port(name, f"port {port}", host, port, datagrams=True)
            return None if found.state is CheckState.OK else found
        case TcpAddress(host, port):
            reached = await dial(f"tcp/[{host}]:{port}" if ":" in host else f"tcp/{host}:{port}")
            if reached.problem is not None:
                remedy = "start the autopilot, or correct host and port"
                return fails(name, reached.problem, remedy)
        case SerialAddress(device, _):
            return _serial_obstacle(name, device)
        case _:
            pass
    return None


def _serial_obstacle(name: str, device: str) -> CheckFinding | None:
    if not Path(device).exists():
        remedy = "plug it in; ls /dev/serial/by-id shows what is there"
        return fails(name, "there is no such device", remedy)
    if not os.access(device, os.R_OK | os.W_OK):
        remedy = "let this user use it: sudo usermod -aG dialout $USER, and log in anew"
        return fails(name, "this user may not use it", remedy)
    return None
