"""A second ground station for tests: one UDP port at which a whole fleet is shown.

It speaks MAVLink by pymavlink's dialect alone, so it shares no code with what it tests.
"""

from __future__ import annotations

import math
import socket
import threading
from collections import Counter
from typing import Any, Self

from pymavlink.dialects.v20 import ardupilotmega as mavlink

POLL_S = 0.2
AGENT = 191


class UdpStation:
    """Hears everybody at one port of this machine, and says everything to everybody heard."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(POLL_S)
        self._speaker = mavlink.MAVLink(None, srcSystem=250, srcComponent=190)
        self._over = threading.Event()
        self._lock = threading.Lock()
        self._senders: set[tuple[str, int]] = set()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self.counts: Counter[tuple[int, int, str]] = Counter()
        """How many messages came, by system, component and name."""
        self.modes: dict[int, tuple[int, bool]] = {}
        """Custom mode and whether armed, of each autopilot by system."""
        self.values: dict[tuple[int, str], float] = {}
        """Newest named value by system and name."""
        self.acks: list[tuple[int, int, int, int]] = []
        """(system, component, command, result) of each acknowledgement to it."""
        self.texts: list[tuple[int, str]] = []
        """(system, first 50 characters) of what agents say."""

    @property
    def url(self) -> str:
        """Where it listens, as `swarm agent --forward` takes it."""
        return f"udp:127.0.0.1:{self._socket.getsockname()[1]}"

    @property
    def systems(self) -> set[int]:
        """System ids of autopilots heard."""
        return set(self.modes)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._socket.close()

    def say(self, message: Any) -> None:
        """To everybody."""
        data = bytes(message.pack(self._speaker))
        with self._lock:
            senders = set(self._senders)
        for sender in senders:
            self._socket.sendto(data, sender)

    def act(self, command: int, system: int, param1: float = 0.0, component: int = AGENT) -> None:
        """Send a COMMAND_LONG."""
        rest = (0.0,) * 6
        self.say(mavlink.MAVLink_command_long_message(system, component, command, 0, param1, *rest))

    def results(self, system: int, command: int) -> list[int]:
        """MAV_RESULT of that system's agent, of each time it acknowledged."""
        return [r for s, c, number, r in self.acks if (s, c, number) == (system, AGENT, command)]

    def _listen(self) -> None:
        parser = mavlink.MAVLink(None)
        while not self._over.is_set():
            try:
                data, sender = self._socket.recvfrom(2048)
            except TimeoutError:
                continue
            except ConnectionError:  # an agent has ended
                continue
            with self._lock:
                self._senders.add(sender)
            self._note(parser.decode(bytearray(data)))

    def _note(self, message: Any) -> None:
        system, component = message.get_srcSystem(), message.get_srcComponent()
        kind = message.get_type()
        self.counts[system, component, kind] += 1
        if kind == "HEARTBEAT" and component == 1:
            self.modes[system] = message.custom_mode, bool(message.base_mode & 128)
        elif kind == "COMMAND_ACK" and message.target_system == 250:
            self.acks.append((system, component, message.command, message.result))
        elif kind == "STATUSTEXT" and component == AGENT:
            self.texts.append((system, str(message.text)))
        elif kind.startswith("NAMED_VALUE"):
            self.values[system, message.name] = message.value


def hostile_words() -> list[Any]:
    """What would move, stop or change a vehicle, were it passed on: to all, and to each."""
    words: list[Any] = []
    for system in (0, 1, 2, 3):
        for component in (0, 1):
            to = (system, component)
            words += [
                mavlink.MAVLink_command_long_message(*to, 400, 0, 0, 21196, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_long_message(*to, 185, 0, 1, 0, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_long_message(*to, 176, 0, 1, 9, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_long_message(*to, 20, 0, 0, 0, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_long_message(*to, 21, 0, 0, 0, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_long_message(*to, 31010, 0, 0, 0, 0, 0, 0, 0, 0),
                mavlink.MAVLink_command_int_message(
                    *to, 6, 192, 0, 0, -1, 1, 0, math.nan, 468000000, 97000000, 90.0
                ),
                mavlink.MAVLink_mission_clear_all_message(*to),
                mavlink.MAVLink_param_set_message(*to, b"RTL_ALT", 100.0, 9),
            ]
        words += [
            mavlink.MAVLink_set_mode_message(system, 1, 6),
            mavlink.MAVLink_manual_control_message(system, 1000, 1000, 0, 0, 0),
        ]
    return words
