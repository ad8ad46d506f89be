"""Timers: positive, finite, and silence well above the interval at which the living speak."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import pytest

from swarm.bus.config import MAX_LEASE_S, MIN_LEASE_S
from swarm.protocol.timing import PRESETS, LinkKind, LinkPreset, Timing, preset


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_a_duration_is_positive_and_finite(value: float) -> None:
    with pytest.raises(ValueError, match="status_s must be > 0 s"):
        Timing(status_s=value)


def test_one_lost_announcement_must_not_pass_for_a_loss() -> None:
    with pytest.raises(ValueError, match=r"silence_s must be >= 2 announce_s = 6\.0, not 5\.9"):
        Timing(announce_s=3.0, silence_s=5.9)
    assert Timing(announce_s=3.0, silence_s=6.0).silence_s == 6.0


def test_scaling_keeps_the_wall_durations() -> None:
    scaled = dataclasses.astuple(Timing().scaled(8.0))

    assert scaled == tuple(8.0 * value for value in dataclasses.astuple(Timing()))


def test_every_kind_of_link_has_a_preset_and_the_normal_one_is_the_default() -> None:
    assert set(PRESETS) == set(LinkKind)
    assert preset(LinkKind.NORMAL).timing == Timing()


def test_a_worse_link_gets_no_shorter_timer_that_waits_for_others() -> None:
    waits = ("objection_window_s", "loss_delay_s", "silence_s", "relink_grace_s", "patience_s")
    clean, normal, bad = (PRESETS[link] for link in (LinkKind.CLEAN, LinkKind.NORMAL, LinkKind.BAD))

    for name in waits:
        assert getattr(clean.timing, name) <= getattr(normal.timing, name), name
        assert getattr(normal.timing, name) < getattr(bad.timing, name), name
    assert clean.lease_s < normal.lease_s < bad.lease_s
    assert clean.answer_s <= normal.answer_s < bad.answer_s


def test_a_lease_given_by_hand_wins_and_changes_nothing_else() -> None:
    assert preset(LinkKind.BAD, 3.0) == dataclasses.replace(PRESETS[LinkKind.BAD], lease_s=3.0)


@pytest.mark.parametrize("link", LinkKind)
def test_a_bus_takes_the_lease_of_every_preset(link: LinkKind) -> None:
    assert MIN_LEASE_S <= PRESETS[link].lease_s <= MAX_LEASE_S


@pytest.mark.parametrize("durations", [(0.0, 1.0), (1.0, math.nan)])
def test_a_preset_of_no_duration_is_refused(durations: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="_s must be > 0 s"):
        LinkPreset(*durations, Timing())


def test_the_protocols_table_tells_the_timers_as_they_are() -> None:
    page = (Path(__file__).parents[4] / "swarm" / "protocol" / "README.md").read_text()
    rows = re.findall(
        r"^\| ((?:`\w+_s`(?:, )?)+) \| (.+?) \| (.+?) \| (.+?) \|", page, re.MULTILINE
    )
    told = {
        name: tuple(float(cell.split(", ")[place]) for cell in cells)
        for names, *cells in rows
        for place, name in enumerate(re.findall(r"\w+_s", names))
    }
    differing = {
        field.name
        for field in dataclasses.fields(Timing)
        if len({getattr(PRESETS[link].timing, field.name) for link in LinkKind}) > 1
    }

    assert set(told) == differing
    for name, values in told.items():
        assert values == tuple(getattr(PRESETS[link].timing, name) for link in LinkKind), name
