"""Router and token-holding processes for tests; none outlives its test."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator

from tests.process.programs import Swarm

PIPE = subprocess.PIPE
SWARM = "import sys; from swarm.cli import console_main; sys.exit(console_main())"
LIMIT_S = 20.0

HOLDER = """
import asyncio, sys
from swarm.bus.config import BusConfig, ClientTopology, MeshTopology
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.runtime.process import parent_gone

async def hold(kind, key, *endpoints):
    mesh = MeshTopology(endpoints[0], endpoints[1:])
    bus = await open_zenoh_bus(BusConfig(ClientTopology(endpoints) if kind == "client" else mesh))
    try:
        bus.declare_token(key)
        print("ready", flush=True)
        await parent_gone()
    finally:
        bus.close()

asyncio.run(hold(*sys.argv[1:]))
"""


@contextlib.contextmanager
def started(*argv: str, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """Run Python with pipes on all three streams; killed at the end if still there."""
    process = subprocess.Popen(
        [sys.executable, *argv],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | environment,
    )
    with process:
        try:
            yield process
        finally:
            process.kill()


@contextlib.contextmanager
def commanded(*words: str, **environment: str) -> Iterator[subprocess.Popen[str]]:
    """Run a `swarm` command with pipes on all three streams; killed at the end if still there."""
    variables = os.environ | environment
    with Swarm(words, stdin=PIPE, stdout=PIPE, stderr=PIPE, env=variables) as process:
        try:
            yield process
        finally:
            process.kill()


@contextlib.contextmanager
def router(*options: str, **environment: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A router that serves already, and its first endpoint."""
    with commanded("router", *options, "--lifeline", **environment) as process:
        yield process, read_endpoints(process)[0]


@contextlib.contextmanager
def token_holder(kind: str, key: str, *endpoints: str) -> Iterator[subprocess.Popen[str]]:
    """A process on the bus that holds one token; ``kind`` is client or mesh."""
    with started("-c", HOLDER, kind, key, *endpoints) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        yield process


def read_endpoints(process: subprocess.Popen[str]) -> list[str]:
    """What a router says it listens on."""
    assert process.stdout is not None
    said = json.loads(process.stdout.readline())
    assert list(said) == ["endpoints"]
    return list(said["endpoints"])


def finish(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    """Exit status, rest of standard output and standard error of one that is ending."""
    assert process.stdout is not None
    assert process.stderr is not None
    status = process.wait(LIMIT_S)
    return status, process.stdout.read(), process.stderr.read()
