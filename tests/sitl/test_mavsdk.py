"""The simulated autopilot flown by MAVSDK, which knows nothing of this project.

MAVSDK decides by itself what it asks of a vehicle and what it makes of the answers, by
flavour, so a flight here is one that programs written for the real firmwares can fly.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager
from dataclasses import replace
from typing import Any

import pytest
from mavsdk.asyncio import Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.mission_raw import MissionRawAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import TelemetryAsync
from mavsdk.autopilot import Autopilot
from mavsdk.component_type import ComponentType
from mavsdk.plugins.action import ActionError, ActionResult
from mavsdk.plugins.mission_raw import MissionItem
from mavsdk.plugins.telemetry import FlightMode, LandedState

from sim.autopilot.config import Delays, VehicleConfig
from sim.autopilot.firmware import FirmwareModelName, firmware_model
from sim.autopilot.options import parse_endpoint
from sim.autopilot.server import VehicleServer
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.model.frames import wgs84_from_enu
from swarm.runtime.clock import ScaledClock

pytestmark = pytest.mark.sitl
DEADLINE_S = 60.0
SPEEDUP = 10.0
HEIGHT_M = 15.0
CONFIG = VehicleConfig(1, cruise_m_s=10.0, climb_m_s=5.0, land_m_s=3.0)
KINDS = {FirmwareModelName.ARDUPILOT: Autopilot.ARDUPILOT, FirmwareModelName.PX4: Autopilot.PX4}
FLAVOURS = pytest.mark.parametrize("flavour", list(FirmwareModelName))


class Pilot:
    """MAVSDK connected to one vehicle."""

    def __init__(self, system: Any) -> None:
        self.system = system
        self.action = ActionAsync(system)
        self.telemetry = TelemetryAsync(system)
        self.parameters = ParamAsync(system)
        self.mission = MissionRawAsync(system)

    async def ask_for_streams(self, flavour: FirmwareModelName) -> None:
        """Ask for what ArduPilot streams to nobody unasked."""
        if flavour is FirmwareModelName.ARDUPILOT:
            await self.telemetry.set_rate_health(5.0)
            await self.telemetry.set_rate_position(5.0)
            await self.telemetry.set_rate_landed_state(5.0)

    async def in_mode(self, mode: FlightMode) -> None:
        await until(self.telemetry.subscribe_flight_mode(), lambda now: now == mode)


async def until(stream: AsyncGenerator[Any, None], wanted: Callable[[Any], bool]) -> Any:
    """The first of a stream that is as wanted."""
    async with asyncio.timeout(DEADLINE_S), aclosing(stream):
        async for state in stream:
            if wanted(state):
                return state
    raise AssertionError("MAVSDK ended a subscription")


@asynccontextmanager
async def seeing(
    stream: AsyncGenerator[Any, None], wanted: Callable[[Any], bool]
) -> AsyncIterator[asyncio.Task[Any]]:
    """Listen from the beginning of the block, and stay in it until a state is as wanted.

    States that last shorter than this machine may be busy elsewhere are not missed so.
    """
    watch = asyncio.create_task(until(stream, wanted))
    await asyncio.sleep(0)  # lets it subscribe
    try:
        yield watch
        await watch
    finally:
        watch.cancel()


@asynccontextmanager
async def connected(
    flavour: FirmwareModelName, delays: Delays, config: VehicleConfig = CONFIG
) -> AsyncIterator[Pilot]:
    """A vehicle that has just been powered up, and MAVSDK connected to it."""
    clock = ScaledClock(SPEEDUP)
    vehicle = SimulatedAutopilot(
        replace(config, delays=delays), firmware_model(flavour), clock.now_s()
    )
    server = VehicleServer(vehicle, parse_endpoint("tcp:127.0.0.1:0"), clock)
    await server.start()
    settings = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    try:
        async with Mavsdk(settings) as client:
            await client.add_any_connection(server.url.replace("tcp:", "tcpout://"))
            system = await client.first_autopilot(timeout_s=DEADLINE_S)
            assert system is not None
            pilot = Pilot(system)
            await pilot.ask_for_streams(flavour)
            yield pilot
    finally:
        await server.close()
    assert vehicle.unknown == 0, "MAVSDK said something the vehicle doesn't know"


def items() -> list[MissionItem]:
    """A square, whose first item ArduPilot takes for home."""
    corners_m = [(0.0, 0.0), (0.0, 40.0), (40.0, 40.0), (40.0, 0.0)]
    places = [wgs84_from_enu(CONFIG.origin, (*corner_m, 0.0)) for corner_m in corners_m]
    return [
        MissionItem(
            seq=seq,
            frame=6,
            command=16,
            current=int(seq == 0),
            autocontinue=1,
            param1=0.0,
            param2=0.0,
            param3=0.0,
            param4=math.nan,
            x=round(lat_deg * 1e7),
            y=round(lon_deg * 1e7),
            z=HEIGHT_M,
            mission_type=0,
        )
        for seq, (lat_deg, lon_deg, _) in enumerate(places)
    ]


async def start_mission(pilot: Pilot) -> None:
    """Start until the mode is seen: PX4 acknowledges before it has checked the mission."""
    modes = pilot.telemetry.subscribe_flight_mode()
    async with seeing(modes, lambda mode: mode == FlightMode.MISSION) as seen:
        while not seen.done():
            await pilot.mission.start_mission()
            await asyncio.wait([seen], timeout=1.0)


async def fly(pilot: Pilot, flavour: FirmwareModelName) -> list[int]:
    """A whole flight; the numbers of the items that MAVSDK saw become the current one."""
    action, telemetry, mission = pilot.action, pilot.telemetry, pilot.mission
    await action.arm()
    await until(telemetry.subscribe_armed(), bool)
    await action.disarm()
    await until(telemetry.subscribe_armed(), lambda armed: not armed)

    await action.set_takeoff_altitude(HEIGHT_M)
    await action.arm()
    await action.takeoff()
    await until(telemetry.subscribe_position(), lambda at: at.relative_altitude_m > HEIGHT_M - 0.1)

    if flavour is FirmwareModelName.PX4:
        await pilot.in_mode(FlightMode.HOLD)

    sent = items()
    await mission.upload_mission(sent)
    held = await mission.download_mission()
    if flavour is FirmwareModelName.PX4:
        assert [str(item) for item in held] == [str(item) for item in sent]
    else:
        assert [(item.x, item.y, item.z) for item in held[1:]] == [
            (item.x, item.y, item.z) for item in sent[1:]
        ]
    seen: list[int] = []

    def finished(progress: Any) -> bool:
        seen.append(progress.current)
        return bool(progress.current == progress.total == len(sent))

    async with seeing(mission.subscribe_mission_progress(), finished):
        await start_mission(pilot)

    modes = telemetry.subscribe_flight_mode()
    async with seeing(modes, lambda mode: mode == FlightMode.RETURN_TO_LAUNCH):
        await action.return_to_launch()
    home = await telemetry.home()
    await until(
        telemetry.subscribe_position(),
        lambda at: (
            math.isclose(at.latitude_deg, home.latitude_deg, abs_tol=1e-6)
            and math.isclose(at.longitude_deg, home.longitude_deg, abs_tol=1e-6)
        ),
    )
    await action.land()
    await until(telemetry.subscribe_landed_state(), lambda now: now == LandedState.ON_GROUND)
    await until(telemetry.subscribe_armed(), lambda armed: not armed)
    return seen


@FLAVOURS
def test_mavsdk_flies_a_whole_mission_and_comes_home(flavour: FirmwareModelName) -> None:
    async def flight() -> None:
        async with connected(flavour, Delays()) as pilot:
            assert await pilot.system.autopilot_type() == KINDS[flavour]
            await until(
                pilot.telemetry.subscribe_health(),
                lambda health: (
                    health.is_armable
                    and health.is_global_position_ok
                    and health.is_home_position_ok
                ),
            )
            # Ten seconds of the vehicle are one here, which a slow machine may need to go on.
            if flavour is FirmwareModelName.PX4:
                await pilot.parameters.set_param_float("COM_DISARM_PRFLT", 300.0)
                assert await pilot.parameters.get_param_float("MPC_XY_CRUISE") == 10.0
                assert await pilot.parameters.get_param_int("SYS_AUTOSTART") == 10040
            else:
                await pilot.parameters.set_param_int("DISARM_DELAY", 127)
                assert await pilot.parameters.get_param_float("WP_SPD") == 10.0
                assert await pilot.parameters.get_param_int("MAV_SYSID") == 1
            seen = await fly(pilot, flavour)
            assert seen == sorted(seen)
            assert {2, 3, 4} <= set(seen)

    asyncio.run(flight())


@FLAVOURS
def test_mavsdk_is_told_clearly_that_a_vehicle_without_position_cannot_be_armed(
    flavour: FirmwareModelName,
) -> None:
    async def refusal() -> None:
        delays = Delays(0.0, 0.0, 1e6, 1e6)
        async with connected(flavour, delays) as pilot:
            reason = asyncio.create_task(
                until(
                    pilot.telemetry.subscribe_status_text(),
                    lambda status: status.text.startswith(
                        ("Arm: Need Position", "Arming denied: ")
                    ),
                )
            )
            await pilot.action.hold()  # ArduCopter boots into a mode that needs no position
            await pilot.in_mode(FlightMode.HOLD)
            await until(
                pilot.telemetry.subscribe_health(),
                lambda health: not (health.is_armable or health.is_global_position_ok),
            )
            with pytest.raises(ActionError) as refused:
                await pilot.action.arm()
            assert refused.value.result in (ActionResult.COMMAND_DENIED, ActionResult.FAILED)
            assert not await pilot.telemetry.armed()
            await reason

    asyncio.run(refusal())
