"""Standing by: taking over when the coordinator is lost, and giving way to another one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import CoordinatorAction, TakeSeat
from coordinator.core.standby import StandbyCore
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    Finish,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Stop,
    Tick,
)
from swarm.protocol.messages import Body, MissionPhase, PlanEpoch, Snapshot
from tests.support.builders import (
    MISSION,
    OUT,
    brief_of,
    done,
    entries_of,
    epoch,
    message,
    mission,
    task,
    uav,
)
from tests.support.lone_coordinator import LAYERS
from tests.support.seat_play import TIMING, SeatPlay
from tests.support.seeds import seeds

FLOWN = mission([uav("u0")], [task("t0", 5.0)])
STARTED_S = 5.0
TAKEN_S = TIMING.silence_s + TIMING.loss_delay_s + TIMING.takeover_s + 2.0
"""By then a lost coordinator has been replaced, however it was lost."""
SETTLED_S = 2.0 * TIMING.announce_s + 4.0
"""By then two coordinators have heard of each other."""
SEEDS = range(25)


def started(seed: int, standbys: int = 1, delay_s: float = 0.05) -> SeatPlay:
    """The mission runs, by the first coordinator."""
    play = SeatPlay(FLOWN, seed=seed, delay_s=delay_s, standbys=standbys)
    play.run(STARTED_S)
    assert play.in_charge == ["c0"]
    return play


# -- taking over ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("standbys", [1, 3])
def test_one_that_stands_by_resumes_the_mission_of_a_killed_one(seed: int, standbys: int) -> None:
    play = started(seed, standbys)
    play.kill("c0")
    play.run(STARTED_S + TAKEN_S + SETTLED_S)

    (successor,) = play.in_charge
    mine = [(at_s, said) for at_s, name, said in play.epochs if name == successor]
    before = [said for _, name, said in play.epochs if name == "c0"]
    assert all(said.stamp > before[-1].stamp for _, said in mine)
    epochs = [(at_s, said.body) for at_s, said in mine if isinstance(said.body, PlanEpoch)]
    assert {each.number for _, each in epochs} == {1}
    zeros_s = [at_s - each.mission_s for at_s, each in epochs]
    assert zeros_s == pytest.approx([play.epochs[0][0]] * len(zeros_s), abs=0.2)


@pytest.mark.parametrize("seed", SEEDS)
def test_it_takes_over_within_the_stated_time(seed: int) -> None:
    play = started(seed)
    play.kill("c0")
    play.run(STARTED_S + TIMING.loss_delay_s + TIMING.takeover_s + 0.6)

    assert play.in_charge == ["c1"]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hung_coordinator_is_replaced_and_gives_way_when_it_goes_on(seed: int) -> None:
    play = started(seed)
    play.hold("c0")
    play.run(STARTED_S + TAKEN_S)
    assert play.in_charge == ["c0", "c1"]

    play.release("c0")
    play.run(STARTED_S + TAKEN_S + SETTLED_S)
    assert play.in_charge == ["c1"]


@pytest.mark.parametrize("seed", SEEDS)
def test_before_the_start_too_it_takes_over(seed: int) -> None:
    play = SeatPlay(FLOWN, seed=seed, delay_s=0.02)
    play.run(0.08)
    assert play.in_charge == []
    play.kill("c0")
    play.run(TAKEN_S + SETTLED_S)

    assert play.in_charge == ["c1"]


@pytest.mark.parametrize("seed", SEEDS)
def test_with_nobody_to_watch_it_begins_the_mission(seed: int) -> None:
    play = SeatPlay(FLOWN, seed=seed, delay_s=0.02, standbys=2)
    play.kill("c0")
    play.run(TIMING.relink_grace_s + TAKEN_S + SETTLED_S)

    assert len(play.in_charge) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_after_a_partition_one_of_the_two_gives_way(seed: int) -> None:
    play = started(seed)
    play.cut("c0")
    play.run(STARTED_S + 30.0)
    assert play.in_charge == ["c0", "c1"]

    play.heal()
    play.run(STARTED_S + 30.0 + SETTLED_S)
    assert play.in_charge == ["c1"]
    assert play.uav.uav is not None
    assert play.uav.uav.epoch is not None
    assert play.uav.uav.epoch.phase is MissionPhase.RUNNING


@pytest.mark.parametrize("seed", SEEDS)
def test_who_gave_way_stands_by_again(seed: int) -> None:
    play = started(seed)
    play.cut("c0")
    play.run(STARTED_S + 30.0)
    play.heal()
    play.run(STARTED_S + 30.0 + SETTLED_S)
    play.kill("c1")
    play.run(STARTED_S + 30.0 + 2.0 * SETTLED_S + TAKEN_S)

    assert play.in_charge == ["c0"]


# -- whatever happens -------------------------------------------------------------------


def disturbed(seed: int) -> tuple[SeatPlay, float]:
    """Three coordinators through partitions, deaths and pauses; when all is well again."""
    rng = np.random.default_rng([seed, 17])
    delay_s = float(rng.choice([0.005, 0.05, 0.3]))
    play = started(seed, standbys=2, delay_s=delay_s)
    names = list(play.coordinators)
    now_s = STARTED_S
    for _ in range(int(rng.integers(3, 8))):
        now_s += float(rng.uniform(0.1, 12.0))
        play.run(now_s)
        name = str(rng.choice(names))
        match rng.integers(5):
            case 0:
                play.cut(*rng.choice(names, int(rng.integers(1, 3)), replace=False))
            case 1:
                play.heal()
            case 2:
                play.kill(name)
            case 3 if not play.coordinators[name].alive:
                play.begin(name, standby=bool(rng.random() < 0.7))
            case _:
                held = play.coordinators[name].held
                (play.release if held else play.hold)(name)
    play.heal()
    for name in names:
        if not play.coordinators[name].alive:
            play.begin(name, standby=True)
        elif play.coordinators[name].held:
            play.release(name)
    return play, now_s


@pytest.mark.parametrize("seed", seeds(50, 150))
def test_in_the_end_one_coordinator_is_in_charge_and_the_fleet_hears_it(seed: int) -> None:
    play, healed_s = disturbed(seed)
    settled_s = healed_s + TAKEN_S + 2.0 * SETTLED_S
    play.run(settled_s)
    assert len(play.in_charge) == 1
    (keeper,) = play.in_charge

    play.run(settled_s + 30.0)
    said = [(name, epoch_) for at_s, name, epoch_ in play.epochs if at_s > settled_s]
    assert {name for name, _ in said} == {keeper}
    fleet = play.uav.uav
    assert fleet is not None
    newest = said[-1][1]
    known = fleet.known(newest)
    assert known is not None
    assert known.stamp.incarnation == newest.stamp.incarnation


# -- step by step -----------------------------------------------------------------------


class Watcher:
    """One that stands by for the coordinator of `FLOWN`, from 100 s of its clock on."""

    def __init__(self, memory: Snapshot | None = None) -> None:
        self.made: list[tuple[Snapshot | None, float]] = []
        self.core = StandbyCore(FLOWN, self._make, TIMING, memory, 7.0)
        self.now_s = 100.0
        self.log: list[CoordinatorAction] = list(self.core.start(self.now_s))
        self.answers: tuple[Snapshot, ...] | None = ()

    def _make(self, memory: Snapshot | None, age_s: float) -> CoordinatorCore:
        self.made.append((memory, age_s))
        return CoordinatorCore(
            FLOWN,
            method="greedy",
            seed=0,
            incarnation=50,
            timing=TIMING,
            start_timeout_s=60.0,
            layers=LAYERS,
            memory=memory,
            memory_age_s=age_s,
        )

    def happen(self, *events: object) -> None:
        for event in events:
            said = self.core.step(event, self.now_s)  # type: ignore[arg-type]  # any of its events
            self.log += said
            if Ask() in said and self.answers is not None:
                self.happen(SnapshotsReceived(self.answers))

    def run_until(self, at_s: float) -> None:
        for due_s in self._deadlines(at_s):
            self.now_s = max(self.now_s, due_s)
            self.happen(Tick())
        self.now_s = at_s
        self.happen(Tick())

    def _deadlines(self, until_s: float) -> Iterator[float]:
        for _ in range(1000):
            due_s = self.core.next_deadline_s()
            if due_s is None or due_s > until_s:
                return
            yield due_s
        raise AssertionError("it spins")

    def watching(self) -> Watcher:
        """The same, with a coordinator there whose mission has run since 98 s."""
        self.happen(SnapshotsReceived(()), PeerSeen(COORDINATOR), PeerSeen("u0"))
        bodies: list[Body] = [brief_of(FLOWN), *entries_of(FLOWN), epoch("u0", mission_s=2.0)]
        for number, body in enumerate(bodies):
            self.happen(MessageReceived(message(COORDINATOR, body, number, incarnation=9)))
        return self

    @property
    def took_over(self) -> bool:
        return TakeSeat() in self.log


def test_it_says_nothing_and_shows_no_seat_while_it_watches() -> None:
    watcher = Watcher().watching()
    watcher.run_until(100.0 + 0.9 * TIMING.silence_s)

    assert not watcher.took_over
    assert [action for action in watcher.log if isinstance(action, Publish)] == []
    assert watcher.core.snapshot(101.0).messages == ()


def test_it_says_once_that_it_stands_by_when_it_has_seen_the_coordinator() -> None:
    watcher = Watcher()
    watcher.happen(SnapshotsReceived(()), PeerSeen("u0"))
    assert LogLine("stands by for the coordinator") not in watcher.log

    watcher.happen(PeerSeen(COORDINATOR))
    assert watcher.log.count(LogLine("stands by for the coordinator")) == 1
    watcher.happen(PeerGone(COORDINATOR), PeerSeen(COORDINATOR))
    watcher.run_until(100.0 + 0.9 * TIMING.silence_s)
    assert watcher.log.count(LogLine("stands by for the coordinator")) == 1


def test_it_takes_over_with_all_that_it_has_heard() -> None:
    watcher = Watcher().watching()
    watcher.happen(PeerGone(COORDINATOR))
    watcher.run_until(100.0 + TIMING.loss_delay_s + 0.9 * TIMING.takeover_s)
    assert not watcher.took_over

    watcher.run_until(103.0)
    ((memory, age_s),) = watcher.made
    assert memory is not None
    assert memory.mission_s == pytest.approx(2.0 + 1.2)
    assert age_s == 0.0
    assert len(memory.messages) == 3
    assert watcher.core.memory(104.0).mission_s == pytest.approx(6.0)


def test_mission_time_is_by_the_word_that_was_least_under_way() -> None:
    watcher = Watcher().watching()
    words = [(10.0, 3.0, 0.0), (20.0, 0.5, 0.4), (30.0, 0.9, 0.0)]
    for counter, (at_s, delay_s, waited_s) in enumerate(words, 100):
        watcher.now_s = 98.0 + at_s + delay_s
        said = message(COORDINATOR, epoch("u0", mission_s=at_s), counter, incarnation=9)
        watcher.happen(MessageReceived(said, watcher.now_s - waited_s))

    assert watcher.core.memory(140.0).mission_s == 42.0


def test_a_coordinator_that_blinks_or_comes_back_in_time_keeps_its_seat() -> None:
    watcher = Watcher().watching()
    watcher.happen(PeerGone(COORDINATOR))
    watcher.run_until(101.0)
    watcher.happen(PeerSeen(COORDINATOR))
    watcher.run_until(104.0)

    assert not watcher.took_over


def test_a_coordinator_that_answers_is_not_lost() -> None:
    """Its token may be hidden by the way the network heals."""
    watcher = Watcher().watching()
    watcher.answers = (Snapshot(MISSION, COORDINATOR, 9, 4.0, ()),)
    watcher.happen(PeerGone(COORDINATOR))
    watcher.run_until(130.0)
    assert not watcher.took_over

    watcher.answers = ()
    watcher.run_until(132.0)
    assert watcher.took_over


def test_without_a_link_of_its_own_it_takes_over_from_nobody() -> None:
    watcher = Watcher().watching()
    watcher.happen(LinkChanged(False), PeerGone(COORDINATOR))
    watcher.run_until(500.0)
    assert not watcher.took_over

    watcher.happen(LinkChanged(True))
    watcher.run_until(500.0 + 0.9 * TIMING.relink_grace_s)
    watcher.happen(PeerSeen(COORDINATOR))
    watcher.run_until(504.0)
    assert not watcher.took_over


def test_after_it_was_held_up_itself_it_looks_first() -> None:
    watcher = Watcher().watching()
    watcher.now_s = 200.0
    watcher.happen(Tick())
    said = message(COORDINATOR, epoch("u0", mission_s=102.0), 20, incarnation=9)
    watcher.happen(MessageReceived(said))
    watcher.run_until(204.0)

    assert not watcher.took_over


def test_what_it_remembers_of_an_earlier_life_counts_when_it_has_heard_nothing() -> None:
    memory = Snapshot(MISSION, COORDINATOR, 3, 40.0, (message(COORDINATOR, brief_of(FLOWN)),))
    watcher = Watcher(memory)
    watcher.happen(SnapshotsReceived(()))
    watcher.run_until(110.0)

    assert watcher.made == [(memory, 7.0)]


@pytest.mark.parametrize(("ended", "status"), [(True, 0), (False, 1)])
def test_it_ends_with_the_mission_it_has_watched(ended: bool, status: int) -> None:
    watcher = Watcher().watching()
    if ended:
        watcher.happen(MessageReceived(message("u0", done("t0"))))
    over = epoch("u0", phase=MissionPhase.ENDED, number=2, mission_s=3.0)
    watcher.happen(MessageReceived(message(COORDINATOR, over, 30, incarnation=9)))
    watcher.happen(PeerGone("u0"), PeerGone(COORDINATOR))
    watcher.run_until(110.0)

    assert [a.status for a in watcher.log if isinstance(a, Finish)] == [status]
    assert not watcher.took_over
    assert watcher.core.next_deadline_s() is None


def test_it_sees_a_mission_to_its_end_whose_coordinator_died_in_the_last_moment() -> None:
    watcher = Watcher().watching()
    over = epoch("u0", phase=MissionPhase.ENDED, number=2, mission_s=3.0)
    watcher.happen(MessageReceived(message(COORDINATOR, over, 30, incarnation=9)))
    watcher.happen(PeerGone(COORDINATOR))
    witness = message("u0", done("t0"))
    watcher.answers = (Snapshot(MISSION, "u0", 1, 4.0, (witness, message("u0", OUT))),)
    watcher.run_until(103.0)
    assert watcher.took_over
    coordinator = watcher.core.coordinator
    assert coordinator is not None
    assert coordinator.replica.epoch is not None
    assert coordinator.replica.epoch.phase is MissionPhase.ENDED

    watcher.happen(PeerGone("u0"))
    watcher.run_until(110.0)
    assert [a.status for a in watcher.log if isinstance(a, Finish)] == [0]


def test_told_to_stop_it_ends_without_harm() -> None:
    watcher = Watcher().watching()
    watcher.happen(Stop("told"))

    assert Finish(0) in watcher.log
    assert not watcher.took_over
