"""Vehicles made of a scenario, and the addresses they are offered on."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim.autopilot.config import Physics, ServedBase, fleet_of
from sim.autopilot.options import Endpoint, Transport, parse_endpoint
from swarm.model import Base, BaseId, Mission, Origin, Task, TaskId, Uav, UavId
from swarm.model.frames import DEFAULT_ORIGIN


def mission(n_uav: int = 3, origin: Origin | None = None) -> Mission:
    return Mission(
        name="test",
        horizon_s=10.0,
        uavs=tuple(
            Uav(UavId(f"uav{number}"), (float(number), 2.0, 3.0), 4.0 + number)
            for number in range(n_uav)
        ),
        tasks=(Task(TaskId("t1"), (0.0, 0.0, 0.0), 1.0),),
        origin=origin,
    )


def test_vehicles_stand_at_the_starts_and_fly_as_fast_as_their_uavs() -> None:
    fleet = fleet_of(mission())

    assert [member.uav for member in fleet] == ["uav0", "uav1", "uav2"]
    assert [member.config.system_id for member in fleet] == [1, 2, 3]
    assert fleet[2].config.start_enu_m == (2.0, 2.0, 3.0)
    assert fleet[2].config.cruise_m_s == 6.0
    assert fleet[2].config.origin == DEFAULT_ORIGIN


def test_vehicles_speed_up_as_the_scenario_says_unless_told_otherwise() -> None:
    plain = mission()
    slow = replace(plain.uavs[0], acceleration_m_s2=1.5)
    flown = replace(plain, uavs=(slow, *plain.uavs[1:]))
    told = fleet_of(flown, physics=Physics(acceleration_m_s2=4.0))

    assert [m.config.acceleration_m_s2 for m in fleet_of(flown)] == [1.5, None, None]
    assert [m.config.acceleration_m_s2 for m in told] == [4.0] * 3


def test_selected_uavs_keep_their_system_ids_unless_told_otherwise() -> None:
    here = Origin(10.0, 20.0, 30.0)
    wanted = [UavId("uav2"), UavId("uav1")]

    assert [m.config.system_id for m in fleet_of(mission(origin=here), wanted)] == [3, 2]
    assert [m.config.system_id for m in fleet_of(mission(), wanted, 40)] == [40, 41]
    assert fleet_of(mission(origin=here))[0].config.origin == here


def test_system_ids_begin_again_beyond_the_last() -> None:
    ids = [member.config.system_id for member in fleet_of(mission(300))]

    assert ids[:2] == [1, 2]
    assert ids[253:256] == [254, 1, 2]


def test_missions_of_the_field_give_batteries_bases_and_air() -> None:
    plain = mission()
    far = replace(
        plain.uavs[0], endurance_s=300.0, charge_frac=0.7, airspeed_m_s=9.0, acceleration_m_s2=2.0
    )
    field = replace(
        plain,
        uavs=(far, *plain.uavs[1:]),
        bases=(Base(BaseId("b0"), (50.0, 0.0, 7.0), 90.0),),
        wind_enu_m_s=(3.0, 0.0),
    )
    first, second, _ = (member.config for member in fleet_of(field))

    assert (first.endurance_s, first.charge_frac, first.drains_in_flight) == (300.0, 0.7, True)
    assert (second.endurance_s, second.charge_frac, second.drains_in_flight) == (None, 1.0, False)
    assert first.bases == second.bases == (ServedBase((50.0, 0.0, 7.0), 90.0),)
    assert first.grounds_enu_m == ((0.0, 2.0, 3.0), (50.0, 0.0, 7.0))
    assert first.swap_reboots
    assert first.airspeed_m_s == 9.0
    assert first.wind is not None
    assert first.wind.velocity_enu_m_s == (3.0, 0.0)
    assert second.wind is None  # the scenario gives it no airspeed


def test_options_win_over_missions_of_the_field() -> None:
    plain = mission()
    far = replace(plain.uavs[0], endurance_s=300.0, charge_frac=0.7, airspeed_m_s=9.0)
    field = replace(plain, uavs=(far, *plain.uavs[1:]), wind_enu_m_s=(3.0, 0.0))
    told = Physics(endurance_s=500.0, wind_enu_m_s=(0.0, 0.0), swap_reboots=False)
    config = fleet_of(field, physics=told)[0].config

    assert (config.endurance_s, config.charge_frac, config.drains_in_flight) == (500.0, 1.0, False)
    assert config.wind is None
    assert not config.swap_reboots


def test_unknown_uav_is_an_error() -> None:
    with pytest.raises(ValueError, match="uav9"):
        fleet_of(mission(), [UavId("uav9")])


@pytest.mark.parametrize(
    ("text", "endpoint"),
    [
        ("tcp:127.0.0.1:0", Endpoint(Transport.TCP, "127.0.0.1", 0)),
        ("udpin:0.0.0.0:14550", Endpoint(Transport.UDP_IN, "0.0.0.0", 14550)),
        ("udpout:host:1", Endpoint(Transport.UDP_OUT, "host", 1)),
        ("tcp:[::1]:5760", Endpoint(Transport.TCP, "::1", 5760)),
    ],
)
def test_endpoints_are_read(text: str, endpoint: Endpoint) -> None:
    assert parse_endpoint(text) == endpoint


@pytest.mark.parametrize(
    "text",
    ["", "tcp", "tcp::1", "tcp:h:", "tcp:h:x", "tcp:h:70000", "udp:h:1", "udpout:h:0", "tcp:h:-1"],
)
def test_wrong_endpoints_say_what_would_be_right(text: str) -> None:
    with pytest.raises(ValueError, match="write tcp:HOST:PORT"):
        parse_endpoint(text)


def test_next_vehicle_takes_the_next_port_where_that_makes_sense() -> None:
    assert parse_endpoint("tcp:h:5760").shifted(2).port == 5762
    assert parse_endpoint("tcp:h:0").shifted(2).port == 0
    assert parse_endpoint("udpout:h:14550").shifted(2).port == 14550
