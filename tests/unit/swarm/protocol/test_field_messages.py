"""What the field adds to what is said: in which bytes, within which bounds, and for whom."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from swarm.model import Area, AreaId, Base, BaseId, Camera, Zone, ZoneId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import FIELD_DEFAULTS, FIELDS, KINDS, SINCE_FIELD, encode
from swarm.protocol.field_messages import AreaSpec, BaseSpec, UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import FIELD_VERSION, SCHEMA_VERSION, Body, UavSpec
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    PAUSED,
    brief,
    done,
    entry,
    held,
    message,
    order,
    proposed,
    uav,
)
from tests.support.spoilt_messages import Parts, drop_reason, parts_of, reason_with

SQUARE = ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))
VILLAGE = ZoneSpec("village", SQUARE, (), None, 120.0, False)
FIELD_A = AreaSpec.of(
    Area(
        AreaId("a"),
        SQUARE,
        5.0,
        camera=Camera(13.2, 8.8, 8.8, 5472, 3648),
        height_m=20.0,
        sidelap_frac=0.7,
        frontlap_frac=0.8,
        max_line_m=100.0,
        due_s=90.0,
        lines=3,
    )
)
B0 = BaseSpec("b0", (1.0, 2.0, 0.0), 120.0, 2)
PLAIN: list[tuple[str, Body]] = [
    (COORDINATOR, brief(uav("u0", t0=0.5))),
    (COORDINATOR, entry("t0")),
    (OPERATOR, order("t0")),
    ("u0", held("t0", 1.0)),
    ("u0", done("t0")),
]
FIELD: dict[str, tuple[str, Body]] = {
    "bases": (COORDINATOR, replace(brief(), bases=(B0,))),
    "zones": (COORDINATOR, replace(brief(), zones=(VILLAGE,))),
    "areas": (COORDINATOR, replace(brief(), areas=(FIELD_A,))),
    "wind": (COORDINATOR, replace(brief(), wind_enu_m_s=(3.0, -1.0))),
    "margin": (COORDINATOR, replace(brief(), zone_margin_m=5.0)),
    "band": (COORDINATOR, replace(brief(), band_m=(30.0, 110.0))),
    "endurance": (
        COORDINATOR,
        replace(brief(), uavs=(replace(brief(uav("u0")).uavs[0], endurance_s=60.0),)),
    ),
    "due": (COORDINATOR, entry("t0", due_s=60.0)),
    "line": (OPERATOR, order("t0", path_enu_m=((0.0, 0.0, 0.0), (5.0, 0.0, 0.0)))),
    "base": ("u0", replace(IDLE, base="b0", stage=BaseStage.LANDED)),
    "sortie": ("u0", replace(held("t0", 1.0), sortie_end_s=90.0)),
    "backwards": ("u0", replace(done("t0"), reversed=True)),
}


@pytest.mark.parametrize(("writer", "body"), PLAIN, ids=[type(body).__name__ for _, body in PLAIN])
def test_what_asks_for_nothing_of_the_field_is_said_as_ever(writer: str, body: Body) -> None:
    version, *_, fields = parts_of(message(writer, body))

    assert version == SCHEMA_VERSION
    assert fields.keys() == set(FIELDS[type(body)]) - SINCE_FIELD[type(body)]
    for described in fields.get("uavs", ()):
        assert not described.keys() & SINCE_FIELD[UavSpec]


@pytest.mark.parametrize("name", FIELD)
def test_what_asks_for_more_is_for_those_alone_who_heed_it(name: str) -> None:
    said = message(*FIELD[name])

    assert parts_of(said)[0] == FIELD_VERSION
    assert Codec(MISSION).decode(said.key, encode(said)) == said


def test_every_default_of_the_wire_is_that_of_the_body() -> None:
    """A field that is left out is read as its body has it, so no two releases can differ in it."""
    for kind in KINDS.values():
        assert FIELD_DEFAULTS.get(kind, {}).keys() == SINCE_FIELD.get(kind, frozenset()), kind


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("bases", lambda fields: fields["bases"][0].update(slots=0)),
        ("bases", lambda fields: fields["bases"][0].update(swap_s=-1.0)),
        ("bases", lambda fields: fields["bases"].append(fields["bases"][0])),
        ("zones", lambda fields: fields["zones"].append(fields["zones"][0])),
        ("zones", lambda fields: fields["zones"][0].update(floor_m=120.0)),
        ("zones", lambda fields: fields["zones"][0].update(polygon_enu_m=[[0, 0], [1, 1]])),
        (
            "zones",
            lambda fields: fields["zones"][0].update(
                polygon_enu_m=[[0, 0], [9, 9], [9, 0], [1, 9]]
            ),
        ),
        (
            "zones",
            lambda fields: fields["zones"][0].update(holes_enu_m=[[[20, 20], [30, 20], [30, 30]]]),
        ),
        (
            "zones",
            lambda fields: fields["zones"][0].update(polygon_enu_m=[[0, 0], [1e9, 0], [1, 1]]),
        ),
        ("areas", lambda fields: fields["areas"].append(fields["areas"][0])),
        ("areas", lambda fields: fields["areas"][0].update(spacing_m=10.0)),
        ("areas", lambda fields: fields["areas"][0].update(height_m=-1.0)),
        ("areas", lambda fields: fields["areas"][0].update(lines=10**9)),
        ("areas", lambda fields: fields["areas"][0]["camera"].update(focal_length_mm=0.0)),
        (
            "areas",
            lambda fields: fields["areas"][0].update(
                polygon_enu_m=[[0, 0], [9, 9], [9, 0], [1, 9]]
            ),
        ),
        ("wind", lambda fields: fields.update(wind_enu_m_s=[1e7, 0.0])),
        ("wind", lambda fields: fields.update(wind_enu_m_s=[3.0])),
        ("margin", lambda fields: fields.update(zone_margin_m=-1.0)),
        ("band", lambda fields: fields.update(band_m=[110.0, 30.0])),
        ("endurance", lambda fields: fields["uavs"][0].update(endurance_s=0.0)),
        ("endurance", lambda fields: fields["uavs"][0].update(reserve_frac=1.5)),
        ("due", lambda fields: fields.update(due_s=-1.0)),
        ("due", lambda fields: fields.update(opens_s=1e300)),
        ("line", lambda fields: fields.update(path_enu_m=fields["path_enu_m"][:1])),
        ("line", lambda fields: fields.update(path_enu_m=fields["path_enu_m"][::-1])),
        ("base", lambda fields: fields.update(stage="hovering")),
        ("backwards", lambda fields: fields.update(reversed="yes")),
    ],
)
def test_what_is_out_of_bounds_is_malformed(name: str, change: Callable[[Any], object]) -> None:
    assert reason_with(message(*FIELD[name]), lambda parts: change(parts[6])) == "malformed"


def test_a_uav_slower_than_the_wind_makes_the_brief_malformed() -> None:
    windy = replace(brief(uav("u0")), wind_enu_m_s=(3.0, 4.0))
    slow = replace(windy, uavs=(replace(windy.uavs[0], airspeed_m_s=5.5),))

    def slower(parts: Parts) -> None:
        parts[6]["uavs"][0]["airspeed_m_s"] = 5.0

    assert reason_with(message(COORDINATOR, slow), slower) == "malformed"


# -- claims -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "claim",
    [
        Claim(ClaimPhase.PROPOSED, None, 1.0, 0, 9.0, base="b0", stage=BaseStage.APPROACHING),
        replace(held("t0", 1.0), base="b0", stage=BaseStage.LANDED, departs_s=5.0, reversed=True),
        replace(IDLE, base="b0", stage=BaseStage.PARKED, sortie_end_s=9.0),
        replace(PAUSED, base="b0", stage=BaseStage.LANDED),
        replace(OUT, base="b0", stage=BaseStage.LANDED),
    ],
)
def test_claims_on_bases_come_through(claim: Claim) -> None:
    said = message("u0", claim)

    assert Codec(MISSION).decode(said.key, encode(said)) == said


@pytest.mark.parametrize(
    ("claim", "change"),
    [
        (proposed("t0", 1.0), {"task": None}),
        (proposed("t0", 1.0), {"base": "b0"}),
        (proposed("t0", 1.0), {"stage": BaseStage.LANDED}),
        (IDLE, {"base": "b0", "stage": BaseStage.APPROACHING}),
        (IDLE, {"base": "b0", "stage": BaseStage.WAITING}),
        (IDLE, {"task": "t0", "base": "b0", "stage": BaseStage.LANDED}),
        (IDLE, {"arrives_s": 1.0}),
        (IDLE, {"reversed": True}),
        (proposed("t0", 1.0), {"departs_s": 5.0}),
    ],
)
def test_claims_that_contradict_themselves_are_none(
    claim: Claim, change: dict[str, object]
) -> None:
    with pytest.raises(ValueError, match="a claim "):
        replace(claim, **change)  # type: ignore[arg-type]  # each case names real fields


# -- the operator's words -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "key"),
    [
        (ZoneEdit(VILLAGE, False, 1, ""), KeySpace(MISSION).operator_zone("village")),
        (UavReady("u0", 1, ""), KeySpace(MISSION).operator_ready("u0")),
    ],
)
def test_only_the_operator_draws_zones_and_lets_uavs_start(body: Body, key: str) -> None:
    said = message(OPERATOR, body)
    assert (said.key, KeySpace(MISSION).writer_of(said.key)) == (key, OPERATOR)
    assert Codec(MISSION).decode(key, encode(said)) == said

    for other in (COORDINATOR, "u0"):
        assert drop_reason(key, encode(replace(said, writer=other))) == "said on another's key"


def test_zones_areas_and_bases_are_said_as_missions_have_them() -> None:
    holes = (((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)),)
    zone = Zone(ZoneId("z"), SQUARE, holes, floor_m=5.0, ceiling_m=80.0, inclusive=True)
    base = Base(BaseId("b"), (1.0, 2.0, 3.0), swap_s=9.0, slots=None)

    assert ZoneSpec.of(zone).zone() == zone
    assert BaseSpec.of(base).base() == base
    area = Area(AreaId("a"), SQUARE, 5.0, holes, spacing_m=3.0, trigger_m=2.0, kind="hay", lines=2)
    assert AreaSpec.of(area).area() == area
    assert AreaSpec.of(FIELD_A.area()) == FIELD_A
