from __future__ import annotations

from dataclasses import fields

from sim.study.style import QUANTITIES, uncertainty_words
from sim.world.uncertainty import Uncertainty
from swarm.model import TaskId, UavId


def test_every_number_of_the_uncertainty_can_be_told() -> None:
    numbers = [item.name for item in fields(Uncertainty) if item.type == "float"]

    assert list(QUANTITIES) == numbers


def test_uncertainty_is_one_sentence_with_units() -> None:
    uncertainty = Uncertainty(
        loss=0.3,
        popups_per_min=0.5,
        speed_sd_frac=0.1,
        wind_m_s=4.0,
        outcomes=True,
        lost_at_s={UavId("u1"): 60.0},
        withdrawn_at_s={TaskId("t1"): 9.5},
    )

    assert uncertainty_words(uncertainty) == (
        "each UAV is lost with probability 30 %, 0.5 further tasks pop up per minute, "
        "UAVs' speeds spread by 10 %, wind of 4 m/s blows from a random direction, "
        "attempts succeed and fail by chance, u1 is lost at 60 s, t1 is withdrawn at 9.5 s"
    )


def test_certain_mission_is_called_so() -> None:
    assert uncertainty_words(Uncertainty()) == "nothing is uncertain"


def test_length_of_partitions_is_told_where_there_are_some() -> None:
    assert uncertainty_words(Uncertainty(partitions_per_min=1.0, partition_s=20.0)) == (
        "half of the fleet is cut off 1 times per minute, for 20 s each"
    )


def test_shares_are_shown_in_percent() -> None:
    assert QUANTITIES["loss"].label == "UAVs lost [%]"
    assert QUANTITIES["loss"].text(0.3) == "30 %"
    assert QUANTITIES["loss"].shown(0.3) == 30.0
    assert QUANTITIES["wind_m_s"].text(2.5) == "2.5 m/s"
