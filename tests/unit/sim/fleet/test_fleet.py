"""Every process of a run gets the arguments with which it finds the others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.vehicle.config import CommandStyle
from coordinator.dashboard.access import ServeAddress
from sim.bench.fleets import survey_mission
from sim.fleet.autopilots import RunningVehicles, SimulatedAutopilots, VehiclePlace
from sim.fleet.keys import RunKeys
from sim.fleet.layout import (
    AUTO_MESH_LIMIT,
    LARGE_LEASE_S,
    LEAST_POSITION_RATE_HZ,
    ONLOOKER,
    BusKind,
    LaunchOptions,
    Layout,
    agent_groups,
    autopilot_groups,
    default_position_rate_hz,
    defaults_for,
    flight_layers,
    uavs_by_height,
)
from sim.fleet.passthrough import PassthroughOptions
from swarm.bus.config import ClientTopology, MeshTopology
from swarm.model import UavId
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.timing import LinkKind
from swarm.separation.fleet_layers import fleet_layers_m
from tests.support.builders import MISSION, mission, task, uav

OPTIONS = LaunchOptions(
    scenario=Path("here/valley.toml"),
    method="lookahead",
    seed=7,
    speedup=4.0,
    bus=BusKind.AUTO,
    position_rate_hz=100.0,
    acceptance_radius_m=0.5,
    start_timeout_s=90.0,
)
UAVS = ("u0", "u1", "u2")
FLEET = mission([uav(name) for name in UAVS], [task("t0", 1.0)])


PLACE = ServeAddress("127.0.0.1", 8080, "http://127.0.0.1:8080", None)
KEYS = RunKeys(
    Path("keys"), routers=("gate",), viewer="onlooking", operator="boss", guests={"spy": "u2"}
)


def layout(
    routers: int = 0, observers: Sequence[str] = (), *, keys: RunKeys | None = None
) -> Layout:
    """In a mesh, or with so many routers."""
    kind = BusKind.ROUTER if routers else BusKind.MESH
    options = replace(OPTIONS, bus=kind, routers=max(1, routers), keys=keys)
    options = replace(options, dashboard=None if keys is None else PLACE)
    return Layout(options, FLEET, np.random.default_rng(0), observers=observers)


def values(arguments: list[str], option: str) -> list[str]:
    """What follows each ``option``."""
    return [value for name, value in pairwise(arguments) if name == option]


def value(arguments: list[str], option: str) -> str:
    (only,) = values(arguments, option)
    return only


def places(made: Layout) -> dict[str, tuple[str, list[str]]]:
    """Name -> own endpoint and those it dials, of every seat of a mesh."""
    commands = {COORDINATOR: made.coordinator()}
    commands |= {name: made.agent(name, "tcp:127.0.0.1:5760", 1) for name in UAVS}
    found = {
        name: (value(arguments, "--listen"), values(arguments, "--connect"))
        for name, arguments in commands.items()
    }
    topology = made.observer_seat().topology
    assert isinstance(topology, MeshTopology)
    return found | {ONLOOKER: (topology.listen, list(topology.dial))}


@pytest.mark.parametrize(
    ("n_uav", "kind"),
    [(1, BusKind.MESH), (AUTO_MESH_LIMIT, BusKind.MESH), (AUTO_MESH_LIMIT + 1, BusKind.ROUTER)],
)
def test_the_size_of_the_fleet_chooses_the_bus(n_uav: int, kind: BusKind) -> None:
    assert BusKind.AUTO.for_fleet(n_uav) is kind


@pytest.mark.parametrize("kind", [BusKind.MESH, BusKind.ROUTER])
@pytest.mark.parametrize("n_uav", [1, 1000])
def test_a_bus_that_was_asked_for_is_taken(kind: BusKind, n_uav: int) -> None:
    assert kind.for_fleet(n_uav) is kind


def test_in_a_mesh_everybody_listens_on_a_place_of_its_own() -> None:
    listens = [listen for listen, _ in places(layout()).values()]

    assert len(set(listens)) == len(UAVS) + 2


def test_in_a_mesh_exactly_one_of_every_two_dials_the_other() -> None:
    found = places(layout())
    dialed = Counter(
        frozenset((listen, other)) for listen, dials in found.values() for other in dials
    )

    pairs = combinations((listen for listen, _ in found.values()), 2)
    assert dialed == Counter(frozenset(pair) for pair in pairs)


def test_asked_twice_a_layout_says_the_same() -> None:
    made = layout()

    assert places(made) == places(made)


def test_with_a_router_everybody_dials_it_and_nobody_listens() -> None:
    made = layout(routers=1)
    endpoint = made.endpoint("router 1")

    assert made.routers == ("router 1",)
    assert values(made.router("router 1"), "--listen") == [endpoint]
    assert values(made.router("router 1"), "--connect") == []
    for arguments in (made.coordinator(), made.agent("u0", "tcp:127.0.0.1:5760", 1)):
        assert value(arguments, "--bus") == "router"
        assert value(arguments, "--connect") == endpoint
        assert values(arguments, "--listen") == []
    assert made.observer_seat().topology == ClientTopology((endpoint,))


def test_of_every_two_routers_one_dials_the_other() -> None:
    made = layout(routers=3)
    endpoints = [made.endpoint(name) for name in made.routers]

    assert len(set(endpoints)) == 3
    dialed = [values(made.router(name), "--connect") for name in made.routers]
    assert dialed == [[], endpoints[:1], endpoints[:2]]


def large_layout(n_uav: int, **changes: Any) -> Layout:
    fleet = mission([uav(f"u{number:03}") for number in range(n_uav)], [task("t0", 1.0)])
    return Layout(replace(OPTIONS, **changes), fleet, np.random.default_rng(0))


def test_links_of_a_large_fleet_outlast_its_start() -> None:
    large, small = large_layout(26, bus=BusKind.ROUTER), large_layout(25, bus=BusKind.ROUTER)

    for arguments in (large.router("router 1"), large.coordinator(), large.agent("u001", "", 1)):
        assert float(value(arguments, "--lease-s")) == LARGE_LEASE_S
        assert value(arguments, "--link") == "normal"
    assert large.observer_seat().lease_s == LARGE_LEASE_S
    assert "--lease-s" not in small.coordinator()
    assert small.observer_seat().lease_s < LARGE_LEASE_S
    assert "--lease-s" not in large_layout(26, link=LinkKind.BAD).coordinator()


def test_the_first_of_a_large_simulated_fleet_wait_for_the_last() -> None:
    hovers_s = [float(value(large_layout(n).coordinator(), "--hover-s")) for n in (10, 50, 200)]
    real = RunningVehicles((VehiclePlace("u000", "udp:1", 1),))
    of_real = large_layout(200, autopilots=real).coordinator()

    assert hovers_s == [60.0, 60.0, 240.0]
    assert float(value(of_real, "--hover-s")) == 60.0
    assert defaults_for(SimulatedAutopilots(), 100).start_timeout_s == 120.0
    assert defaults_for(SimulatedAutopilots(), 200).start_timeout_s == 240.0


def test_those_that_are_told_the_same_share_a_process_and_the_highest_start_first() -> None:
    seven = mission([uav(f"u{number}") for number in range(7)], [])
    places = [VehiclePlace(f"u{number}", f"tcp:127.0.0.1:{number}", number) for number in range(7)]
    other = PassthroughOptions(command={"u3": CommandStyle.MISSION})
    sharing = replace(OPTIONS, bus=BusKind.ROUTER, agents_per_process=3)

    def groups(options: LaunchOptions) -> list[str]:
        found = agent_groups(places, seven, options)
        assert sorted(place.system_id for group in found for place in group) == list(range(7))
        return [" ".join(place.uav for place in group) for group in found]

    assert groups(OPTIONS) == ["u6", "u5", "u4", "u3", "u2", "u1", "u0"]
    assert groups(sharing) == ["u6 u3 u0", "u5 u2", "u4 u1"]
    assert groups(replace(sharing, passthrough=other)) == ["u6 u4 u1", "u5 u2 u0", "u3"]


def test_who_begins_highest_starts_first_wherever_it_is_in_the_mission() -> None:
    """In layers that all share neighbours begin apart, whoever they are."""
    own = survey_mission(30, 60, 0)
    shared = survey_mission(30, 60, 0, separation_m=6.0)
    assert uavs_by_height(own, OPTIONS) == [uav.id for uav in own.uavs]

    heights_m = dict(zip((uav.id for uav in shared.uavs), fleet_layers_m(shared), strict=True))
    rising = [heights_m[uav] for uav in uavs_by_height(shared, OPTIONS)]
    assert len(rising) == 30
    assert rising == sorted(rising)
    assert rising[0] < rising[-1]

    places = [VehiclePlace(each.id, "tcp:127.0.0.1:1", 1) for each in shared.uavs]
    together = replace(OPTIONS, bus=BusKind.ROUTER, agents_per_process=10)
    first, *_ = zip(*agent_groups(places, shared, together), strict=True)
    assert [heights_m[UavId(place.uav)] for place in first] == rising[:-4:-1]


def test_a_process_of_several_agents_is_told_of_each() -> None:
    places = [VehiclePlace("u0", "tcp:127.0.0.1:7", 4), VehiclePlace("u1", "tcp:127.0.0.1:8", 5)]
    options = replace(OPTIONS, agents_per_process=2)
    made = Layout(options, FLEET, np.random.default_rng(0))
    arguments = made.agents(places)

    assert made.routers == ("router 1",)  # in a mesh each listens for itself
    assert values(arguments, "--uav") == ["u0", "u1"]
    assert values(arguments, "--mavlink") == ["tcp:127.0.0.1:7", "tcp:127.0.0.1:8"]
    assert values(arguments, "--system-id") == ["4", "5"]
    assert arguments.count("--connect") == 1


@pytest.mark.parametrize("changes", [{"bus": BusKind.MESH}, {"keys": KEYS}])
def test_agents_with_places_or_keys_of_their_own_share_no_process(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="each agent has a process of its own"):
        replace(OPTIONS, agents_per_process=2, **changes)


def test_clients_take_turns_in_the_router_they_prefer_and_know_all() -> None:
    made = layout(routers=2)
    first, second = (made.endpoint(name) for name in made.routers)

    assert values(made.coordinator(), "--connect") == [first, second]
    agents = [values(made.agent(name, "tcp:127.0.0.1:5760", 1), "--connect") for name in UAVS]
    assert agents == [[second, first], [first, second], [second, first]]
    assert made.observer_seat().topology == ClientTopology((first, second))


def test_processes_are_told_where_to_keep_their_memory_and_what_the_network_is_like() -> None:
    made = layout(routers=1)
    made.state = Path("here/state")

    for arguments in (made.coordinator(), made.agent("u0", "tcp:127.0.0.1:5760", 1)):
        assert value(arguments, "--state") == "here/state"
        assert value(arguments, "--link") == "normal"
    assert value(made.router("router 1"), "--link") == "normal"


@pytest.mark.parametrize("routers", [0, 9])
def test_no_run_has_fewer_than_one_router_or_too_many(routers: int) -> None:
    with pytest.raises(ValueError, match=r"routers must be within 1\.\.8"):
        replace(OPTIONS, routers=routers)


@pytest.mark.parametrize("routers", [0, 1, 2])
def test_a_diverted_link_is_dialed_elsewhere_and_no_other(routers: int) -> None:
    made = layout(routers)
    before = {name: values(made.agent(name, "tcp:127.0.0.1:1", 1), "--connect") for name in UAVS}
    link = next(link for link in made.links if link.dialer == "u1")
    made.divert(link, "tcp/127.0.0.1:1")
    after = {name: values(made.agent(name, "tcp:127.0.0.1:1", 1), "--connect") for name in UAVS}

    real = made.endpoint(link.listener)
    expected = ["tcp/127.0.0.1:1" if each == real else each for each in before["u1"]]
    assert after == before | {"u1": expected}
    assert before["u1"] != expected


def test_links_are_those_that_are_dialed_by_others_than_onlookers() -> None:
    mesh, routers = layout(), layout(routers=2)
    seats = [COORDINATOR, *UAVS]

    assert {frozenset((link.dialer, link.listener)) for link in mesh.links} == {
        frozenset(pair) for pair in combinations(seats, 2)
    }
    assert Counter(link.dialer for link in routers.links) == {
        "router 2": 1,
        **dict.fromkeys(seats, 2),
    }


def test_further_onlookers_have_a_place_in_a_mesh() -> None:
    made = layout(observers=("recorder",))
    topology = made.observer_seat("recorder").topology

    assert isinstance(topology, MeshTopology)
    assert len(topology.dial) == len(UAVS) + 2
    assert topology.listen not in topology.dial


@pytest.mark.parametrize("routers", [0, 2])
def test_with_keys_every_process_has_its_own_and_only_encrypted_links(routers: int) -> None:
    made = layout(routers, observers=("spy", "guest"), keys=KEYS)
    commands = {
        "coordinator": made.coordinator(),
        **{name: made.agent(name, "tcp:127.0.0.1:1", 1) for name in UAVS},
        "boss": made.dashboard(PLACE, Path()),
        "u2": made.seat_arguments("spy"),
        "onlooking": made.seat_arguments("guest"),
    }

    for name, arguments in commands.items():
        assert value(arguments, "--keys") == f"keys/{name}"
        assert all(each.startswith("tls/") for each in values(arguments, "--connect"))
    for router in made.routers:
        assert value(made.router(router), "--keys") == "keys/gate"
        assert value(made.router(router), "--listen").startswith("tls/")


def test_without_keys_nobody_is_told_of_any() -> None:
    made = layout(routers=1)
    for arguments in (made.router("router 1"), made.coordinator(), made.seat_arguments("u0")):
        assert "--keys" not in arguments


def test_an_agent_is_told_its_mission_its_vehicle_and_the_pace() -> None:
    arguments = layout(routers=1).agent("u1", "tcp:127.0.0.1:5771", 2)

    assert arguments[0] == "agent"
    assert value(arguments, "--mission") == MISSION
    assert value(arguments, "--uav") == "u1"
    assert value(arguments, "--mavlink") == "tcp:127.0.0.1:5771"
    assert value(arguments, "--system-id") == "2"
    assert float(value(arguments, "--speedup")) == OPTIONS.speedup
    assert float(value(arguments, "--acceptance-radius-m")) == OPTIONS.acceptance_radius_m


def test_position_reports_are_asked_for_at_their_wall_rate_in_vehicle_time() -> None:
    arguments = layout(routers=1).agent("u1", "tcp:127.0.0.1:5771", 2)

    rate_hz = float(value(arguments, "--position-rate-hz"))
    assert rate_hz * OPTIONS.speedup == OPTIONS.position_rate_hz


def test_the_coordinator_is_told_scenario_method_seed_and_patience() -> None:
    arguments = layout(routers=1).coordinator()

    assert arguments[:2] == ["coordinator", str(OPTIONS.scenario)]
    assert value(arguments, "--method") == "lookahead"
    assert value(arguments, "--seed") == "7"
    assert float(value(arguments, "--start-timeout-s")) == OPTIONS.start_timeout_s
    assert "--json" in arguments


def test_an_autopilot_process_is_told_its_uavs() -> None:
    arguments = layout().autopilot(["u0", "u2"])

    assert arguments[:2] == ["autopilot", str(OPTIONS.scenario)]
    assert values(arguments, "--uav") == ["u0", "u2"]
    assert float(value(arguments, "--speedup")) == OPTIONS.speedup


@pytest.mark.parametrize("n_uav", [0, 1, 20, 21, 25, 26, 50, 1000])
def test_every_uav_has_its_autopilot_in_one_process(n_uav: int) -> None:
    names = [f"u{n}" for n in range(n_uav)]
    groups = autopilot_groups(names)

    assert sorted(name for group in groups for name in group) == sorted(names)
    assert all(groups)
    assert len(groups) <= max(20, n_uav / 25 + 1)


@pytest.mark.parametrize("n_uav", [0, 1, 3, 20, 100, 1000])
def test_the_fleets_position_reports_stay_within_what_a_machine_handles(n_uav: int) -> None:
    rate_hz = default_position_rate_hz(n_uav)

    assert 5.0 <= rate_hz <= 100.0
    assert rate_hz * n_uav <= 1000.0 or rate_hz == LEAST_POSITION_RATE_HZ


@pytest.mark.parametrize("n_uav", [1, 37, 38, 100, 1000])
def test_simulated_fleets_fly_no_higher_than_one_may_and_real_ones_as_told(
    n_uav: int,
) -> None:
    fleet, usual = mission([uav(f"u{n}") for n in range(n_uav)], [task("t0", 1.0)]), FlightLayers()
    simulated = flight_layers(fleet, OPTIONS)

    assert simulated.layer_m(n_uav - 1) <= 120.0 + 1e-9
    assert (simulated == usual) == (usual.layer_m(n_uav - 1) <= 120.0)
    heights_m = {simulated.layer_m(index) for index in range(n_uav)}
    assert len(heights_m) == n_uav
    assert flight_layers(fleet, replace(OPTIONS, autopilots=RunningVehicles(()))) == usual
