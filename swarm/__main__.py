"""``python -m swarm`` is the `swarm` command."""

import sys

from swarm.cli import console_main

if __name__ == "__main__":
    sys.exit(console_main())
