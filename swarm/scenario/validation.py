"""Tables of a TOML file against pydantic models: every fault at once, in words people use.

Scenario and study files share it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from swarm.model.ids import valid_id
from swarm.scenario.findings import Document, Finding, Path, absent, close_match, shown

T = TypeVar("T", bound=BaseModel)

PROBABILITY = "a probability within 0..1"
"""What is right where a `Probability` is wrong."""


class StrictTable(BaseModel):
    """One table, with these keys and no others."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


def wrong(problem: str) -> PydanticCustomError:
    """What a validator raises to say ``problem``, in which ``{}`` stands for the value."""
    return PydanticCustomError("said", "{problem}", {"problem": problem})


def _require_id(name: str) -> str:
    if not valid_id(name):
        raise wrong("{} is not an id")
    return name


def _require_probability(share: float) -> float:
    if not 0.0 <= share <= 1.0:
        raise wrong("{} is not within 0..1")
    return share


Id = Annotated[str, AfterValidator(_require_id)]
Probability = Annotated[float, AfterValidator(_require_probability)]


def known_schema(*known: int) -> AfterValidator:
    """Accepts the versions ``known`` of a format."""

    def check(version: int) -> int:
        if version not in known:
            raise wrong("version {} of the format is not known")
        return version

    return AfterValidator(check)


@dataclass(frozen=True, slots=True)
class TableShape:
    """One table of a file."""

    header: str
    """As the file has it, such as ``[[uav]]``; what is called ``the top`` has none."""
    keys: Sequence[str]

    @classmethod
    def of(cls, header: str, model: type[BaseModel]) -> TableShape:
        """The table that ``model`` describes; an id is its first key."""
        names = [field.alias or key for key, field in model.model_fields.items()]
        return cls(header, sorted(names, key="id".__ne__))


def validate_tables(
    model: type[T],
    document: Document,
    tables: Mapping[tuple[str, ...], TableShape],
    right: Mapping[tuple[str, ...], str],
) -> tuple[T | None, list[Finding]]:
    """The document if every shape, type and range is right, and all findings otherwise.

    Args:
        model: of the whole document.
        document: the parsed file.
        tables: by the names of the keys that lead to them.
        right: what would be right, by the names of the keys that lead there; ``*`` stands for any
            last name, and whatever is not there is as its table.
    """
    try:
        return model.model_validate(document), []
    except ValidationError as error:
        details = error.errors(include_url=False, include_context=True)
    findings: list[Finding] = []
    for detail in details:
        path = detail["loc"]
        remedy = _remedy(path, right)
        match detail["type"]:
            case "missing":
                findings.append(absent(path, remedy))
            case "extra_forbidden":
                findings.append(_unknown_key(path, document, tables))
            case _:
                findings.append(Finding(path, _problem(detail), remedy))
    return None, findings


_WANTED: Mapping[str, str] = {
    "float_type": "a number",
    "int_type": "an integer",
    "bool_type": "true or false",
    "string_type": "a string in quotes",
    "list_type": "an array",
    "dict_type": "a table",
    "model_type": "a table",
    "finite_number": "a finite number",
}
_RANGE: Mapping[str, str] = {
    "greater_than": "> {gt:g}",
    "greater_than_equal": ">= {ge:g}",
    "less_than_equal": "<= {le:g}",
}


def _problem(detail: ErrorDetails) -> str:
    kind, value = detail["type"], detail["input"]
    context: dict[str, Any] = detail.get("ctx", {})
    if kind == "float_type" and isinstance(value, int) and not isinstance(value, bool):
        return f"{shown(value)} is out of range"  # no float is as large
    if kind in _WANTED:
        return f"{shown(value)} is not {_WANTED[kind]}"
    if kind in _RANGE:
        return f"{shown(value)} is not {_RANGE[kind].format(**context)}"
    match kind:
        case "said":
            return str(context["problem"]).format(shown(value))
        case "string_too_short":
            return "the word is empty"
        case "string_too_long":
            return f"{shown(value)} is too long"
        case "too_short" if not context["actual_length"]:
            return "is empty"
        case _:
            return f"{shown(value)} is not valid"


def _names(path: Iterable[str | int]) -> tuple[str, ...]:
    """The way there without indices: ``("uav",)`` is the array, and each table of it."""
    return tuple(step for step in path if isinstance(step, str))


def _remedy(path: Path, right: Mapping[tuple[str, ...], str]) -> str:
    names = _names(path)
    for end in range(len(names), 0, -1):
        for place in (names[:end], (*names[: end - 1], "*")):
            if place in right:
                return f"give {right[place]}"
    return "leave it out"


def _unknown_key(
    path: Path, document: Document, tables: Mapping[tuple[str, ...], TableShape]
) -> Finding:
    *parents, key = path
    place, name = _names(parents), str(key)
    table = tables[place]
    there = _there(document, path[:-1])
    meant = close_match(name, [known for known in table.keys if known not in there])
    if meant is not None:
        return Finding(path, "unknown key", f"did you mean {meant!r}?", meant=(*parents, meant))
    homes = [home for home, other in tables.items() if name in other.keys and home != place]
    # A name in one of many tables is likelier its id than that of the whole file.
    if homes and not (table.header.startswith("[[") and not homes[0]):
        return Finding(path, "unknown key here", f"it belongs in {tables[homes[0]].header}")
    return Finding(path, "unknown key", f"the keys here are {', '.join(table.keys)}")


def _there(document: Document, path: Path) -> Mapping[str, object]:
    here: Any = document
    for step in path:
        here = here[step]
    return here if isinstance(here, Mapping) else {}
