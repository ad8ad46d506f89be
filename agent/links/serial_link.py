"""Serial links on POSIX systems, with what the standard library has.

Leaves out: baud rates that termios does not name, and other operating systems.
"""

from __future__ import annotations

import asyncio
import contextlib
import os

from agent.links.link import ByteLink, LinkListener
from agent.vehicle.config import SerialAddress
from swarm.runtime.errors import Fault, InputError

__all__ = ["SerialLink"]


try:
    import fcntl
    import termios
    import tty
except ImportError:  # not POSIX
    _POSIX = False
else:
    _POSIX = True

_CHUNK_BYTES = 4096


class SerialLink(ByteLink):
    """A serial port of a real autopilot.

    Raises:
        InputError: the baud rate is unknown here, or there are no serial ports at all.
    """

    def __init__(self, address: SerialAddress, listener: LinkListener) -> None:
        super().__init__(str(address), listener)
        if not _POSIX:
            raise InputError(
                Fault(
                    str(address),
                    "",
                    "serial links need a POSIX system",
                    "use tcp: or udpout: through a MAVLink router",
                )
            )
        speed = getattr(termios, f"B{address.baud}", None)
        if speed is None:
            raise InputError(
                Fault(
                    str(address),
                    "",
                    f"{address.baud} is no baud rate of this system",
                    "give one such as 57600, 115200 or 921600",
                )
            )
        self._device = address.device
        self._speed: int = speed
        self._file: int | None = None

    async def _open(self) -> None:
        file = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            # No second process may speak to the same vehicle.
            fcntl.ioctl(file, termios.TIOCEXCL)
            tty.setraw(file)
            settings = termios.tcgetattr(file)
            settings[4] = settings[5] = self._speed
            termios.tcsetattr(file, termios.TCSANOW, settings)
            termios.tcflush(file, termios.TCIFLUSH)
        except termios.error as error:
            os.close(file)
            raise OSError(f"{self._device} is no serial port") from error
        except OSError:
            os.close(file)
            raise
        self._file = file
        asyncio.get_running_loop().add_reader(file, self._on_readable)

    def _on_readable(self) -> None:
        if self._file is None:
            return
        try:
            data = os.read(self._file, _CHUNK_BYTES)
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
        if self._file is None:
            return False
        try:
            return os.write(self._file, data) == len(data)
        except OSError:
            return False  # full, or gone: reading will notice

    def discard(self) -> None:
        """Throw away what the port has not sent yet; it stays open."""
        if self._file is not None:
            with contextlib.suppress(OSError, termios.error):  # gone: reading will notice
                termios.tcflush(self._file, termios.TCOFLUSH)

    def _stop_reading(self) -> None:
        if self._file is not None:
            asyncio.get_running_loop().remove_reader(self._file)

    def _shut(self) -> None:
        if self._file is not None:
            self._stop_reading()
            self.discard()  # closing would wait until it is sent
            with contextlib.suppress(OSError):
                os.close(self._file)
            self._file = None
