"""``python -m tests.chaos``: kill processes of real fleets at random moments."""

import sys
from importlib.metadata import EntryPoint

from swarm.cli import COMMAND_GROUP, main
from swarm.runtime.process import leave

if __name__ == "__main__":
    command = EntryPoint("chaos", "tests.chaos.cli:chaos", COMMAND_GROUP)
    leave(main(["chaos", *sys.argv[1:]], {"chaos": command}))
