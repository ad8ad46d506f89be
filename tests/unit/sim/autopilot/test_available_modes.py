"""Simulated autopilots tell their modes as real ones were seen to."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20 import development as later_dialect

from sim.autopilot.available_modes import available_modes
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.ardurover import ArduRoverModel
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.firmware.quadplane import QuadPlaneModel


def told(model: FirmwareModel, asked: float) -> list[Any]:
    """As pymavlink reads them from the wire."""
    sender, reader = mavlink.MAVLink(None, srcSystem=1, srcComponent=1), later_dialect.MAVLink(None)
    return [reader.decode(bytearray(m.pack(sender))) for m in available_modes(model, asked)]


@pytest.mark.parametrize(
    ("model", "name", "number"),
    [
        (ArduCopterModel(), "Auto", 3),
        (ArduRoverModel(), "Manual", 0),
        (QuadPlaneModel(), "Manual", 0),
    ],
)
def test_ardupilot_tells_the_first_alone_and_each_by_its_number(
    model: FirmwareModel, name: str, number: int
) -> None:
    (first,) = told(model, 0.0)
    assert (first.mode_name, first.custom_mode, first.mode_index) == (name, number, 1)
    every = [each for n in range(1, first.number_modes + 1) for each in told(model, float(n))]
    assert [each.mode_index for each in every] == list(range(1, len(model.mode_names) + 1))
    assert {each.custom_mode for each in every} == set(model.mode_names)


def test_px4_tells_all_and_gives_standard_modes_no_name() -> None:
    every = told(Px4Model(), 0.0)
    assert {each.custom_mode for each in every} == set(Px4Model.mode_names)
    assert [bool(each.mode_name) for each in every] == [each.standard_mode == 0 for each in every]
    assert {each.mode_name for each in every} == {"", "Manual", "Hold", "Stabilized"}


@pytest.mark.parametrize("model", [ArduCopterModel(), Px4Model()])
@pytest.mark.parametrize("asked", [-1.0, 99.0, math.nan, math.inf])
def test_there_is_no_mode_of_any_other_number(model: FirmwareModel, asked: float) -> None:
    assert told(model, asked) == []
