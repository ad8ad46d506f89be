"""Structured logs on standard error; standard output is kept for results.

A module that logs calls `get_logger` and binds what its lines are about; a command that
logs calls `configure_logging` once, with what its options `swarm.runtime.options.LogLevelOption`
and `LogFormatOption` say, and with the ids that every line of its process carries: mission,
UAV, incarnation. Importing this module is cheap: structlog is loaded by the first logger.
"""

from __future__ import annotations

import enum
import json
import logging
import sys
import time
from collections.abc import MutableMapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO, cast

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger, Processor

_identity: dict[str, object] = {}
"""What every line of this process carries, whichever thread and logger it comes from."""


class LogLevel(enum.StrEnum):
    """How much is logged: this and everything graver."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogFormat(enum.StrEnum):
    """What a log line looks like."""

    AUTO = "auto"
    """`CONSOLE` on a terminal, `LINES` elsewhere."""
    CONSOLE = "console"
    """For people: aligned and, on a terminal, coloured."""
    LINES = "lines"
    """One line of key=value pairs per event."""
    JSON = "json"
    """One JSON object per event and line."""


def configure_logging(
    level: LogLevel = LogLevel.INFO, form: LogFormat = LogFormat.AUTO, **identity: object
) -> None:
    """Send every log line of this process to standard error; the last call counts.

    Loggers of the standard library go the same way, from warnings on, so that
    what a dependency complains about is seen but its chatter is not. As JSON the traceback
    of a process that dies of an exception is a line, too.

    Each carries the ids of ``identity``, such as ``mission``; see `identify`.
    """
    import structlog

    _identity.clear()
    identify(**identity)
    on_terminal = sys.stderr.isatty()
    structlog.configure(
        processors=_processors(form, on_terminal),
        wrapper_class=structlog.make_filtering_bound_logger(_number(level)),
        logger_factory=structlog.PrintLoggerFactory(file=cast("TextIO", _Stderr())),
        cache_logger_on_first_use=False,
    )
    handler = logging.StreamHandler(cast("TextIO", _Stderr()))
    plain = logging.Formatter("%(levelname)s %(name)s: %(message)s")
    handler.setFormatter(_JsonFormatter() if form is LogFormat.JSON else plain)
    logging.basicConfig(level=max(_number(level), logging.WARNING), handlers=[handler], force=True)
    logging.captureWarnings(form is LogFormat.JSON)
    sys.excepthook = _log_crash if form is LogFormat.JSON else sys.__excepthook__


def identify(**identity: object) -> None:
    """Let every line of this process carry more ids; what a logger binds itself goes first."""
    _identity.update(identity)


def identify_task(**identity: object) -> None:
    """Let every line of the running asyncio task, and of what it starts, carry more ids."""
    import structlog

    structlog.contextvars.bind_contextvars(**identity)


def get_logger(name: str, **context: object) -> FilteringBoundLogger:
    """A logger that names its module ``name`` and carries ``context`` in every line.

    A process that has configured nothing gets the defaults, so that no line ever
    lands on standard output.
    """
    import structlog

    if not structlog.is_configured():
        configure_logging()
    return cast("FilteringBoundLogger", structlog.get_logger(module=name, **context))


class _Stderr:
    """Whatever ``sys.stderr`` is at the time of writing: a test or a live table may swap it."""

    def write(self, text: str) -> int:
        return sys.stderr.write(text)

    def flush(self) -> None:
        sys.stderr.flush()


def _processors(form: LogFormat, on_terminal: bool) -> list[Processor]:
    import structlog

    if form is LogFormat.AUTO:
        form = LogFormat.CONSOLE if on_terminal else LogFormat.LINES
    stamp = structlog.processors.TimeStamper(
        fmt="%H:%M:%S.%f" if form is LogFormat.CONSOLE else "iso",
        utc=form is not LogFormat.CONSOLE,
    )
    shared: list[Processor] = [
        _identified,
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        stamp,
    ]
    if form is LogFormat.CONSOLE:
        return [*shared, structlog.dev.ConsoleRenderer(colors=on_terminal)]
    traced: list[Processor] = [*shared, structlog.processors.format_exc_info]
    if form is LogFormat.JSON:
        return [*traced, structlog.processors.JSONRenderer(default=str)]
    order = ["timestamp", "level", "module", "event"]
    return [*traced, structlog.processors.LogfmtRenderer(key_order=order, drop_missing=True)]


def _identified(
    _logger: object, _method: str, event: MutableMapping[str, Any]
) -> MutableMapping[str, Any]:
    """The line with what every line of this process carries."""
    for name, value in _identity.items():
        event.setdefault(name, value)
    return event


class _JsonFormatter(logging.Formatter):
    """Lines of the standard library's loggers, like all the others."""

    def format(self, record: logging.LogRecord) -> str:
        stamp = self.formatTime(record, "%Y-%m-%dT%H:%M:%S")
        line = {
            **_identity,
            "module": record.name,
            "event": record.getMessage(),
            "level": record.levelname.lower(),
            "timestamp": f"{stamp}.{int(record.msecs):03}Z",
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)

    @staticmethod
    def converter(timestamp: float | None) -> time.struct_time:
        return time.gmtime(timestamp)


def _log_crash(
    kind: type[BaseException], fault: BaseException, traceback: TracebackType | None
) -> None:
    """The last line of a process that dies of an exception."""
    if issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, fault, traceback)
        return
    get_logger("swarm").critical("crashed", exc_info=(kind, fault, traceback))


def _number(level: LogLevel) -> int:
    return logging.getLevelNamesMapping()[level.name]
