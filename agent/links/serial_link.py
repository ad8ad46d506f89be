"""Serial links, opened and set by pyserial, at any baud rate that the port's driver takes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys

import serial

from agent.links.link import ByteLink, LinkListener
from agent.vehicle.config import SerialAddress
from swarm.runtime.errors import Fault, InputError

if sys.platform != "win32":
    import fcntl
    import termios

_CHUNK_BYTES = 4096


class SerialLink(ByteLink):
    """A serial port of a real autopilot.

    Raises:
        InputError: there are no serial links on this system.
    """

    def __init__(self, address: SerialAddress, listener: LinkListener) -> None:
        super().__init__(str(address), listener)
        if sys.platform == "win32":  # whose event loop does not wait for ports
            raise InputError(
                Fault(
                    str(address),
                    "",
                    "serial links need a POSIX system",
                    "use tcp: or udpout: through a MAVLink router",
                )
            )
        self._address = address
        self._port: serial.Serial | None = None

    async def _open(self) -> None:
        device, baud = self._address.device, self._address.baud
        try:
            port = serial.Serial(device, baud, timeout=0.0, exclusive=True)
        except (ValueError, OverflowError) as error:
            raise OSError(f"{device} does not take {baud} baud") from error
        except termios.error as error:
            raise OSError(f"{device} is no serial port") from error
        self._port = port
        fcntl.ioctl(port.fileno(), termios.TIOCEXCL)  # nobody else may speak to the same vehicle
        asyncio.get_running_loop().add_reader(port.fileno(), self._on_readable)

    # Bytes are passed by hand: pyserial's own writing waits without end for a port that is full.

    def _on_readable(self) -> None:
        if self._port is None:
            return
        try:
            data = os.read(self._port.fileno(), _CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._listener.received(data)
        else:
            self._stop_reading()
            self._lost.set()

    def _write(self, data: bytes) -> bool:
        if self._port is None:
            return False
        try:
            return os.write(self._port.fileno(), data) == len(data)
        except OSError:
            return False  # full, or gone: reading will notice

    def discard(self) -> None:
        """Throw away what the port has not sent yet; it stays open."""
        if self._port is not None:
            with contextlib.suppress(OSError, termios.error):
                self._port.reset_output_buffer()  # gone: reading will notice

    def _stop_reading(self) -> None:
        if self._port is not None:
            asyncio.get_running_loop().remove_reader(self._port.fileno())

    def _shut(self) -> None:
        if self._port is not None:
            self._stop_reading()
            self.discard()  # closing would wait until it is sent
            with contextlib.suppress(OSError):
                self._port.close()
            self._port = None
