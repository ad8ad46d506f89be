"""What rows and messages of a feed are made of: plain values, rounded to what anyone reads."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.predicted_conflicts import PredictedConflict
from coordinator.mission_view.uav_state import LOST, UavState
from coordinator.mission_view.wording import clean, short_names, visit_reason_in_words
from swarm.protocol.messages import MissionConfig
from swarm.protocol.uav_messages import Choice
from swarm.separation.shared_air import air_of_brief

if TYPE_CHECKING:
    from coordinator.mission_view.ways import UavWays


def uav_values(state: UavState, command: str | None, speedup: float) -> dict[str, object]:
    """Of a UAV's row.

    Args:
        state: how it stands.
        command: the operator's word to it that holds.
        speedup: seconds of the observer per wall second.
    """
    age_s, in_layer = state.link_age_s, state.in_layer_enu_m
    return {
        "id": state.id,
        "does": state.now_does,
        "task": state.now_task,
        "claim": state.claim,
        "completion_s": rounded(state.now_completion_s, 1),
        "position": _point(state.told_enu_m),
        "velocity": _point(state.velocity_enu_m_s),
        "height_m": None if in_layer is None else rounded(in_layer[2], 1),
        "battery": rounded(state.battery_frac, 3),
        "base": state.base,
        "stage": state.stage,
        "visit": state.visit,
        "sortie_end_s": rounded(state.sortie_end_s, 1),
        "swaps": state.swaps,
        "silent_s": None if age_s is None else rounded(age_s / speedup, 1),
        "lost": state.does == LOST,
        "present": state.there,
        "note": clean(state.note),
        "command": command,
        "dropped": dict(state.dropped),
    }


def approach_values(near: Approach | None) -> dict[str, object] | None:
    """Of two UAVs that are, or were, near each other."""
    if near is None:
        return None
    return {
        "uavs": near.uavs,
        "distance_m": rounded(near.distance_m, 2),
        "error_m": rounded(near.error_m, 2),
        "at_s": rounded(near.at_s, 2),
        "places": [_point(place) for place in near.places_enu_m],
    }


def conflict_values(conflict: PredictedConflict) -> dict[str, object]:
    """Of two UAVs that would come too near to each other."""
    return {
        "uavs": conflict.uavs,
        "distance_m": rounded(conflict.distance_m, 2),
        "in_s": rounded(conflict.in_s, 1),
        "places": [_point(place) for place in conflict.places_enu_m],
    }


def ways_values(ways: UavWays) -> dict[str, object]:
    """Points of its ways in the field [m]."""
    paths = {"flown": ways.flown, "leg": ways.leg, "ahead": ways.ahead}
    return {name: [[round(m, 1) for m in point] for point in path] for name, path in paths.items()}


def mission_text(name: str, brief: MissionConfig) -> str:
    """The ``mission`` message."""
    shorts, air = short_names([uav.id for uav in brief.uavs]), air_of_brief(brief)
    uavs = [
        {
            "id": uav.id,
            "short": short,
            "start": uav.position_enu_m,
            "speed_m_s": uav.speed_m_s,
            "kind": uav.kind,
            "layer_m": uav.layer_m,
            "endurance_s": uav.endurance_s,
        }
        for uav, short in zip(brief.uavs, shorts, strict=True)
    ]
    return json.dumps(
        {
            "type": "mission",
            "name": name,
            "horizon_s": brief.horizon_s,
            "origin": brief.origin,
            "bases": [
                {
                    "id": base.id,
                    "position": base.position_enu_m,
                    "swap_s": base.swap_s,
                    "slots": base.slots,
                }
                for base in brief.bases
            ],
            "areas": [
                {"id": area.id, "rings": [area.polygon_enu_m, *area.holes_enu_m]}
                for area in brief.areas
            ],
            "zone_margin_m": brief.zone_margin_m,
            "separation_m": brief.separation_m,
            "layers_m": () if air is None else air.slabs.layers_m,
            "uavs": uavs,
        },
        allow_nan=False,
    )


def choice_values(n: int, uav: str, choice: Choice) -> dict[str, object]:
    """Of the row of a choice, the ``n``-th."""
    return {
        "n": n,
        "id": f"{uav}-{choice.number}",
        "uav": uav,
        "task": choice.task,
        "base": choice.base,
        "why": visit_reason_in_words(choice),
        "left": choice.left,
        "mission_s": rounded(choice.chosen_s, 3),
        "rule": choice.rule,
        "epoch": choice.epoch,
        "rank": choice.rank,
        "score": choice.score,
        "second_score": choice.second_score,
        "certificate": choice.certificate,
        "completion_s": rounded(choice.completion_s, 3),
        "candidates": [{"task": each.task, "score": each.score} for each in choice.candidates],
    }


def _point(place: tuple[float, float, float] | None) -> list[float] | None:
    return None if place is None else [round(each, 2) for each in place]


def rounded(value: float | None, digits: int) -> float | None:
    """Unknown values stay so."""
    return None if value is None else round(value, digits)
