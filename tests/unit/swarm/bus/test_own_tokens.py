from __future__ import annotations

from swarm.bus.own_tokens import OwnTokens


class Told:
    """What was told, in order."""

    def __init__(self) -> None:
        self.words: list[tuple[str, bool]] = []

    def __call__(self, key: str, seen: bool) -> None:
        self.words.append((key, seen))


def test_what_others_hold_is_told_and_what_is_held_here_is_not() -> None:
    own, told = OwnTokens(), Told()
    assert own.hold("a")
    assert not own.hold("a")
    for key, seen in (("a", True), ("b", True), ("b", False), ("a", False)):
        own.hear(key, seen, told)
    assert told.words == [("b", True), ("b", False)]
    assert not own.let_go("b")


def test_what_comes_back_of_a_token_let_go_is_not_of_others() -> None:
    own, told = OwnTokens(), Told()
    own.hold("a")
    assert own.let_go("a")
    own.hear("a", True, told)
    own.hear("a", False, told)
    own.hear_of_others("a")
    assert told.words == []

    own.release("a", False, told)
    assert told.words == [("a", False)]
    own.hear("a", True, told)
    assert told.words[1:] == [("a", True)]


def test_what_is_heard_after_the_question_is_later_than_its_answer() -> None:
    own, told = OwnTokens(), Told()
    own.hold("a")
    own.let_go("a")
    own.hear_of_others("a")
    own.hear("a", True, told)
    own.release("a", False, told)
    assert told.words == [("a", True)]


def test_one_held_again_before_its_release_has_ended_is_own() -> None:
    own, told = OwnTokens(), Told()
    own.hold("a")
    own.let_go("a")
    own.hold("a")
    own.release("a", True, told)
    own.hear("a", True, told)
    assert told.words == []

    own.let_go("a")
    own.hold("a")
    own.let_go("a")
    own.release("a", True, told)
    assert told.words == []
    own.hear_of_others("a")
    own.release("a", True, told)
    assert told.words == [("a", True)]
