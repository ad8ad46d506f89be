"""What the command `swarm study` can be told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from swarm.runtime.errors import Fault, InputError
from swarm.runtime.option_groups import argument, option


@dataclass(frozen=True, slots=True)
class StudyRequest:
    """Which study is meant; None where nothing is said."""

    what: str | None = argument(
        None,
        metavar="[SCENARIO|STUDY]",
        help="A scenario or a study: a TOML file, or the name of a shipped one such as "
        "valley-survey or robustness.",
    )
    random: str | None = option(
        None,
        "--random",
        metavar="N,M",
        help="Fly random missions of N UAVs and M tasks, another one in each trial.",
    )
    trials: int | None = option(
        None,
        "--trials",
        min=1,
        max=1_000_000,
        metavar="K",
        help="Fates that every policy meets, at every point. Default: as the study says, or 50.",
    )
    seed: int | None = option(
        None,
        "--seed",
        min=0,
        max=2**63 - 1,
        metavar="N",
        help="Seed of everything random. Default: as the study says, or 0.",
    )
    policies: str | None = option(
        None,
        "--policies",
        metavar="NAME,…",
        help="What to compare: guided, guided-alone (its coordinator dead), greedy, lookahead, "
        "central, central-divert, interval:SECONDS, frozen, cbba, nearest, value-per-time. "
        "Default: as the study says, or all.",
    )
    reference: str | None = option(
        None,
        "--reference",
        metavar="NAME",
        help="The policy to which the others are compared, trial by trial. Default: as the "
        "study says, or central, or the first one.",
    )
    bound: bool | None = option(
        None,
        "--bound/--no-bound",
        help="Also work out a value that no policy can exceed, from the draws themselves.",
    )
    vary: list[str] | None = option(  # noqa: RUF009 - it makes a field
        None,
        "--vary",
        metavar="NAME=V,…",
        help="Fly the study again with this number of its uncertainty at each of the values, "
        "instead of what the study varies; may be repeated. Names are those of study files, "
        "such as loss, popup and message_loss.",
    )


@dataclass(frozen=True, slots=True)
class StudyOutput:
    """Where trials are flown, and what is kept of them."""

    jobs: int | None = option(
        None,
        "--jobs",
        min=1,
        max=1024,
        metavar="J",
        help="Processes that fly trials; 1 for none but this one. Default: one per processor. "
        "The numbers do not depend on it.",
    )
    scheduler: str | None = option(
        None,
        "--scheduler",
        metavar="ADDRESS",
        help="Fly the trials on the Dask cluster whose scheduler is there, such as "
        "tcp://10.0.0.1:8786; needs peckorder[study] here and on the workers.",
    )
    out: Path | None = option(  # noqa: RUF009
        None,
        "--out",
        metavar="FOLDER",
        help="Keep the study, every trial, a summary and plots there. The same command goes on "
        "where it was interrupted, or flies more --trials.",
    )
    file_format: str = option(
        "csv",
        "--format",
        metavar="csv|parquet",
        help="How --out keeps the trials: as CSV, or as Parquet too (needs peckorder[study]).",
    )
    plots: bool = option(True, "--plots/--no-plots", help="Whether --out gets plots.")
    update: Path | None = option(  # noqa: RUF009
        None,
        "--update",
        metavar="FILE.md",
        help="Renew the table of this study in a Markdown file, between the lines "
        "<!-- study NAME --> and <!-- end of study -->.",
    )

    def check(self) -> None:
        """Refuse what does not go together.

        Raises:
            InputError: some of it does not.
        """
        if self.file_format not in ("csv", "parquet"):
            fault = Fault("--format", self.file_format, "no such format", "choose csv or parquet")
            raise InputError(fault)
        if self.file_format == "parquet" and self.out is None:
            fault = Fault(
                "--format", self.file_format, "has no folder to write to", "add --out FOLDER"
            )
            raise InputError(fault)
        if self.jobs is not None and self.scheduler is not None:
            problem = "does not go with --scheduler"
            remedy = "leave it out: the cluster has as many processes as it has"
            raise InputError(Fault("--jobs", str(self.jobs), problem, remedy))
