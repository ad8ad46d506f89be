"""Study files: TOML in, a study out, every fault at once; and the way back."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, create_model

from sim.study.design import (
    FIELD_NUMBERS,
    FIELD_SHARES,
    LISTED,
    NUMBERS,
    PROBABILITIES,
    SWITCHES,
    Factor,
    RandomMissions,
    SameMission,
    Study,
    right_number,
    unlisted,
    wrong_values,
)
from sim.study.field_generator import FieldShape
from sim.study.policies.roster import PolicyRoster
from sim.world.uncertainty import Uncertainty
from swarm.model.ids import ID_RULE
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario, resolve_scenario
from swarm.scenario.files import read_bytes
from swarm.scenario.findings import Document, Finding, close_match, faults_of, printable, shown
from swarm.scenario.read import parse_toml
from swarm.scenario.validation import (
    Id,
    Probability,
    StrictTable,
    TableShape,
    known_schema,
    validate_tables,
)
from swarm.scenario.write import toml_float, toml_string

PLAIN_SCHEMA, SCHEMA = 1, 2
"""The versions of the format: of studies of plain missions, and of those in the field."""
DEFAULT_TRIALS = 50
MOST_TRIALS = 1_000_000
MOST_SEED = 2**63 - 1
MOST_UAVS, MOST_TASKS = 1000, 10_000
_WHAT = "study file"

_Trials = Annotated[int, Field(ge=1, le=MOST_TRIALS)]
_Amount = Annotated[float, Field(ge=0.0)]


class _SizeTable(StrictTable):
    uavs: Annotated[int, Field(ge=1, le=MOST_UAVS)]
    tasks: Annotated[int, Field(ge=1, le=MOST_TASKS)]


_SHAPE: dict[str, Any] = {
    name: (Probability if name in FIELD_SHARES else _Amount, getattr(FieldShape(), name))
    for name in FIELD_NUMBERS
}
_RandomTable = create_model("_RandomTable", __base__=_SizeTable, **_SHAPE)


class _MissionTable(StrictTable):
    scenario: Annotated[str, Field(min_length=1)] | None = None
    random: _RandomTable | None = None


class _VaryTable(StrictTable):
    what: str
    values: Annotated[list[Any], Field(min_length=1)]
    """Which of them are right depends on `what`."""
    trials: _Trials | None = None


_UNCERTAIN: dict[str, Any] = {
    **{name: (Probability if name in PROBABILITIES else _Amount, 0.0) for name in NUMBERS},
    **dict.fromkeys(SWITCHES, (bool, False)),
    **dict.fromkeys(LISTED, (dict[str, _Amount], {})),
    "reattempt": (bool | None, None),
}
_UncertaintyTable = create_model("_UncertaintyTable", __base__=StrictTable, **_UNCERTAIN)


class _StudyTable(StrictTable):
    version: Annotated[int, known_schema(PLAIN_SCHEMA, SCHEMA)] = Field(alias="schema")
    name: Id
    trials: _Trials = DEFAULT_TRIALS
    seed: Annotated[int, Field(ge=0, le=MOST_SEED)] = 0
    policies: Annotated[list[str], Field(min_length=1)] | None = None
    reference: str | None = None
    bound: bool = True
    mission: _MissionTable
    uncertainty: _UncertaintyTable = Field(default_factory=_UncertaintyTable)
    vary: list[_VaryTable] = Field(default_factory=list)


_TABLES: Mapping[tuple[str, ...], TableShape] = {
    (): TableShape.of("the top", _StudyTable),
    ("mission",): TableShape.of("[mission]", _MissionTable),
    ("mission", "random"): TableShape.of("random of [mission]", _RandomTable),
    ("uncertainty",): TableShape.of("[uncertainty]", _UncertaintyTable),
    ("vary",): TableShape.of("[[vary]]", _VaryTable),
}
_A_MISSION = '[mission] with scenario = "…" or random = { uavs = 10, tasks = 50 }'
_SWITCH = "true or false"
_MOMENTS = "a table of ids with a mission time >= 0 each [s]"
_TRIALS = f"an integer within 1..{MOST_TRIALS}"
_RIGHT: Mapping[tuple[str, ...], str] = {
    ("schema",): f"schema = {PLAIN_SCHEMA}, or {SCHEMA} for missions in the field",
    ("name",): f'an id of {ID_RULE}, such as name = "robustness"',
    ("trials",): _TRIALS,
    ("seed",): f"an integer within 0..{MOST_SEED}",
    ("policies",): 'at least one in an array, such as policies = ["guided", "central"]',
    ("reference",): "one of the policies",
    ("bound",): _SWITCH,
    ("mission",): _A_MISSION,
    ("mission", "scenario"): 'a shipped scenario or a file, such as scenario = "valley-survey"',
    ("mission", "random"): "random = { uavs = 10, tasks = 50 }",
    ("mission", "random", "uavs"): f"an integer within 1..{MOST_UAVS}",
    ("mission", "random", "tasks"): f"an integer within 1..{MOST_TASKS}",
    **{("mission", "random", name): right_number(name) for name in FIELD_NUMBERS},
    ("uncertainty",): "a table [uncertainty]",
    **{("uncertainty", name): right_number(name) for name in NUMBERS},
    **{("uncertainty", name): _SWITCH for name in (*SWITCHES, "reattempt")},
    **dict.fromkeys((("uncertainty", name) for name in LISTED), _MOMENTS),
    **{("uncertainty", name, "*"): "a mission time >= 0 [s]" for name in LISTED},
    ("vary",): "a table [[vary]] for each number that is varied",
    ("vary", "what"): f"one of {', '.join(NUMBERS)}; in the field also {', '.join(FIELD_NUMBERS)}",
    ("vary", "values"): "at least one in an array, such as values = [0.0, 0.3]",
    ("vary", "trials"): _TRIALS,
}


def load_study(path: Path, roster: PolicyRoster) -> Study:
    """The study in the file ``path``.

    Raises:
        InputError: the file, or the scenario that it names, cannot be read or is wrong.
    """
    return parse_study(read_bytes(path, _WHAT), printable(str(path)), roster, path.parent)


def parse_study(data: bytes, source: str, roster: PolicyRoster, folder: Path = Path()) -> Study:
    """The study that ``data``, the bytes of the file ``source``, describes.

    A scenario is looked for in ``folder`` before the shipped ones.

    Raises:
        InputError: with every fault of the file, in its order, then those of its scenario.
    """
    document = parse_toml(data, source, _WHAT)
    study, findings = validate_tables(_StudyTable, document, _TABLES, _RIGHT)
    findings += [
        *_wrong_policies(document, roster),
        *_wrong_mission(document),
        *_wrong_factors(document),
        *_wrong_in_field(document),
    ]
    missions = None
    if not any(finding.path[0] == "mission" for finding in findings):
        try:
            missions = _missions(document["mission"], folder)
        except InputError as error:
            raise InputError(*faults_of(document, source, findings), *error.faults) from error
        findings += _wrong_ids(document, missions)
        findings += _wrong_of_field(document, missions, roster)
    if study is None or missions is None or findings:
        raise InputError(*faults_of(document, source, findings))
    given = study.uncertainty.model_dump(exclude_unset=True)
    reattempt = given.pop("reattempt", None)
    return Study(
        name=study.name,
        missions=missions,
        policies=tuple(study.policies or roster.names(in_field=study.version == SCHEMA)),
        trials=study.trials,
        seed=study.seed,
        reference=study.reference,
        bound=study.bound and study.version == PLAIN_SCHEMA,
        uncertainty=Uncertainty(**given),
        reattempt=reattempt,
        varied=tuple(Factor(v.what, tuple(map(float, v.values)), v.trials) for v in study.vary),
    )


def _missions(table: Any, folder: Path) -> SameMission | RandomMissions:
    """Those of a table in which nothing is wrong.

    Raises:
        InputError: the scenario cannot be found or is wrong.
    """
    if "random" in table:
        given = {name: float(n) for name, n in table["random"].items() if name in FIELD_NUMBERS}
        shape = FieldShape(**given) if given else None
        return RandomMissions(table["random"]["uavs"], table["random"]["tasks"], shape)
    beside = folder / table["scenario"]
    mission = load_scenario(beside if beside.is_file() else resolve_scenario(table["scenario"]))
    return SameMission(mission)


# -- rules between several places ---------------------------------------------------------
# They read the document itself and pass over what has the wrong shape, so that one run names
# every fault.


def _wrong_policies(document: Document, roster: PolicyRoster) -> Iterator[Finding]:
    names = document.get("policies", list(roster.policies))
    if not isinstance(names, list):
        return
    for index, name in enumerate(names):
        if not isinstance(name, str):
            continue
        if fault := roster.fault(name):
            yield Finding(("policies", index), *fault)
        elif name in names[:index]:
            yield Finding(("policies", index), f"{shown(name)} is there twice", "name it once")
    reference = document.get("reference")
    if isinstance(reference, str) and reference not in names:
        known = [name for name in names if isinstance(name, str)]
        yield _not_one_of(("reference",), reference, known)


def _wrong_mission(document: Document) -> Iterator[Finding]:
    table = document.get("mission")
    if not isinstance(table, Mapping):
        return
    if "scenario" in table and "random" in table:
        problem = "has both a scenario and random missions"
        yield Finding(("mission",), problem, f"give {_A_MISSION}")
    elif not table:
        yield Finding(("mission",), "is empty", f"give {_A_MISSION}")


def _wrong_factors(document: Document) -> Iterator[Finding]:
    tables, seen = document.get("vary"), set()
    for index, table in enumerate(tables if isinstance(tables, list) else ()):
        what = table.get("what") if isinstance(table, Mapping) else None
        if not isinstance(what, str):
            continue
        place = ("vary", index)
        if what not in (*NUMBERS, *FIELD_NUMBERS):
            yield _not_one_of((*place, "what"), what, NUMBERS)
            continue
        if what in seen:
            problem = f"{what} is varied twice"
            yield Finding((*place, "what"), problem, "put its values together")
        seen.add(what)
        values = table.get("values")
        for at, problem, remedy in wrong_values(what, values if isinstance(values, list) else ()):
            yield Finding((*place, "values", at), problem, remedy)


def _wrong_in_field(document: Document) -> Iterator[Finding]:
    """Keys of schema 2 in a file of schema 1."""
    mission, tables = document.get("mission"), document.get("vary")
    given = mission.get("random") if isinstance(mission, Mapping) else None
    random = given if isinstance(given, Mapping) else {}
    varies = tables if isinstance(tables, list) else []
    remedy = f"say schema = {SCHEMA}"
    if document.get("schema") == PLAIN_SCHEMA:
        for name in FIELD_NUMBERS:
            if name in random:
                yield Finding(("mission", "random", name), "needs another schema", remedy)
        for index, table in enumerate(varies):
            if isinstance(table, Mapping) and table.get("what") in FIELD_NUMBERS:
                yield Finding(("vary", index, "what"), "needs another schema", remedy)
    elif not any(name in random for name in FIELD_NUMBERS):
        for index, table in enumerate(varies):
            if isinstance(table, Mapping) and table.get("what") in FIELD_NUMBERS:
                problem = f"is of random missions in the field, and {given!r} has none of it"
                remedy = "give random such as { uavs = 10, tasks = 50, bases = 2 }"
                yield Finding(("vary", index, "what"), problem, remedy)


def _wrong_of_field(
    document: Document, missions: SameMission | RandomMissions, roster: PolicyRoster
) -> Iterator[Finding]:
    """A schema that does not fit the missions, and what is not known of missions in the field."""
    in_field = Study("-", missions, (), 1).in_field
    if in_field != (document.get("schema") == SCHEMA):
        problem = f"does not fit: these missions are {'in the field' if in_field else 'plain'}"
        yield Finding(("schema",), problem, f"say schema = {SCHEMA if in_field else PLAIN_SCHEMA}")
    if not in_field:
        return
    if document.get("bound") is True:
        yield Finding(("bound",), "no bound is known of missions in the field", "say bound = false")
    names = document.get("policies")
    for index, name in enumerate(names if isinstance(names, list) else ()):
        if isinstance(name, str) and roster.fault(name) is None and not roster.in_field(name):
            known = ", ".join(roster.names(in_field=True))
            yield Finding(
                ("policies", index), "does not heed the field's constraints", f"give one of {known}"
            )


def _wrong_ids(document: Document, missions: SameMission | RandomMissions) -> Iterator[Finding]:
    table = document.get("uncertainty")
    listed = {key: table.get(key) for key in LISTED} if isinstance(table, Mapping) else {}
    there: dict[str, Any] = {
        key: dict.fromkeys(ids, 0.0) for key, ids in listed.items() if isinstance(ids, Mapping)
    }
    for key, uav_or_task, ids in unlisted(Uncertainty(**there), missions):
        close = close_match(uav_or_task, ids)
        remedy = f"did you mean {close!r}?" if close else f"name one such as {ids[0]!r}"
        yield Finding(("uncertainty", key, uav_or_task), "is not in the mission", remedy)


def _not_one_of(place: tuple[str | int, ...], name: str, known: Collection[str]) -> Finding:
    close = close_match(name, known)
    remedy = f"did you mean {close!r}?" if close else f"give one of {', '.join(known)}"
    return Finding(place, f"{shown(name)} is not one of them", remedy)


def format_study(study: Study, scenario: str) -> str:
    """The text of a study file for ``study``, with nothing left to defaults.

    The file ``scenario`` beside it holds the mission, where every trial flies the same.
    """
    head = [
        f"schema = {SCHEMA if study.in_field else PLAIN_SCHEMA}",
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
        case RandomMissions(uavs, tasks, shape):
            more = {} if shape is None else {n: getattr(shape, n) for n in FIELD_NUMBERS}
            inner = "".join(f", {name} = {toml_float(value)}" for name, value in more.items())
            mission = f"random = {{ uavs = {uavs}, tasks = {tasks}{inner} }}"
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
