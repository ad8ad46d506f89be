"""A lossy, slow IP path on this machine: real packets of the kernel's own TCP, some of them lost.

In a network namespace of its own, which needs no rights on the machine's network, a TUN
device holds `HERE`; every other address of its network leads into the device. Whatever is
sent to `THERE` is read from it, lost or kept for a while, and comes back with source and
destination exchanged. So a connection dialed to `THERE` ends at whoever listens on
`HERE`, and both ways of it are bad, while one dialed to `HERE` is not. Exchanging the two
leaves every checksum right.
"""

from __future__ import annotations

import asyncio
import ctypes
import fcntl
import os
import socket
import struct
from pathlib import Path
from typing import Self

import numpy as np

from sim.fleet.faults.relay import RelayQuality

HERE, THERE = "10.77.0.1", "10.77.0.2"
_NETMASK = "255.255.255.0"
_DEVICE = b"badlink0"
_LONGEST_BYTES = 65_536
_MOST_PACKETS = 64
"""Packets read before the loop gets its turn."""

_CLONE_NEWNET, _CLONE_NEWUSER = 0x40000000, 0x10000000
_TUNSETIFF = 0x400454CA
_IFF_TUN, _IFF_NO_PI, _IFF_UP = 0x0001, 0x1000, 0x1
_SIOCGIFFLAGS, _SIOCSIFFLAGS, _SIOCSIFADDR, _SIOCSIFNETMASK = 0x8913, 0x8914, 0x8916, 0x891C
_IPV4 = 4


class TunUnavailableError(Exception):
    """This system does not let us have a network namespace or a TUN device."""


def enter_own_network() -> None:
    """Move this thread, and every thread and process it starts from now on, to a new network.

    It has a loopback interface and nothing else. There is no way back.

    Raises:
        TunUnavailableError: it is not permitted, or not Linux.
    """
    try:
        libc = ctypes.CDLL(None, use_errno=True)
        unshare = libc.unshare
    except (OSError, AttributeError) as fault:
        raise TunUnavailableError(str(fault)) from fault
    user_id, group_id = os.geteuid(), os.getegid()
    if unshare(_CLONE_NEWNET) != 0:
        if unshare(_CLONE_NEWUSER | _CLONE_NEWNET) != 0:
            raise TunUnavailableError(os.strerror(ctypes.get_errno()))
        _become_root_of_namespace(user_id, group_id)
    try:
        _up(b"lo")
    except OSError as fault:
        raise TunUnavailableError(f"no loopback interface: {fault}") from fault


class TunPath:
    """The path between `HERE` and `THERE`; use as a context manager in a loop's thread.

    Of its quality, bandwidth does not count.
    """

    def __init__(self, quality: RelayQuality, rng: np.random.Generator) -> None:
        self.quality = quality
        """May be changed at any time, for packets from now on."""
        self.carried = 0
        """Packets brought to the other side."""
        self.lost = 0
        """Packets thrown away."""
        self._rng = rng
        self._loop = asyncio.get_running_loop()
        self._last_s = 0.0
        self._file = -1

    def __enter__(self) -> Self:
        try:
            self._file = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            request = struct.pack("16sH22x", _DEVICE, _IFF_TUN | _IFF_NO_PI)
            fcntl.ioctl(self._file, _TUNSETIFF, request)
            _set_address(_SIOCSIFADDR, HERE)
            _set_address(_SIOCSIFNETMASK, _NETMASK)
            _up(_DEVICE)
        except OSError as fault:
            self.__exit__()
            raise TunUnavailableError(f"no TUN device: {fault}") from fault
        self._loop.add_reader(self._file, self._read)
        return self

    def __exit__(self, *_: object) -> None:
        if self._file >= 0:
            self._loop.remove_reader(self._file)
            os.close(self._file)
            self._file = -1

    def _read(self) -> None:
        for _ in range(_MOST_PACKETS):
            try:
                packet = os.read(self._file, _LONGEST_BYTES)
            except BlockingIOError:
                return
            if packet[0] >> 4 != _IPV4:
                continue  # what the kernel asks of its neighbours in IPv6
            if self._rng.random() < self.quality.loss_frac:
                self.lost += 1
                continue
            back = packet[:12] + packet[16:20] + packet[12:16] + packet[20:]
            travel_s = self.quality.delay_s + self.quality.jitter_s * self._rng.random()
            # Packets of one path keep their order.
            self._last_s = max(self._last_s + 1e-6, self._loop.time() + travel_s)
            self._loop.call_at(self._last_s, self._write, back)

    def _write(self, packet: bytes) -> None:
        if self._file < 0:
            return
        try:
            os.write(self._file, packet)
        except OSError:
            self.lost += 1
        else:
            self.carried += 1


def _become_root_of_namespace(user_id: int, group_id: int) -> None:
    try:
        for name, text in (
            ("setgroups", "deny"),
            ("uid_map", f"0 {user_id} 1"),
            ("gid_map", f"0 {group_id} 1"),
        ):
            (Path("/proc/self") / name).write_text(text, encoding="ascii")
    except OSError as fault:
        raise TunUnavailableError(str(fault)) from fault


def _up(device: bytes) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        answer = fcntl.ioctl(any_socket, _SIOCGIFFLAGS, struct.pack("16sH22x", device, 0))
        (flags,) = struct.unpack_from("16xH", answer)
        fcntl.ioctl(any_socket, _SIOCSIFFLAGS, struct.pack("16sH22x", device, flags | _IFF_UP))


def _set_address(request: int, address: str) -> None:
    place = struct.pack("HH4s8x", socket.AF_INET, 0, socket.inet_aton(address))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, request, struct.pack("16s16s8x", _DEVICE, place))
