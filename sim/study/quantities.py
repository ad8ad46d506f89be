"""The numbers of an uncertainty in words: axes, headings and sentences of studies.

Leaves out: what they do (sim.uncertainty).
"""

from __future__ import annotations

from dataclasses import dataclass

from sim.uncertainty import Uncertainty

__all__ = ["QUANTITIES", "Quantity", "uncertainty_words"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """How one number is shown."""

    name: str
    """What it is, for an axis or a heading."""
    unit: str
    """``%`` is shown for shares of 1."""
    words: str
    """A clause with the number, in that unit, in place of ``{}``."""

    @property
    def label(self) -> str:
        """Name and unit, for an axis."""
        return f"{self.name} [{self.unit}]"

    def shown(self, value: float) -> float:
        """``value`` in the unit."""
        return 100.0 * value if self.unit.startswith("%") else value

    def text(self, value: float) -> str:
        """``value`` with its unit: 30 %, 0.5 per min."""
        return f"{self.shown(value):g} {self.unit.split(' of')[0]}"


QUANTITIES = {
    "loss": Quantity("UAVs lost", "%", "each UAV is lost with probability {} %"),
    "popup": Quantity(
        "tasks that pop up", "%", "each task appears only during the mission with probability {} %"
    ),
    "popups_per_min": Quantity("further pop-ups", "per min", "{} further tasks pop up per minute"),
    "withdrawals_per_min": Quantity("withdrawals", "per min", "{} tasks are withdrawn per minute"),
    "speed_sd_frac": Quantity(
        "spread of UAVs' speeds", "% of cruise speed", "UAVs' speeds spread by {} %"
    ),
    "leg_sd_frac": Quantity(
        "spread of speeds from leg to leg", "% of cruise speed", "speeds of legs spread by {} %"
    ),
    "wind_m_s": Quantity("wind", "m/s", "wind of {} m/s blows from a random direction"),
    "position_error_m": Quantity("position error", "m", "UAVs stop {} m (1 σ) beside their places"),
    "message_loss": Quantity("messages lost", "%", "{} % of all messages are lost"),
    "delay_s": Quantity("least delay of messages", "s", "messages take {} s or longer"),
    "jitter_s": Quantity(
        "mean further delay of messages", "s", "messages take another {} s on average"
    ),
    "partitions_per_min": Quantity(
        "partitions", "per min", "half of the fleet is cut off {} times per minute"
    ),
    "partition_s": Quantity("length of a partition", "s", "for {} s each"),
}
"""By field of `Uncertainty`."""


def uncertainty_words(uncertainty: Uncertainty) -> str:
    """What is uncertain, in one sentence without its full stop."""
    clauses = []
    for name, quantity in QUANTITIES.items():
        value = getattr(uncertainty, name)
        if name == "partition_s" and uncertainty.partitions_per_min == 0.0:
            continue  # a default without effect
        if value > 0.0:
            clauses.append(quantity.words.format(f"{quantity.shown(value):g}"))
    if uncertainty.outcomes:
        clauses.append("attempts succeed and fail by chance")
    if uncertainty.survival:
        clauses.append("tasks cost UAVs by chance")
    for uav, when_s in uncertainty.lost_at_s.items():
        clauses.append(f"{uav} is lost at {when_s:g} s")
    for task, when_s in uncertainty.withdrawn_at_s.items():
        clauses.append(f"{task} is withdrawn at {when_s:g} s")
    return ", ".join(clauses) or "nothing is uncertain"
