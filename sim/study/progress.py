"""How far a study is, on standard error: a bar on a terminal, else a line now and then."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING, Self

from swarm.runtime.clock import Clock

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_LINE_EVERY_S = 30.0
"""Between lines where there is no terminal; the last one comes in any case."""


class StudyProgress:
    """Shows the jobs done, their total, and the time left; call it with both numbers."""

    def __init__(self, console: Console, name: str, clock: Clock) -> None:
        self._console = console
        self._name = name
        self._clock = clock
        self._bar: tuple[Progress, TaskID] | None = None
        self._began_s = self._told_s = clock.now_s()
        self.done = self.total = 0

    def __enter__(self) -> Self:
        """Begin."""
        if self._console.is_terminal:
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

            columns = (
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.fields[left]}"),
            )
            bar = Progress(*columns, console=self._console, transient=True)
            self._bar = bar, bar.add_task(self._name, total=None, left="")
            bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End; the bar vanishes."""
        if self._bar is not None:
            self._bar[0].stop()

    def __call__(self, done: int, total: int) -> None:
        """So many jobs of so many are done."""
        now_s = self._clock.now_s()
        if done == 0:
            self._began_s = self._told_s = now_s
        self.done, self.total = done, total
        left = self._left(now_s)
        if self._bar is not None:
            bar, task = self._bar
            bar.update(task, completed=done, total=total, left=left)
        elif now_s - self._told_s >= _LINE_EVERY_S or (done == total and done):
            self._told_s = now_s
            line = f"{self._name}: {done} of {total} trials done{', ' if left else ''}{left}"
            self._console.print(line, highlight=False, soft_wrap=True)

    def _left(self, now_s: float) -> str:
        if not 0 < self.done < self.total:
            return ""
        per_job_s = (now_s - self._began_s) / self.done
        return f"{duration_text(per_job_s * (self.total - self.done))} left"


def duration_text(duration_s: float) -> str:
    """In words, roughly: 40 s, 12 min, 3 h 20 min."""
    if duration_s < 90.0:
        return f"{duration_s:.0f} s"
    minutes = round(duration_s / 60.0)
    hours, rest = divmod(minutes, 60)
    return f"{hours} h {rest} min" if hours else f"{minutes} min"
