"""From the start of the process to the start of the mission: learn, prepare, wait."""

from __future__ import annotations

from agent.core.interface import Action, GoTo, HandedOver, NotReady, Prepare, Refused, VehicleReady
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, MissionPhase, Snapshot
from swarm.protocol.uav_messages import ClaimPhase, Status, StatusPhase
from tests.support.builders import (
    IDLE,
    MISSION,
    brief,
    done,
    entry,
    epoch,
    failed,
    held,
    message,
    uav,
)
from tests.support.lone_agent import START_S, LoneAgent, claims, orders, outcomes, statuses

PREPARE = Prepare((0.0, 0.0, 10.0), 1.0, ground_up_m=0.0)


def test_it_asks_first_and_prepares_nothing_before_it_has_learned() -> None:
    agent = LoneAgent(uav("u0"))
    assert agent.log == [Ask()]

    agent.learn()
    agent.now_s += agent.timing.ask_gap_s
    actions = agent.hear(COORDINATOR, agent.brief)
    assert (orders(actions), actions.count(Ask())) == ([], 1)
    assert orders(agent.learn()) == [PREPARE]


def test_it_asks_again_as_long_as_nobody_knows_the_brief() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn()
    asked = []
    while agent.now_s < START_S + 3.5 * agent.timing.ask_s:
        asked += [action for action in agent.tick_when_due() if action == Ask()]
        agent.learn()

    assert len(asked) == 3
    assert "brief" in statuses(agent.log)[-1].note
    agent.hear(COORDINATOR, agent.brief)
    assert orders(agent.learn()) == [PREPARE]


def test_it_asks_again_as_long_as_the_brief_does_not_name_it() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, brief(uav("u9"))))
    agent.now_s += agent.timing.ask_s

    assert Ask() in agent.tick()
    assert orders(agent.log) == []


def test_it_asks_no_more_once_it_prepares() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.now_s += 100.0

    assert Ask() not in agent.tick()


def test_it_asks_again_when_the_coordinator_comes_or_the_own_link_is_back() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))

    agent.now_s += agent.timing.ask_gap_s
    assert Ask() in agent.happen(PeerSeen(COORDINATOR))
    agent.now_s += agent.timing.ask_gap_s
    assert Ask() not in agent.happen(LinkChanged(False))
    assert Ask() in agent.happen(LinkChanged(True))


def test_it_asks_when_the_coordinator_died_before_the_mission_was_heard_to_run() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(entry("t0"))

    assert Ask() in agent.lose(COORDINATOR, 0.0)

    agent.learn(agent.statement(COORDINATOR, epoch("u0")), mission_s=0.5)
    assert agent.task == "t0"


def test_it_says_that_it_is_idle_once_the_vehicle_is_ready() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    assert claims(agent.log) == []

    assert [c.phase for c in claims(agent.happen(VehicleReady()))] == [ClaimPhase.IDLE]
    assert agent.core.phase is StatusPhase.IDLE


def test_why_the_vehicle_is_not_ready_goes_out_with_the_status() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(NotReady("no position yet"))
    agent.now_s += agent.timing.status_s

    assert statuses(agent.tick())[-1].note == "no position yet"
    agent.happen(VehicleReady())
    agent.now_s += agent.timing.status_s
    assert statuses(agent.tick())[-1].note == ""


def test_it_decides_nothing_before_the_mission_runs() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(entry("t0"))
    agent.hear(COORDINATOR, epoch("u0", phase=MissionPhase.PREPARING))

    assert [order for order in orders(agent.log) if isinstance(order, GoTo)] == []
    agent.start_mission()
    assert agent.task == "t0"


def test_it_decides_at_once_when_it_gets_airborne_in_a_running_mission() -> None:
    agent = LoneAgent(uav("u0"))
    agent.see(COORDINATOR)
    known = agent.coordinators(agent.brief, entry("t0", east_m=3.0), epoch("u0"))
    agent.learn(*known, mission_s=40.0)
    agent.now_s += 2.0
    agent.happen(VehicleReady())

    assert agent.claim is not None
    assert (agent.claim.task, agent.claim.decided_s) == ("t0", 42.0)
    assert agent.claim.completion_s == 42.0 + 3.0


def test_mission_time_is_learned_from_the_answer_that_is_furthest() -> None:
    agent = LoneAgent(uav("u0"))
    running = agent.statement(COORDINATOR, epoch("u0", mission_s=0.0))
    slow, fresh = Snapshot(MISSION, "u1", 1, 9.0, ()), Snapshot(MISSION, "u2", 1, 10.0, (running,))
    agent.happen(SnapshotsReceived((slow, fresh, Snapshot(MISSION, "u3", 1, None, ()))))

    assert agent.core.snapshot(agent.now_s + 1.0).mission_s == 11.0


def test_a_refused_preparation_takes_the_uav_out_for_good() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(Refused(PREPARE, "no such vehicle"))
    assert agent.phase is ClaimPhase.OUT

    agent.happen(VehicleReady())
    agent.post(entry("t0"))
    agent.start_mission()
    assert orders(agent.log) == [PREPARE]


def test_a_pilot_who_takes_over_during_preparation_takes_the_uav_out() -> None:
    agent = LoneAgent(uav("u0"))
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(HandedOver("mode changed"))

    assert agent.phase is ClaimPhase.OUT
    assert agent.core.phase is StatusPhase.OUT


# -- a process that was there before ----------------------------------------------------


def registers(actions: list[Action]) -> list[Message]:
    """What was published, but for status."""
    published = [action.message for action in actions if isinstance(action, Publish)]
    return [message for message in published if not isinstance(message.body, Status)]


def test_a_restarted_agent_outdoes_what_others_remember_of_it() -> None:
    """Also when the clock of its machine went back, so that its incarnation is no greater."""
    agent = LoneAgent(uav("u0"), incarnation=1)
    remembered = message("u0", held("t0", 3.0), counter=70, incarnation=4)
    agent.learn(agent.statement(COORDINATOR, agent.brief), remembered)
    agent.happen(VehicleReady())

    (idle,) = [said for said in registers(agent.log) if said != remembered]
    assert idle.stamp > remembered.stamp


def test_an_agent_that_hears_of_its_earlier_life_too_late_says_its_claim_again() -> None:
    agent = LoneAgent(uav("u0"), incarnation=1)
    agent.fly_to(entry("t0"))
    agent.start_mission()
    remembered = message("u0", held("t9", 3.0), counter=70, incarnation=4)

    (again,) = registers(agent.learn(remembered))

    assert again.stamp > remembered.stamp
    assert again.body == agent.core.claim == agent.core.replica.claims["u0"]


def test_its_own_words_coming_back_are_no_reason_to_speak() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(entry("t0"))
    agent.start_mission()

    for own in registers(agent.log):
        assert registers(agent.happen(MessageReceived(own))) == []


def test_a_restarted_agent_remembers_through_others_what_it_has_done() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.see(COORDINATOR, "u1")
    tasks = entry("t0", east_m=1.0), entry("t1", east_m=9.0, number=1)
    known = agent.coordinators(agent.brief, *tasks, epoch("u0", "u1"))
    own = message("u0", done("t0", 3.0), counter=4, incarnation=4)
    agent.learn(*known, own, mission_s=9.0)
    agent.happen(VehicleReady())

    assert agent.task == "t1"
    assert [o.task for o in outcomes(agent.arrive(30.0))] == ["t1"]
    assert own in agent.core.snapshot(agent.now_s).messages


def test_a_second_attempt_is_counted_as_such() -> None:
    agent = LoneAgent(uav("u0"), reattempt_failed=True)
    own = message("u0", failed("t0"), counter=4, incarnation=4)
    agent.learn(own)
    agent.fly_to(entry("t0"))
    agent.start_mission()

    assert [o.attempt for o in outcomes(agent.arrive(5.0))] == [2]


# -- answering others -------------------------------------------------------------------


def answered_for(agent: LoneAgent) -> set[str]:
    return {message.writer for message in agent.core.snapshot(agent.now_s).messages}


def test_it_answers_for_itself_and_for_the_absent() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"), uav("u2"))
    agent.fly_to(entry("t0"))
    assert answered_for(agent) == {"u0"}

    agent.start_mission()
    agent.lose("u1", 1.0)
    assert answered_for(agent) == {"u0", "u1"}
    agent.lose(COORDINATOR, 2.0)
    assert answered_for(agent) == {"u0", "u1", COORDINATOR}


def test_it_answers_for_whoever_comes_back_until_that_one_has_spoken() -> None:
    """A new process must hear what the old one did from somebody."""
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(entry("t0"))
    agent.start_mission()
    agent.hear("u1", done("t7"))
    agent.happen(PeerGone("u1"), 1.0)
    agent.see("u1")

    assert answered_for(agent) == {"u0", "u1"}
    agent.hear("u1", IDLE)
    assert answered_for(agent) == {"u0"}


def test_who_comes_is_told_the_own_registers_at_once() -> None:
    agent = LoneAgent(uav("u0"), uav("u1"))
    agent.fly_to(entry("t0"))

    (told,) = registers(agent.happen(PeerSeen("u9")))

    assert told.writer == "u0"
    assert told.body == agent.claim
    assert registers(agent.happen(PeerSeen("u9"))) == []
