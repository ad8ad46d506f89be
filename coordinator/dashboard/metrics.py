"""What Prometheus is told, read from what is known whenever it asks.

Names begin with ``peckorder_`` and end in their unit; of the process itself there are the usual
``process_…``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.exposition import choose_encoder
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from coordinator.dashboard.hub import Hub
from coordinator.dashboard.source import DashboardSource
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.uav_state import LOST, FleetStates
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.messages import MissionConfig, MissionPhase

__all__ = ["Metrics"]


class Metrics:
    """The metrics of one dashboard."""

    def __init__(self, source: DashboardSource, hub: Hub) -> None:
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(_Mission(source, hub))
        ProcessCollector(registry=self._registry)

    def page(self, accept: str) -> tuple[bytes, str]:
        """What to answer, and its content type, to somebody who accepts that."""
        encode, content_type = choose_encoder(accept)
        return encode(self._registry), content_type


class _Mission(Collector):
    """Reads what is known of the mission when asked."""

    def __init__(self, source: DashboardSource, hub: Hub) -> None:
        self._source = source
        self._hub = hub

    def collect(self) -> Iterator[Metric]:
        """All metrics, as they are now."""
        yield _gauge("dashboard_clients", "Pages that follow the feed.", self._hub.clients)
        yield _gauge("link_up", "Whether this process is linked to the bus.", self._source.link)
        yield self._dropped()
        yield self._commands()
        mission_state = self._source.mission_state
        brief = None if mission_state is None else mission_state.replica.brief
        if mission_state is not None and brief is not None:
            yield from self._of_mission(mission_state)
            yield from _of_uavs(mission_state, brief, self._source, self._done())

    def _dropped(self) -> Metric:
        text = "Messages this process has dropped, by reason."
        family = CounterMetricFamily(
            "peckorder_dashboard_dropped_messages", text, labels=["reason"]
        )
        for reason, number in sorted(self._source.dropped.items()):
            family.add_metric((reason,), number)
        return family

    def _commands(self) -> Metric:
        family = GaugeMetricFamily(
            "peckorder_operator_commands",
            "Commands and tasks given here, by what has come of them.",
            labels=("command", "state"),
        )
        count = Counter((row.text.partition(" ")[0], row.state) for row in self._source.commands)
        for (command, state), number in sorted(count.items()):
            family.add_metric((command, state.value.replace(" ", "_")), number)
        return family

    def _done(self) -> dict[str, int]:
        progress = self._hub.feed.progress
        return {} if progress is None else {uav: len(t) for uav, t in progress.flown.items()}

    def _of_mission(self, mission_state: MissionState) -> Iterator[Metric]:
        mission, epoch = mission_state.mission.name, mission_state.replica.epoch
        progress, measure = self._hub.feed.progress, self._hub.feed.measure

        def gauge(name: str, text: str, value: float | None) -> Metric:
            family = GaugeMetricFamily(f"peckorder_{name}", text, labels=("mission",))
            if value is not None:
                family.add_metric((mission,), value)
            return family

        mission_s = mission_state.mission_s(self._source.now_s())
        yield gauge("mission_time_seconds", "Mission time; from 0 at the start.", mission_s)
        phases = GaugeMetricFamily(
            "peckorder_mission_phase", "1 for the phase it is in.", labels=("mission", "phase")
        )
        for phase in MissionPhase:
            phases.add_metric((mission, phase), mission_state.phase is phase)
        yield phases
        objective = 0.0 if progress is None else progress.objective
        yield gauge("objective_value_seconds", "J of the tasks done so far.", objective)
        planned = None if measure is None else measure.objective
        yield gauge("plan_objective_value_seconds", "J of the first epoch's lists.", planned)
        bound = None if measure is None else measure.bound
        yield gauge("objective_bound_value_seconds", "Upper bound on J of any lists.", bound)
        yield gauge(
            "epoch", "Number of the epoch in force.", None if epoch is None else epoch.number
        )
        there = COORDINATOR in mission_state.present
        yield gauge("coordinator_present", "Whether there is a coordinator.", there)
        tasks = GaugeMetricFamily(
            "peckorder_tasks", "Tasks on the board, by state.", labels=("mission", "state")
        )
        states = Counter(mission_state.board.states.values())
        for state in TaskState:
            tasks.add_metric((mission, state), states[state])
        yield tasks


def _of_uavs(
    mission_state: MissionState, brief: MissionConfig, source: DashboardSource, done: dict[str, int]
) -> Iterable[Metric]:
    mission = mission_state.mission.name
    labels = ("mission", "uav")
    present = GaugeMetricFamily(
        "peckorder_uav_present", "Whether its agent is there.", labels=labels
    )
    lost = GaugeMetricFamily(
        "peckorder_uav_lost", "Whether it disappeared while it took part.", labels=labels
    )
    phase = GaugeMetricFamily(
        "peckorder_uav_phase", "1 for what it does.", labels=(*labels, "phase")
    )
    battery = GaugeMetricFamily(
        "peckorder_uav_battery_ratio", "Charge left, from 0 to 1.", labels=labels
    )
    silence = GaugeMetricFamily(
        "peckorder_uav_silence_seconds", "Since its agent last said something.", labels=labels
    )
    tasks = CounterMetricFamily("peckorder_uav_tasks_done", "Tasks it has done.", labels=labels)
    dropped = CounterMetricFamily(
        "peckorder_uav_dropped_messages",
        "Messages its agents have dropped, by reason.",
        labels=(*labels, "reason"),
    )
    states = FleetStates(mission_state, source.now_s())
    for uav in brief.uavs:
        names, state = (mission, uav.id), states.of(uav.id)
        present.add_metric(names, state.there)
        lost.add_metric(names, state.does == LOST)
        if state.there or state.does == LOST:
            phase.add_metric((*names, state.does), 1.0)
        if state.battery_frac is not None:
            battery.add_metric(names, state.battery_frac)
        if state.link_age_s is not None:
            silence.add_metric(names, state.link_age_s / source.speedup)
        tasks.add_metric(names, done.get(uav.id, 0))
    for name, reasons in sorted(mission_state.dropped.items()):
        for reason, number in sorted(reasons.items()):
            dropped.add_metric((mission, name, reason), number)
    return present, lost, phase, battery, silence, tasks, dropped


def _gauge(name: str, text: str, value: float) -> Metric:
    family = GaugeMetricFamily(f"peckorder_{name}", text)
    family.add_metric((), value)
    return family
