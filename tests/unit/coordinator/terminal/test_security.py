"""What the report says of a run with keys."""

from __future__ import annotations

from collections import Counter

from coordinator.mission_view.results import ProtectionSummary, refusals


def test_what_honest_messages_are_dropped_for_is_no_refusal() -> None:
    by_process = [{"stale": 7, "not signed": 2}, {"not forwarded": 1, "malformed": 0}]

    assert refusals(by_process) == Counter({"not signed": 2})


def test_a_report_says_what_was_on_what_was_not_and_what_was_refused() -> None:
    calm = ProtectionSummary(("TLS", "signed statements"))
    assert calm.fact.shown() == "TLS, signed statements; nothing was refused"
    assert not calm.fact.bad

    attacked = ProtectionSummary(
        ("TLS",), ("MAVLink not signed",), {"not signed": 3, "malformed": 1}
    )
    told = "TLS; MAVLink not signed; 4 refused: 1 malformed, 3 not signed"
    assert attacked.fact.shown() == told
    assert attacked.fact.bad
    assert attacked.as_json() == {
        "measures": ["TLS"],
        "lacking": ["MAVLink not signed"],
        "refused": {"not signed": 3, "malformed": 1},
    }
