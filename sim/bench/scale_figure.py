"""The picture of `swarm bench scale`: what grows with the fleet, and what does not."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.bench.results import quantile
from sim.bench.scale import LATENCY_TARGET_MS, SHARE_TARGET_BYTES, START_TARGET_S, ScaleBench

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MARKERS = ("o", "s", "^", "D", "P", "v")


def scale_figure(bench: ScaleBench) -> Figure:
    """Six panels over the number of UAVs; dotted lines are what is wanted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 7.6), layout="constrained")
    panels = figure.subplots(2, 3).ravel().tolist()
    sizes = [run.uavs for run in bench.runs]
    kinds = sorted({kind for run in bench.runs for kind in run.cpu_frac})
    said = sorted({kind for run in bench.runs for kind in run.published_hz})
    heard = sorted({kind for run in bench.runs for kind in run.received_hz})

    def draw(place: int, title: str, lines: dict[str, list[float | None]]) -> Axes:
        axes: Axes = panels[place]
        for look, (label, values) in enumerate(lines.items()):
            known = [(x, y) for x, y in zip(sizes, values, strict=True) if y is not None]
            axes.plot(
                [x for x, _ in known],
                [y for _, y in known],
                marker=_MARKERS[look % len(_MARKERS)],
                color=_COLOURS[look % len(_COLOURS)],
                label=label,
            )
        axes.set_title(title, loc="left")
        axes.set_xlabel("UAVs")
        axes.set_ylim(bottom=0.0)
        axes.set_xticks(sizes)
        axes.grid(visible=True, axis="y", color="#e4e4e4", linewidth=0.6)
        if len(lines) > 1:
            axes.legend()
        return axes

    runs = bench.runs
    start = draw(
        0,
        "start [s]",
        {"up": [run.up_s for run in runs], "airborne": [run.airborne_s for run in runs]},
    )
    start.axhline(START_TARGET_S, color="#000000", linestyle=":")
    memory = draw(1, "memory per agent [MB]", {"": [r.agent_share_mean_bytes / 1e6 for r in runs]})
    memory.axhline(SHARE_TARGET_BYTES / 1e6, color="#000000", linestyle=":")
    delay = draw(
        2,
        "from end of service [ms]",
        {
            f"{what}, p{share:.0%}"[:-1]: [quantile(times_ms, share) for times_ms in of]
            for what, of in (
                ("next target", [run.latency_ms for run in runs]),
                ("claim heard", [run.told_ms for run in runs]),
            )
            for share in (0.5, 0.99)
        },
    )
    delay.axhline(LATENCY_TARGET_MS, color="#000000", linestyle=":")
    draw(
        3,
        "CPU per UAV [% of a processor]",
        {kind: [100.0 * run.cpu_frac[kind] / run.uavs for run in runs] for kind in kinds},
    )
    draw(
        4,
        "published by each UAV [1/s]",
        {kind: [run.published_hz.get(kind, 0.0) for run in runs] for kind in said},
    )
    draw(
        5,
        "heard by each agent [1/s]",
        {kind: [run.received_hz.get(kind, 0.0) for run in runs] for kind in heard},
    )
    return figure
