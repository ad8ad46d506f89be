"""How the shell of a large fleet hears claims, outcomes and board: now and then, and together."""

from __future__ import annotations

from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.events import CommonEvent, MessageReceived, MessagesReceived, Tick
from swarm.protocol.messages import Message
from swarm.protocol.timing import UNSTRETCHED_UAVS
from tests.support.builders import brief, done, epoch, held, message, uav
from tests.support.scripted_shell import Played, ScriptedCore, at_work
from tests.support.shell_play import play, until

CLAIMS = [message(f"u{n}", held(f"t{n}", 1.0)) for n in range(2, 6)]
EPOCH = message(COORDINATOR, epoch("u0"))


def said_by(played: Played, *said: Message) -> None:
    """The other seat says so."""
    for one in said:
        played.other.publish(one.key, encode(one))


class Ear:
    """What a core heard together."""

    def __init__(self) -> None:
        self.heard: list[Message] = []
        self.times = 0

    def together(self, heard: MessagesReceived) -> CommonEvent:
        """In place of the event a tick, which the scripted core knows."""
        self.heard += heard.messages
        self.times += 1
        return Tick()


def large(n_uav: int) -> Message:
    return message(COORDINATOR, brief(*(uav(f"u{n}") for n in range(n_uav))))


async def brief_of(core: ScriptedCore, played: Played, ear: Ear, n_uav: int) -> None:
    """Let it hear of a fleet of that size; what is gathered from then on is heard together."""
    told = large(n_uav)

    def there() -> bool:
        return told in ear.heard or MessageReceived(told) in core.heard

    said_by(played, told)
    await until(there, "hearing of the fleet")


def test_a_large_fleets_claims_wait_for_each_other_and_are_heard_at_once() -> None:
    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()
        async with at_work(core, together=ear.together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS + 1)
            ear.heard.clear()
            ear.times = 0
            said_by(played, *CLAIMS, message("u2", done("t2")))
            await until(lambda: len(ear.heard) == 5, "hearing all")
            assert ear.times == 1
            assert ear.heard == [*CLAIMS, message("u2", done("t2"))]

    play(scenario)


def test_of_one_claim_that_is_restated_meanwhile_the_newest_is_heard() -> None:
    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()
        async with at_work(core, together=ear.together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS + 1)
            newer = message("u2", held("t9", 1.0), counter=7)
            said_by(played, *CLAIMS, newer)
            played.shell.gather()
            assert [one for one in ear.heard if one.writer == "u2"] == [newer]

    play(scenario)


def test_what_waits_is_heard_before_a_tick_and_on_demand() -> None:
    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()
        async with at_work(core, together=ear.together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS + 1)
            ear.heard.clear()
            said_by(played, CLAIMS[0])
            played.shell.gather()
            assert ear.heard == CLAIMS[:1]

            core.deadline_s = played.clock.now_s()
            said_by(played, CLAIMS[1])
            before = ear.times
            played.shell.step(Tick())  # sets the timer
            await until(lambda: ear.times > before, "the tick")
            assert ear.heard == CLAIMS[:2]

    play(scenario)


def test_the_coordinators_plan_wakes_the_shell_of_any_fleet() -> None:
    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()
        async with at_work(core, together=ear.together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS + 1)
            said_by(played, EPOCH)
            assert EPOCH not in ear.heard
            await until(lambda: EPOCH in ear.heard, "hearing the plan")

    play(scenario)


def test_a_small_fleet_hears_each_statement_by_itself() -> None:
    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()
        async with at_work(core, together=ear.together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS)
            said_by(played, *CLAIMS)
            wanted = [MessageReceived(claim) for claim in CLAIMS]
            await until(lambda: all(each in core.heard for each in wanted), "hearing all")
            assert ear.times == 0

    play(scenario)
