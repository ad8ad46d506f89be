"""JSON of files people have, with one clear line when it is none.

Leaves out: what is in it (plan_file, geojson_file).
"""

from __future__ import annotations

import json
from collections.abc import Mapping

from swarm.errors import Fault, InputError
from swarm.scenario.findings import printable

__all__ = ["member", "parse_object"]


def parse_object(text: str, source: str, what: str) -> Mapping[str, object]:
    """The object that ``text`` is.

    Raises:
        InputError: it is no JSON, or another value than an object.
    """
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        problem = f"is not JSON: {printable(error.msg[:1].lower() + error.msg[1:])}"
        raise InputError(Fault(source, place, problem, f"give {what}")) from error
    except (RecursionError, ValueError) as error:
        # Nested thousands deep, or a number of thousands of digits.
        raise InputError(Fault(source, "", "is not JSON of any use", f"give {what}")) from error
    if not isinstance(document, Mapping):
        raise InputError(Fault(source, "", "is not a JSON object", f"give {what}"))
    return document


def member(value: object, *keys: str) -> object:
    """What is at ``keys`` inside ``value``; None if any step is missing or no object."""
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
