"""A study as a study file that reads back as the same study.

Leaves out: comments.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from sim.study.config import LISTED, NUMBERS, SWITCHES, RandomMissions, SameMission, Study
from sim.study.study_file import SCHEMA
from swarm.scenario.write import toml_float, toml_string

__all__ = ["format_study"]


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
