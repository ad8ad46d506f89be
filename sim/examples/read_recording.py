"""Read a recording of a mission, and tell who did what when, and why.

    python -m sim.examples.read_recording [FILE.mcap]

Without a file a flight is simulated and recorded first. Shows `swarm.read_recording`: the same
`swarm.Flight` as of a simulation, and behind it every message that was heard. Needs the extra
``ground``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import swarm
from swarm.protocol.events import MessageReceived
from swarm.protocol.uav_messages import Choice


def tell(path: Path) -> None:
    """Print what became of the recorded mission."""
    flight = swarm.read_recording(path)
    tasks = len(flight.done) + len(flight.failed) + len(flight.open)
    print(f"{flight.mission.name}: {len(flight.done)} of {tasks} tasks, J {flight.objective:.2f}")
    if flight.cut_short is not None:
        print(flight.cut_short)
    for mission_s, text in flight.story:
        print(f"{'' if mission_s is None else f'{mission_s:.2f} s':>9}  {text}")
    for _, fact in flight.facts:
        if isinstance(fact, MessageReceived) and isinstance(fact.message.body, Choice):
            choice = fact.message.body
            others = [f"{each.task} {each.score:.2f}" for each in choice.candidates[1:3]]
            rather = f" rather than {', '.join(others)}" if others else ""
            goal = choice.task or f"base {choice.base}"
            print(f"{fact.message.writer} chose {goal} {choice.score:.2f}{rather}")


def main(recording: str | None = None) -> None:
    """Tell of a recording, or of one that is made for it."""
    if recording is not None:
        tell(Path(recording))
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight.mcap"
        lost_at_s = {swarm.UavId("uav2"): 1.0}
        swarm.simulate(swarm.load("table-1"), "greedy", lost_at_s=lost_at_s, record=path)
        tell(path)


if __name__ == "__main__":
    main(*sys.argv[1:2])
