"""Compare a policy of one's own with the project's, in many futures that nobody knows.

    python -m sim.examples.monte_carlo [SCENARIO [TRIALS]]

UAVs are lost, attempts fail and tasks pop up by chance. With the same seed every policy meets the
same losses, failures and pop-ups, so that differences show with few trials. Shows what may go
wrong in `swarm.simulate`. `swarm study` does the same with intervals, tables and plots.
"""

from __future__ import annotations

import math
import statistics
import sys

import swarm


def patient(turn: swarm.Turn) -> swarm.Task | None:
    """Take the best task that is near; if there is none, the best of all."""
    nearest_s = min(turn.travel_s(task) for task in turn.open)
    near = [task for task in turn.open if turn.travel_s(task) <= 2.0 * nearest_s]
    return max(near or turn.open, key=turn.gain)


def main(scenario: str = "table-1", trials: int = 20) -> None:
    """Print mean values, and the mean difference with its standard error."""
    mission = swarm.load(scenario)
    ours: list[float] = []
    theirs: list[float] = []
    for seed in range(trials):
        for policy, values in ((patient, ours), ("greedy", theirs)):
            flight = swarm.simulate(mission, policy, seed=seed, loss=0.2, popup=0.3, outcomes=True)
            values.append(flight.value)
    differences = [mine - other for mine, other in zip(ours, theirs, strict=True)]
    error = statistics.stdev(differences) / math.sqrt(trials) if trials > 1 else math.nan
    print(f"patient {statistics.fmean(ours):.2f}, greedy {statistics.fmean(theirs):.2f} value·s")
    print(f"difference {statistics.fmean(differences):+.2f} ± {error:.2f} in {trials} futures")


if __name__ == "__main__":
    main(
        sys.argv[1] if len(sys.argv) > 1 else "table-1",
        int(sys.argv[2]) if len(sys.argv) > 2 else 20,
    )
