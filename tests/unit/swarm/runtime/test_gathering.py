"""How the shell of a large fleet hears claims, outcomes, board and who is near: now and then,
and together."""

from __future__ import annotations

from functools import partial

from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    CommonEvent,
    MessageReceived,
    MessagesReceived,
    Stop,
    Tick,
    TuneIn,
)
from swarm.protocol.messages import Message
from swarm.protocol.timing import UNSTRETCHED_UAVS
from swarm.protocol.uav_messages import Nearby
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


def test_a_tick_for_which_nothing_is_left_to_do_is_left_out() -> None:
    """What was gathered before it has moved the deadline."""

    async def scenario() -> None:
        core, ear = ScriptedCore(), Ear()

        def together(heard: MessagesReceived) -> CommonEvent:
            core.deadline_s = None
            return ear.together(heard)

        async with at_work(core, together=together) as played:
            await brief_of(core, played, ear, UNSTRETCHED_UAVS + 1)
            core.deadline_s = played.clock.now_s()
            said_by(played, CLAIMS[0])
            before = core.heard.count(Tick())
            played.shell.step(MessageReceived(EPOCH))  # sets the timer
            await until(lambda: CLAIMS[0] in ear.heard, "the gathering")
            assert core.heard.count(Tick()) == before + 1, "that of what was heard together"

    play(scenario)


def test_where_others_are_waits_in_a_large_fleet_and_wakes_the_shell_of_a_small_one() -> None:
    async def scenario(n_uav: int, early: bool) -> None:
        listen, tunes = Stop("listen"), TuneIn(frozenset({(0, 0)}))
        core, ear = ScriptedCore(lambda event: [tunes] if event == listen else ()), Ear()
        place = still = (0.0, 0.0, 0.0)
        said = message("u2", Nearby((0, 0), True, place, still, (), 8.0, 1, 2, 0, 5.0))
        async with at_work(core, together=ear.together) as played:
            if early:
                played.shell.step(listen)
            await brief_of(core, played, ear, n_uav)
            if not early:
                played.shell.step(listen)
            said_by(played, said)
            if n_uav > UNSTRETCHED_UAVS:
                played.shell.gather()
                assert said in ear.heard
            else:
                await until(lambda: MessageReceived(said) in core.heard, "hearing it")

    for early in (False, True):
        play(partial(scenario, UNSTRETCHED_UAVS, early))
        play(partial(scenario, UNSTRETCHED_UAVS + 1, early))


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
