"""What the results of all benchmarks share: the machine, tables, and quantiles of times."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from operator import attrgetter
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from sim.bench.machine import MachineInfo
from swarm.runtime.table import Column, ResultTable

Progress = Callable[[str], None]
"""Is told what is being done."""


def unheard(what: str) -> None:
    """Progress that nobody follows."""
    del what


@dataclass(frozen=True, slots=True)
class BenchResult(ABC):
    """What one run of a benchmark found."""

    machine: MachineInfo

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return asdict(self)

    @abstractmethod
    def parts(self) -> Iterable[RenderableType]:
        """What people are shown below the machine, in the width of a terminal of 80 columns."""

    def __rich__(self) -> Group:
        """Everything for a terminal; strings hold no markup."""
        parts = (str(self.machine), *self.parts())
        return Group(*(Text(part) if isinstance(part, str) else part for part in parts))


def size_name(n_uav: int, n_task: int) -> str:
    """What tables call missions of so many UAVs and tasks."""
    return f"{n_uav}×{n_task}"


def table_of(rows: Iterable[object], *columns: Column, title: str = "") -> ResultTable:
    """A table in which every column shows the attribute of the rows that its key names."""
    getters = [attrgetter(column.key) for column in columns]
    return ResultTable(columns, [[get(row) for get in getters] for row in rows], title)


def quantile(times: Sequence[float], share: float) -> float | None:
    """The smallest time that is not exceeded in that share of all.

    Times are infinite for what never happened. None where that is so, and without any time.
    """
    if not times:
        return None
    found = sorted(times)[max(0, math.ceil(share * len(times)) - 1)]
    return found if math.isfinite(found) else None
