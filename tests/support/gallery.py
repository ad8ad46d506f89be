"""Pictures for the gallery: `python -m tests.support.gallery [FOLDER]`.

All but those of the dashboard, which need a browser (`tests.support.dashboard_pictures`). Every
flight is simulated, so the pictures are the same each time. Look at each before it is kept.
"""

from __future__ import annotations

import io
import re
import sys
from pathlib import Path

from matplotlib.figure import Figure
from PIL import Image
from rich.console import Console

from coordinator.plot import flight_figure, plan_figure
from coordinator.recording.explanation import explain_task
from coordinator.recording.flown_tracks import flight_of
from coordinator.recording.playback import Playback
from coordinator.recording.reader import Recording, read_recording
from coordinator.terminal.live_view import live_picture
from swarm import simulate
from swarm.model import UavId
from tests.support.area_missions import paddock
from tests.support.observed_mission import shipped

FOLDER = Path("sim/examples/screenshots")
LOST = UavId("uav2")


def keep(picture: bytes, file: Path) -> None:
    """Write a picture in 256 colours, which is a third of the size."""
    with Image.open(io.BytesIO(picture)) as drawn:
        few = drawn.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=4)
        few.save(file, optimize=True)


def keep_figure(figure: Figure, file: Path) -> None:
    """Write a figure of matplotlib's."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=90)
    keep(drawn.getvalue(), file)


def keep_terminal(console: Console, title: str, file: Path) -> None:
    """Write what ``console`` has printed, as a drawing of a terminal."""
    drawing = console.export_svg(title=title, unique_id=file.stem)
    # Nothing is fetched from elsewhere: any font of even width will do.
    file.write_text(re.sub(r"@font-face \{[^}]*\}\s*", "", drawing), encoding="utf-8")


def terminal(width: int) -> Console:
    """One that prints nowhere, and remembers."""
    return Console(
        record=True,
        file=io.StringIO(),
        width=width,
        force_terminal=True,
        color_system="truecolor",
        highlight=False,
    )


def draw(folder: Path) -> None:
    """Fly, and draw all pictures into ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    _of_the_table(folder)
    _of_an_area(folder)


def _of_the_table(folder: Path) -> None:
    """The paper's mission, in which a UAV is lost: as planned, in flight, and explained."""
    file = folder / "table-1.mcap"
    flight = simulate(shipped("table-1"), "guided", lost_at_s={LOST: 1.0}, record=file)
    recording = _read(file)
    assert flight.plan is not None
    keep_figure(plan_figure(flight.mission, flight.plan), folder / "plan.png")

    playback = Playback(recording)
    playback.seek(1.5 - recording.start_s)
    console = terminal(110)
    console.print(live_picture(playback.mission_state, playback.now_s, width=110, height=26))
    keep_terminal(console, "swarm run table-1", folder / "terminal.svg")

    (taken_over, *_) = (t for t in flight.plan.routes[LOST] if t not in flight.routes[LOST])
    told = terminal(100)
    explain_task(recording, taken_over, near_m=0.0).render(told)
    title = f"swarm explain flight.mcap --task {taken_over}"
    keep_terminal(told, title, folder / "explain.svg")


def _of_an_area(folder: Path) -> None:
    """An area that two UAVs mow, of which one is lost: the other one flies its lines."""
    file = folder / "paddock.mcap"
    simulate(paddock(endurance_s=120.0), "guided", lost_at_s={LOST: 40.0}, record=file)
    keep_figure(flight_figure(flight_of(_read(file))), folder / "flight.png")


def _read(file: Path) -> Recording:
    """A recording that nobody needs afterwards."""
    recording = read_recording(file)
    file.unlink()
    return recording


if __name__ == "__main__":
    draw(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
