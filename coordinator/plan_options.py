"""What `swarm plan` is asked for, refused at once where it cannot be done."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from coordinator.planner.options import method_names
from swarm.runtime.errors import Fault, InputError, remedy_for_name

USUAL_FIRMWARE = "ardupilot"
"""That exported plans are for, unless asked otherwise."""


def check_plan_options(method: str, plot: Path | None, firmware: str, vain_s: float | None) -> None:
    """Refuse what cannot be done before any work is done.

    Args:
        method: of the plan.
        plot: where to draw it, if it is to be drawn.
        firmware: that exported plans are for.
        vain_s: asked for a bound that is not to be made [s].

    Raises:
        InputError: any of them, one line each.
    """
    faults = []
    methods = method_names()
    if method not in methods:
        remedy = remedy_for_name(method, methods)
        faults.append(Fault("--method", method, "no such method", remedy))
    if plot is not None:
        faults += _plot_faults(plot)
    if vain_s is not None:
        problem = "there is no bound with --no-bound"
        faults.append(Fault("--bound-s", f"{vain_s:g}", problem, "give one of the two"))
    if firmware != USUAL_FIRMWARE:
        faults += _firmware_faults(firmware)
    if faults:
        raise InputError(*faults)


def _plot_faults(plot: Path) -> Iterator[Fault]:
    from coordinator.plot import PLOT_SUFFIXES
    from swarm.runtime.extras import require_extra

    if plot.suffix.lower() in PLOT_SUFFIXES:
        require_extra("ground", "--plot")
        return
    problem = f"no picture is called {plot.suffix!r}" if plot.suffix else "it has no suffix"
    yield Fault("--plot", str(plot), problem, f"end it in {', '.join(PLOT_SUFFIXES)}")


def _firmware_faults(firmware: str) -> Iterator[Fault]:
    from coordinator.export import ExportFirmware

    firmwares = [known.value for known in ExportFirmware]
    if firmware not in firmwares:
        remedy = remedy_for_name(firmware, firmwares)
        yield Fault("--firmware", firmware, "no such firmware", remedy)
