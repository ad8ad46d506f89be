"""Who looks on at a mission asks for what it does not know yet."""

from __future__ import annotations

import asyncio

from coordinator.joining import observer_shell
from coordinator.mission_view.observation import MissionObserver
from swarm.bus.port import Query
from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.events import Tick
from swarm.protocol.key_space import KeySpace
from swarm.protocol.sync import decode_digest
from swarm.protocol.timing import Timing
from tests.support.builders import MISSION, brief, message, uav
from tests.support.memory_bus import MemoryNetwork
from tests.support.shell_play import HandClock, play, until

BRIEF = message(COORDINATOR, brief(uav("u0")))


def test_an_onlooker_tells_what_it_knows_when_it_asks_again() -> None:
    async def scenario() -> None:
        network, clock = MemoryNetwork(), HandClock()
        fleet, seat = network.join("u0"), network.join("onlooker")
        fleet.serve(KeySpace(MISSION).state("u0"))
        core = MissionObserver(MISSION, Timing(), None)
        replica = core.mission_state.replica
        shell = observer_shell(core, seat, clock, MISSION, "onlooker", known=replica.digest)
        told: list[dict[str, int]] = []

        def asked(times: int) -> bool:
            queries = [each for each in fleet.inbox.take() if isinstance(each, Query)]
            told.extend(decode_digest(each.payload) or {} for each in queries)
            for each in queries:
                each.reply(b"")
            return len(told) >= times

        running = asyncio.get_running_loop().create_task(shell.run())
        await until(lambda: asked(1), "being asked")
        fleet.publish(BRIEF.key, encode(BRIEF))
        await until(lambda: replica.brief is not None, "hearing the brief")
        fleet.declare_token(KeySpace(MISSION).alive("u0"))
        clock.time_s = 100.0

        def again() -> bool:
            shell.step(Tick())
            return asked(2)

        await until(again, "being asked again")
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

        assert told[0] == {}
        assert told[1] == replica.digest() != {}

    play(scenario)
