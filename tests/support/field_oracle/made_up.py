"""Tiny scenarios made up from a seed, each about some of the field's constraints.

They are dicts in the shape of the TOML (`as_toml` writes one). What DESIGN.md leaves open is kept
out as far as it goes: no point lies in a zone at any height or on its border, no two UAVs or bases
share a place, no zone just touches a height that is used. Every one is a file without faults.
"""

from __future__ import annotations

import copy
import functools
import random
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tests.support.field_oracle.faults import is_faultless
from tests.support.field_oracle.scenario import Point

Draft = dict[str, Any]

SIDE_M = 400.0
"""Everything lies within a square of this side."""

RAYS: Sequence[Point] = (
    (1.0, 0.1),
    (0.8, 0.7),
    (0.1, 1.0),
    (-0.7, 0.8),
    (-1.0, -0.1),
    (-0.6, -0.8),
    (0.1, -1.0),
    (0.7, -0.7),
)
"""Where corners of zones may lie from the middle, from the east on against the clock."""

HEIGHTS_M = [(0.0, 120.0), (0.0, 11.5), (11.5, 40.5), (200.0, 300.0)]
"""Floors and ceilings: layers lie at 10 m, 13 m, … above places of whole metres."""


def made_up(seed: int, kind: str = "all", n_uavs: int = 2, n_tasks: int = 4) -> Draft:
    """A scenario of that kind (`KINDS`), always the same of the same seed.

    Args:
        seed: of everything.
        kind: which constraints it has; `all`: some of each, together.
        n_uavs: so many UAVs.
        n_tasks: so many tasks.
    """
    return copy.deepcopy(_made_up(seed, kind, n_uavs, n_tasks))


@functools.cache
def _made_up(seed: int, kind: str, n_uavs: int, n_tasks: int) -> Draft:
    for attempt in range(1000):
        rng = random.Random(f"{kind}-{seed}-{n_uavs}-{n_tasks}-{attempt}")
        draft = _plain(rng, f"made-up-{kind}-{seed}", n_uavs, n_tasks)
        for name in PARTS[kind]:
            ADD[name](rng, draft)
        if is_faultless(draft):
            return draft
    raise AssertionError("no draft without faults in 1000")


def as_toml(draft: Mapping[str, Any]) -> str:
    """The file's text."""
    lines = [f"{key} = {_toml(value)}" for key, value in draft.items() if not _is_table(value)]
    for key, value in draft.items():
        if isinstance(value, Mapping):
            lines += ["", f"[{key}]", *(f"{k} = {_toml(v)}" for k, v in value.items())]
        elif _is_table(value):
            for row in value:
                lines += ["", f"[[{key}]]", *(f"{k} = {_toml(v)}" for k, v in row.items())]
    return "\n".join(lines) + "\n"


def _is_table(value: object) -> bool:
    if isinstance(value, Mapping):
        return True
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f'"{k}" = {_toml(v)}' for k, v in value.items()) + " }"
    if isinstance(value, Sequence):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value)


def _place(rng: random.Random) -> list[float]:
    """Anywhere, on a grid of half a metre, which floats hold exactly."""
    return [rng.randrange(int(2 * SIDE_M) + 1) / 2 for _ in range(2)]


def _tenths(rng: random.Random, low: float, high: float) -> float:
    return round(rng.uniform(low, high), 1)


def _plain(rng: random.Random, name: str, n_uavs: int, n_tasks: int) -> Draft:
    uavs = [
        {"id": f"u{i + 1}", "position_m": _place(rng), "speed_m_s": _tenths(rng, 6.0, 14.0)}
        for i in range(n_uavs)
    ]
    tasks = []
    for i in range(n_tasks):
        task: Draft = {
            "id": f"t{i + 1}",
            "position_m": _place(rng),
            "value": float(rng.randint(1, 9)),
            "service_s": float(rng.choice([0, 0, 5, 20])),
        }
        if rng.random() < 0.3:
            task["kind"] = rng.choice(["inspect", "deliver"])
        tasks.append(task)
    for uav in uavs:
        table = {f"t{i + 1}": 0.9 for i in range(n_tasks) if rng.random() < 0.3}
        if rng.random() < 0.3 and any(task.get("kind") == "inspect" for task in tasks):
            table["inspect"] = 0.8
        if rng.random() < 0.2:
            table[f"t{rng.randint(1, n_tasks)}"] = 0.0
        uav["success"] = table
    return {
        "schema": 2,
        "name": name,
        "mission": {"horizon_s": 600.0, "success_default": 0.7},
        "uav": uavs,
        "base": [],
        "zone": [],
        "task": tasks,
    }


def _acceleration(rng: random.Random, draft: Draft) -> None:
    for uav in draft["uav"]:
        if rng.random() < 0.8:
            uav["acceleration_m_s2"] = _tenths(rng, 0.3, 3.0)


def _wind(rng: random.Random, draft: Draft) -> None:
    draft["mission"]["wind_m_s"] = [_tenths(rng, -4.0, 4.0), _tenths(rng, -4.0, 4.0)]
    for uav in draft["uav"]:
        if rng.random() < 0.8:
            uav["airspeed_m_s"] = _tenths(rng, 6.5, 14.0)


def _energy(rng: random.Random, draft: Draft) -> None:
    _bases(rng, draft, rng.randint(1, 2))
    for uav in draft["uav"]:
        if rng.random() < 0.85:
            uav["endurance_s"] = float(rng.randint(40, 160))
            if rng.random() < 0.5:
                uav["reserve_frac"] = rng.choice([0.0, 0.1, 0.3])
            if rng.random() < 0.5:
                uav["charge_frac"] = rng.choice([0.4, 0.6, 0.9])


def _slots(rng: random.Random, draft: Draft) -> None:
    """One base with one slot, and batteries that bring everybody there soon."""
    draft["base"] = []
    _bases(rng, draft, 1)
    base = draft["base"][0]
    base["position_m"] = [100.0 + x / 2 for x in _place(rng)]
    base["slots"] = 1
    base["swap_s"] = float(rng.randint(40, 120))
    for uav in draft["uav"]:
        uav["endurance_s"] = float(rng.randint(60, 110))
        uav["reserve_frac"] = rng.choice([0.0, 0.1])
        uav["charge_frac"] = _tenths(rng, 0.3, 0.6)


def _bases(rng: random.Random, draft: Draft, n: int) -> None:
    for index in range(n):
        base: Draft = {"id": f"b{index}", "position_m": _place(rng)}
        if rng.random() < 0.8:
            base["swap_s"] = float(rng.randint(5, 60))
        draft["base"].append(base)


def _zones(rng: random.Random, draft: Draft) -> None:
    for index in range(rng.randint(1, 3)):
        middle = [100.0 + x / 2 for x in _place(rng)]
        zone: Draft = {"id": f"z{index}", "polygon_m": _star(rng, middle, 90.0)}
        if rng.random() < 0.25:
            zone["floor_m"], zone["ceiling_m"] = rng.choice(HEIGHTS_M)
        draft["zone"].append(zone)
    if rng.random() < 0.3:  # a yard with a gate, and its inside a hole that is shut
        x, y = 20.0 + rng.randrange(200), 20.0 + rng.randrange(200)
        yard = {
            "id": "yard",
            "polygon_m": _box(x, y, 120.5, 100.0),
            "holes_m": [_box(x + 20.0, y + 20.0, 60.0, 50.5)],
        }
        draft["zone"].append(yard)


def _inclusive(rng: random.Random, draft: Draft) -> None:
    corners = [[-30.0, -30.0], [SIDE_M + 40.0, -25.0], [SIDE_M + 20.0, SIDE_M + 30.0]]
    notch = [_place(rng), [-20.0, SIDE_M + 25.0]]
    draft["zone"].append({"id": "field", "polygon_m": [*corners, *notch], "inclusive": True})


def _margin(rng: random.Random, draft: Draft) -> None:
    if not draft["zone"]:
        _zones(rng, draft)
    draft["mission"]["zone_margin_m"] = _tenths(rng, 2.0, 15.0)


def _windows(rng: random.Random, draft: Draft) -> None:
    for task in draft["task"]:
        if rng.random() < 0.6:
            task["opens_s"] = float(rng.randint(0, 120))
        if rng.random() < 0.5:
            task["closes_s"] = task.get("opens_s", 0.0) + rng.randint(0, 80)


def _due(rng: random.Random, draft: Draft) -> None:
    for task in draft["task"]:
        if rng.random() < 0.7:
            task["due_s"] = float(rng.randint(20, 200))


def _lines(rng: random.Random, draft: Draft) -> None:
    for task in draft["task"]:
        if rng.random() < 0.6:
            points = [task.pop("position_m")]
            for _ in range(rng.randint(1, 2)):
                x, y = points[-1][:2]
                points.append([x + rng.randint(-80, 80), y + rng.randint(1, 80)])
            task["path_m"] = points


def _heights(rng: random.Random, draft: Draft) -> None:
    """With wind all the same, since the text leaves open what it does to a climb."""
    climbs = "wind_m_s" not in draft["mission"]
    common_m = float(rng.randint(0, 60))
    for row in (*draft["uav"], *draft["task"], *draft["base"]):
        height_m = float(rng.randint(0, 60)) if climbs else common_m
        if "position_m" in row:
            row["position_m"] = [*row["position_m"][:2], height_m]
        else:
            row["path_m"] = [[*point[:2], height_m] for point in row["path_m"]]
    if rng.random() < 0.5:
        draft["mission"]["band_m"] = [30.0, 110.0]


def _survival(rng: random.Random, draft: Draft) -> None:
    draft["mission"]["survival_default"] = rng.choice([1.0, 0.95])
    for uav in draft["uav"]:
        uav["survival"] = {t["id"]: 0.8 for t in draft["task"] if rng.random() < 0.4}


def _popups(rng: random.Random, draft: Draft) -> None:
    """One task more, which no plan may know."""
    task = {"id": "late", "position_m": _place(rng), "value": 9.0, "appears_s": 30.0}
    draft["task"].append(task)


def _box(x: float, y: float, width_m: float, depth_m: float) -> list[list[float]]:
    return [[x, y], [x + width_m, y], [x + width_m, y + depth_m], [x, y + depth_m]]


def _star(rng: random.Random, middle: Sequence[float], reach_m: float) -> list[list[float]]:
    """A polygon that sees all its corners from ``middle``: convex or not, never crossing itself."""
    corners = []
    chosen: list[Point] = []
    while not _surround(chosen):
        chosen = sorted(rng.sample(RAYS, rng.randint(4, 7)), key=RAYS.index)
    for east, north in chosen:
        length_m = rng.uniform(0.3, 1.0) * reach_m
        corners.append(
            [round(2 * x) / 2 for x in (middle[0] + east * length_m, middle[1] + north * length_m)]
        )
    return corners


def _surround(rays: Sequence[Point]) -> bool:
    """Whether each turns left to the next, by less than half a circle; if not, edges may cross."""
    turns = zip(rays, [*rays[1:], *rays[:1]], strict=True)
    return len(rays) > 0 and all(a[0] * b[1] - a[1] * b[0] > 0.0 for a, b in turns)


ADD: Mapping[str, Callable[[random.Random, Draft], None]] = {
    "acceleration": _acceleration,
    "wind": _wind,
    "energy": _energy,
    "slots": _slots,
    "zones": _zones,
    "inclusive": _inclusive,
    "margin": _margin,
    "windows": _windows,
    "due": _due,
    "lines": _lines,
    "heights": _heights,
    "survival": _survival,
    "popups": _popups,
}
"""What adds a constraint to a draft."""

PARTS: Mapping[str, tuple[str, ...]] = {
    "plain": (),
    **{name: (name,) for name in ADD},
    "all": tuple(ADD),
    "all-but-margin": tuple(name for name in ADD if name != "margin"),
}
KINDS = tuple(PARTS)
