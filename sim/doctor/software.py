"""Whether what is installed is right and works: Python, packages, kernels.

Leaves out: the machine it runs on (sim.doctor.machine).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

from sim.doctor.finding import Finding, fails, fine

__all__ = ["check_kernels", "check_packages", "check_python"]

_REQUIREMENT = re.compile(r"([A-Za-z0-9_.-]+)(?:\[[^\]]*\])?\s*([^;]*)(;.*)?")
_NAMED = ("eclipse-zenoh", "pymavlink")
"""Packages whose versions are told: what is flown depends on them most."""
_INSTALL = "install it anew: pip install --force-reinstall peckorder"


def check_python(version: tuple[int, int, int], least: tuple[int, int]) -> Finding:
    """The interpreter's version."""
    shown = ".".join(map(str, version))
    if version[:2] < least:
        wanted = ".".join(map(str, least))
        return fails("python", f"{shown} is too old", f"use Python {wanted} or newer")
    return fine("python", shown)


def check_packages(requirements: Sequence[str], version_of: Callable[[str], str | None]) -> Finding:
    """Whether every package that is needed is there and new enough.

    Args:
        requirements: as the package's metadata names them, extras among them.
        version_of: the installed version; None if there is none.
    """
    missing, old, told = [], [], []
    for text in requirements:
        match = _REQUIREMENT.fullmatch(text.strip())
        if match is None or "extra ==" in (match[3] or ""):
            continue
        name, wanted, installed = match[1], match[2].strip(), version_of(match[1])
        if installed is None:
            missing.append(name)
        elif not _satisfies(installed, wanted):
            old.append(f"{name} {installed} (needed {wanted})")
        elif name in _NAMED:
            told.append(f"{name} {installed}")
    if missing or old:
        parts = [f"{', '.join(missing)} missing"] if missing else []
        return fails("packages", "; ".join(parts + old), "install them: pip install -U peckorder")
    return fine("packages", ", ".join(told) or "all there")


def _satisfies(installed: str, wanted: str) -> bool:
    """Whether a version lies within bounds such as ``>=1.10.2,<2``; others are not judged."""
    for bound in filter(None, (part.strip() for part in wanted.split(","))):
        if bound.startswith(">=") and _numbers(installed) < _numbers(bound[2:]):
            return False
        if bound.startswith("<") and bound[1] != "=" and _numbers(installed) >= _numbers(bound[1:]):
            return False
    return True


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def check_kernels(plan: Callable[[], Mapping[str, float]]) -> Finding:
    """Whether the compiled kernels load, and compute what they should.

    Args:
        plan: objectives of table-1 by method.
    """
    try:
        found = plan()
    except Exception as fault:  # noqa: BLE001 - whatever is wrong with what was compiled
        problem = f"{type(fault).__name__}: {fault}"
        return fails("kernels", f"do not work ({problem})", _INSTALL)
    wrong = [
        f"{method} {found.get(method)} instead of {right}"
        for method, right in _TABLE_1.items()
        if abs(found.get(method, 0.0) - right) > 5e-5
    ]
    if wrong:
        return fails("kernels", f"compute wrongly: {', '.join(wrong)}", _INSTALL)
    return fine("kernels", "load, and plan table-1 as they should")


_TABLE_1 = {"greedy": 118.4939, "exact": 120.3335}
"""J of the plans of table-1 by method [value·s]; README."""
