"""Study files: TOML in, a study out, every fault at once; and the way back.

Leaves out: what a study means (sim.study.design), and comments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from sim.study.design import (
    LISTED,
    NUMBERS,
    SWITCHES,
    Factor,
    RandomMissions,
    SameMission,
    Study,
    right_number,
    unlisted,
    wrong_number,
    wrong_values,
)
from sim.study.policies.roster import PolicyRoster
from sim.study.table_reader import (
    TableReader,
    ValueType,
    WrongValueError,
    array,
    as_switch,
    as_table,
    as_tables,
    as_word,
    integer,
    one_of,
)
from sim.world.uncertainty import Uncertainty
from swarm.model.ids import ID_RULE, valid_id
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario, resolve_scenario
from swarm.scenario.files import read_bytes
from swarm.scenario.findings import Document, close_match, faults_of, number_of, printable, shown
from swarm.scenario.read import parse_toml
from swarm.scenario.write import toml_float, toml_string

__all__ = [
    "DEFAULT_TRIALS",
    "MOST_SEED",
    "MOST_TASKS",
    "MOST_TRIALS",
    "MOST_UAVS",
    "SCHEMA",
    "format_study",
    "load_study",
    "parse_study",
]


SCHEMA = 1
"""The version of the format that is read and written."""

DEFAULT_TRIALS = 50

MOST_TRIALS = 1_000_000

MOST_SEED = 2**63 - 1

MOST_UAVS, MOST_TASKS = 1000, 10_000

_WHAT = "study file"


_KEYS: Mapping[str, Sequence[str]] = {
    "": (
        *("schema", "name", "trials", "seed", "policies", "reference", "bound"),
        *("mission", "uncertainty", "vary"),
    ),
    "mission": ("scenario", "random"),
    "random": ("uavs", "tasks"),
    "uncertainty": (*NUMBERS, *SWITCHES, *LISTED, "reattempt"),
    "vary": ("what", "values", "trials"),
}


def load_study(path: Path, roster: PolicyRoster) -> Study:
    """The study in the file ``path``.

    Raises:
        InputError: the file, or the scenario that it names, cannot be read or is wrong.
    """
    return parse_study(read_bytes(path, _WHAT), printable(str(path)), roster, path.parent)


def parse_study(data: bytes, source: str, roster: PolicyRoster, folder: Path = Path()) -> Study:
    """The study that ``data`` describes.

    Args:
        data: the bytes of a study file.
        source: name of the file, for messages.
        roster: policies that it may name.
        folder: where a scenario is looked for, before the shipped ones.

    Raises:
        InputError: with every fault of the file, in its order.
    """
    document = parse_toml(data, source, _WHAT)
    reader = _Reader(roster, folder)
    study = reader.study(document)
    if study is None:
        raise InputError(*faults_of(document, source, reader.findings))
    return study


class _Reader(TableReader):
    """Reads one document and gathers what is wrong with it."""

    def __init__(self, roster: PolicyRoster, folder: Path) -> None:
        super().__init__()
        self._roster = roster
        self._folder = folder

    def study(self, top: Document) -> Study | None:
        """The study; None if there are findings."""
        self.unknown_keys(top, (), _KEYS[""])
        self.required(top, (), "schema", _SCHEMA)
        name = self.required(top, (), "name", _NAME)
        trials = self.optional(top, (), "trials", integer(1, MOST_TRIALS), DEFAULT_TRIALS)
        seed = self.optional(top, (), "seed", integer(0, MOST_SEED), 0)
        policies = self._policies(top)
        reference = self.optional(top, (), "reference", one_of(policies), None)
        bound = self.optional(top, (), "bound", _SWITCH, default=True)
        missions = self._missions(top)
        uncertainty, reattempt = self._uncertainty(top)
        varied = tuple(self._varied(top))
        if missions is not None:
            for key, uav_or_task, ids in unlisted(uncertainty, missions):
                close = close_match(uav_or_task, ids)
                remedy = f"did you mean {close!r}?" if close else f"name one such as {ids[0]!r}"
                self.add(("uncertainty", key, uav_or_task), "is not in the mission", remedy)
        if self.findings or name is None or missions is None:
            return None
        return Study(
            name=name,
            missions=missions,
            policies=policies,
            trials=trials,
            seed=seed,
            reference=reference,
            bound=bound,
            uncertainty=uncertainty,
            reattempt=reattempt,
            varied=varied,
        )

    # -- tables ---------------------------------------------------------------------------

    def _policies(self, top: Document) -> tuple[str, ...]:
        every: list[object] = list(self._roster.policies)
        names = self.optional(top, (), "policies", array('policies = ["guided", "central"]'), every)
        for index, name in enumerate(names):
            if not isinstance(name, str):
                self.add(
                    ("policies", index), f"{shown(name)} is not a string in quotes", "name a policy"
                )
            elif fault := self._roster.fault(name):
                self.add(("policies", index), *fault)
            elif name in names[:index]:
                self.add(("policies", index), f"{shown(name)} is there twice", "name it once")
        return tuple(str(name) for name in names)

    def _missions(self, top: Document) -> SameMission | RandomMissions | None:
        table = self.required(top, (), "mission", _MISSION)
        if table is None:
            return None
        place = ("mission",)
        self.unknown_keys(table, place, _KEYS["mission"])
        if "scenario" in table and "random" in table:
            self.add(place, "has both a scenario and random missions", f"give {_MISSION.right}")
        elif "scenario" in table:
            name = self.required(table, place, "scenario", _SCENARIO)
            return None if name is None else SameMission(load_scenario(self._scenario(name)))
        elif "random" in table:
            return self._random_missions(table)
        elif not table:
            self.add(place, "is empty", f"give {_MISSION.right}")
        return None

    def _random_missions(self, table: Document) -> RandomMissions | None:
        place = ("mission", "random")
        size = self.required(table, place[:1], "random", _RANDOM)
        if size is None:
            return None
        self.unknown_keys(size, place, _KEYS["random"])
        uavs = self.required(size, place, "uavs", integer(1, MOST_UAVS))
        tasks = self.required(size, place, "tasks", integer(1, MOST_TASKS))
        return None if uavs is None or tasks is None else RandomMissions(uavs, tasks)

    def _scenario(self, name: str) -> Path:
        beside = self._folder / name
        return beside if beside.is_file() else resolve_scenario(name)

    def _uncertainty(self, top: Document) -> tuple[Uncertainty, bool | None]:
        place = ("uncertainty",)
        table = self.optional(top, (), "uncertainty", _UNCERTAINTY, {})
        self.unknown_keys(table, place, _KEYS["uncertainty"])
        before = len(self.findings)
        given: dict[str, Any] = {}
        for key in _KEYS["uncertainty"]:
            if key in table:
                given[key] = self.required(table, place, key, _kind_of(key))
        reattempt = given.pop("reattempt", None)
        return Uncertainty(**given) if len(self.findings) == before else Uncertainty(), reattempt

    def _varied(self, top: Document) -> Iterator[Factor]:
        seen: set[str] = set()
        tables: list[object] = self.optional(top, (), "vary", _VARY, [])
        for index, table in enumerate(tables):
            place = ("vary", index)
            if not isinstance(table, Mapping):
                self.add(place, f"{shown(table)} is not a table", f"give {_VARY.right}")
                continue
            self.unknown_keys(table, place, _KEYS["vary"])
            what = self.required(table, place, "what", one_of(NUMBERS))
            values = self.required(table, place, "values", array("values = [0.0, 0.3]"))
            trials = self.optional(table, place, "trials", integer(1, MOST_TRIALS), None)
            if what is None or values is None:
                continue
            if what in seen:
                self.add((*place, "what"), f"{what} is varied twice", "put its values together")
            seen.add(what)
            for at, problem, remedy in wrong_values(what, values):
                self.add((*place, "values", at), problem, remedy)
            yield Factor(what, tuple(number_of(value) or 0.0 for value in values), trials)


def _kind_of(key: str) -> ValueType[Any]:
    """What a key of ``[uncertainty]`` may be."""
    if key in NUMBERS:
        return ValueType(right_number(key), lambda value: _number(key, value))
    return _TIMES if key in LISTED else _SWITCH


def _number(name: str, value: object) -> float:
    if problem := wrong_number(name, value):
        raise WrongValueError(problem)
    return number_of(value) or 0.0


def _schema(value: object) -> int:
    if isinstance(value, bool) or value != SCHEMA:
        raise WrongValueError(f"version {shown(value)} of the format is not known")
    return SCHEMA


def _id(value: object) -> str:
    if not isinstance(value, str) or not valid_id(value):
        raise WrongValueError(f"{shown(value)} is not an id")
    return value


def _times(value: object) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise WrongValueError(f"{shown(value)} is not a table")
    for name, moment in value.items():
        number = number_of(moment)
        if number is None or number < 0.0:
            raise WrongValueError(f"{shown(moment)} of {name} is no mission time")
    return {name: float(moment) for name, moment in value.items()}


_SCHEMA = ValueType(f"schema = {SCHEMA}", _schema)

_NAME = ValueType(f'an id of {ID_RULE}, such as name = "robustness"', _id)

_SWITCH = ValueType("true or false", as_switch)

_SCENARIO = ValueType('a shipped scenario or a file, such as scenario = "valley-survey"', as_word)

_MISSION = ValueType(
    '[mission] with scenario = "…" or random = { uavs = 10, tasks = 50 }', as_table
)

_RANDOM = ValueType("random = { uavs = 10, tasks = 50 }", as_table)

_UNCERTAINTY = ValueType("a table [uncertainty]", as_table)

_VARY = ValueType("a table [[vary]] for each number that is varied", as_tables)

_TIMES = ValueType("a table of ids with a mission time >= 0 each [s]", _times)


def format_study(study: Study, scenario: str) -> str:
    """The text of a study file for ``study``, with nothing left to defaults.

    Args:
        study: what to write.
        scenario: file beside it that holds the mission, where every trial flies the same.
    """
    head = [
        f"schema = {SCHEMA}",
        f"name = {toml_string(study.name)}",
        f"trials = {study.trials}",
        f"seed = {study.seed}",
        "policies = [",
        *(f"    {toml_string(name)}," for name in study.policies),
        "]",
        f"bound = {_truth(study.bound)}",
    ]
    if study.reference is not None:
        head.insert(-1, f"reference = {toml_string(study.reference)}")
    match study.missions:
        case RandomMissions(uavs, tasks):
            mission = f"random = {{ uavs = {uavs}, tasks = {tasks} }}"
        case SameMission():
            mission = f"scenario = {toml_string(scenario)}"
    blocks = [head, ["[mission]", mission], ["[uncertainty]", *_uncertainty_lines(study)]]
    for varied in study.varied:
        values = ", ".join(toml_float(value) for value in varied.values)
        block = ["[[vary]]", f"what = {toml_string(varied.what)}", f"values = [{values}]"]
        if varied.trials is not None:
            block.append(f"trials = {varied.trials}")
        blocks.append(block)
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _uncertainty_lines(study: Study) -> Iterator[str]:
    for key in NUMBERS:
        yield f"{key} = {toml_float(getattr(study.uncertainty, key))}"
    for key in SWITCHES:
        yield f"{key} = {_truth(getattr(study.uncertainty, key))}"
    for key in LISTED:
        times: Mapping[str, float] = getattr(study.uncertainty, key)
        inner = ", ".join(f"{toml_string(name)} = {toml_float(at)}" for name, at in times.items())
        yield f"{key} = {{ {inner} }}" if inner else f"{key} = {{}}"
    if study.reattempt is not None:
        yield f"reattempt = {_truth(study.reattempt)}"


def _truth(value: bool) -> str:
    return "true" if value else "false"
