"""Where UAVs were on the map, as a recording has it; a flight to be drawn."""

from __future__ import annotations

from coordinator.mission_view.mission_state import FEW_S, FEW_STATUSES
from coordinator.mission_view.observation import MissionObserver
from coordinator.plot import DrawnFlight
from coordinator.recording.reader import Recording
from swarm.model import UavId
from swarm.protocol.events import MessageReceived
from swarm.protocol.uav_messages import Status


def flight_of(recording: Recording) -> DrawnFlight:
    """The whole flight; of one that goes on, as far as it was recorded."""
    timing = recording.timing
    observer = MissionObserver(recording.mission, timing, None)
    observer.start(recording.start_s)
    longest_s = max(FEW_S, FEW_STATUSES * timing.status_s)
    tracks: dict[str, list[list[tuple[float, float]]]] = {}
    told_s: dict[str, float] = {}
    for entry in recording.entries:
        observer.step(entry.fact, entry.now_s)
        match entry.fact:
            case MessageReceived(message):
                body, uav = message.body, message.writer
            case _:
                continue
        if not isinstance(body, Status) or body.position_enu_m is None:
            continue
        ways = tracks.setdefault(uav, [[]])
        if entry.now_s - told_s.get(uav, entry.now_s) > longest_s:
            ways.append([])
        told_s[uav] = entry.now_s
        ways[-1].append(body.position_enu_m[:2])
    state = observer.mission_state
    result = state.result()
    return DrawnFlight(
        mission=state.mission,
        tracks={uav.id: tracks.get(uav.id, []) for uav in state.mission.uavs},
        done_by={task: UavId(uav) for task, uav in result.done_by.items()},
        lost=result.lost_uavs,
        plan=recording.plans[0].plan if recording.plans else None,
        nearest=state.nearest,
        makespan_s=result.makespan_s,
    )
