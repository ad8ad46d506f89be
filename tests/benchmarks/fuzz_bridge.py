"""`make fuzz`: a bridge among hostile input, many steps from one seed.

    python -m tests.benchmarks.fuzz_bridge --steps 1000000 --seed 1
    python -m tests.benchmarks.fuzz_bridge --replay "px4 reposition signed:1:42"

Prints one line per setting and ends with 1 if something did not hold; the line says how to
play that episode again.
"""

from __future__ import annotations

import argparse
import platform
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

from swarm.runtime.clock import SystemClock
from tests.support.bridge_fuzz import Episode, Setting, setting_of, settings
from tests.support.hostile_input import FLAVOURS

_REPLAY = "SETTING:SEED:EPISODE, as a failure prints it"
_MOST_FAILURES = 10


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one episode."""

    number: int
    steps: int
    phases: Counter[str]
    fault: str = ""


def play(setting: Setting, seed: int, number: int) -> Outcome:
    """Play one episode; whatever it raises is its fault."""
    episode = Episode(setting, seed, number)
    fault = ""
    try:
        episode.play()
    except Exception as error:  # noqa: BLE001 - finding them is what this is for
        fault = f"{type(error).__name__}: {error}"
    phases = Counter({phase.value: count for phase, count in episode.phases.items()})
    return Outcome(number, episode.watch.steps, phases, fault)


def fuzz(setting: Setting, seed: int, steps: int, jobs: int) -> bool:
    """Play episodes until there were so many steps; whether everything held."""
    clock = SystemClock()
    began_s = clock.now_s()
    taken, episodes, failures = 0, 0, 0
    phases: Counter[str] = Counter()
    with ProcessPoolExecutor(jobs) as pool:
        while taken < steps and failures < _MOST_FAILURES:
            batch = range(episodes, episodes + 16 * jobs)
            for outcome in pool.map(play, *zip(*((setting, seed, n) for n in batch), strict=True)):
                taken += outcome.steps
                phases += outcome.phases
                if outcome.fault:
                    failures += 1
                    print(f"{setting}:{seed}:{outcome.number}  {outcome.fault}", flush=True)
            episodes = batch.stop
    elapsed_s = clock.now_s() - began_s
    spread = ", ".join(f"{phase} {count / taken:.0%}" for phase, count in phases.most_common())
    print(
        f"{setting}: {taken} steps in {episodes} episodes, {taken / elapsed_s:.0f} a second, "
        f"{failures} failures ({spread})",
        flush=True,
    )
    return not failures


def replay(text: str) -> bool:
    """Play one episode again and tell what happened before it failed."""
    name, seed, number = text.rsplit(":", 2)
    episode = Episode(setting_of(name), int(seed), int(number))
    try:
        episode.play()
    except Exception:
        print("\n".join(episode.story))
        raise
    print(f"{episode.watch.steps} steps, everything held")
    return True


def main(argv: Sequence[str] | None = None) -> int:
    """Fuzz every setting of the flavours asked for."""
    parser = argparse.ArgumentParser(prog="fuzz_bridge", description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000, help="of each flavour")
    parser.add_argument("--flavour", choices=FLAVOURS, help="only this one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--replay", metavar="EPISODE", help=_REPLAY)
    options = parser.parse_args(argv)
    if options.replay is not None:
        return 0 if replay(options.replay) else 1
    print(f"seed {options.seed}, {options.jobs} jobs, {platform.processor() or platform.machine()}")
    held = True
    for flavour in [options.flavour] if options.flavour else FLAVOURS:
        each = settings(flavour)
        for setting in each:
            held &= fuzz(setting, options.seed, options.steps // len(each), options.jobs)
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
