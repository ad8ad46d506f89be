"""Who floods loses its own words, and nobody else's."""

from __future__ import annotations

import pytest

from swarm.bus.admission import (
    ASKER_BURST,
    CLAIMED_BURST,
    MOST_STRANGERS,
    TOKEN_BURST,
    UAV_BURST,
    UAV_HZ,
    AdmissionControl,
    QuestionFilter,
    RateLimiter,
)
from swarm.bus.port import BusEvent, LinkDown, LinkUp, Query, Sample, TokenGone, TokenSeen
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.seal import Seal
from swarm.protocol.sync import NONCE_BYTES, Question, encode_question
from tests.support.builders import MISSION, brief, held, message, uav
from tests.support.keyring import Keyring
from tests.support.shell_play import HandClock

KEYS = KeySpace(MISSION)
RING = Keyring("u0", "u1", "u2")


def claim_of(uav: str, *, signer: str | None = None) -> Sample:
    said = message(uav, held("t0", 1.0))
    return Sample(said.key, RING.seal(signer or uav).wrap(encode(said)))


def question_of(name: str) -> Query:
    payload = encode_question({}, bytes(NONCE_BYTES), RING.seal(name))
    return Query(KEYS.state("u0"), lambda _: None, payload)


def admitted(gate: AdmissionControl, event: BusEvent, times: int) -> int:
    return sum(gate.admits(event) for _ in range(times))


def test_a_burst_passes_and_then_as_much_as_the_rate_lets() -> None:
    limiter = RateLimiter(10.0, 5)

    assert [limiter.allows("u0", 0.0) for _ in range(7)] == [True] * 5 + [False] * 2
    assert [limiter.allows("u0", 0.2) for _ in range(3)] == [True, True, False]
    assert sum(limiter.allows("u0", 100.0) for _ in range(50)) == 5


def test_a_clock_that_goes_back_gives_nothing() -> None:
    limiter = RateLimiter(10.0, 1)
    assert limiter.allows("u0", 100.0)

    assert not limiter.allows("u0", 0.0)


def test_sources_that_have_been_quiet_are_forgotten() -> None:
    limiter = RateLimiter(1.0, 10)
    for number in range(20_000):
        assert limiter.allows(f"u{number}", number / 100.0)

    assert len(limiter) == 1000, "those of the last 10 s"
    assert limiter.allows("u0", 200.0)


def test_who_was_refused_is_not_forgotten_for_it() -> None:
    limiter = RateLimiter(1.0, 2)
    assert [limiter.allows("u0", at_s) for at_s in (0.0, 0.0, 0.0, 0.5, 0.9)] == [True] * 2 + [
        False
    ] * 3
    assert limiter.allows("u1", 1.6)
    assert [limiter.allows("u0", 1.6) for _ in range(2)] == [True, False]


def plain(uav: str) -> Sample:
    said = message(uav, held("t0", 1.0))
    return Sample(said.key, encode(said))


def test_of_made_up_names_only_so_many_count_however_slowly_they_come() -> None:
    clock = HandClock()
    gate = AdmissionControl(KEYS, None, clock.now_s)
    passed = 0
    for number in range(2 * MOST_STRANGERS):
        clock.time_s += 1.0
        event = plain(f"ghost{number}") if number % 2 else TokenSeen(KEYS.alive(f"ghost{number}"))
        passed += gate.admits(event)

    assert passed == MOST_STRANGERS
    assert gate.refused == {"too many names": MOST_STRANGERS}
    assert gate.admits(plain("ghost1")), "who is known may go on"


def test_made_up_names_shut_out_neither_fleet_nor_coordinator() -> None:
    gate = AdmissionControl(KEYS, None, HandClock().now_s)
    gate.fleet = {"u1", "u2"}
    for number in range(3 * MOST_STRANGERS):
        gate.admits(plain(f"ghost{number}"))
        gate.admits(TokenSeen(KEYS.alive(f"phantom{number}")))

    for name in ("u1", "u2", COORDINATOR):
        assert gate.admits(TokenSeen(KEYS.alive(name)))
    assert gate.admits(plain("u1"))
    said = message(COORDINATOR, brief(uav("u3")))
    assert gate.admits(Sample(said.key, encode(said)))

    assert not gate.admits(plain("u3"))
    gate.fleet = {"u3"}
    assert gate.admits(plain("u3"))


@pytest.mark.parametrize("seal", [None, RING.seal("u0")], ids=["plain", "keys"])
def test_one_uav_that_floods_silences_itself_alone(seal: Seal | None) -> None:
    clock = HandClock()
    gate = AdmissionControl(KEYS, seal, clock.now_s)

    assert admitted(gate, claim_of("u1"), 2 * UAV_BURST) == UAV_BURST
    assert gate.refused == {"too many": UAV_BURST}
    assert gate.admits(claim_of("u2"))
    clock.time_s = 1.0
    assert admitted(gate, claim_of("u1"), 2 * UAV_BURST) == UAV_HZ


def test_what_a_uav_signs_on_anothers_key_takes_no_room_of_that_one() -> None:
    gate = AdmissionControl(KEYS, RING.seal("u0"), HandClock().now_s)

    assert admitted(gate, claim_of("u2", signer="u1"), 5 * UAV_BURST) == 0
    assert gate.refused == {"not the signer's to say": 5 * UAV_BURST}
    assert gate.admits(claim_of("u2"))


def test_what_is_not_signed_or_by_nobody_is_not_taken_in_where_there_are_keys() -> None:
    gate = AdmissionControl(KEYS, RING.seal("u0", RING.without("u2")), HandClock().now_s)
    said = message("u1", held("t0", 1.0))

    assert not gate.admits(Sample(said.key, encode(said)))
    assert not gate.admits(claim_of("u2"))
    assert not gate.admits(Query(KEYS.state("u0"), lambda _: None))
    assert not gate.admits(question_of("u2"))
    assert not gate.admits(TokenSeen(KEYS.alive("u2")))
    assert not gate.admits(TokenSeen(KEYS.alive("ghost")))
    assert gate.refused == {"not signed": 2, "signer unknown": 4}


def asked(name: str, number: int) -> Question:
    return Question({}, name, number.to_bytes(NONCE_BYTES, "big"))


def test_one_that_asks_too_much_is_not_answered_and_the_others_are() -> None:
    questions = QuestionFilter(HandClock().now_s)

    answered = [questions.fault(asked("u1", number)) for number in range(1000)]
    assert answered == [None] * ASKER_BURST + ["too many"] * (1000 - ASKER_BURST)
    assert questions.fault(asked("u2", 0)) is None


def test_who_says_anothers_questions_again_uses_up_nothing_of_that_one() -> None:
    questions = QuestionFilter(HandClock().now_s)
    assert questions.fault(asked("u1", 0)) is None

    assert {questions.fault(asked("u1", 0)) for _ in range(10 * ASKER_BURST)} == {"asked before"}
    assert questions.fault(asked("u1", 1)) is None
    assert questions.fault(asked("u2", 0)) is None, "who takes over a nonce silences nobody"


def test_questions_under_one_name_are_limited_before_anybody_checks_who_asks() -> None:
    gate = AdmissionControl(KEYS, RING.seal("u0"), HandClock().now_s)

    assert admitted(gate, question_of("u1"), 1000) == CLAIMED_BURST
    assert gate.admits(question_of("u2"))


def test_a_token_that_flickers_is_soon_believed_no_more() -> None:
    gate = AdmissionControl(KEYS, RING.seal("u0"), HandClock().now_s)

    seen, gone = TokenSeen(KEYS.alive("u1")), TokenGone(KEYS.alive("u1"))
    assert admitted(gate, seen, 500) + admitted(gate, gone, 500) == TOKEN_BURST
    assert gate.admits(TokenSeen(KEYS.alive("u2")))


def test_the_own_link_and_rosters_always_pass() -> None:
    gate = AdmissionControl(KEYS, RING.seal("u0"), HandClock().now_s)

    assert all(gate.admits(event) for event in (LinkUp(), LinkDown()) for _ in range(5000))
    assert gate.admits(Sample(KEYS.roster, b"whatever"))


def test_what_has_no_key_of_the_mission_shares_one_small_room() -> None:
    gate = AdmissionControl(KEYS, None, HandClock().now_s)

    passed = sum(gate.admits(Sample(f"swarm/other/uav/u{n}/claim", b"")) for n in range(5000))
    assert passed == UAV_BURST


def test_a_gate_reads_nothing_of_what_is_signed() -> None:
    """It costs a look at the envelope, and the codec then finds the signature wrong."""
    sample = claim_of("u1")
    broken = Sample(sample.key, sample.payload[:-1] + b"\x00")
    gate = AdmissionControl(KEYS, RING.seal("u0"), HandClock().now_s)

    assert gate.admits(broken)
    assert Codec(MISSION, RING.seal("u0")).decode(broken.key, broken.payload) is None
