"""Logs: on standard error only, as people or as machines want them."""

from __future__ import annotations

import json
import logging
import sys
import threading

import pytest
import structlog

from swarm.runtime.log import LogFormat, LogLevel, configure_logging, get_logger, identify


def test_json_has_one_object_per_line_with_its_context(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging(form=LogFormat.JSON)
    get_logger("agent.core.agent_core", uav="uav1").info("claimed", task="t 3", at_s=1.5, who={1})
    captured = capsys.readouterr()

    line = json.loads(captured.err)
    assert captured.out == ""
    assert line.pop("timestamp").endswith("Z")
    assert line == {
        "level": "info",
        "module": "agent.core.agent_core",
        "uav": "uav1",
        "event": "claimed",
        "task": "t 3",
        "at_s": 1.5,
        "who": "{1}",
    }


def test_lines_hold_keys_and_values(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging(form=LogFormat.LINES)
    get_logger("agent.core.agent_core").warning("lost link", peer="uav 2")

    stamp, _, rest = capsys.readouterr().err.partition(" ")
    assert stamp.startswith("timestamp=")
    assert rest == 'level=warning module=agent.core.agent_core event="lost link" peer="uav 2"\n'


def test_without_a_terminal_lines_are_the_default(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging()
    get_logger("x").info("begun")

    assert "level=info module=x event=begun" in capsys.readouterr().err


def test_console_is_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging(form=LogFormat.CONSOLE)
    get_logger("x").info("begun", n=3)

    assert "[info     ] begun" in capsys.readouterr().err


def test_logger_made_before_configuration_follows_it(capsys: pytest.CaptureFixture[str]) -> None:
    logger = get_logger("x")
    configure_logging(LogLevel.ERROR, LogFormat.JSON)
    logger.warning("quiet")
    logger.error("loud")

    assert [json.loads(line)["event"] for line in capsys.readouterr().err.splitlines()] == ["loud"]


def test_unconfigured_process_keeps_standard_output_clean(
    capsys: pytest.CaptureFixture[str],
) -> None:
    structlog.reset_defaults()
    get_logger("x").info("begun")
    captured = capsys.readouterr()

    assert captured.out == ""
    assert "event=begun" in captured.err


@pytest.mark.parametrize("form", LogFormat)
def test_exception_is_logged_with_its_traceback(
    form: LogFormat, capsys: pytest.CaptureFixture[str]
) -> None:
    configure_logging(form=form)
    try:
        raise ZeroDivisionError("a bug")
    except ZeroDivisionError:
        get_logger("x").exception("step failed")
    captured = capsys.readouterr()

    assert captured.out == ""
    assert "ZeroDivisionError" in captured.err
    assert "a bug" in captured.err


def test_dependencies_are_heard_from_warnings_on(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging(LogLevel.DEBUG, LogFormat.LINES)
    logging.getLogger("asyncio").info("chatter")
    logging.getLogger("asyncio").warning("slow callback")

    assert capsys.readouterr().err == "WARNING asyncio: slow callback\n"


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def test_every_line_of_a_process_carries_its_ids_on_every_thread(
    capsys: pytest.CaptureFixture[str],
) -> None:
    configure_logging(form=LogFormat.JSON, mission="m", uav="uav1")
    identify(incarnation=7)
    thread = threading.Thread(target=lambda: get_logger("bus").warning("stuck"))
    thread.start()
    thread.join()
    logging.getLogger("dependency").warning("old %s", "name")
    get_logger("core", mission="other").info("own goes first")

    told = lines(capsys)
    assert [each["event"] for each in told] == ["stuck", "old name", "own goes first"]
    assert {each["uav"] for each in told} == {"uav1"}
    assert {each["incarnation"] for each in told} == {7}
    assert [each["mission"] for each in told] == ["m", "m", "other"]
    assert all({"level", "module", "timestamp"} <= each.keys() for each in told)
    assert all(str(each["timestamp"]).endswith("Z") for each in told)


def test_the_ids_of_an_earlier_configuration_are_forgotten(
    capsys: pytest.CaptureFixture[str],
) -> None:
    configure_logging(form=LogFormat.JSON, mission="m")
    configure_logging(form=LogFormat.JSON)
    get_logger("x").info("begun")

    assert "mission" not in lines(capsys)[0]


def test_a_process_that_dies_of_an_exception_says_so_in_one_line_of_json(
    capsys: pytest.CaptureFixture[str],
) -> None:
    configure_logging(form=LogFormat.JSON, mission="m")
    try:
        raise ZeroDivisionError("a bug")
    except ZeroDivisionError as fault:
        sys.excepthook(type(fault), fault, fault.__traceback__)

    (told,) = lines(capsys)
    assert (told["event"], told["mission"]) == ("crashed", "m")
    assert "ZeroDivisionError: a bug" in str(told["exception"])
    configure_logging(form=LogFormat.LINES)
    assert sys.excepthook is sys.__excepthook__
