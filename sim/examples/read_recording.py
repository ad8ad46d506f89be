# %% [markdown]
"""# Read a recording of a mission, and tell who did what when, and why.

    python -m sim.examples.read_recording

Shows `swarm.read_recording`: the same `swarm.Flight` as of a simulation, and behind it every
message that was heard. Needs the extra ``ground``.
"""

# %%
from __future__ import annotations

import tempfile
from pathlib import Path

import swarm
from swarm.protocol.events import MessageReceived
from swarm.protocol.uav_messages import Choice

# %% [markdown]
"""A flight to read: a UAV is lost after a second. One of yours comes from `swarm run --record`,
or from `swarm record` beside a mission.
"""

# %%
recording = Path(tempfile.mkdtemp()) / "flight.mcap"
swarm.simulate(
    swarm.load("table-1"), "greedy", lost_at_s={swarm.UavId("uav2"): 1.0}, record=recording
)

# %% [markdown]
"""What became of the mission, and its story."""

# %%
flight = swarm.read_recording(recording)
tasks = len(flight.done) + len(flight.failed) + len(flight.open)
print(f"{flight.mission.name}: {len(flight.done)} of {tasks} tasks, J {flight.objective:.2f}")
for mission_s, text in flight.story:
    print(f"{'' if mission_s is None else f'{mission_s:.2f} s':>9}  {text}")

# %% [markdown]
"""Every message is there: with each choice a UAV says what else it had thought of."""

# %%
for _, fact in flight.facts:
    if isinstance(fact, MessageReceived) and isinstance(fact.message.body, Choice):
        choice = fact.message.body
        others = [f"{each.task} {each.score:.2f}" for each in choice.candidates[1:3]]
        rather = f" rather than {', '.join(others)}" if others else ""
        goal = choice.task or f"base {choice.base}"
        print(f"{fact.message.writer} chose {goal} {choice.score:.2f}{rather}")

# %% [markdown]
"""From the command line: `swarm replay`, `swarm explain`; in Foxglove: `deploy/foxglove`."""
