"""Notice that the parent process is gone, by the end of standard input.

A process that starts daemons gives each a pipe as standard input and never writes
to it. However the parent ends, the kernel closes its end, and the daemon, started
with ``--lifeline``, sees end of file and leaves. Leaves out: what it does then
(swarm.process).
"""

from __future__ import annotations

import asyncio
import os

__all__ = ["parent_gone"]

STDIN_FD = 0
CHUNK_BYTES = 4096


async def parent_gone(fd: int = STDIN_FD) -> None:
    """Return when ``fd``, standard input unless told otherwise, is at its end.

    What arrives before the end is read and thrown away. No thread is used, so an
    unfinished wait never delays the exit of the process. The descriptor stays in
    blocking mode: the parent may share it. A file that cannot be waited for, such
    as ``/dev/null``, a regular file or a closed descriptor, has no writer whose
    end could be noticed: it counts as ended.
    """
    loop = asyncio.get_running_loop()
    ended = loop.create_future()

    def on_readable() -> None:
        try:
            chunk = os.read(fd, CHUNK_BYTES)
        except (BlockingIOError, InterruptedError):
            return  # somebody else made it non-blocking and was faster
        except OSError:
            chunk = b""  # hung up terminal, closed descriptor
        if not chunk:
            loop.remove_reader(fd)
            if not ended.done():
                ended.set_result(None)

    try:
        loop.add_reader(fd, on_readable)
    except (OSError, ValueError):
        return
    try:
        await ended
    finally:
        loop.remove_reader(fd)
