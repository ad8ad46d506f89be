"""Published routing instances whose objective is a special case of ours, read from a folder.

Travelling repairman (`*.tsp`, TSPLIB): one UAV of speed 1 at node 1, all other nodes tasks; cost is
the sum of completion times. EUC_2D distances are rounded down, as this literature does (Salehipour
et al. 2011, doi:10.1007/s10288-011-0153-0); ATT ones as TSPLIB does. Multiple travelling repairman
with profits (Avci and Avci 2017, doi:10.1016/j.cor.2017.06.008): the first line is the number of
tasks and of UAVs, each line after it x, y and profit, first of the depot; distances are rounded,
halves up; what is not worth its arrival is left out.

A file `*.csv` with the columns `file` and `best_known` says which files of its folder, or of
folders in it, are instances. Where it has a column `upper_bound`, no profit is above that.
"""

from __future__ import annotations

import csv
import difflib
import fnmatch
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
import numpy.typing as npt

from swarm.allocation.problem import Problem
from swarm.kernels.routes import GivenTimes
from swarm.model import TaskId, UavId
from swarm.runtime.errors import Fault, InputError

FloatArray = npt.NDArray[np.float64]


class Family(StrEnum):
    """Which objective an instance has."""

    TRP = "trp"
    """Least sum of completion times; all tasks are done."""
    MTRPP = "mtrpp"
    """Most profit, each less its arrival; tasks may be left out."""


@dataclass(frozen=True, slots=True, eq=False)
class Instance:
    """One published instance."""

    file: str
    family: Family
    n_uav: int
    distance: FloatArray
    """(n_node, n_node) rounded as its literature does; node 0 is the depot."""
    profit: FloatArray
    """(n_node,); 0 in `Family.TRP`."""
    place: FloatArray
    """(n_node, 2)."""
    best_known: float
    upper_bound: float | None = None
    """Published for `Family.MTRPP`: nobody finds a larger value."""

    @property
    def n_task(self) -> int:
        """Nodes but for the depot."""
        return len(self.distance) - 1

    def given_times(self) -> GivenTimes:
        """What the search is given; task k is node k + 1."""
        due = self.profit[1:] if self.family is Family.MTRPP else None
        return GivenTimes(self.distance[0, 1:], self.distance[1:, 1:], due)

    def problem(self) -> Problem:
        """The mission: equal UAVs of speed 1 at the depot, tasks of value 1, nobody is lost."""
        n_uav, n_task = self.n_uav, self.n_task
        place_m = np.column_stack([self.place, np.zeros(n_task + 1)])
        return Problem(
            uav_ids=tuple(UavId(f"uav{uav + 1}") for uav in range(n_uav)),
            task_ids=tuple(TaskId(f"node{task + 2}") for task in range(n_task)),
            start_enu_m=np.repeat(place_m[:1], n_uav, axis=0),
            task_enu_m=place_m[1:],
            speed_m_s=np.ones(n_uav),
            value=np.ones(n_task),
            service_s=np.zeros(n_task),
            success=np.ones((n_uav, n_task)),
            survival=np.ones((n_uav, n_task)),
            horizon_s=1.0,
        )

    def value(self, routes: Sequence[Sequence[int]]) -> float:
        """The published objective of lists of nodes, the depot being 1 and not listed."""
        total = 0.0
        for route in routes:
            here, now = 0, 0.0
            for node in route:
                now += float(self.distance[here, node - 1])
                here = node - 1
                total += now if self.family is Family.TRP else float(self.profit[here]) - now
        return total

    def gap(self, value: float) -> float:
        """How much worse than the best known, over that; less than 0 if better."""
        worse = value - self.best_known if self.family is Family.TRP else self.best_known - value
        return worse / abs(self.best_known) if self.best_known else worse


def read_instances(folder: Path, only: str | None = None) -> list[Instance]:
    """What the tables in ``folder`` and below name, by table and line.

    Args:
        folder: where to look.
        only: patterns of file names between commas, such as ``st70.tsp,Pr_200_*``; others are not
            read. All when None.

    Raises:
        InputError: no table, a table or an instance that cannot be read, or a pattern that
            names none.
    """
    if not folder.is_dir():
        raise InputError(Fault("--instances", str(folder), "not a folder", "give a folder"))
    named = list(_named(folder))
    if not named:
        problem = "no table *.csv of instances in it or below"
        raise InputError(Fault("--instances", str(folder), problem, "add one: file,best_known"))
    patterns = ["*"] if only is None else [word.strip() for word in only.split(",")]
    names = [path.name for path, *_ in named]
    for pattern in patterns:
        if not fnmatch.filter(names, pattern):
            alike = difflib.get_close_matches(pattern, names) or names[:3]
            raise InputError(
                Fault("--only", pattern, "names no instance", f"name some, as {', '.join(alike)}")
            )
    chosen = [any(fnmatch.fnmatchcase(name, each) for each in patterns) for name in names]
    return [_read(*row) for row in itertools.compress(named, chosen)]


def _named(folder: Path) -> Iterator[tuple[Path, float, float | None]]:
    """Instances, their best known values and the upper bounds on these."""
    for table in sorted(folder.rglob("*.csv")):
        for line, row in enumerate(csv.DictReader(_text(table).splitlines()), start=2):
            name, best = row.get("file"), row.get("best_known")
            if name is None or best is None:
                raise _fault(table, 1, "no columns file and best_known", "begin with their names")
            if not _is_number(best):
                raise _fault(table, line, f"best_known is {best!r}", "give a number")
            bound = row.get("upper_bound") or ""
            if bound and not _is_number(bound):
                raise _fault(table, line, f"upper_bound is {bound!r}", "give a number or nothing")
            usable = name and not Path(name).is_absolute()
            paths = sorted(table.parent.rglob(name)) if usable else []
            if not paths:
                raise _fault(table, line, f"no file {name!r} here or below", "name one that is")
            yield paths[0], float(best), float(bound) if bound else None


def _read(path: Path, best_known: float, upper_bound: float | None) -> Instance:
    if path.suffix == ".tsp":
        place, distance = _read_tsplib(path)
        profit = np.zeros(len(place))
        return Instance(path.name, Family.TRP, 1, distance, profit, place, best_known)
    lines = [(k, line.split()) for k, line in enumerate(_text(path).splitlines(), start=1)]
    lines = [(k, words) for k, words in lines if words]
    if not lines or len(lines[0][1]) != 2 or not all(w.isdecimal() for w in lines[0][1]):
        raise _fault(path, 1, "no number of tasks and of UAVs", "begin with both")
    n_task, n_uav = (int(word) for word in lines[0][1])
    if n_uav < 1 or len(lines) != n_task + 2:
        problem = f"{len(lines) - 1} nodes and {n_uav} UAVs for {n_task} tasks"
        raise _fault(path, 1, problem, "give the depot, a line for each task, and a UAV")
    table = np.array([_numbers(path, line, words, 3) for line, words in lines[1:]])
    place, profit = table[:, :2].copy(), table[:, 2].copy()
    distance = np.floor(_straight(place) + 0.5)
    return Instance(
        path.name, Family.MTRPP, n_uav, distance, profit, place, best_known, upper_bound
    )


def _read_tsplib(path: Path) -> tuple[FloatArray, FloatArray]:
    kind, in_nodes = "", False
    nodes: list[list[float]] = []
    for line, text in enumerate(_text(path).splitlines(), start=1):
        key, _, rest = text.partition(":")
        if key.strip() == "EDGE_WEIGHT_TYPE":
            kind = rest.strip()
        elif key.strip() == "NODE_COORD_SECTION":
            in_nodes = True
        elif key.strip() == "EOF":
            break
        elif in_nodes and text.strip():
            number, *at = _numbers(path, line, text.split(), 3)
            if number != len(nodes) + 1:
                raise _fault(path, line, f"node {number:g} is out of turn", "number from 1 on")
            nodes.append(at)
    if len(nodes) < 2:
        raise _fault(path, 1, "fewer than two nodes", "give NODE_COORD_SECTION")
    place = np.array(nodes)
    if kind == "EUC_2D":
        return place, np.floor(_straight(place))
    if kind == "ATT":
        exact = _straight(place) / math.sqrt(10.0)
        return place, np.ceil(exact)
    raise _fault(path, 1, f"EDGE_WEIGHT_TYPE {kind!r} is not known", "give EUC_2D or ATT")


def _straight(place: FloatArray) -> FloatArray:
    east, north = (place[:, axis, None] - place[None, :, axis] for axis in (0, 1))
    return np.sqrt(east * east + north * north)


def _numbers(path: Path, line: int, words: list[str], n: int) -> list[float]:
    if len(words) != n or not all(_is_number(word) for word in words):
        raise _fault(path, line, f"{' '.join(words)[:40]!r} is not {n} numbers", f"give {n}")
    return [float(word) for word in words]


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise _fault(path, 1, f"cannot be read: {error}", "give a text file") from None


def _fault(path: Path, line: int, problem: str, remedy: str) -> InputError:
    return InputError(Fault(str(path), f"line {line}", problem, remedy))
