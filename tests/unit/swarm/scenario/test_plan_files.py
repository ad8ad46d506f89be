"""Plans of QGroundControl become tasks; what is wrong in them takes one line with its place."""

from __future__ import annotations

import json

import pytest

from swarm.scenario.task_files import ReadOptions
from swarm.scenario.task_files.plan_file import read_plan
from tests.support.task_files import TERRAIN, lines, tables, wp

SIMPLE = {
    "autoContinue": True,
    "command": 16,
    "frame": 3,
    "params": [0, 0, 0, None, 47.001, 8.001, 50],
    "type": "SimpleItem",
}


def plan_text(*items: object, **mission: object) -> str:
    inner: dict[str, object] = {
        "items": list(items),
        "plannedHomePosition": [47.0, 8.0, 400],
        "version": 2,
    }
    return json.dumps({"fileType": "Plan", "version": 1, "mission": inner | mission})


def transects(camera: object, *corners: object) -> dict[str, object]:
    inner = {"CameraCalc": camera, "VisualTransectPoints": list(corners)}
    return {
        "type": "ComplexItem",
        "complexItemType": "CorridorScan",
        "TransectStyleComplexItem": inner,
    }


@pytest.mark.parametrize(
    ("camera", "alt_m"),
    [
        ({"DistanceToSurface": 60, "DistanceMode": 1}, 450.0),
        ({"DistanceToSurface": 460, "DistanceMode": 2}, 450.0),
        ({"DistanceToSurface": 60, "DistanceToSurfaceRelative": True}, 450.0),
        ({"DistanceToSurface": 460, "DistanceToSurfaceRelative": False}, 450.0),
    ],
)
def test_scan_without_stored_items_gives_its_corners(camera: object, alt_m: float) -> None:
    text = plan_text(transects(camera, [47.001, 8.001], [47.002, 8.002]))

    assert tables(read_plan(text, ReadOptions("f"))) == [
        wp("t1", 47.001, 8.001, alt_m),
        wp("t2", 47.002, 8.002, alt_m),
    ]


def test_layer_of_an_exported_plan_is_taken_off_again_unless_told() -> None:
    text = plan_text(SIMPLE).replace('{"fileType"', '{"peckorder": {"layer_m": 13.0}, "fileType"')

    assert read_plan(text, ReadOptions("f")).entries[0].table["alt_m"] == 437.0
    assert read_plan(text, ReadOptions("f", below_m=1.0)).entries[0].table["alt_m"] == 449.0


def test_landing_patterns_are_left_out() -> None:
    landing = {"type": "ComplexItem", "complexItemType": "fwLandingPattern"}

    assert read_plan(plan_text(SIMPLE, landing), ReadOptions("f")).left_out == {
        "landing pattern": 1
    }


def test_fixed_wing_cruises() -> None:
    text = plan_text(SIMPLE, cruiseSpeed=18, hoverSpeed=5, vehicleType=1)

    assert read_plan(text, ReadOptions("f")).speed_m_s == 18.0


def with_params(*params: object, **changes: object) -> dict[str, object]:
    return {**SIMPLE, "params": list(params), **changes}


GIVE = "give a plan saved by QGroundControl"
HOMELESS = (
    "f: mission.plannedHomePosition: is no place with a height, and heights are counted from it; "
    "give the home in QGroundControl, or --home LAT,LON,ALT, or [origin] in the scenario"
)
NO_WAYPOINTS = "holds no waypoints; replace it by waypoints, a survey or a corridor scan"
ITEM = "f: mission.items[0]"

WRONG_PLANS = {
    "no object": ("[]", f"f: is not a JSON object; {GIVE}"),
    "nested": ("[" * 100_000, f"f: is not JSON of any use; {GIVE}"),
    "mission of old": (
        '{"fileType": "Mission", "version": 2}',
        f"f: fileType: 'Mission' is not 'Plan'; {GIVE}",
    ),
    "no type": ("{}", f"f: fileType: 'nothing' is not 'Plan'; {GIVE}"),
    "version": (
        '{"fileType": "Plan", "version": 2}',
        (
            "f: version: version 2 of the format is not known; give version 1, as QGroundControl "
            "writes"
        ),
    ),
    "no mission": (
        '{"fileType": "Plan", "version": 1}',
        f"f: mission: is not an object; {GIVE}",
    ),
    "no items": (plan_text(items=None), f"f: mission.items: is not an array; {GIVE}"),
    "mission version": (
        plan_text(SIMPLE, version=3),
        (
            "f: mission.version: version 3 of the format is not known; give version 2, as "
            "QGroundControl writes"
        ),
    ),
    "nothing to do": (
        plan_text({**SIMPLE, "command": 20}),
        "f: holds no task; add waypoints or a survey in QGroundControl",
    ),
    "no home": (plan_text(SIMPLE, plannedHomePosition=None), HOMELESS),
    "home without height": (plan_text(SIMPLE, plannedHomePosition=[47.0, 8.0, None]), HOMELESS),
    "home off the map": (plan_text(SIMPLE, plannedHomePosition=[97.0, 8.0, 4.0]), HOMELESS),
    "item": (plan_text(7), f"{ITEM}: has no type; give 'SimpleItem' or 'ComplexItem'"),
    "type": (
        plan_text({"type": "Thing"}),
        f"{ITEM}: 'Thing' is no type of item; give 'SimpleItem' or 'ComplexItem'",
    ),
    "command": (
        plan_text({**SIMPLE, "command": "16"}),
        f"{ITEM}: has no command or no frame; give both as whole numbers",
    ),
    "params": (
        plan_text(with_params(0, 0, 0, 0)),
        f"{ITEM}: has 4 params instead of 7; save the plan again in QGroundControl",
    ),
    "no params": (
        plan_text({**SIMPLE, "params": None}),
        f"{ITEM}: has no params instead of 7; save the plan again in QGroundControl",
    ),
    "no place": (
        plan_text(with_params(0, 0, 0, None, None, 8.0, 50)),
        f"{ITEM}: nothing, 8.0 is no place; give the waypoint a latitude and a longitude",
    ),
    "here": (
        plan_text(with_params(0, 0, 0, None, 0, 0, 50)),
        f"{ITEM}: 0, 0 is no place; give the waypoint a latitude and a longitude",
    ),
    "no height": (
        plan_text(with_params(0, 0, 0, None, 47.0, 8.0, None)),
        f"{ITEM}: nothing is no height; give the waypoint a height [m]",
    ),
    "frame": (
        plan_text({**SIMPLE, "frame": 1}),
        f"{ITEM}: frame 1 is not known; give frame 0 (above mean sea level) or 3 (above home)",
    ),
    "terrain": (plan_text({**SIMPLE, "frame": 10}), f"{ITEM}: {TERRAIN}"),
    "structure scan": (
        plan_text({"type": "ComplexItem", "complexItemType": "StructureScan"}),
        f"{ITEM}: 'StructureScan' {NO_WAYPOINTS}",
    ),
    "terrain scan": (
        plan_text(transects({"DistanceToSurface": 60, "DistanceMode": 3}, [47.001, 8.001])),
        f"{ITEM}.TransectStyleComplexItem.VisualTransectPoints[0]: {TERRAIN}",
    ),
    "corner": (
        plan_text(transects({"DistanceToSurface": 60}, 5)),
        (
            f"{ITEM}.TransectStyleComplexItem.VisualTransectPoints[0]: "
            "nothing, nothing is no place; give the waypoint a latitude and a longitude"
        ),
    ),
}


@pytest.mark.parametrize("case", WRONG_PLANS)
def test_wrong_plan_takes_its_exact_line(case: str) -> None:
    text, line = WRONG_PLANS[case]

    assert lines(".plan", text) == [line]


def test_plan_cut_off_takes_one_line_with_its_place() -> None:
    (line,) = lines(".plan", plan_text(SIMPLE)[:60])

    assert line.startswith("f: line 1, column ")
    assert line.endswith(GIVE)


def test_every_wrong_item_is_named_at_once() -> None:
    text = plan_text({**SIMPLE, "frame": 1}, SIMPLE, {"type": "Thing"}, {**SIMPLE, "frame": 10})

    places = [line.split(":")[1].strip() for line in lines(".plan", text)]
    assert sorted(places) == ["mission.items[0]", "mission.items[2]", "mission.items[3]"]
