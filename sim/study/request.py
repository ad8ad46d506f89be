"""Which study the command line asks for: a file, a shipped name or a scenario, and changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from sim.options import ChanceOptions
from sim.study.design import (
    FIELD_NUMBERS,
    NUMBERS,
    Factor,
    RandomMissions,
    SameMission,
    Study,
    unlisted,
    wrong_values,
)
from sim.study.options import StudyRequest
from sim.study.policies.roster import PolicyRoster
from sim.study.study_file import DEFAULT_TRIALS, MOST_TASKS, MOST_UAVS, load_study
from swarm.runtime.errors import Fault, InputError
from swarm.scenario import load_scenario, shipped_scenarios
from swarm.scenario.files import read_bytes
from swarm.scenario.findings import close_match, printable
from swarm.scenario.read import parse_toml

_STUDIES = "sim.studies"
_USUAL_REFERENCE = "central"
_SCENARIO_KEYS = ("uav", "task", "tasks_from", "origin")
"""Of scenario files alone."""


def shipped_studies() -> dict[str, Path]:
    """Names and files of the studies that ship with the package."""
    return shipped_scenarios(_STUDIES)


def requested_study(asked: StudyRequest, chance: ChanceOptions, roster: PolicyRoster) -> Study:
    """The study that is meant, with what the command line changes in it.

    Raises:
        InputError: something is wrong with it.
    """
    study = _base(asked, roster)
    if asked.policies is not None:
        names = _policies(asked.policies, roster)
        reference = study.reference if study.reference in names else _usual_reference(names)
        study = replace(study, policies=names, reference=reference)
    if asked.reference is not None:
        if asked.reference not in study.policies:
            remedy = f"name one of the policies: {', '.join(study.policies)}"
            problem = "is none of the policies of this study"
            raise InputError(Fault("--reference", printable(asked.reference), problem, remedy))
        study = replace(study, reference=asked.reference)
    if asked.trials is not None:
        everywhere = tuple(replace(varied, trials=None) for varied in study.varied)
        study = replace(study, trials=asked.trials, varied=everywhere)
    if asked.vary:
        study = replace(study, varied=tuple(_varied(asked.vary)))
    _check_field(study, asked, roster)
    return replace(
        study,
        seed=study.seed if asked.seed is None else asked.seed,
        bound=study.bound if asked.bound is None else asked.bound,
        reattempt=study.reattempt if chance.reattempt is None else chance.reattempt,
        uncertainty=chance.changed(study.uncertainty),
    )


def _base(asked: StudyRequest, roster: PolicyRoster) -> Study:
    """The study without changes, other than of its missions."""
    missions = None if asked.random is None else _random(asked.random)
    if asked.what is None:
        if missions is None:
            remedy = "name one, or ask for --random 10,50"
            raise InputError(Fault("swarm study", "", "no scenario or study is given", remedy))
        return _plain(f"random-{missions.uavs}x{missions.tasks}", missions, roster)
    path = _resolve(asked.what)
    if _is_scenario(path):
        if missions is not None:
            fault = Fault(
                "--random", str(asked.random), "does not go with a scenario", "leave it out"
            )
            raise InputError(fault)
        mission = load_scenario(path)
        return _plain(mission.name, SameMission(mission), roster)
    study = load_study(path, roster)
    if missions is None:
        return study
    for key, name, _ in unlisted(study.uncertainty, missions):
        problem = f"has no {name}, of which the study lists {key}"
        fault = Fault("--random", str(asked.random), problem, "ask for larger missions")
        raise InputError(fault)
    if isinstance(study.missions, RandomMissions):
        missions = replace(missions, shape=study.missions.shape)
    return replace(study, missions=missions)


def _check_field(study: Study, asked: StudyRequest, roster: PolicyRoster) -> None:
    """Refuse what does not go with missions in the field, or without them.

    Raises:
        InputError: something of it is asked for.
    """
    faults: list[Fault] = []
    shaped = isinstance(study.missions, RandomMissions) and study.missions.shape is not None
    for varied in study.varied:
        if varied.what in FIELD_NUMBERS and not shaped:
            problem = "is of random missions in the field alone"
            remedy = "give a study of them, such as field"
            faults.append(Fault("--vary", varied.what, problem, remedy))
    if study.in_field:
        for name in study.policies:
            if not roster.in_field(name):
                remedy = f"give some of {', '.join(roster.names(in_field=True))}"
                faults.append(
                    Fault("--policies", name, "does not heed the field's constraints", remedy)
                )
        if asked.bound:
            problem = "no bound is known of missions in the field"
            faults.append(Fault("--bound", "", problem, "leave it out"))
    if faults:
        raise InputError(*faults)


def _plain(name: str, missions: SameMission | RandomMissions, roster: PolicyRoster) -> Study:
    in_field = Study(name, missions, (), 1).in_field
    names = roster.names(in_field=in_field)
    study = Study(name, missions, names, DEFAULT_TRIALS, reference=_usual_reference(names))
    return replace(study, bound=not in_field)


def _usual_reference(names: Sequence[str]) -> str:
    return _USUAL_REFERENCE if _USUAL_REFERENCE in names else names[0]


def _resolve(argument: str) -> Path:
    """The file that is meant; an existing path wins over a shipped name."""
    path = Path(argument)
    try:
        if path.is_file():
            return path
    except (OSError, ValueError):  # a name too long, or with a null character
        pass
    shipped = {**shipped_scenarios(), **shipped_studies()}
    if argument in shipped:
        return shipped[argument]
    close = get_close_matches(argument.removesuffix(".toml"), shipped, n=1)
    hint = f"did you mean {close[0]!r}?" if close else "give a file or a shipped name;"
    remedy = (
        f"{hint} Shipped studies: {', '.join(shipped_studies())}; "
        f"scenarios: {', '.join(shipped_scenarios())}"
    )
    problem = "no such scenario or study"
    raise InputError(Fault(printable(argument) or "SCENARIO", "", problem, remedy))


def _is_scenario(path: Path) -> bool:
    if path.suffix != ".toml":
        return True  # of which reading says what it is instead
    document = parse_toml(read_bytes(path, "study file"), printable(str(path)), "study file")
    return any(key in document for key in _SCENARIO_KEYS)


def _random(text: str) -> RandomMissions:
    try:
        uavs, tasks = (int(word) for word in text.split(","))
    except ValueError:
        uavs = tasks = 0
    if not (1 <= uavs <= MOST_UAVS and 1 <= tasks <= MOST_TASKS):
        problem = "is no size of a mission"
        remedy = f"give UAVs (1..{MOST_UAVS}) and tasks (1..{MOST_TASKS}), such as 10,50"
        raise InputError(Fault("--random", printable(text), problem, remedy))
    return RandomMissions(uavs, tasks)


def _policies(text: str, roster: PolicyRoster) -> tuple[str, ...]:
    names = tuple(word.strip() for word in text.split(","))
    faults: list[Fault] = []
    for index, name in enumerate(names):
        if fault := roster.fault(name):
            faults.append(Fault("--policies", "", *fault))
        elif name in names[:index]:
            faults.append(Fault("--policies", "", f"{name!r} is there twice", "name it once"))
    if faults:
        raise InputError(*faults)
    return names


def _varied(options: Sequence[str]) -> list[Factor]:
    varied: list[Factor] = []
    faults: list[Fault] = []
    for option in options:
        what, equals, text = option.partition("=")
        if what not in (*NUMBERS, *FIELD_NUMBERS) or not equals:
            close = close_match(what, NUMBERS)
            right = f"did you mean {close!r}?" if close else f"vary one of {', '.join(NUMBERS)}"
            remedy = right if equals else "give NAME=VALUE,VALUE, such as loss=0,0.1,0.3"
            faults.append(Fault("--vary", printable(option), "varies nothing known", remedy))
            continue
        if any(what == other.what for other in varied):
            problem = f"{what} is varied twice"
            faults.append(Fault("--vary", printable(option), problem, "put its values together"))
        values = [_number(word) for word in text.split(",")]
        for _, problem, remedy in wrong_values(what, values):
            faults.append(Fault("--vary", printable(option), problem, remedy))
        numbers = tuple(value for value in values if isinstance(value, float))
        varied.append(Factor(what, numbers))
    if faults:
        raise InputError(*faults)
    return varied


def _number(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word
